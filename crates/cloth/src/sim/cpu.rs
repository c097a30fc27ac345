use fixedbitset::FixedBitSet;

use super::line::Scratch;
use super::model::Model;
use super::self_contact::SelfContact;
use super::state::{Batch, Press, Snapshot};
use super::stepping::Control;
use super::substep::Substeps;
use crate::math::{Kernel, Lanes, Real, Vec3x};
use crate::tool::Tool;

/// The CPU backend: state in lanes, [vertex][xyz][lane].
pub struct Cpu<V: Lanes> {
    pub(super) position: Vec<Vec3x<V>>,
    pub(super) velocity: Vec<Vec3x<V>>,
    pub(super) inverse_mass: Vec<V>,
    /// 1/m of a free vertex [1/kg].
    free_inverse_mass: Vec<f64>,
    /// Positions at the start of the substep.
    pub(super) previous: Vec<Vec3x<V>>,
    /// How far a vertex gives way within a substep [m/N]: h^2/m, less where its yarns pull hard.
    pub(super) mobility: Vec<V>,
    /// Tangent plane of the tool under each vertex, as last looked up.
    pub(super) plane: Vec<Plane<V>>,
    /// What only a solve along lines needs, empty without.
    pub(super) yarns: YarnState<V>,
    pub(super) self_contact: Option<Box<SelfContact<V>>>,
}

/// n . x - offset is the distance to the tool [m].
#[derive(Clone, Copy)]
pub(super) struct Plane<V> {
    pub normal: Vec3x<V>,
    pub offset: V,
}

/// Forces of the yarns.
pub(super) struct YarnState<V> {
    /// Force density of each yarn edge [N/m], > 0 in tension.
    pub density: Vec<V>,
    /// By edge, the pull of a weft's on its end on the earlier warp [N], since that warp began.
    pub across: Vec<Vec3x<V>>,
    pub scratch: Scratch<V>,
}

impl<V: Lanes> Cpu<V> {
    /// A group for `model` with every vertex free and at rest in the origin.
    pub fn new(model: &Model) -> Self {
        let count = model.vertex_count();
        let (edges, longest) = match &model.lines {
            Some(lines) => (lines.edge_count, lines.longest),
            None => (0, 0),
        };
        let mut cpu = Self {
            inverse_mass: model.inverse_mass.iter().map(|&w| V::of(w)).collect(),
            free_inverse_mass: model.inverse_mass.clone(),
            self_contact: (model.layers.is_some()).then(|| Box::new(SelfContact::new(count))),
            ..Self::immovable(count, edges, longest)
        };
        cpu.yarns.across.resize(edges, Vec3x::zero());
        cpu
    }

    /// Room for so many vertices and yarn edges and the vertices of the longest line, 0 for none,
    /// with every vertex fixed in the origin.
    pub(super) fn immovable(count: usize, edges: usize, longest: usize) -> Self {
        let plane = Plane {
            normal: Vec3x::zero(),
            offset: V::zero(),
        };
        Self {
            position: vec![Vec3x::zero(); count],
            velocity: vec![Vec3x::zero(); count],
            inverse_mass: vec![V::zero(); count],
            free_inverse_mass: Vec::new(),
            previous: vec![Vec3x::zero(); count],
            mobility: vec![V::zero(); count],
            plane: vec![plane; count],
            yarns: YarnState {
                density: vec![V::zero(); edges],
                across: Vec::new(),
                scratch: Scratch::new(longest),
            },
            self_contact: None,
        }
    }
}

impl<V: Lanes> Batch for Cpu<V> {
    fn lanes(&self) -> usize {
        V::COUNT
    }

    fn load(&mut self, lane: usize, snapshot: &Snapshot) {
        for v in 0..self.position.len() {
            self.position[v].set(lane, snapshot.position[v]);
            self.velocity[v].set(lane, snapshot.velocity[v]);
            let w = if snapshot.fixed.contains(v) {
                0.0
            } else {
                self.free_inverse_mass[v]
            };
            self.inverse_mass[v].as_mut_slice()[lane] = V::Scalar::from_f64(w);
        }
        for (edge, density) in self.yarns.density.iter_mut().enumerate() {
            let of = snapshot.force_density.get(edge).copied().unwrap_or(0.0);
            density.as_mut_slice()[lane] = V::Scalar::from_f64(of);
        }
        if let Some(contact) = &mut self.self_contact {
            contact.load(lane, &snapshot.sides);
        }
    }

    fn snapshot(&self, lane: usize) -> Snapshot {
        let mut fixed = FixedBitSet::with_capacity(self.position.len());
        for (vertex, w) in self.inverse_mass.iter().enumerate() {
            fixed.set(vertex, w.as_slice()[lane] == V::Scalar::from_f64(0.0));
        }
        let density = self.yarns.density.iter();
        Snapshot {
            position: self.position.iter().map(|x| x.get(lane)).collect(),
            velocity: self.velocity.iter().map(|v| v.get(lane)).collect(),
            fixed,
            force_density: density.map(|q| q.as_slice()[lane].to_f64()).collect(),
            sides: (self.self_contact.as_ref()).map_or(Vec::new(), |c| c.sides(lane)),
        }
    }

    fn position(&self, lane: usize, vertex: u32) -> [f64; 3] {
        self.position[vertex as usize].get(lane)
    }

    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]) {
        self.position[vertex as usize].set(lane, at);
    }

    fn fix(&mut self, lane: usize, vertex: u32) {
        let zero = V::Scalar::from_f64(0.0);
        self.inverse_mass[vertex as usize].as_mut_slice()[lane] = zero;
        self.velocity[vertex as usize].set(lane, [0.0; 3]);
    }

    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]) {
        let interval = control.contact_interval;
        if let Some(contact) = &mut self.self_contact {
            contact.start();
        }
        let mut first = 0;
        while first < control.substeps {
            let last = (first + interval).min(control.substeps);
            V::vectorize(Substeps {
                model,
                tool,
                control: *control,
                presses,
                range: first..last,
                state: self,
            });
            first = last;
        }
    }

    fn sound(&self) -> Vec<bool> {
        let mut lost = V::zero();
        V::vectorize(Lost {
            position: &self.position,
            lost: &mut lost,
        });
        let is_zero = |lost: &V::Scalar| lost.to_f64() == 0.0;
        lost.as_slice().iter().map(is_zero).collect()
    }

    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64> {
        let mut distances = vec![V::zero(); vertices.len()];
        V::vectorize(Distances {
            tool,
            position: &self.position,
            vertices,
            distances: &mut distances,
        });
        let lanes = distances.iter().flat_map(|phi| phi.as_slice());
        lanes.map(|phi| phi.to_f64()).collect()
    }
}

/// Marks the lanes in which a position is no number or out of reach by 1.
struct Lost<'a, V> {
    position: &'a [Vec3x<V>],
    lost: &'a mut V,
}

impl<V: Lanes> Kernel for Lost<'_, V> {
    #[inline(always)]
    fn run(self) {
        let mut lost = V::zero();
        for &x in self.position.iter().flat_map(|x| &x.0) {
            let inside = x.max(-x).lt(V::of(100.0));
            lost = V::select(inside, lost, V::of(1.0));
        }
        *self.lost = lost;
    }
}

/// Looks up the distance of vertices to the tool.
struct Distances<'a, V> {
    tool: &'a Tool,
    position: &'a [Vec3x<V>],
    vertices: &'a [u32],
    distances: &'a mut [V],
}

impl<V: Lanes> Kernel for Distances<'_, V> {
    #[inline(always)]
    fn run(self) {
        for (&v, distance) in self.vertices.iter().zip(self.distances) {
            *distance = self.tool.distance_in_lanes(self.position[v as usize].0).0;
        }
    }
}
