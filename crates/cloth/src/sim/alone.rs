use std::ops::Range;

use fixedbitset::FixedBitSet;

use super::cpu::Cpu;
use super::fold::{Fold, Places};
use super::line::{Chain, Grip, bend, recall, shear, stretch};
use super::model::Model;
use super::state::{Batch, Press, Snapshot};
use super::stepping::Control;
use super::substep::{
    Frame, Plate, Wefts, conclude, find_planes, give_way, predict, project, stretch_yarn,
};
use crate::math::{Kernel, Lanes, Real, Vec3x};
use crate::tool::Tool;

/// One environment by itself with the solve along yarns, its lines side by side in the lanes.
/// The same bits as [`Cpu`] with one lane of the same precision: lines of a family share no
/// vertex, so it does not matter which is solved first.
pub struct Alone<V: Lanes> {
    /// The state in the order of the fold.
    cloth: Cpu<V>,
    held: Held<V>,
    fold: Fold<V>,
    /// 1/m of a free vertex [1/kg].
    free_inverse_mass: Vec<f64>,
    /// Room for the vertices of a bundle that crosses the warps.
    crossing: Crossing<V>,
    /// Room for constraints that are projected one by one, vertices in the model's order.
    single: Single<V::Scalar>,
}

/// What the wefts of each vertex do to it in this substep.
struct Held<V> {
    /// [N]
    pull: Vec<Vec3x<V>>,
    /// [N/m]
    stress: Vec<V>,
}

impl<V: Lanes> Wefts<V> for Held<V> {
    #[inline(always)]
    fn hold(&self, _: usize, v: usize, _: &mut Cpu<V>) -> (Vec3x<V>, V) {
        (self.pull[v], self.stress[v])
    }
}

struct Crossing<V> {
    position: Vec<Vec3x<V>>,
    mobility: Vec<V>,
    pull: Vec<Vec3x<V>>,
    stress: Vec<V>,
}

struct Single<S> {
    /// Vertices of any such constraint.
    vertices: Vec<u32>,
    position: Vec<Vec3x<S>>,
    mobility: Vec<S>,
}

impl<V: Lanes> Alone<V> {
    /// For `model` with every vertex free and at rest in the origin; none if it is not solved
    /// along yarns, or its layers touch each other.
    pub fn new(model: &Model) -> Option<Self> {
        let lines = model.lines.as_ref().filter(|_| model.layers.is_none())?;
        let fold = Fold::new(lines);
        let mut cloth = Cpu::<V>::immovable(fold.count, fold.edge_count, fold.longest);
        for (&[number, lane], &w) in fold.vertices.iter().zip(&model.inverse_mass) {
            let inverse_mass = &mut cloth.inverse_mass[number as usize];
            inverse_mass.as_mut_slice()[lane as usize] = V::Scalar::from_f64(w);
        }
        let mut vertices: Vec<u32> = model.passes.iter().flat_map(|p| p.vertices()).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let room = if vertices.is_empty() {
            0
        } else {
            model.vertex_count()
        };
        Some(Self {
            crossing: Crossing {
                position: vec![Vec3x::zero(); fold.longest],
                mobility: vec![V::zero(); fold.longest],
                pull: vec![Vec3x::zero(); fold.longest],
                stress: vec![V::zero(); fold.longest],
            },
            single: Single {
                vertices,
                position: vec![Vec3x::zero(); room],
                mobility: vec![V::Scalar::zero(); room],
            },
            held: Held {
                pull: vec![Vec3x::zero(); fold.count],
                stress: vec![V::zero(); fold.count],
            },
            cloth,
            fold,
            free_inverse_mass: model.inverse_mass.clone(),
        })
    }

    fn slot(&self, vertex: usize) -> (usize, usize) {
        let [number, lane] = self.fold.vertices[vertex];
        (number as usize, lane as usize)
    }
}

impl<V: Lanes> Batch for Alone<V> {
    fn lanes(&self) -> usize {
        1
    }

    fn load(&mut self, _: usize, snapshot: &Snapshot) {
        // Also where no vertex or edge is: a lost state may have left anything there.
        self.cloth.position.fill(Vec3x::zero());
        self.cloth.velocity.fill(Vec3x::zero());
        self.held.pull.fill(Vec3x::zero());
        self.held.stress.fill(V::zero());
        self.cloth.yarns.density.fill(V::zero());
        for vertex in 0..self.free_inverse_mass.len() {
            let (v, lane) = self.slot(vertex);
            self.cloth.position[v].set(lane, snapshot.position[vertex]);
            self.cloth.velocity[v].set(lane, snapshot.velocity[vertex]);
            let w = if snapshot.fixed.contains(vertex) {
                0.0
            } else {
                self.free_inverse_mass[vertex]
            };
            self.cloth.inverse_mass[v].as_mut_slice()[lane] = V::Scalar::from_f64(w);
        }
        for (edge, &[number, lane]) in self.fold.edges.iter().enumerate() {
            let density = snapshot.force_density.get(edge).copied().unwrap_or(0.0);
            let all = &mut self.cloth.yarns.density[number as usize];
            all.as_mut_slice()[lane as usize] = V::Scalar::from_f64(density);
        }
    }

    fn snapshot(&self, _: usize) -> Snapshot {
        let places = || (0..self.free_inverse_mass.len()).map(|vertex| self.slot(vertex));
        let mut fixed = FixedBitSet::with_capacity(self.free_inverse_mass.len());
        for (vertex, (v, lane)) in places().enumerate() {
            let w = self.cloth.inverse_mass[v].as_slice()[lane];
            fixed.set(vertex, w == V::Scalar::from_f64(0.0));
        }
        let density = self.fold.edges.iter().map(|&[number, lane]| {
            self.cloth.yarns.density[number as usize].as_slice()[lane as usize].to_f64()
        });
        Snapshot {
            position: places()
                .map(|(v, lane)| self.cloth.position[v].get(lane))
                .collect(),
            velocity: places()
                .map(|(v, lane)| self.cloth.velocity[v].get(lane))
                .collect(),
            fixed,
            force_density: density.collect(),
            sides: Vec::new(),
        }
    }

    fn position(&self, _: usize, vertex: u32) -> [f64; 3] {
        let (v, lane) = self.slot(vertex as usize);
        self.cloth.position[v].get(lane)
    }

    fn place(&mut self, _: usize, vertex: u32, at: [f64; 3]) {
        let (v, lane) = self.slot(vertex as usize);
        self.cloth.position[v].set(lane, at);
    }

    fn fix(&mut self, _: usize, vertex: u32) {
        let (v, lane) = self.slot(vertex as usize);
        let zero = V::Scalar::from_f64(0.0);
        self.cloth.inverse_mass[v].as_mut_slice()[lane] = zero;
        self.cloth.velocity[v].set(lane, [0.0; 3]);
    }

    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]) {
        let mut tack = Vec::new();
        if let Some(of) = &model.tack {
            tack.resize(self.fold.count, V::zero());
            for (&[number, lane], &tension) in self.fold.vertices.iter().zip(of) {
                let tack = tack[number as usize].as_mut_slice();
                tack[lane as usize] = V::Scalar::from_f64(tension);
            }
        }
        let interval = control.contact_interval;
        let mut first = 0;
        while first < control.substeps {
            let last = (first + interval).min(control.substeps);
            V::vectorize(Substeps {
                model,
                tool,
                control,
                presses,
                range: first..last,
                tack: &tack,
                state: self,
            });
            first = last;
        }
    }

    fn sound(&self) -> Vec<bool> {
        vec![self.cloth.sound().iter().all(|&sound| sound)]
    }

    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64> {
        let all: Vec<u32> = (0..self.fold.count as u32).collect();
        let distances = self.cloth.distances(tool, &all);
        let of = |&vertex: &u32| {
            let (v, lane) = self.slot(vertex as usize);
            distances[v * V::COUNT + lane]
        };
        vertices.iter().map(of).collect()
    }
}

/// As the substeps along lines of a group.
struct Substeps<'a, V: Lanes> {
    model: &'a Model,
    tool: &'a Tool,
    control: &'a Control,
    presses: &'a [Press],
    range: Range<usize>,
    /// Greatest pull of the tool's tack [N], empty without.
    tack: &'a [V],
    state: &'a mut Alone<V>,
}

impl<V: Lanes> Kernel for Substeps<'_, V> {
    #[inline(always)]
    fn run(self) {
        let Alone {
            cloth,
            fold,
            crossing,
            single,
            held,
            ..
        } = self.state;
        let frame = Frame::new(self.model, self.control);
        let last = self.range.end;
        find_planes(self.tool, cloth);
        for v in 0..fold.count {
            predict(v, &frame, cloth);
        }
        for substep in self.range {
            for (weft, places) in &fold.wefts {
                crossing.read_position(places, cloth);
                let count = weft.vertices().len();
                let mut grip = Grip {
                    pull: &mut crossing.pull[..count],
                    stress: &mut crossing.stress[..count],
                };
                let density = &cloth.yarns.density[weft.edges()];
                recall(weft, &crossing.position, density, &mut grip);
                let pull = Vec3x::components_mut(&mut held.pull);
                places.write::<V, 3>(Vec3x::components(&crossing.pull), pull);
                places.write::<V, 1>(&crossing.stress, &mut held.stress);
            }
            for warp in &fold.warps {
                give_way(warp, held, &frame, cloth);
            }
            if let Some(trellis) = &fold.trellis {
                for (diagonal, places) in &fold.diagonals {
                    crossing.read_position(places, cloth);
                    places.read::<V, 1>(&cloth.mobility, &mut crossing.mobility);
                    let (x, mobility) = (&mut crossing.position, &crossing.mobility);
                    shear(diagonal, trellis, x, mobility, &mut cloth.yarns.scratch);
                    crossing.write_position(places, cloth);
                }
            }
            if !single.vertices.is_empty() {
                single.read(fold, cloth);
                for pass in &self.model.passes {
                    project(pass, &mut single.position, &single.mobility);
                }
                single.write(fold, cloth);
            }
            for press in self.presses {
                let plate = Plate::new(self.model, press, substep);
                for &vertex in &press.vertices {
                    let [number, lane] = fold.vertices[vertex as usize];
                    plate.hold_down(number as usize, lane as usize, 0.0, cloth);
                }
            }
            for (weft, places) in &fold.wefts {
                crossing.read_position(places, cloth);
                places.read::<V, 1>(&cloth.mobility, &mut crossing.mobility);
                let scratch = &mut cloth.yarns.scratch;
                bend(weft, &mut crossing.position, &crossing.mobility, scratch);
                let density = &mut cloth.yarns.density[weft.edges()];
                let x = &mut crossing.position;
                stretch(weft, x, &crossing.mobility, density, scratch);
                crossing.write_position(places, cloth);
            }
            for warp in &fold.warps {
                stretch_yarn(warp, cloth);
                let next = substep + 1 < last;
                for &v in warp.vertices() {
                    let v = v as usize;
                    match self.tack {
                        [] => conclude(v, &frame, None, next, cloth),
                        tack => conclude(v, &frame, Some(tack[v]), next, cloth),
                    }
                }
            }
        }
    }
}

impl<V: Lanes> Crossing<V> {
    #[inline(always)]
    fn read_position(&mut self, places: &Places, cloth: &Cpu<V>) {
        let x = Vec3x::components_mut(&mut self.position);
        places.read::<V, 3>(Vec3x::components(&cloth.position), x);
    }

    #[inline(always)]
    fn write_position(&self, places: &Places, cloth: &mut Cpu<V>) {
        let x = Vec3x::components_mut(&mut cloth.position);
        places.write::<V, 3>(Vec3x::components(&self.position), x);
    }
}

impl<S: Real> Single<S> {
    #[inline(always)]
    fn read<V: Lanes<Scalar = S>>(&mut self, fold: &Fold<V>, cloth: &Cpu<V>) {
        for &vertex in &self.vertices {
            let [number, lane] = fold.vertices[vertex as usize].map(|i| i as usize);
            let Vec3x([x, y, z]) = &cloth.position[number];
            let x = [x.as_slice()[lane], y.as_slice()[lane], z.as_slice()[lane]];
            self.position[vertex as usize] = Vec3x(x);
            self.mobility[vertex as usize] = cloth.mobility[number].as_slice()[lane];
        }
    }

    #[inline(always)]
    fn write<V: Lanes<Scalar = S>>(&self, fold: &Fold<V>, cloth: &mut Cpu<V>) {
        for &vertex in &self.vertices {
            let [number, lane] = fold.vertices[vertex as usize].map(|i| i as usize);
            let Vec3x(to) = &mut cloth.position[number];
            let Vec3x(x) = self.position[vertex as usize];
            for k in 0..3 {
                to[k].as_mut_slice()[lane] = x[k];
            }
        }
    }
}
