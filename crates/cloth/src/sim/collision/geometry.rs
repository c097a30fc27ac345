//! Gaps between parts of the cloth, f64.

/// A point or direction [m].
pub type Point = [f64; 3];

pub fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] - b[k])
}

pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Which parts of the cloth meet; with four vertices either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A vertex, then the corners of a triangle.
    VertexFace,
    /// The ends of an edge, then those of another.
    EdgeEdge,
}

/// Below this sine of the angle between two edges their gap has no direction: 2 degrees.
const LEAST_SINE: f64 = 0.035;
/// A triangle whose doubled area is less than this share of its longest edges' product has no
/// normal.
const LEAST_SPREAD: f64 = 1e-3;

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
    /// Way along `normal` from the second part to the first [m]; its sign tells the side.
    pub height: f64,
    /// Unit length. That of the triangle, or the vector product of the edges.
    pub normal: Point,
    /// Share of each vertex in the two nearest points: the first part's add up to 1, the
    /// second's to -1, so height = normal . sum(weight x).
    pub weight: [f64; 4],
    /// How far sideways the parts are from facing each other [m]; they do where <= 0.
    pub aside: f64,
}

impl Gap {
    /// Measures the gap; none where the parts have no common normal: a triangle without area,
    /// edges that are parallel, coordinates that are no numbers.
    pub fn new(kind: Kind, x: [Point; 4]) -> Option<Self> {
        match kind {
            Kind::VertexFace => vertex_face(x),
            Kind::EdgeEdge => edge_edge(x),
        }
    }
}

fn vertex_face([p, a, b, c]: [Point; 4]) -> Option<Gap> {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let n = cross(ab, ac);
    let square = dot(n, n);
    let [ab2, ac2] = [dot(ab, ab), dot(ac, ac)];
    let bc = sub(c, b);
    let bc2 = dot(bc, bc);
    let longest = ab2.max(ac2).max(bc2);
    // Also false for NaN.
    let spread = square > (LEAST_SPREAD * longest).powi(2);
    if !spread || !square.is_finite() {
        return None;
    }
    let wb = dot(cross(ap, ac), n) / square;
    let wc = dot(cross(ab, ap), n) / square;
    let wa = 1.0 - wb - wc;
    let length = square.sqrt();
    // Twice the area over the opposite edge is the altitude of a corner.
    let aside = -(wa / bc2.sqrt()).min(wb / ac2.sqrt()).min(wc / ab2.sqrt()) * length;
    let normal = n.map(|n| n / length);
    Some(Gap {
        height: dot(ap, normal),
        normal,
        weight: [1.0, -wa, -wb, -wc],
        aside,
    })
}

fn edge_edge([a, b, c, d]: [Point; 4]) -> Option<Gap> {
    let (u, v, r) = (sub(b, a), sub(d, c), sub(c, a));
    let n = cross(u, v);
    let square = dot(n, n);
    let [u2, v2] = [dot(u, u), dot(v, v)];
    let crossing = square > LEAST_SINE.powi(2) * u2 * v2;
    if !crossing || !square.is_finite() {
        return None;
    }
    let s = dot(cross(r, v), n) / square;
    let t = dot(cross(r, u), n) / square;
    let length = square.sqrt();
    let beyond = |s: f64| (-s).max(s - 1.0);
    let sine = length / (u2 * v2).sqrt();
    let aside = sine * (beyond(s) * u2.sqrt()).max(beyond(t) * v2.sqrt());
    let normal = n.map(|n| n / length);
    Some(Gap {
        height: -dot(r, normal),
        normal,
        weight: [1.0 - s, s, t - 1.0, -t],
        aside,
    })
}

/// An overlap that is to be projected away.
pub struct Overlap {
    /// What is missing to the thickness [m], > 0.
    pub depth: f64,
    /// See [`Gap`].
    pub normal: Point,
    pub weight: [f64; 4],
}

impl Overlap {
    /// The overlap of two parts that face each other nearer than `thickness` [m], counted
    /// towards `side`. The same as by [`Gap::new`], but what does not overlap, nearly all, is
    /// found without a division.
    #[inline(always)]
    pub fn new(kind: Kind, x: [Point; 4], side: f64, thickness: f64) -> Option<Self> {
        let [p, a, b, c] = x;
        let (u, v, r) = match kind {
            Kind::VertexFace => (sub(b, a), sub(c, a), sub(p, a)),
            Kind::EdgeEdge => (sub(a, p), sub(c, b), sub(p, b)),
        };
        let n = cross(u, v);
        let square = dot(n, n);
        let height = side * dot(r, n);
        let near = height < 0.0 || height * height < thickness * thickness * square;
        let has_area = square > 0.0;
        if !near || !has_area {
            return None;
        }
        let facing = match kind {
            Kind::VertexFace => {
                let [s, t] = [dot(cross(r, v), n), dot(cross(u, r), n)];
                s >= 0.0 && t >= 0.0 && s + t <= square
            }
            Kind::EdgeEdge => {
                let [s, t] = [dot(cross(v, r), n), dot(cross(u, r), n)];
                let inside = |s: f64| s >= 0.0 && s <= square;
                inside(s) && inside(t)
            }
        };
        if !facing {
            return None;
        }
        let gap = Gap::new(kind, x)?;
        Some(Self {
            depth: thickness - side * gap.height,
            normal: gap.normal,
            weight: gap.weight,
        })
    }
}
