use std::sync::Arc;

use super::backend::World;
use super::model::Model;
use super::parameters::Own;
use super::press::Press;
use super::state::Snapshot;
use super::stencil::{Tie, ties};
use super::step::step;
use super::stepping::Control;
use super::storage::Storage;
use super::view::View;
use crate::math::{Lanes, Vec3x, bits};
use crate::tool::{Atlas, Tool, Tools};

/// Environments of the same model that move in lockstep on the CPU.
pub(super) trait Group: Send + Sync {
    /// Number of environments that it has room for.
    fn lanes(&self) -> usize;

    /// Sets one lane.
    fn load(&mut self, model: &Model, lane: usize, snapshot: &Snapshot, own: &Own);

    /// One lane, exactly, without what presses have done.
    fn save(&self, model: &Model, lane: usize) -> Snapshot;

    /// What the environment of a lane has of its own.
    fn own(&self, lane: usize) -> &Own;

    /// Position of a vertex [m].
    fn position(&self, lane: usize, vertex: u32) -> [f64; 3];

    /// Puts a vertex `at` a place [m].
    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]);

    /// Stops a vertex where it is, for good.
    fn fix(&mut self, lane: usize, vertex: u32);

    /// Whether something holds a vertex for good.
    fn is_fixed(&self, lane: usize, vertex: u32) -> bool;

    /// Moves all lanes by one control step; presses count their environments from the first lane.
    fn step(&mut self, known: &Known, control: &Control, presses: &[Press]);

    /// Whether every position of a lane is a number within 100 m of the origin, lane by lane.
    fn finite(&self) -> Vec<bool>;

    /// Distance to the tool [m], negative inside, of the vertices that each environment shows.
    /// Its bits are the same in any company.
    fn distances(&self, known: &Known) -> Vec<Vec<f64>>;
}

/// A world and what follows from it.
pub(super) struct Known {
    pub world: World,
    pub atlas: Atlas,
    /// Area of each vertex that is pressed [m^2].
    pub areas: Vec<f64>,
    /// See [`ties`].
    pub ties: Vec<Vec<Tie>>,
}

impl Known {
    pub fn new(world: &World) -> Self {
        let presses = world.presses.as_ref();
        let areas = presses.map(|(lamina, _)| lamina.vertex_areas());
        let ties = presses.map(|(lamina, stencil)| ties(lamina, stencil.max_strain));
        Self {
            world: world.clone(),
            atlas: Atlas::new(&world.tools),
            areas: areas.unwrap_or_default(),
            ties: ties.unwrap_or_default(),
        }
    }

    /// The tool of an environment.
    pub fn tool(&self, own: &Own) -> &Tool {
        &self.world.tools[usize::from(own.tool)]
    }
}

impl<S: Storage> Group for S {
    fn lanes(&self) -> usize {
        Storage::lanes(self)
    }

    fn load(&mut self, model: &Model, lane: usize, snapshot: &Snapshot, own: &Own) {
        self.clear(lane, &snapshot.sides);
        for (vertex, &free) in model.inverse_mass.iter().enumerate() {
            let [place, lane] = self.slot(lane, vertex);
            let is_fixed = snapshot.fixed.contains(vertex);
            let free = free / own.parameters.areal_mass;
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
        let lanes = match Storage::lanes(self) {
            1 => 0..S::V::COUNT,
            _ => lane..lane + 1,
        };
        let (cloth, bending) = (self.cloth_mut(), model.bending_stiffness);
        cloth.scales.set(lanes, bending, &own.parameters);
        if let Some(known) = cloth.own.get_mut(lane) {
            known.clone_from(own);
        }
    }

    fn save(&self, model: &Model, lane: usize) -> Snapshot {
        let (cloth, count) = (self.cloth(), model.vertex_count());
        let slots = || (0..count).map(|vertex| self.slot(lane, vertex));
        let is_fixed = |v: &usize| Group::is_fixed(self, lane, *v as u32);
        let edges = (0..model.edge_count).map(|edge| self.edge_slot(lane, edge));
        let vectors = |all: &[Vec3x<S::V>]| slots().map(|[v, lane]| all[v].get(lane)).collect();
        Snapshot {
            position: vectors(&cloth.position),
            velocity: vectors(&cloth.velocity),
            fixed: bits::set(count, (0..count).filter(is_fixed)),
            force_density: edges.map(|[e, lane]| cloth.density[e].get(lane)).collect(),
            sides: self.sides(lane),
            own: cloth.own[lane].clone(),
            ..Snapshot::default()
        }
    }

    fn own(&self, lane: usize) -> &Own {
        &self.cloth().own[lane]
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

    fn is_fixed(&self, lane: usize, vertex: u32) -> bool {
        let [place, lane] = self.slot(lane, vertex as usize);
        self.cloth().inverse_mass[place].get(lane) == 0.0
    }

    fn step(&mut self, known: &Known, control: &Control, presses: &[Press]) {
        self.start();
        let tools = tools(self, known);
        step(&known.world.model, &tools, control, presses, self);
    }

    fn finite(&self) -> Vec<bool> {
        let lanes = self.cloth().finite();
        match Storage::lanes(self) {
            1 => vec![!lanes.contains(&false)],
            _ => lanes[..self.cloth().own.len()].to_vec(),
        }
    }

    fn distances(&self, known: &Known) -> Vec<Vec<f64>> {
        let world = &known.world;
        let own = self.cloth().own.iter();
        let views: Vec<&Arc<View>> = own.map(|own| &world.views[usize::from(own.view)]).collect();
        let is_same = |view: &&Arc<View>| view.vertices == views[0].vertices;
        let count = match views.iter().all(is_same) {
            true => 1,
            false => views.len(),
        };
        let vertices = views[..count].iter().map(|view| &*view.vertices);
        Storage::distances(self, &tools(self, known), &vertices.collect::<Vec<_>>())
    }
}

/// The tools in the lanes of a group.
fn tools<'a, S: Storage>(group: &S, known: &'a Known) -> Tools<'a, S::V> {
    let own = &group.cloth().own;
    let number = |lane: usize| usize::from(own[lane].tool);
    known.atlas.in_lanes(own.len(), number)
}
