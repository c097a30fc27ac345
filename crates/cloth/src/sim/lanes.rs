use fixedbitset::FixedBitSet;

use super::cloth::Cloth;
use super::collision::{Around, Layers, SelfContact};
use super::group::Group;
use super::length::pull_of;
use super::line::{Along, Line};
use super::lines::{Direction, Lines};
use super::model::{Model, Pass};
use super::press::{self, Press};
use super::state::Snapshot;
use super::step::step;
use super::stepping::Control;
use super::storage::Storage;
use crate::math::{Lanes, Real, Vec3x};
use crate::tool::Tool;

/// A group of environments, one in every lane: a place is a vertex.
pub(super) struct InLanes<V: Lanes> {
    cloth: Cloth<V>,
    /// 1/m of a free vertex [1/kg].
    free_inverse_mass: Vec<f64>,
    self_contact: Option<Box<SelfContact<V>>>,
}

impl<V: Lanes> InLanes<V> {
    /// A group for `model` with every vertex free and at rest in the origin.
    pub fn new(model: &Model) -> Self {
        let count = model.vertex_count();
        let (edges, longest) = match &model.lines {
            Some(lines) => (lines.edge_count, lines.longest),
            None => (0, 0),
        };
        let mut cloth = Cloth::new(count, edges, longest);
        cloth.inverse_mass = model.inverse_mass.iter().map(|&w| V::of(w)).collect();
        cloth.tack = model.tack.iter().flatten().map(|&t| V::of(t)).collect();
        Self {
            cloth,
            free_inverse_mass: model.inverse_mass.clone(),
            self_contact: (model.layers.is_some()).then(|| Box::new(SelfContact::new(count))),
        }
    }
}

impl<V: Lanes> Storage for InLanes<V> {
    type V = V;
    type Line = Line;

    #[inline(always)]
    fn cloth(&mut self) -> &mut Cloth<V> {
        &mut self.cloth
    }

    #[inline(always)]
    fn count(&self, lines: &Lines, direction: Direction) -> usize {
        lines.of(direction).len()
    }

    #[inline(always)]
    fn warp<'a>(&'a mut self, lines: &'a Lines, i: usize) -> (&'a Line, &'a mut Cloth<V>) {
        (&lines.warps[i], &mut self.cloth)
    }

    #[inline(always)]
    fn take<'a>(
        &'a mut self,
        lines: &'a Lines,
        direction: Direction,
        i: usize,
    ) -> Along<'a, V, Line> {
        self.cloth.along(&lines.of(direction)[i])
    }

    #[inline(always)]
    fn put(&mut self, _: Direction, _: usize) {}

    #[inline(always)]
    fn warm_start_wefts(&mut self) {}

    #[inline(always)]
    fn weft_pull(&self, lines: &Lines, place: usize) -> (Vec3x<V>, V) {
        let beside = &lines.beside[place];
        let (at, density) = (&self.cloth.predicted, &self.cloth.density);
        let min_warm = V::of(beside.min_warm);
        let none = (Vec3x::zero(), V::zero());
        // No closures: they would be compiled without the instruction set.
        let before = match beside.before {
            Some([from, edge]) => {
                let along = at[place] - at[from as usize];
                pull_of(along, density[edge as usize], min_warm)
            }
            None => none,
        };
        let after = match beside.after {
            Some([to, edge]) => {
                let along = at[to as usize] - at[place];
                pull_of(along, density[edge as usize], min_warm)
            }
            None => none,
        };
        (after.0 - before.0, before.1 + after.1)
    }

    #[inline(always)]
    fn project(&mut self, passes: &[Pass]) {
        for pass in passes {
            pass.project(&mut self.cloth.position, &self.cloth.mobility);
        }
    }

    #[inline(always)]
    fn hold_down(&mut self, layers: Option<&Layers>, plate: &Press, height: f64, compliance: f64) {
        for &vertex in &plate.vertices {
            let (v, lane) = (vertex as usize, plate.environment);
            let beneath = match (&self.self_contact, layers) {
                (Some(contact), Some(layers)) => contact.beneath(layers, lane, v),
                _ => 0.0,
            };
            press::hold_down([v, lane], height + beneath, compliance, &mut self.cloth);
        }
    }

    #[inline(always)]
    fn separate(&mut self, layers: &Layers) {
        if let Some(contact) = &mut self.self_contact {
            let around = Around {
                previous: &self.cloth.previous,
                w: &self.cloth.inverse_mass,
                planes: &self.cloth.plane,
            };
            contact.separate(layers, &mut self.cloth.position, &around);
        }
    }
}

impl<V: Lanes> Group for InLanes<V> {
    fn lanes(&self) -> usize {
        V::COUNT
    }

    fn load(&mut self, lane: usize, snapshot: &Snapshot) {
        let cloth = &mut self.cloth;
        for v in 0..cloth.position.len() {
            cloth.position[v].set(lane, snapshot.position[v]);
            cloth.velocity[v].set(lane, snapshot.velocity[v]);
            let w = match snapshot.fixed.contains(v) {
                true => 0.0,
                false => self.free_inverse_mass[v],
            };
            cloth.inverse_mass[v].as_mut_slice()[lane] = V::Scalar::from_f64(w);
        }
        for (edge, density) in cloth.density.iter_mut().enumerate() {
            let of = snapshot.force_density.get(edge).copied().unwrap_or(0.0);
            density.as_mut_slice()[lane] = V::Scalar::from_f64(of);
        }
        if let Some(contact) = &mut self.self_contact {
            contact.load(lane, &snapshot.sides);
        }
    }

    fn save(&self, lane: usize, snapshot: &mut Snapshot) {
        let cloth = &self.cloth;
        snapshot.position = cloth.position.iter().map(|x| x.get(lane)).collect();
        snapshot.velocity = cloth.velocity.iter().map(|v| v.get(lane)).collect();
        let mut fixed = FixedBitSet::with_capacity(cloth.position.len());
        for (vertex, w) in cloth.inverse_mass.iter().enumerate() {
            fixed.set(vertex, w.as_slice()[lane].to_f64() == 0.0);
        }
        snapshot.fixed = fixed;
        let density = cloth.density.iter();
        snapshot.force_density = density.map(|q| q.as_slice()[lane].to_f64()).collect();
        snapshot.sides = (self.self_contact.as_ref()).map_or(Vec::new(), |c| c.sides(lane));
    }

    fn position(&self, lane: usize, vertex: u32) -> [f64; 3] {
        self.cloth.position[vertex as usize].get(lane)
    }

    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]) {
        self.cloth.position[vertex as usize].set(lane, at);
    }

    fn fix(&mut self, lane: usize, vertex: u32) {
        let zero = V::Scalar::from_f64(0.0);
        self.cloth.inverse_mass[vertex as usize].as_mut_slice()[lane] = zero;
        self.cloth.velocity[vertex as usize].set(lane, [0.0; 3]);
    }

    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, plates: &[Press]) {
        if let Some(contact) = &mut self.self_contact {
            contact.start();
        }
        step(model, tool, control, plates, self);
    }

    fn finite(&self) -> Vec<bool> {
        self.cloth.finite()
    }

    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64> {
        self.cloth.distances(tool, vertices)
    }
}
