//! Gaps between parts of the cloth, f64.

use crate::math::Vec3;

/// Which parts of the cloth meet; with four vertices either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A vertex, then the corners of a triangle.
    VertexFace,
    /// The ends of an edge, then those of another.
    EdgeEdge,
}

/// Below this sine of the angle between two edges their gap has no direction: 2 degrees.
const MIN_SINE: f64 = 0.035;
/// A triangle whose doubled area is less than this share of its longest edges' product has no
/// normal.
const MIN_SPREAD: f64 = 1e-3;

/// Two parts of the cloth that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub kind: Kind,
    pub vertices: [u32; 4],
    /// 1 or -1: the sign of [`Gap::height`] as long as layers do not pass through each other.
    pub side: f64,
}

/// The gap between two parts, along their common normal.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Displacement along `normal` from the second part to the first [m]; its sign tells the side.
    pub height: f64,
    /// Unit length. That of the triangle, or the vector product of the edges.
    pub normal: Vec3,
    /// Share of each vertex in the two nearest points: the first part's add up to 1, the
    /// second's to -1, so height = normal . sum(weight x).
    pub weight: [f64; 4],
    /// How far sideways the parts are from facing each other [m]; they do where <= 0.
    pub aside: f64,
}

impl Gap {
    /// Measures the gap; none where the parts have no common normal: a triangle without area,
    /// edges that are parallel, coordinates that are no numbers.
    pub fn new(kind: Kind, x: [Vec3; 4]) -> Option<Self> {
        match kind {
            Kind::VertexFace => vertex_face(x),
            Kind::EdgeEdge => edge_edge(x),
        }
    }
}

fn vertex_face([p, a, b, c]: [Vec3; 4]) -> Option<Gap> {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let n = ab.cross(&ac);
    let square = n.dot(&n);
    let [ab2, ac2] = [ab.dot(&ab), ac.dot(&ac)];
    let bc = c - b;
    let bc2 = bc.dot(&bc);
    let longest = ab2.max(ac2).max(bc2);
    // Also false for NaN.
    let spread = square > (MIN_SPREAD * longest).powi(2);
    if !spread || !square.is_finite() {
        return None;
    }
    let wb = ap.cross(&ac).dot(&n) / square;
    let wc = ab.cross(&ap).dot(&n) / square;
    let wa = 1.0 - wb - wc;
    let length = square.sqrt();
    // Twice the area over the opposite edge is the altitude of a corner.
    let aside = -(wa / bc2.sqrt()).min(wb / ac2.sqrt()).min(wc / ab2.sqrt()) * length;
    let normal = n / length;
    Some(Gap {
        height: ap.dot(&normal),
        normal,
        weight: [1.0, -wa, -wb, -wc],
        aside,
    })
}

fn edge_edge([a, b, c, d]: [Vec3; 4]) -> Option<Gap> {
    let (u, v, r) = (b - a, d - c, c - a);
    let n = u.cross(&v);
    let square = n.dot(&n);
    let [u2, v2] = [u.dot(&u), v.dot(&v)];
    let crossing = square > MIN_SINE.powi(2) * u2 * v2;
    if !crossing || !square.is_finite() {
        return None;
    }
    let s = r.cross(&v).dot(&n) / square;
    let t = r.cross(&u).dot(&n) / square;
    let length = square.sqrt();
    let beyond = |s: f64| (-s).max(s - 1.0);
    let sine = length / (u2 * v2).sqrt();
    let aside = sine * (beyond(s) * u2.sqrt()).max(beyond(t) * v2.sqrt());
    let normal = n / length;
    Some(Gap {
        height: -r.dot(&normal),
        normal,
        weight: [1.0 - s, s, t - 1.0, -t],
        aside,
    })
}

impl Gap {
    /// The gap of two parts that face each other nearer than `thickness` [m], counted towards `side`,
    /// with what is missing to that [m]; what does not overlap, nearly all, costs no division.
    #[inline(always)]
    pub fn too_small(kind: Kind, x: [Vec3; 4], side: f64, thickness: f64) -> Option<(Self, f64)> {
        let [p, a, b, c] = x;
        let (u, v, r) = match kind {
            Kind::VertexFace => (b - a, c - a, p - a),
            Kind::EdgeEdge => (a - p, c - b, p - b),
        };
        let n = u.cross(&v);
        let square = n.dot(&n);
        let height = side * r.dot(&n);
        let near = height < 0.0 || height * height < thickness * thickness * square;
        let has_area = square > 0.0;
        if !near || !has_area {
            return None;
        }
        let facing = match kind {
            Kind::VertexFace => {
                let [s, t] = [r.cross(&v).dot(&n), u.cross(&r).dot(&n)];
                s >= 0.0 && t >= 0.0 && s + t <= square
            }
            Kind::EdgeEdge => {
                let [s, t] = [v.cross(&r).dot(&n), u.cross(&r).dot(&n)];
                let inside = |s: f64| s >= 0.0 && s <= square;
                inside(s) && inside(t)
            }
        };
        if !facing {
            return None;
        }
        let gap = Self::new(kind, x)?;
        Some((gap, thickness - side * gap.height))
    }
}
