//! Force laws of edges: two or three straight branches.

use super::physics::{PhysicsConfig, Tension};
use crate::fabric::{Lamina, Yarn, color};
use crate::math::{Lanes, Vec3x};

/// Below this squared length [m^2] an edge has no direction, and nothing pulls along it.
pub(super) const MIN_SQUARE: f64 = 1e-20;

/// Compliance of an edge [m/N] for each sign of its strain.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeLaw {
    pub tension: f64,
    pub compression: f64,
}

impl EdgeLaw {
    /// The law of tensile and compressive stiffness [N/m].
    pub fn of_stiffness([tension, compression]: [f64; 2]) -> Self {
        Self {
            tension: 1.0 / tension,
            compression: 1.0 / compression,
        }
    }

    /// The compliance of the sign of `c`.
    #[inline(always)]
    pub fn branch<V: Lanes>(&self, c: V) -> V {
        let (tension, compression) = (V::of(self.tension), V::of(self.compression));
        V::select(c.lt(V::zero()), compression, tension)
    }
}

/// Compliance of a yarn beyond the strain limit, as a share of that in tension. At the limit's
/// force times ten it adds a hundredth of the limit. 0 would make the system of a yarn between
/// clamps singular.
pub(super) const LIMITED: f64 = 1e-3;

/// The law of an edge beyond a tension, its strain limit or the knee of the material's law:
/// C = offset + compliance * force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// Tension at which it begins [N].
    pub force: f64,
    /// [m/N]
    pub compliance: f64,
    /// [m]; such that there the law is continuous.
    pub offset: f64,
}

impl Limit {
    /// Of an edge without one.
    pub const NONE: Self = Self {
        force: f64::INFINITY,
        compliance: 1.0,
        offset: 0.0,
    };

    /// Beyond a growth of an edge by `stretch` [m], `share` of the compliance that it has before.
    fn new(law: EdgeLaw, stretch: f64, share: f64) -> Self {
        Self {
            force: stretch / law.tension,
            compliance: share * law.tension,
            offset: stretch * (1.0 - share),
        }
    }

    /// Of the edges of a yarn, where the scene lists one. A strain limit takes the knee's place.
    pub fn of_yarn(
        law: EdgeLaw,
        lamina: &Lamina,
        physics: &PhysicsConfig,
        yarn: &Yarn,
    ) -> Option<Self> {
        if let Some(strain) = physics.strain_limit {
            return Some(Self::new(law, strain * yarn.rest_length, LIMITED));
        }
        match physics.tension {
            Tension::FirstBranch => None,
            Tension::Material => {
                let [strain, slope] = lamina.material.yarn(yarn.family).tension.knee()?;
                Some(Self::new(law, strain * yarn.rest_length, 1.0 / slope))
            }
        }
    }
}

/// Edges of which no two share a vertex.
#[derive(Clone, Debug)]
pub(super) struct EdgeClass {
    pub vertices: Vec<[u32; 2]>,
    pub rest_length: Vec<f64>,
    pub law: Vec<EdgeLaw>,
}

/// Ends, length at rest [m] and law of an edge.
pub(super) type Edge = ([u32; 2], f64, EdgeLaw);

/// The `edges` in colours: which they are, and as passes need them.
pub(super) fn edge_classes(lamina: &Lamina, edges: &[Edge]) -> Vec<(Vec<u32>, EdgeClass)> {
    let vertices: Vec<[u32; 2]> = edges.iter().map(|e| e.0).collect();
    let classes = color(lamina.vertex_count(), &vertices).into_iter();
    let with_edges = |class: Vec<u32>| {
        let of = |&i: &u32| edges[i as usize];
        let edges = EdgeClass {
            vertices: class.iter().map(|i| of(i).0).collect(),
            rest_length: class.iter().map(|i| of(i).1).collect(),
            law: class.iter().map(|i| of(i).2).collect(),
        };
        (class, edges)
    };
    classes.map(with_edges).collect()
}

/// Constraints on `vertices` in colours.
pub(super) fn in_colors<T: Copy, const N: usize>(
    lamina: &Lamina,
    all: &[T],
    vertices: impl Fn(&T) -> [u32; N],
) -> Vec<Vec<T>> {
    let vertices: Vec<[u32; N]> = all.iter().map(vertices).collect();
    let members = |class: Vec<u32>| class.iter().map(|&i| all[i as usize]).collect();
    let classes = color(lamina.vertex_count(), &vertices);
    classes.into_iter().map(members).collect()
}

/// What an edge that is projected by itself answers to.
pub(super) trait EdgeResponse<V: Lanes> {
    /// C less what the law leaves of it without force [m], and compliance [m/N], of edge `i`
    /// whose ends give way by `gives` [m/N] together.
    fn at(&self, class: &EdgeClass, i: usize, square: V, c: V, gives: V) -> [V; 2];

    /// Whether edge `i` is without force in all lanes, from the square of its length [m^2].
    #[inline(always)]
    fn is_idle(&self, _: &EdgeClass, _: usize, _: V) -> bool {
        false
    }
}

/// Projects the edges of one colour, one after the other.
///
/// C = |x1 - x0| - l [m]. Macklin et al. 2016 (XPBD), eqs. 17-18, with lambda = 0 at the
/// start of the substep.
#[inline(always)]
pub(super) fn project_edges<V: Lanes>(
    class: &EdgeClass,
    response: &impl EdgeResponse<V>,
    x: &mut [Vec3x<V>],
    w: &[V],
) {
    for (i, (v, rest)) in class.vertices.iter().zip(&class.rest_length).enumerate() {
        let [a, b] = v.map(|v| v as usize);
        let d = x[b] - x[a];
        let square = d.dot(d).max(V::of(MIN_SQUARE));
        if response.is_idle(class, i, square) {
            continue;
        }
        let length = square.sqrt();
        let gives = w[a] + w[b];
        let [c, compliance] = response.at(class, i, square, length - V::of(*rest), gives);
        let pull = d.scale(c / ((gives + compliance) * length).max(V::of(1e-28)));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}
