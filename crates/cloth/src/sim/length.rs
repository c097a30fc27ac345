//! Length of the yarns: solved along each yarn with forces that last, or edge by edge.

use super::edges::{Edge, EdgeClass, EdgeResponse, Projected, in_colors};
use super::frame::Frame;
use super::law::{EdgeLaw, Limit, branch};
use super::line::{Along, Chain, Direction, LineLaw, Response, solve};
use super::physics::PhysicsConfig;
use crate::fabric::{Family, Lamina, Yarn};
use crate::math::{Lanes, Vec3x};

/// Substeps in which a vertex would at least need to cross an edge under the forces of its
/// yarns. The solve along a line is linear in the directions at its start, so yarns that pull
/// (or push) a vertex far within a substep overshoot: from a force of about m l / h^2 on they
/// would throw it to and fro. There the vertex is given the inertia at which it moves l / 2.5 at
/// most. At rest nothing moves, so the forces there are right whatever the number; below it
/// nothing changes, so it goes away with h^2. Inertia keeps a press from dragging cloth in: pressed
/// on a hemisphere, places are 12.0 mm off the finite-element twin's with 5, 7.6 with 2.5, 6.9 with
/// 2, where 80 times as many substeps leave 6.5. Less tears single edges: by 2 a sheet whose presses
/// are over may shake, by 1 it diverges.
pub(super) const CROSSING: f64 = 2.5;

/// Share of its displacement that such a vertex loses in a substep, as its inertia grows without
/// bound. Between draped neighbours slack yarns would throw it to and fro for ever.
pub(super) const DRAG: f64 = 0.2;

/// Edge stiffness k = E h (b / a) of a yarn of width b and edge length a (Table 2).
pub(super) fn yarn_law(lamina: &Lamina, yarn: &Yarn) -> EdgeLaw {
    let law = lamina.material.yarn(yarn.family);
    let per_modulus = lamina.material.thickness() * yarn.width / yarn.rest_length;
    EdgeLaw::of_stiffness(
        [law.tension.modulus(), law.compression.modulus()].map(|e| e * per_modulus),
    )
}

/// Yarn edges in colours, with the limit of each where any yarn has one.
pub(super) fn edges(
    lamina: &Lamina,
    physics: &PhysicsConfig,
) -> impl Iterator<Item = (EdgeClass, Vec<Limit>)> {
    let mut edges = Vec::new();
    for yarn in &lamina.yarns {
        let law = yarn_law(lamina, yarn);
        let limit = Limit::of_yarn(law, lamina, physics, yarn).unwrap_or(Limit::NONE);
        for pair in yarn.vertices.windows(2) {
            let edge = Edge {
                ends: [pair[0], pair[1]],
                rest_length: yarn.rest_length,
                law,
                direction: match yarn.family {
                    Family::Warp => Direction::Warp,
                    Family::Weft => Direction::Weft,
                },
            };
            edges.push((edge, limit));
        }
    }
    let is_limited = edges.iter().any(|(_, limit)| limit.force.is_finite());
    let classes = in_colors(lamina, &edges, |(edge, _)| edge.ends).into_iter();
    classes.map(move |class| {
        let (edges, mut limits): (Vec<Edge>, Vec<Limit>) = class.into_iter().unzip();
        limits.retain(|_| is_limited);
        (edges.into(), limits)
    })
}

/// The law of yarn edges that are projected by themselves.
pub(super) struct Plain;

impl<V: Lanes> EdgeResponse<V> for Plain {
    #[inline(always)]
    fn at(&self, _: &EdgeClass, edge: Projected<V>) -> [V; 2] {
        [edge.c, branch(edge.law, edge.c)]
    }
}

/// A response with another compliance beyond a tension: where the projection by the law before it would end with more.
pub(super) struct Limited<'a>(pub &'a [Limit]);

impl<V: Lanes> EdgeResponse<V> for Limited<'_> {
    #[inline(always)]
    fn at(&self, _: &EdgeClass, edge: Projected<V>) -> [V; 2] {
        let Projected { c, gives, .. } = edge;
        let (limit, compliance) = (self.0[edge.i], branch(edge.law, c));
        let (mut force, mut limited) = (V::of(limit.force), V::of(limit.compliance));
        if let Some([pulled, _]) = edge.factors {
            (force, limited) = (force / pulled, limited * pulled);
        }
        let beyond = (force * (gives + compliance)).lt(c);
        [
            V::select(beyond, c - V::of(limit.offset), c),
            V::select(beyond, limited, compliance),
        ]
    }
}

/// Solves all length constraints of a yarn together.
///
/// C_j = |x_{j+1} - x_j| - l [m], law C = compliance * force with force > 0 in tension. The
/// forces of the last substep have moved the vertices already ([`warm_start`]); the solve finds
/// their changes. XPBD (Macklin et al. 2016, eqs. 17-18) with multipliers that last: at rest
/// nothing changes, so every yarn meets its law whatever the splitting.
///
/// What lasts of an edge is its force density, force / length [N/m] (Schek 1974): its pull is then
/// the edge times it, and no length is asked for between solves.
///
/// Each edge takes the compliance of the sign of its force. That of the predicted strain would
/// not do: at rest it is the sign of gravity's last push, so edges would change branch in every
/// substep and never come to rest. Beyond the limit or knee of a yarn that has one there is a
/// third branch, likewise by its force.
#[inline(always)]
pub(super) fn stretch<V: Lanes, C: Chain<V>>(mut yarn: Along<V, C>) {
    let warm = &mut Warm(std::mem::take(&mut yarn.density));
    if yarn.law.limit.is_none() {
        // A constant where this is inlined, so that limits cost nothing where there are none.
        yarn.law.limit = None;
        solve(yarn, warm);
    } else {
        solve(yarn, warm);
    }
}

/// Force densities from the last substep.
struct Warm<'a, V>(&'a mut [V]);

impl<V: Lanes> Response<V> for Warm<'_, V> {
    #[inline(always)]
    fn at(&self, law: &LineLaw<V>, j: usize, _: V, length: V) -> [V; 2] {
        let c = length - law.rest[0];
        let compliance = branch(law.compliance, self.0[j]);
        let force = self.0[j].max(law.min_warm) * length;
        match law.limit {
            None => [compliance, c - compliance * force],
            Some([max, limited, offset]) => {
                let beyond = max.lt(force);
                let compliance = V::select(beyond, limited, compliance);
                let offset = V::select(beyond, offset, V::zero());
                [compliance, c - offset - compliance * force]
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, law: &LineLaw<V>, j: usize, change: V) {
        self.0[j] = self.0[j].max(law.min_warm) + change;
    }
}

/// What an edge with this force density, as it lies, pulls at its start when a substep starts [N],
/// and its stress |force density| [N/m].
///
/// Directions are those of the predicted positions: at the start of the substep they would feed
/// the yarns' vibrations.
#[inline(always)]
pub(super) fn pull_of<V: Lanes>(edge: Vec3x<V>, density: V, min_warm: V) -> (Vec3x<V>, V) {
    let pull = edge.scale(density.max(min_warm));
    (pull, density.max(-density))
}

/// That of the edge after number `i` of a yarn, 0 at its end.
#[inline(always)]
pub(super) fn pull_after<V: Lanes>(
    line: &impl Chain<V>,
    min_warm: V,
    i: usize,
    x: &[Vec3x<V>],
    density: &[V],
) -> (Vec3x<V>, V) {
    match line.vertices().get(i + 1) {
        Some(&next) => {
            let edge = x[next as usize] - x[line.vertices()[i] as usize];
            pull_of(edge, density[i], min_warm)
        }
        None => (Vec3x::zero(), V::zero()),
    }
}

/// The pull [N] of a yarn's edges on each of its vertices, and the sum of their stress [N/m].
#[inline(always)]
pub(super) fn warm_start<V: Lanes>(
    line: &impl Chain<V>,
    min_warm: V,
    x: &[Vec3x<V>],
    density: &[V],
    pull: &mut [Vec3x<V>],
    stress: &mut [V],
) {
    let mut before = (Vec3x::zero(), V::zero());
    for (i, &v) in line.vertices().iter().enumerate() {
        let after = pull_after(line, min_warm, i, x, density);
        pull[v as usize] = after.0 - before.0;
        stress[v as usize] = before.1 + after.1;
        before = after;
    }
}

/// What lasting forces do to vertices when a substep starts.
pub(super) struct Held<V> {
    /// [N]
    pub pull: Vec<Vec3x<V>>,
    /// [N/m]
    pub stress: Vec<V>,
}

impl<V: Lanes> Held<V> {
    pub fn new(count: usize) -> Self {
        Self {
            pull: vec![Vec3x::zero(); count],
            stress: vec![V::zero(); count],
        }
    }
}

/// How far a vertex gives way in this substep [m/N], and where it goes under its weight and the
/// `pull` [N] of its yarns from where its velocity has taken it; `from` is where it was. Under
/// hard `stress` [N/m] it has the inertia and the drag that [`CROSSING`] and [`DRAG`] say.
#[inline(always)]
pub(super) fn give_way<V: Lanes>(
    frame: &Frame<V>,
    inverse_mass: V,
    [from, predicted, pull]: [Vec3x<V>; 3],
    stress: V,
) -> (V, Vec3x<V>) {
    let one = V::of(1.0);
    let free = inverse_mass * V::of(frame.h * frame.h);
    let inertia = free * stress * V::of(CROSSING);
    let fall = V::select(V::zero().lt(free), V::of(frame.fall), V::zero());
    let mut x = predicted;
    // What is rare is computed only where it happens: divisions and roots cost most.
    let (mobility, fall) = if V::any(one.lt(inertia)) {
        let share = one / one.max(inertia);
        let kept = one - V::of(DRAG) * (one - share);
        // Where nothing is taken away, not even a rounding: no lane may depend on others.
        let slowed = from + (x - from).scale(kept);
        x = Vec3x::select(one.lt(inertia), slowed, x);
        (free * share, fall * share)
    } else {
        (free, fall)
    };
    let Vec3x([dx, dy, dz]) = pull.scale(mobility);
    (mobility, x + Vec3x([dx, dy, dz + fall]))
}

#[cfg(test)]
mod tests;
