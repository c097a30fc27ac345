//! Contact of the cloth with itself.
//!
//! Vertices against triangles and edges against edges that share no vertex are kept one fabric
//! thickness apart, with Coulomb friction. Each pair that faces each other remembers its side: a
//! press that drives layers through each other does not decide which of them is on top.
//!
//! Pairs are refreshed at the start of every control step and whenever a vertex has moved by
//! `SLACK` thicknesses, with boxes that cover the displacement of the last substep. They are pushed
//! apart one after the other until none overlaps by half the thickness more than it may, lane by
//! lane in f64, so that a lane's bits depend on nothing but its own state. What overlapped before
//! the substep comes apart slowly: all at once, layers that a press has driven through each other
//! would be thrown about.
//!
//! Not modelled: adhesion, compaction of the fabric, a fold sharper than its cells.

mod geometry;
mod search;
mod tree;

use super::cloth::Plane;
use super::physics::SelfCollision;
use crate::fabric::Lamina;
use crate::math::{Lanes, Vec3, Vec3x};
use geometry::{Gap, Kind, Pair};
use search::{Scratch, Topology};

/// Displacement of a vertex after which pairs are refreshed, in thicknesses. More refreshes them
/// less often, but more of them.
const SLACK: f64 = 1.0;

/// Times that the pairs of a lane are pushed apart in a substep at most, one pair after the
/// other, and the overlap in thicknesses with which it is enough.
const PASSES: usize = 30;
const TOLERANCE: f64 = 0.5;
/// How far layers come apart in a substep that overlapped at its start, in thicknesses: those in
/// their order, and those pressed through each other.
const RECOVERY: [f64; 2] = [0.3, 0.1];
/// Projections of a substep at most, for each vertex: bounds the time that a tangle costs.
const WORK: usize = 120;

/// What of self-contact is fixed between resets.
#[derive(Clone, Debug)]
pub(super) struct Layers {
    surface: Topology,
    /// Distance between the middles of two layers in contact [m].
    thickness: f64,
    /// Static and dynamic coefficient.
    friction: Option<[f64; 2]>,
}

impl Layers {
    pub fn new(
        lamina: &Lamina,
        collision: SelfCollision,
        friction: Option<[f64; 2]>,
    ) -> Option<Self> {
        let thickness = collision.thickness(lamina)?;
        Some(Self {
            surface: Topology::new(&lamina.rest, &lamina.triangles),
            thickness,
            friction,
        })
    }

    /// Whether [`Snapshot::sides`](super::Snapshot::sides) are such as these layers remember.
    pub fn know(&self, sides: &[u64]) -> bool {
        sides.is_sorted() && sides.iter().all(|&side| self.surface.has(side))
    }
}

/// What a substep knows of the vertices besides their positions.
pub(super) struct Around<'a, V> {
    /// Positions at its start, which tell the sides.
    pub previous: &'a [Vec3x<V>],
    /// Inverse masses [1/kg].
    pub w: &'a [V],
    /// Tangent planes of the tool.
    pub planes: &'a [Plane<V>],
    /// Factors on static and dynamic friction.
    pub friction: &'a [V; 2],
}

/// Contacts of one lane.
#[derive(Default)]
struct Lane {
    /// Those that may touch before the next refresh, in the order of projection.
    pairs: Vec<Pair>,
    /// Sides of the pairs that faced each other at the last refresh, see [`search`], ascending.
    sides: Vec<u64>,
    /// Layers of cloth between each vertex and the tool at the last refresh.
    beneath: Vec<u8>,
    /// Refresh the pairs in the next substep, whether or not anything has moved.
    due: bool,
}

/// Contacts of the cloth with itself in a group of environments.
pub(super) struct SelfContact<V> {
    lanes: Vec<Lane>,
    /// Positions at the last refresh of each lane.
    seen: Vec<Vec3x<V>>,
    scratch: Scratch,
}

impl<V: Lanes> SelfContact<V> {
    pub fn new(vertex_count: usize) -> Self {
        Self {
            lanes: (0..V::COUNT)
                .map(|_| Lane {
                    beneath: vec![0; vertex_count],
                    ..Lane::default()
                })
                .collect(),
            seen: vec![Vec3x::zero(); vertex_count],
            scratch: Scratch::default(),
        }
    }

    pub fn load(&mut self, lane: usize, sides: &[u64]) {
        self.lanes[lane].beneath.fill(0);
        self.lanes[lane].sides.clear();
        self.lanes[lane].sides.extend_from_slice(sides);
    }

    /// What has to be remembered of a lane between two control steps.
    pub fn sides(&self, lane: usize) -> Vec<u64> {
        self.lanes[lane].sides.clone()
    }

    /// How high over the tool the cloth beneath a vertex reaches [m]: no roller can press the
    /// vertex further down. Infinite where other cloth lies above it and bears the roller, and before the
    /// first search of a control step.
    pub fn beneath(&self, layers: &Layers, lane: usize, vertex: usize) -> f64 {
        let lane = &self.lanes[lane];
        match lane.beneath[vertex] {
            count if count == COVERED || lane.due => f64::INFINITY,
            count => layers.thickness * f64::from(count),
        }
    }

    /// Starts a control step. A refresh at its start makes what follows a function of the
    /// snapshot alone.
    pub fn start(&mut self) {
        self.lanes.iter_mut().for_each(|lane| lane.due = true);
    }

    /// Keeps the layers of every lane apart.
    #[inline(always)]
    pub fn separate(&mut self, layers: &Layers, x: &mut [Vec3x<V>], around: &Around<V>) {
        let mut moved = V::zero();
        for (x, seen) in x.iter().zip(&self.seen) {
            for d in (*x - *seen).0 {
                moved = moved.max(d.max(-d));
            }
        }
        let slack = V::of(SLACK * layers.thickness);
        let moved = V::select(slack.lt(moved), V::of(1.0), V::zero());
        for lane in 0..V::COUNT {
            let moved = moved.get(lane) > 0.0;
            self.separate_lane(layers, lane, moved, x, around);
        }
    }

    /// Scalar code, for which the instruction set of the lanes is of no use.
    #[inline(never)]
    fn separate_lane(
        &mut self,
        layers: &Layers,
        lane: usize,
        moved: bool,
        x: &mut [Vec3x<V>],
        around: &Around<V>,
    ) {
        let contacts = &mut self.lanes[lane];
        if moved || contacts.due {
            contacts.due = false;
            let place = |to: &mut Vec<Vec3>, from: &[Vec3x<V>]| {
                to.clear();
                to.extend(from.iter().map(|x| Vec3::from(x.get(lane))));
            };
            place(&mut self.scratch.from, around.previous);
            place(&mut self.scratch.to, x);
            for (seen, x) in self.seen.iter_mut().zip(&self.scratch.to) {
                seen.set(lane, (*x).into());
            }
            let slack = SLACK * layers.thickness;
            let surface = &layers.surface;
            let (pairs, sides) = (&mut contacts.pairs, &mut contacts.sides);
            self.scratch
                .search(surface, layers.thickness, slack, pairs, sides);
            count_beneath(pairs, &self.scratch.from, &mut contacts.beneath, |v| {
                around.planes[v].normal.get(lane).into()
            });
        }
        let work = WORK * x.len() / self.lanes[lane].pairs.len().max(1);
        for _ in 0..PASSES.min(work.max(1)) {
            let mut deepest = 0.0f64;
            for pair in &self.lanes[lane].pairs {
                deepest = deepest.max(project(layers, pair, lane, x, around));
            }
            if deepest <= TOLERANCE * layers.thickness {
                break;
            }
        }
    }
}

/// In place of a number of layers beneath: other cloth lies above.
const COVERED: u8 = u8::MAX;

/// Counts the layers between each vertex and the tool, near enough to touch: of each layer,
/// one triangle faces the vertex.
fn count_beneath(pairs: &[Pair], x: &[Vec3], beneath: &mut [u8], normal: impl Fn(usize) -> Vec3) {
    beneath.fill(0);
    for pair in pairs.iter().filter(|p| p.kind == Kind::VertexFace) {
        let index = pair.vertices.map(|v| v as usize);
        let Some(gap) = Gap::new(pair.kind, index.map(|v| x[v])) else {
            continue;
        };
        let up = pair.side * gap.normal.dot(&normal(index[0]));
        let beneath = &mut beneath[index[0]];
        if gap.aside <= 0.0 && up > 0.5 {
            *beneath = beneath.saturating_add(1);
        }
        if gap.aside <= 0.0 && up < -0.5 {
            *beneath = COVERED;
        }
    }
}

/// Projects one pair: C = side height - wanted height >= 0 [m], rigid, where wanted is the
/// thickness or what [`RECOVERY`] allows; then takes back what it slid in this substep, as far as
/// friction holds (wholly while below the static coefficient times the push, else by the dynamic
/// coefficient times the push). Returns what was missing [m].
///
/// Shares add up to zero and the push is along the line between the nearest points, so neither
/// changes the momentum of free vertices. No vertex is pushed by more than is missing: where the only
/// free one is far from the nearest points, it would by a hundred times as much.
#[inline(always)]
fn project<V: Lanes>(
    layers: &Layers,
    pair: &Pair,
    lane: usize,
    x: &mut [Vec3x<V>],
    around: &Around<V>,
) -> f64 {
    let index = pair.vertices.map(|v| v as usize);
    let at = index.map(|v| Vec3::from(x[v].get(lane)));
    let Some((gap, missing)) = Gap::too_small(pair.kind, at, pair.side, layers.thickness) else {
        return 0.0;
    };
    let between = |x: [Vec3; 4]| -> Vec3 { (0..4).map(|i| x[i] * gap.weight[i]).sum() };
    let before = between(index.map(|v| around.previous[v].get(lane).into()));
    let height = pair.side * before.dot(&gap.normal) / layers.thickness;
    let recovered = height + RECOVERY[usize::from(height < 0.0)];
    let depth = missing - layers.thickness * (1.0 - recovered).max(0.0);
    let w = index.map(|v| around.w[v].get(lane));
    let by_weight = |power: i32| (0..4).map(move |i| w[i] * gap.weight[i].abs().powi(power));
    let sum = by_weight(2)
        .sum::<f64>()
        .max(by_weight(1).fold(0.0, f64::max));
    let movable = sum > 0.0;
    if depth <= 0.0 || !movable {
        return 0.0;
    }
    let mut push = gap.normal.map(|n| n * pair.side * depth);
    if let Some(of_layers) = layers.friction {
        let [stick, slide] = [0, 1].map(|k| of_layers[k] * around.friction[k].get(lane));
        let slid = between(at) - before;
        let slid = slid - gap.normal * slid.dot(&gap.normal);
        let length = slid.norm();
        let share = if length < stick * depth {
            1.0
        } else {
            (slide * depth / length.max(1e-20)).min(1.0)
        };
        push -= slid * share;
    }
    for i in (0..4).filter(|&i| w[i] > 0.0) {
        let share = w[i] * gap.weight[i] / sum;
        let mut to = at[i] + push * share;
        // The tool gives way to no layer, so the stack grows from it upwards.
        let plane = &around.planes[index[i]];
        let normal = Vec3::from(plane.normal.get(lane));
        let phi = normal.dot(&to) - plane.offset.get(lane);
        if phi < 0.0 {
            to -= normal * phi;
        }
        x[index[i]].set(lane, to.into());
    }
    depth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};
    use crate::math::Vec3x;

    const THICKNESS: f64 = 0.35e-3;

    /// Projects a vertex at `height` thicknesses on one side of the triangle (0, 0), (1, 0), (0, 1) m,
    /// from `before` thicknesses at the start of the substep, and returns where all four end up.
    fn projected(
        side: f64,
        at: [f64; 2],
        [before, height]: [f64; 2],
        free: [bool; 4],
    ) -> [[f64; 3]; 4] {
        let lamina = Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap();
        let layers = Layers::new(&lamina, SelfCollision::ThicknessMm(1e3 * THICKNESS), None);
        let mut x = [
            [at[0], at[1], side * height * THICKNESS],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
        ]
        .map(Vec3x);
        let mut previous = x;
        previous[0].0[2] = side * before * THICKNESS;
        let far_below = Plane {
            normal: Vec3x([0.0, 0.0, 1.0]),
            offset: -1.0,
        };
        let around = Around {
            previous: &previous,
            w: &free.map(|free| if free { 1.0 } else { 0.0 }),
            planes: &[far_below; 4],
            friction: &[1.0; 2],
        };
        let pair = Pair {
            kind: Kind::VertexFace,
            vertices: [0, 1, 2, 3],
            side,
        };
        project::<f64>(&layers.unwrap(), &pair, 0, &mut x, &around);
        x.map(|x| x.0.map(|x| side * x / THICKNESS))
    }

    /// What a substep does is taken back whole; what overlapped before comes apart slowly, even more
    /// so where the layers have passed through each other.
    #[test]
    fn only_what_overlapped_before_comes_apart_slowly() {
        let height = |before: f64, now: f64| {
            let [up, down] = [1.0, -1.0].map(|side| {
                let [p, a, ..] = projected(side, [0.0, 0.0], [before, now], [true; 4]);
                p[2] - a[2]
            });
            assert_eq!(up, down);
            up
        };
        let close = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
        };
        close(height(2.0, -8.0), 1.0);
        close(height(0.5, -3.0), 0.5 + RECOVERY[0]);
        close(height(0.9, 0.2), 1.0);
        close(height(-4.0, -6.0), -4.0 + RECOVERY[1]);
        close(height(0.2, 0.7), 0.7);
    }

    /// A free corner far from the nearest point has a short lever there and would have to go a
    /// hundred times as far as the layers overlap.
    #[test]
    fn no_vertex_moves_by_more_than_the_layers_overlap() {
        let [p, _, b, _] = projected(1.0, [0.01, 0.3], [2.0, 0.0], [false, false, true, false]);
        assert_eq!(p[2], 0.0);
        assert!((b[2] + 1.0).abs() < 1e-9, "{b:?}");
    }
}
