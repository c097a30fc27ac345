//! The substep, for all lanes at once. Everything here is inlined into [`Substeps::run`], so
//! that it is compiled for the instruction set in use.

use std::ops::Range;

use super::constraints::{
    project_diagonals, project_edges, project_hinges, project_limited_edges, project_triples,
};
use super::cpu::{Cpu, Plane, YarnState};
use super::line::{
    Chain, Crossing, Leads, Line, Lines, bend, recall_after, recall_edge, shear, stretch,
};
use super::membrane::project_elements;
use super::model::{Model, Pass};
use super::self_contact::Around;
use super::state::Press;
use super::stepping::Control;
use crate::math::{Kernel, Lanes, Real, Vec3x};
use crate::tool::Tool;

/// Substeps in which a vertex would at least need to cross an edge under the forces of its
/// yarns. The solve along a line is linear in the directions at its start, so yarns that pull
/// (or push) a vertex far within a substep overshoot: from a force of about m l / h^2 on they
/// would throw it to and fro. There the vertex is given the inertia at which it moves l / 5 at
/// most. At rest nothing moves, so the forces there are right whatever the number; below it
/// nothing changes, so it goes away with h^2. Measured on whole random episodes: 2 leaves
/// edges strained by 7 %, 5 by 2.6 %, 10 makes motion so slow that draping is easier than it
/// is with many substeps.
const CROSSING: f64 = 5.0;

/// Share of its way that such a vertex loses in a substep, as its inertia grows without bound.
/// Between draped neighbours slack yarns would throw it to and fro for ever. Measured after 64
/// random episodes at 600 substeps a second, the greatest speed (root mean square) at rest and
/// the mean distance left, which converges to 0.92 to 0.97 m: 10 mm/s and 0.94 m with 0, 6 mm/s
/// and 1.01 m with 0.1, 1.1 mm/s and 0.99 m with 0.2; 1 slows draping itself: 1.66 m.
const DRAG: f64 = 0.2;

/// Gap over which the tool's tack pulls [m]: a film of resin, thinner than a layer of cloth, so
/// that only what lies on the tool is held.
const TACK_RANGE: f64 = 2e-4;

/// Consecutive substeps of a control step (paper, Algorithm 1), with one look for contact.
pub(super) struct Substeps<'a, V: Lanes> {
    pub model: &'a Model,
    pub tool: &'a Tool,
    pub control: Control,
    pub presses: &'a [Press],
    pub range: Range<usize>,
    pub state: &'a mut Cpu<V>,
}

/// What is the same for all vertices in a substep.
pub(super) struct Frame<'a> {
    /// Duration [s].
    h: f64,
    /// Motion under gravity in it [m].
    fall: f64,
    /// What the wind adds to velocities in it [m/s].
    wind: Option<[f64; 3]>,
    /// v = rate (x - p) [1/s].
    rate: f64,
    /// Largest speed [m/s], 0 for none.
    speed_cap: f64,
    /// Static and dynamic coefficient.
    friction: Option<[f64; 2]>,
    /// Greatest pull of the tool's tack on each vertex [N].
    tack: Option<&'a [f64]>,
}

impl<'a> Frame<'a> {
    pub fn new(model: &'a Model, control: &Control) -> Self {
        let physics = model.physics();
        let h = control.dt / control.substeps as f64;
        Self {
            h,
            fall: -h * h * physics.gravity,
            wind: (model.wind).map(|u| u.map(|u| u - u / (1.0 + h * physics.damping))),
            rate: 1.0 / h / (1.0 + h * physics.damping),
            speed_cap: physics.speed_cap,
            friction: model.friction,
            tack: model.tack.as_deref(),
        }
    }
}

impl<V: Lanes> Kernel for Substeps<'_, V> {
    #[inline(always)]
    fn run(self) {
        let frame = Frame::new(self.model, &self.control);
        find_planes(self.tool, self.state);
        match &self.model.lines {
            Some(lines) => self.along(lines, &frame),
            None => self.edge_by_edge(&frame),
        }
    }
}

impl<V: Lanes> Substeps<'_, V> {
    /// Substeps of the solve along lines: weight, kept forces and the warps' bending, shear and
    /// what else there is, the press, wefts in bending and length, warps in length, the cloth's
    /// own contact, the tool. Yarns have the last word before the tool: their stiffness is
    /// greatest, so what comes after them shows as strain. The next substep begins for a warp
    /// while its vertices are at hand, once those that wefts lead to from there are predicted.
    #[inline(always)]
    fn along(self, lines: &Lines, frame: &Frame) {
        let Self {
            model,
            presses,
            range,
            state,
            ..
        } = self;
        let last = range.end;
        for v in 0..state.position.len() {
            predict(v, frame, state);
        }
        for warp in 0..lines.warps.len() {
            begin(warp, lines, frame, state);
        }
        for substep in range {
            if let Some(trellis) = &lines.trellis {
                for diagonal in &lines.diagonals {
                    let scratch = &mut state.yarns.scratch;
                    let x = &mut state.position;
                    shear(diagonal, trellis, x, &state.mobility, scratch);
                }
            }
            for pass in &model.passes {
                project(pass, &mut state.position, &state.mobility);
            }
            for press in presses {
                hold_down(model, press, substep, state);
            }
            for weft in &lines.wefts {
                let scratch = &mut state.yarns.scratch;
                bend(weft, &mut state.position, &state.mobility, scratch);
                stretch_yarn(weft, state);
            }
            if model.layers.is_some() {
                for warp in &lines.warps {
                    stretch_yarn(warp, state);
                }
                separate(model, state);
            }
            let goes_on = substep + 1 < last;
            let mut next = 0;
            for (index, warp) in lines.warps.iter().enumerate() {
                if model.layers.is_none() {
                    stretch_yarn(warp, state);
                }
                finish(indices(warp), frame, goes_on, state);
                while goes_on && next <= index && lines.crossings[next].last_warp <= index {
                    begin(next, lines, frame, state);
                    next += 1;
                }
            }
        }
    }

    /// Substeps of coloured Gauss-Seidel.
    #[inline(always)]
    fn edge_by_edge(self, frame: &Frame) {
        let Self {
            model,
            presses,
            range,
            state,
            ..
        } = self;
        let square = V::of(frame.h * frame.h);
        for (mobility, w) in state.mobility.iter_mut().zip(&state.inverse_mass) {
            *mobility = *w * square;
        }
        for substep in range {
            for v in 0..state.position.len() {
                predict(v, frame, state);
                let (free, fall) = (V::zero().lt(state.inverse_mass[v]), V::of(frame.fall));
                let Vec3x([x, y, z]) = state.position[v];
                state.position[v] = Vec3x([x, y, z + V::select(free, fall, V::zero())]);
            }
            for press in presses {
                hold_down(model, press, substep, state);
            }
            for pass in &model.passes {
                project(pass, &mut state.position, &state.mobility);
            }
            separate(model, state);
            finish(0..state.position.len(), frame, false, state);
        }
    }
}

/// Looks up the tangent plane of the tool under every vertex.
#[inline(always)]
pub(super) fn find_planes<V: Lanes>(tool: &Tool, state: &mut Cpu<V>) {
    for (x, plane) in state.position.iter().zip(&mut state.plane) {
        let (phi, n) = tool.distance_in_lanes(x.0);
        let normal = Vec3x(n);
        let offset = normal.dot(*x) - phi;
        *plane = Plane { normal, offset };
    }
}

/// Position at the start of a substep, and the way that its velocity takes a vertex.
#[inline(always)]
pub(super) fn predict<V: Lanes>(v: usize, frame: &Frame, state: &mut Cpu<V>) {
    let x = state.position[v];
    state.previous[v] = x;
    state.position[v] = x + state.velocity[v].scale(V::of(frame.h));
}

/// The start of a substep along a warp: the pull of the kept forces of its yarns by directions at
/// the predicted positions (at the start of the substep they would feed the yarns' vibrations),
/// what it and weight do, and its bending. Warps begin in their order, those that wefts lead to
/// from here later.
#[inline(always)]
fn begin<V: Lanes>(warp: usize, lines: &Lines, frame: &Frame, state: &mut Cpu<V>) {
    let wefts = &lines.crossings[warp].edges[..];
    give_way(&lines.warps[warp], wefts, frame, state);
}

/// What the kept forces of wefts do to the vertices of a warp.
pub(super) trait Wefts<V: Lanes> {
    /// Pull [N] and stress [N/m] at number i along the warp, vertex v, which has not yet moved.
    fn hold(&self, i: usize, v: usize, state: &mut Cpu<V>) -> (Vec3x<V>, V);
}

impl<V: Lanes> Wefts<V> for [[Option<Crossing>; 2]] {
    #[inline(always)]
    fn hold(&self, i: usize, v: usize, state: &mut Cpu<V>) -> (Vec3x<V>, V) {
        let (mut pull, mut stress) = (Vec3x::zero(), V::zero());
        let YarnState {
            density, across, ..
        } = &mut state.yarns;
        for crossing in self[i].iter().flatten() {
            let edge = crossing.edge as usize;
            let (q, across) = (density[edge], &mut across[edge]);
            match crossing.leads {
                Leads::On { to, least_kept } => {
                    let d = state.position[to as usize] - state.position[v];
                    *across = recall_edge(d, q, V::of(least_kept)).0;
                    pull = pull + *across;
                }
                Leads::Back => pull = pull - *across,
            }
            stress = stress + q.max(-q);
        }
        (pull, stress)
    }
}

/// What weight and the yarns' kept forces do to the predicted positions along a warp, and its
/// bending.
#[inline(always)]
pub(super) fn give_way<V: Lanes>(
    warp: &impl Chain<V>,
    wefts: &(impl Wefts<V> + ?Sized),
    frame: &Frame,
    state: &mut Cpu<V>,
) {
    let square = V::of(frame.h * frame.h);
    let mut before = (Vec3x::zero(), V::zero());
    for (i, &v) in warp.vertices().iter().enumerate() {
        let v = v as usize;
        let (pull, stress) = wefts.hold(i, v, state);
        let density = &state.yarns.density[warp.edges()];
        let after = recall_after(warp, i, &state.position, density);
        let pull = pull - before.0 + after.0;
        let stress = stress + before.1 + after.1;
        before = after;

        let free = state.inverse_mass[v] * square;
        let inertia = free * stress * V::of(CROSSING);
        let fall = V::select(V::zero().lt(free), V::of(frame.fall), V::zero());
        let mut x = state.position[v];
        // What is rare is computed only where it happens: divisions and roots cost most.
        let (mobility, fall) = if V::any(V::of(1.0).lt(inertia)) {
            let share = V::of(1.0) / V::of(1.0).max(inertia);
            let from = state.previous[v];
            let kept = V::of(1.0) - V::of(DRAG) * (V::of(1.0) - share);
            // Where nothing is taken away, not even a rounding: no lane may depend on others.
            let slowed = from + (x - from).scale(kept);
            x = Vec3x::select(V::of(1.0).lt(inertia), slowed, x);
            (free * share, fall * share)
        } else {
            (free, fall)
        };
        state.mobility[v] = mobility;
        let Vec3x([dx, dy, dz]) = pull.scale(mobility);
        state.position[v] = x + Vec3x([dx, dy, dz + fall]);
    }
    let scratch = &mut state.yarns.scratch;
    bend(warp, &mut state.position, &state.mobility, scratch);
}

#[inline(always)]
pub(super) fn stretch_yarn<V: Lanes>(yarn: &impl Chain<V>, state: &mut Cpu<V>) {
    let YarnState {
        density, scratch, ..
    } = &mut state.yarns;
    let density = &mut density[yarn.edges()];
    let x = &mut state.position;
    stretch(yarn, x, &state.mobility, density, scratch);
}

#[inline(always)]
pub(super) fn project<V: Lanes>(pass: &Pass, x: &mut [Vec3x<V>], w: &[V]) {
    match pass {
        Pass::Edges(class) => project_edges(class, x, w),
        Pass::LimitedEdges(class, limits) => project_limited_edges(class, limits, x, w),
        Pass::Diagonals(class, trellis) => project_diagonals(class, trellis, x, w),
        Pass::Triples(triples) => project_triples(triples, x, w),
        Pass::Hinges(hinges) => project_hinges(hinges, x, w),
        Pass::Membrane(elements) => project_elements(elements, x, w),
    }
}

/// Keeps the pressed vertices of one lane below the stencil: C = phi - height <= 0 [m], with
/// the compliance of the roller's skin.
#[inline(always)]
fn hold_down<V: Lanes>(model: &Model, press: &Press, substep: usize, state: &mut Cpu<V>) {
    let plate = Plate::new(model, press, substep);
    for &vertex in &press.vertices {
        let v = vertex as usize;
        let beneath = match (&state.self_contact, &model.layers) {
            (Some(contact), Some(layers)) => contact.beneath(layers, press.lane, v),
            _ => 0.0,
        };
        plate.hold_down(v, press.lane, beneath, state);
    }
}

/// The stencil in a substep.
pub(super) struct Plate {
    /// Over the tool [m].
    height: f64,
    /// Of the roller's skin [m/N].
    compliance: f64,
}

impl Plate {
    pub fn new(model: &Model, press: &Press, substep: usize) -> Self {
        let left = 1.0 - (substep + 1) as f64 / press.descent as f64;
        Self {
            height: press.height * left.max(0.0),
            compliance: 1.0 / model.physics().press_stiffness,
        }
    }

    /// Keeps one lane of number `v` below the plate, on top of what lies `beneath` it [m].
    #[inline(always)]
    pub fn hold_down<V: Lanes>(&self, v: usize, lane: usize, beneath: f64, state: &mut Cpu<V>) {
        let mobility = state.mobility[v].as_slice()[lane].to_f64();
        let n = state.plane[v].normal.get(lane);
        let offset = state.plane[v].offset.as_slice()[lane].to_f64();
        let mut x = state.position[v].get(lane);
        let c = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offset - self.height - beneath;
        if c > 0.0 && mobility > 0.0 {
            let depth = c * mobility / (mobility + self.compliance);
            for k in 0..3 {
                x[k] -= n[k] * depth;
            }
            state.position[v].set(lane, x);
        }
    }
}

/// The vertices of a line.
#[inline(always)]
fn indices(line: &Line) -> impl Iterator<Item = usize> + '_ {
    line.vertices.iter().map(|&v| v as usize)
}

/// Keeps the layers of the cloth apart, in a scene that asks for it.
#[inline(always)]
fn separate<V: Lanes>(model: &Model, state: &mut Cpu<V>) {
    if let (Some(contact), Some(layers)) = (&mut state.self_contact, &model.layers) {
        let around = Around {
            previous: &state.previous,
            w: &state.inverse_mass,
            planes: &state.plane,
        };
        contact.separate(layers, &mut state.position, &around);
    }
}

/// The end of a substep for some vertices, contact and velocity, and the prediction of the
/// `next` one if there is one: while they are at hand.
#[inline(always)]
fn finish<V: Lanes>(
    vertices: impl Iterator<Item = usize>,
    frame: &Frame,
    next: bool,
    state: &mut Cpu<V>,
) {
    match frame.tack {
        None => {
            for v in vertices {
                conclude(v, frame, None, next, state);
            }
        }
        Some(tack) => {
            for v in vertices {
                conclude(v, frame, Some(V::of(tack[v])), next, state);
            }
        }
    }
}

/// Pushes a vertex out of the tool, and holds or slows what slides on it (Coulomb): the
/// tangential motion of the substep is taken back wholly while it is below the static
/// coefficient times the push, else by the dynamic coefficient times the push. Then
/// v = (x - p) / h, damped and capped, and what the air of a moving frame adds; fixed vertices keep
/// theirs. If there is a `next` substep, its prediction follows, and the velocity is not stored.
///
/// Within its range `tack` [N] draws the vertex towards the tool first. It lasts in contact, so
/// the push, and with it friction, is that of a load greater by it (Derjaguin's law). `tack` is
/// a constant where this is inlined without it, so that it costs nothing there.
#[inline(always)]
pub(super) fn conclude<V: Lanes>(
    v: usize,
    frame: &Frame,
    tack: Option<V>,
    next: bool,
    state: &mut Cpu<V>,
) {
    let (mut x, plane) = (state.position[v], &state.plane[v]);
    let free = V::zero().lt(state.inverse_mass[v]);
    let mut phi = plane.normal.dot(x) - plane.offset;
    if let Some(tack) = tack {
        let near = phi.lt(V::of(TACK_RANGE));
        let drawn = V::select(near, tack * state.mobility[v], V::zero());
        x = x - plane.normal.scale(drawn);
        phi = phi - drawn;
    }
    let depth = V::select(free, (-phi).max(V::zero()), V::zero());
    let x = x + plane.normal.scale(depth);
    let mut moved = x - state.previous[v];
    let mut out = x;
    if let Some([stick, slide]) = frame.friction
        && V::any(V::zero().lt(depth))
    {
        let tangential = moved - plane.normal.scale(plane.normal.dot(moved));
        let square = tangential.dot(tangential);
        let hold = V::of(stick) * depth;
        let slides = (hold * hold).lt(square);
        // Without contact the depth is 0, and so is the share that is taken back.
        let touches = V::zero().lt(depth);
        let mut share = V::select(touches, V::of(1.0), V::zero());
        if V::any(slides) {
            let taken = V::of(slide) * depth / square.sqrt();
            share = V::select(slides, taken.min(V::of(1.0)), share);
        }
        out = x - tangential.scale(share);
        moved = out - state.previous[v];
    }
    let mut velocity = moved.scale(V::of(frame.rate));
    if frame.speed_cap > 0.0 {
        let cap = V::of(frame.speed_cap);
        let square = velocity.dot(velocity);
        let fast = (cap * cap).lt(square);
        if V::any(fast) {
            velocity = Vec3x::select(fast, velocity.scale(cap / square.sqrt()), velocity);
        }
    }
    if let Some(wind) = frame.wind {
        velocity = velocity + Vec3x(wind.map(V::of));
    }
    let velocity = Vec3x::select(free, velocity, state.velocity[v]);
    if next {
        state.previous[v] = out;
        state.position[v] = out + velocity.scale(V::of(frame.h));
    } else {
        state.position[v] = out;
        state.velocity[v] = velocity;
    }
}
