use fixedbitset::FixedBitSet;

use super::model::Model;
use super::press::Press;
use super::state::Snapshot;
use super::step::step;
use super::stepping::Control;
use super::storage::Storage;
use crate::math::{Lanes, Vec3x};
use crate::tool::Tool;

/// Environments of the same model that move in lockstep on the CPU.
pub(super) trait Group: Send + Sync {
    /// Number of environments.
    fn lanes(&self) -> usize;

    /// Sets the cloth of one lane.
    fn load(&mut self, model: &Model, lane: usize, snapshot: &Snapshot);

    /// The cloth of one lane, exactly, without what presses have done.
    fn save(&self, model: &Model, lane: usize) -> Snapshot;

    /// Position of a vertex [m].
    fn position(&self, lane: usize, vertex: u32) -> [f64; 3];

    /// Puts a vertex `at` a place [m].
    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]);

    /// Stops a vertex where it is, for good.
    fn fix(&mut self, lane: usize, vertex: u32);

    /// Moves all lanes by one control step; presses count their environments from the first lane.
    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]);

    /// Whether every position of a lane is a number within 100 m of the origin, lane by lane.
    fn finite(&self) -> Vec<bool>;

    /// Distance of some vertices to the tool [m], negative inside, [vertex][lane]. A lane's are
    /// the same bits in any company.
    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64>;
}

impl<S: Storage> Group for S {
    fn lanes(&self) -> usize {
        Storage::lanes(self)
    }

    fn load(&mut self, model: &Model, lane: usize, snapshot: &Snapshot) {
        self.clear(lane, &snapshot.sides);
        for (vertex, &free) in model.inverse_mass.iter().enumerate() {
            let [place, lane] = self.slot(lane, vertex);
            let is_fixed = snapshot.fixed.contains(vertex);
            let cloth = self.cloth_mut();
            cloth.position[place].set(lane, snapshot.position[vertex]);
            cloth.velocity[place].set(lane, snapshot.velocity[vertex]);
            cloth.inverse_mass[place].set(lane, if is_fixed { 0.0 } else { free });
        }
        for edge in 0..model.edge_count {
            let [place, lane] = self.edge_slot(lane, edge);
            let density = snapshot.force_density.get(edge).copied().unwrap_or(0.0);
            self.cloth_mut().density[place].set(lane, density);
        }
    }

    fn save(&self, model: &Model, lane: usize) -> Snapshot {
        let (cloth, count) = (self.cloth(), model.vertex_count());
        let slots = || (0..count).map(|vertex| self.slot(lane, vertex));
        let edges = (0..model.edge_count).map(|edge| self.edge_slot(lane, edge));
        let mut fixed = FixedBitSet::with_capacity(count);
        for (vertex, [place, lane]) in slots().enumerate() {
            fixed.set(vertex, cloth.inverse_mass[place].get(lane) == 0.0);
        }
        let vectors = |all: &[Vec3x<S::V>]| slots().map(|[v, lane]| all[v].get(lane)).collect();
        Snapshot {
            position: vectors(&cloth.position),
            velocity: vectors(&cloth.velocity),
            fixed,
            force_density: edges.map(|[e, lane]| cloth.density[e].get(lane)).collect(),
            sides: self.sides(lane),
            ..Snapshot::default()
        }
    }

    fn position(&self, lane: usize, vertex: u32) -> [f64; 3] {
        let [place, lane] = self.slot(lane, vertex as usize);
        self.cloth().position[place].get(lane)
    }

    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]) {
        let [place, lane] = self.slot(lane, vertex as usize);
        self.cloth_mut().position[place].set(lane, at);
    }

    fn fix(&mut self, lane: usize, vertex: u32) {
        let [place, lane] = self.slot(lane, vertex as usize);
        self.cloth_mut().inverse_mass[place].set(lane, 0.0);
        self.cloth_mut().velocity[place].set(lane, [0.0; 3]);
    }

    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]) {
        self.start();
        step(model, tool, control, presses, self);
    }

    fn finite(&self) -> Vec<bool> {
        let lanes = self.cloth().finite();
        match Storage::lanes(self) {
            1 => vec![!lanes.contains(&false)],
            _ => lanes,
        }
    }

    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64> {
        Storage::distances(self, tool, vertices)
    }
}
