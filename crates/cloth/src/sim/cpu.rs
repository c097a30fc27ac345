use rayon::prelude::*;

#[cfg(not(any(test, debug_assertions)))]
use crate::math::Portable;
#[cfg(all(target_arch = "x86_64", not(any(test, debug_assertions))))]
use crate::math::{F32x8, F32x16, F64x4, F64x8};
use crate::math::{Isa, Lanes, Vec3};

use super::alone::Alone;
use super::backend::{Backend, Observed, World};
use super::group::{Group, Known};
use super::lanes::InLanes;
use super::model::Model;
use super::observations::{Column, Observations};
use super::parameters::Own;
use super::press::{Press, Roller};
use super::state::{Pressed, Snapshot};
use super::stencil::{Tie, under_stencil};
use super::stepping::Control;
use crate::measure::Measures;
use serde::{Deserialize, Serialize};

/// Number type of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Several environments in SIMD lanes.
    #[default]
    F32,
    /// One environment at a time, for reference.
    F64,
}

impl Precision {
    /// As in configurations and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// The CPU: groups of environments in SIMD lanes, over rayon. An environment by itself has its
/// lines in the lanes. Its bits are the same in any company, on any instruction set and for any
/// number of threads.
pub struct Cpu {
    known: Known,
    groups: Vec<Box<dyn Group>>,
    /// Environments of a group.
    lanes: usize,
    pressed: Vec<Pressed>,
}

impl Cpu {
    /// `count` > 0 environments, each at the first start, on the best instruction set that there is.
    pub fn new(world: &World, count: usize, precision: Precision) -> Self {
        Self::on(world, count, precision, Isa::best())
    }

    /// `count` > 0 environments on an instruction set.
    pub fn on(world: &World, count: usize, precision: Precision, isa: Isa) -> Self {
        let model = &world.model;
        let make = match isa {
            // Lanes take long to compile and give the same bits: `tests/` has them in release.
            #[cfg(any(test, debug_assertions))]
            _ => maker::<f32, f64>(precision, count),
            #[cfg(not(any(test, debug_assertions)))]
            Isa::Portable => maker::<Portable, f64>(precision, count),
            #[cfg(all(target_arch = "x86_64", not(any(test, debug_assertions))))]
            Isa::Avx2 => maker::<F32x8, F64x4>(precision, count),
            #[cfg(all(target_arch = "x86_64", not(any(test, debug_assertions))))]
            Isa::Avx512 => maker::<F32x16, F64x8>(precision, count),
        };
        let first = make(model, count);
        let lanes = first.lanes();
        let more = (1..count.div_ceil(lanes)).map(|k| make(model, count - k * lanes));
        let groups: Vec<_> = std::iter::once(first).chain(more).collect();
        let mut cpu = Self {
            known: Known::new(world),
            groups,
            lanes,
            pressed: vec![Pressed::default(); count],
        };
        let own = Own::default();
        // Lanes that nobody uses hold a state that can be stepped as well.
        for group in &mut cpu.groups {
            for lane in 0..lanes {
                group.load(model, lane, &world.starts[0], &own);
            }
        }
        for environment in 0..count {
            cpu.reset(environment, &own);
        }
        cpu
    }

    fn place(&self, environment: usize) -> (usize, usize) {
        (environment / self.lanes, environment % self.lanes)
    }

    fn set(&mut self, environment: usize, snapshot: &Snapshot, own: &Own) {
        let (group, lane) = self.place(environment);
        let model = &self.known.world.model;
        self.groups[group].load(model, lane, snapshot, own);
        let pressed = &mut self.pressed[environment];
        pressed.clone_from(&snapshot.pressed);
        let count = model.vertex_count();
        pressed.touched.grow(count);
        pressed.draped.grow(count);
    }
}

/// Makes a group: of as many environments as `V` has lanes, or of one by itself. At most so many of
/// them are used.
type Make = fn(&Model, usize) -> Box<dyn Group>;

fn maker<V, W>(precision: Precision, count: usize) -> Make
where
    V: Lanes<Scalar = f32>,
    W: Lanes<Scalar = f64>,
{
    match precision {
        Precision::F32 if count > 1 => {
            |model, used| Box::new(InLanes::<V>::new(model, used.min(V::COUNT)))
        }
        Precision::F32 => alone::<V>,
        Precision::F64 => alone::<W>,
    }
}

/// In one lane where not all is solved along lines, or without other lanes.
fn alone<V: Lanes>(model: &Model, _: usize) -> Box<dyn Group> {
    match Alone::<V>::new(model).filter(|_| V::COUNT > 1) {
        Some(alone) => Box::new(alone),
        None => Box::new(InLanes::<V::Scalar>::new(model, 1)),
    }
}

impl Backend for Cpu {
    fn count(&self) -> usize {
        self.pressed.len()
    }

    fn load(&mut self, environment: usize, snapshot: &Snapshot) {
        self.set(environment, snapshot, &snapshot.own);
    }

    fn reset(&mut self, environment: usize, own: &Own) {
        let start = self.known.world.starts[usize::from(own.start)].clone();
        self.set(environment, &start, own);
    }

    fn snapshot(&self, environment: usize) -> Snapshot {
        let (group, lane) = self.place(environment);
        Snapshot {
            pressed: self.pressed[environment].clone(),
            ..self.groups[group].save(&self.known.world.model, lane)
        }
    }

    fn step(&mut self, control: &Control, presses: &[Press]) {
        let (known, lanes) = (&self.known, self.lanes);
        let step = |(index, group): (usize, &mut Box<dyn Group>)| {
            let own = presses.iter().filter(|p| p.environment / lanes == index);
            let own: Vec<Press> = own
                .map(|press| Press {
                    environment: press.environment % lanes,
                    ..press.clone()
                })
                .collect();
            group.step(known, control, &own);
        };
        // A single group stays on this thread.
        match &mut self.groups[..] {
            [group] => step((0, group)),
            groups => groups.par_iter_mut().enumerate().for_each(step),
        }
    }

    fn press(&mut self, vertices: &[Option<u32>]) -> Column<f64> {
        assert_eq!(vertices.len(), self.count(), "one entry an environment");
        let (known, groups) = (&self.known, self.groups.par_iter_mut());
        let pressed = self.pressed.par_chunks_mut(self.lanes);
        let all = groups.zip(pressed).zip(vertices.par_chunks(self.lanes));
        let places = all.flat_map_iter(|((group, pressed), vertices)| {
            press(&mut **group, known, vertices, pressed)
        });
        Column::on_host(places.collect::<Vec<_>>().into_flattened())
    }

    fn finite(&self) -> Vec<bool> {
        let groups = self.groups.par_iter();
        groups.flat_map_iter(|group| group.finite()).collect()
    }

    fn observe(&self) -> Observed {
        let (known, count) = (&self.known, self.count());
        let world = &known.world;
        let (lamina, _) = world.pressed();
        let pixels = world.views[0].pixel_count;
        let places = (0..count).map(|environment| self.place(environment));
        let views = places.map(|(group, lane)| self.groups[group].own(lane).view);
        let views: Vec<u16> = views.collect();
        let (mut distance, mut marks) = (vec![0.0; count * pixels], vec![0; count * pixels]);
        let groups = self.groups.par_iter();
        let found: Vec<Vec<f64>> = groups
            .flat_map_iter(|group| group.distances(known))
            .collect();
        let rows = distance
            .par_chunks_mut(pixels)
            .zip(marks.par_chunks_mut(pixels));
        let all = rows.zip(&found).zip(&self.pressed).zip(&views);
        let left = all.map(|((((distance, marks), found), pressed), &view)| {
            let view = &world.views[usize::from(view)];
            for (&pixel, phi) in view.pixels.iter().zip(found) {
                distance[pixel as usize] = phi.max(0.0) as f32;
            }
            view.mark(lamina, pressed, marks)
        });
        Observed {
            left: left.collect(),
            finite: self.finite(),
            seen: Observations::new(views, distance, marks),
        }
    }

    fn measure(&self, environments: &[usize]) -> Vec<Measures> {
        let world = &self.known.world;
        let (lamina, _) = world.pressed();
        let measure = |&environment: &usize| {
            let (group, lane) = self.place(environment);
            let state = self.groups[group].save(&world.model, lane);
            let view = &world.views[usize::from(state.own.view)];
            let tool = self.known.tool(&state.own);
            Measures::new(lamina, tool, &view.region, &state.position)
        };
        environments.par_iter().map(measure).collect()
    }
}

/// A press in a group: who is under the stencil, the press itself, what is draped, settling. Gives
/// where the pressed vertices were [m].
fn press(
    group: &mut dyn Group,
    known: &Known,
    vertices: &[Option<u32>],
    pressed: &mut [Pressed],
) -> Vec<[f64; 3]> {
    let Known { areas, ties, .. } = known;
    let (lamina, stencil) = known.world.pressed();
    let mut places = vec![[0.0; 3]; vertices.len()];
    let mut presses = Vec::with_capacity(vertices.len());
    for (lane, &vertex) in vertices.iter().enumerate() {
        let Some(vertex) = vertex else { continue };
        let own = group.own(lane);
        let side = stencil.side * own.parameters.stencil;
        let aim = own.parameters.aim(pressed[lane].count);
        places[lane] = group.position(lane, vertex);
        let position = |v| group.position(lane, v);
        let under = under_stencil(lamina, known.tool(own), vertex, side, aim, position);
        pressed[lane].stencil.clone_from(&under);
        pressed[lane].count += 1;
        let roller = Roller {
            pressure: stencil.roller.pressure * own.parameters.pressure,
            ..stencil.roller
        };
        presses.push(roller.press(lane, &under, areas));
    }
    group.step(known, &stencil.press, &presses);

    for press in presses {
        let lane = press.environment;
        let tool = known.tool(group.own(lane));
        let pressed = &mut pressed[lane];
        let is_open = |&v: &u32| !pressed.draped.contains(v as usize);
        let vertices = press.forces.iter().map(|&(v, _)| v);
        let under: Vec<u32> = vertices.filter(is_open).collect();
        for &v in &under {
            pressed.touched.insert(v as usize);
            let x = group.position(lane, v);
            let (phi, normal) = tool.distance(x);
            // Tangent planes are a few substeps old: what they let in goes out again.
            if phi < 0.0 && !group.is_fixed(lane, v) {
                let at = [0, 1, 2].map(|k| x[k] - phi * normal[k]);
                group.place(lane, v, at);
            }
        }
        for v in under {
            let x = group.position(lane, v);
            let beside = ties[v as usize].iter().flat_map(|tie| tie.terms);
            let held = beside
                .map(|(w, _)| w)
                .chain([v])
                .all(|v| is_slack(group, ties, lane, v));
            if held && tool.distance(x).0 <= stencil.threshold {
                pressed.draped.insert(v as usize);
                group.fix(lane, v);
            }
        }
    }
    if let Some(settle) = &stencil.settle {
        group.step(known, settle, &[]);
    }
    places
}

/// No yarn of a vertex is stretched so much that it would pull it off the tool.
fn is_slack(group: &dyn Group, ties: &[Vec<Tie>], lane: usize, vertex: u32) -> bool {
    let term = |(v, weight)| Vec3::from(group.position(lane, v)) * weight;
    let mut ties = ties[vertex as usize].iter();
    ties.all(|tie| tie.terms.map(term).iter().sum::<Vec3>().norm() <= tie.most)
}
