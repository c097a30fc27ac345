//! Edges that are projected one by one.

use super::law::{Direction, EdgeLaw, MIN_SQUARE};
use super::scales::Scales;
use crate::fabric::{Lamina, color};
use crate::math::{Lanes, Vec3x};

/// Edges of which no two share a vertex.
#[derive(Clone, Debug)]
pub(super) struct EdgeClass {
    pub vertices: Vec<[u32; 2]>,
    pub rest_length: Vec<f64>,
    pub law: Vec<EdgeLaw>,
    pub direction: Vec<Direction>,
}

impl From<Vec<Edge>> for EdgeClass {
    fn from(edges: Vec<Edge>) -> Self {
        Self {
            vertices: edges.iter().map(|edge| edge.ends).collect(),
            rest_length: edges.iter().map(|edge| edge.rest_length).collect(),
            law: edges.iter().map(|edge| edge.law).collect(),
            direction: edges.iter().map(|edge| edge.direction).collect(),
        }
    }
}

/// An edge that is projected by itself.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    pub ends: [u32; 2],
    /// [m]
    pub rest_length: f64,
    pub law: EdgeLaw,
    pub direction: Direction,
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

/// An edge that is being projected.
#[derive(Clone, Copy)]
pub(super) struct Projected<V> {
    /// Its number in its class.
    pub i: usize,
    /// Its law, and the factors that this holds where environments differ.
    pub law: [V; 2],
    pub factors: Option<[V; 2]>,
    /// Of its length [m^2].
    pub square: V,
    /// Length - rest length [m].
    pub c: V,
    /// How far its ends give way together [m/N].
    pub gives: V,
}

/// What an edge that is projected by itself answers to.
pub(super) trait EdgeResponse<V: Lanes> {
    /// C less what the law leaves of it without force [m], and compliance [m/N].
    fn at(&self, class: &EdgeClass, edge: Projected<V>) -> [V; 2];

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
    scales: Option<&Scales<V>>,
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
        let factors = match scales {
            Some(scales) => Some(scales.compliance[class.direction[i] as usize]),
            None => None,
        };
        let edge = Projected {
            i,
            law: class.law[i].in_lanes(factors),
            factors,
            square,
            c: length - V::of(*rest),
            gives,
        };
        let [c, compliance] = response.at(class, edge);
        let pull = d.scale(c / ((gives + compliance) * length).max(V::of(1e-28)));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}
