use fixedbitset::FixedBitSet;

use super::constraints::{
    ChainScratch, project_chain, project_edges, project_hinges, project_triples,
};
use super::membrane::project_elements;
use super::model::{Model, Pass};
use super::self_contact::{Around, SelfContact};
use super::state::{Batch, Control, Press, Snapshot};
use crate::math::{Kernel, Lanes, Real, Vec3x};
use crate::tool::Tool;

/// The CPU backend: state in lanes, [vertex][xyz][lane].
pub struct Cpu<V: Lanes> {
    position: Vec<Vec3x<V>>,
    velocity: Vec<Vec3x<V>>,
    inverse_mass: Vec<V>,
    /// 1/m of a free vertex [1/kg].
    free_inverse_mass: Vec<f64>,
    /// Positions at the start of the substep.
    previous: Vec<Vec3x<V>>,
    /// Tangent plane of the tool under each vertex, as last looked up.
    plane: Vec<Plane<V>>,
    /// Yarn edges that the last direct solve found in compression.
    compressed: Vec<V::Mask>,
    chain: ChainScratch<V>,
    self_contact: Option<Box<SelfContact<V>>>,
}

/// n . x - offset is the distance to the tool [m].
#[derive(Clone, Copy)]
pub(super) struct Plane<V> {
    pub normal: Vec3x<V>,
    pub offset: V,
}

impl<V: Lanes> Cpu<V> {
    /// A group for `model` with every vertex free and at rest in the origin.
    pub fn new(model: &Model) -> Self {
        let count = model.vertex_count();
        let plane = Plane {
            normal: Vec3x::zero(),
            offset: V::zero(),
        };
        Self {
            position: vec![Vec3x::zero(); count],
            velocity: vec![Vec3x::zero(); count],
            inverse_mass: model.inverse_mass.iter().map(|&w| V::of(w)).collect(),
            free_inverse_mass: model.inverse_mass.clone(),
            previous: vec![Vec3x::zero(); count],
            plane: vec![plane; count],
            chain: ChainScratch::new(model.longest_chain),
            self_contact: (model.layers.is_some()).then(|| Box::new(SelfContact::new(count))),
            compressed: vec![V::zero().lt(V::zero()); model.yarn_edge_count],
        }
    }

    /// Looks up the tangent plane of the tool under every vertex that is free in its lane;
    /// fixed ones keep theirs, which nothing reads.
    fn find_planes(&mut self, tool: &Tool) {
        let moving = self.position.iter().zip(&self.inverse_mass);
        for ((x, w), plane) in moving.zip(&mut self.plane) {
            for lane in 0..V::COUNT {
                if w.as_slice()[lane] == V::Scalar::from_f64(0.0) {
                    continue;
                }
                let x = x.get(lane);
                let (phi, n) = tool.distance(x);
                plane.normal.set(lane, n);
                let offset = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - phi;
                plane.offset.as_mut_slice()[lane] = V::Scalar::from_f64(offset);
            }
        }
    }
}

/// 1 where the mask is set, else 0.
fn as_numbers<V: Lanes>(mask: V::Mask) -> V {
    V::select(mask, V::of(1.0), V::zero())
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
        for (edge, mask) in self.compressed.iter_mut().enumerate() {
            let mut bits = as_numbers::<V>(*mask);
            let bit = f64::from(u8::from(snapshot.compressed.contains(edge)));
            bits.as_mut_slice()[lane] = V::Scalar::from_f64(bit);
            *mask = V::zero().lt(bits);
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
        let mut compressed = FixedBitSet::with_capacity(self.compressed.len());
        for (edge, mask) in self.compressed.iter().enumerate() {
            let bit = as_numbers::<V>(*mask).as_slice()[lane];
            compressed.set(edge, bit == V::Scalar::from_f64(1.0));
        }
        Snapshot {
            position: self.position.iter().map(|x| x.get(lane)).collect(),
            velocity: self.velocity.iter().map(|v| v.get(lane)).collect(),
            fixed,
            compressed,
            sides: (self.self_contact.as_ref()).map_or(Vec::new(), |c| c.sides(lane)),
        }
    }

    fn position(&self, lane: usize, vertex: u32) -> [f64; 3] {
        self.position[vertex as usize].get(lane)
    }

    fn fix(&mut self, lane: usize, vertex: u32) {
        let zero = V::Scalar::from_f64(0.0);
        self.inverse_mass[vertex as usize].as_mut_slice()[lane] = zero;
        self.velocity[vertex as usize].set(lane, [0.0; 3]);
    }

    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]) {
        let interval = model.physics().contact_interval;
        if let Some(contact) = &mut self.self_contact {
            contact.start();
        }
        let mut first = 0;
        while first < control.substeps {
            let last = (first + interval).min(control.substeps);
            self.find_planes(tool);
            V::vectorize(Substeps {
                model,
                control: *control,
                presses,
                range: first..last,
                state: self,
            });
            first = last;
        }
    }

    fn is_sound(&self, lane: usize) -> bool {
        let inside = |x: &Vec3x<V>| x.get(lane).iter().all(|x| x.abs() <= 100.0);
        self.position.iter().all(inside)
    }
}

/// Consecutive substeps of a control step (paper, Algorithm 1).
struct Substeps<'a, V: Lanes> {
    model: &'a Model,
    control: Control,
    presses: &'a [Press],
    range: std::ops::Range<usize>,
    state: &'a mut Cpu<V>,
}

impl<V: Lanes> Kernel for Substeps<'_, V> {
    #[inline(always)]
    fn run(self) {
        let Self {
            model,
            control,
            state,
            ..
        } = self;
        let h = control.dt / control.substeps as f64;
        for substep in self.range {
            predict(model, h, state);
            // Before the yarns: they give way to no press, so theirs is the last word.
            for press in self.presses {
                hold_down(model, press, substep, h, state);
            }
            for pass in &model.passes {
                project(pass, h, state);
            }
            if let (Some(contact), Some(layers)) = (&mut state.self_contact, &model.layers) {
                let around = Around {
                    previous: &state.previous,
                    w: &state.inverse_mass,
                    planes: &state.plane,
                };
                contact.separate(layers, &mut state.position, &around);
            }
            contact(model, state);
            update_velocity(model, h, state);
        }
    }
}

/// x~ = x + h v + h^2 g, for vertices that are free; fixed ones move with their velocity.
#[inline(always)]
fn predict<V: Lanes>(model: &Model, h: f64, state: &mut Cpu<V>) {
    let (hv, fall) = (V::of(h), V::of(-h * model.physics().gravity));
    let vertices = state.position.iter_mut().zip(&mut state.previous);
    for (((x, p), v), w) in vertices.zip(&state.velocity).zip(&state.inverse_mass) {
        *p = *x;
        let free = V::zero().lt(*w);
        let [vx, vy, vz] = v.0;
        let vz = vz + V::select(free, fall, V::zero());
        *x = *x + Vec3x([vx, vy, vz]).scale(hv);
    }
}

#[inline(always)]
fn project<V: Lanes>(pass: &Pass, h: f64, state: &mut Cpu<V>) {
    let inverse_h_squared = V::of(1.0 / (h * h));
    let (x, w) = (&mut state.position, &state.inverse_mass);
    match pass {
        Pass::Yarns(chains) => {
            for chain in chains {
                let compressed = &mut state.compressed[chain.edges.clone()];
                project_chain(chain, inverse_h_squared, x, w, compressed, &mut state.chain);
            }
        }
        Pass::Edges(class) => project_edges(class, inverse_h_squared, x, w),
        Pass::Triples(triples) => project_triples(triples, inverse_h_squared, x, w),
        Pass::Hinges(hinges) => project_hinges(hinges, inverse_h_squared, x, w),
        Pass::Membrane(elements) => project_elements(elements, inverse_h_squared, x, w),
    }
}

/// Keeps the pressed vertices of one lane below the stencil: C = phi - height <= 0 [m], with
/// the compliance of the roller's skin.
#[inline(always)]
fn hold_down<V: Lanes>(model: &Model, press: &Press, substep: usize, h: f64, state: &mut Cpu<V>) {
    let left = 1.0 - (substep + 1) as f64 / press.descent as f64;
    let height = press.height * left.max(0.0);
    let alpha_tilde = 1.0 / (model.physics().press_stiffness * h * h);
    for &vertex in &press.vertices {
        let v = vertex as usize;
        let w = state.inverse_mass[v].as_slice()[press.lane].to_f64();
        let n = state.plane[v].normal.get(press.lane);
        let offset = state.plane[v].offset.as_slice()[press.lane].to_f64();
        let mut x = state.position[v].get(press.lane);
        let beneath = match (&state.self_contact, &model.layers) {
            (Some(contact), Some(layers)) => contact.beneath(layers, press.lane, v),
            _ => 0.0,
        };
        let c = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offset - height - beneath;
        if c > 0.0 && w > 0.0 {
            let depth = c * w / (w + alpha_tilde);
            for k in 0..3 {
                x[k] -= n[k] * depth;
            }
            state.position[v].set(press.lane, x);
        }
    }
}

/// Pushes vertices out of the tool, and holds or slows what slides on it (Coulomb): the
/// tangential motion of the substep is taken back wholly while it is below the static
/// coefficient times the push, else by the dynamic coefficient times the push.
#[inline(always)]
fn contact<V: Lanes>(model: &Model, state: &mut Cpu<V>) {
    let vertices = state.position.iter_mut().zip(&state.previous);
    for (((x, p), plane), w) in vertices.zip(&state.plane).zip(&state.inverse_mass) {
        let phi = plane.normal.dot(*x) - plane.offset;
        let inside = phi.lt(V::zero());
        let depth = V::select(
            V::zero().lt(*w),
            V::select(inside, -phi, V::zero()),
            V::zero(),
        );
        let mut out = *x + plane.normal.scale(depth);
        if let Some([stick, slide]) = model.friction {
            let moved = out - *p;
            let tangential = moved - plane.normal.scale(plane.normal.dot(moved));
            let length = tangential.dot(tangential).sqrt();
            let holds = length.lt(V::of(stick) * depth);
            let share = V::of(slide) * depth / length.max(V::of(1e-20));
            let share = V::select(holds, V::of(1.0), share.min(V::of(1.0)));
            // Without contact the depth is 0, and so is the share that is taken back.
            out = out - tangential.scale(V::select(V::zero().lt(depth), share, V::zero()));
        }
        *x = out;
    }
}

/// v = (x - p) / h, damped and capped; fixed vertices keep theirs.
#[inline(always)]
fn update_velocity<V: Lanes>(model: &Model, h: f64, state: &mut Cpu<V>) {
    let rate = V::of(1.0 / h / (1.0 + h * model.physics().damping));
    let cap = model.physics().speed_cap;
    let vertices = state.position.iter().zip(&state.previous);
    for (((x, p), v), w) in vertices.zip(&mut state.velocity).zip(&state.inverse_mass) {
        let mut new = (*x - *p).scale(rate);
        if cap > 0.0 {
            let square = new.dot(new).max(V::of(cap * cap));
            new = new.scale(V::of(cap) / square.sqrt());
        }
        *v = Vec3x::select(V::zero().lt(*w), new, *v);
    }
}
