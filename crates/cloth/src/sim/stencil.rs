//! Where the stencil presses, and what stays on the tool after it.

use super::parameters::Aim;
use super::press::Roller;
use super::stepping::Control;
use crate::fabric::Lamina;
use crate::math::Vec3;
use crate::tool::Tool;

/// How far on the flat blank to look for vertices under the stencil, in stencil sides: under
/// a wrinkle more cloth lies below the stencil than its own size.
const REACH: f64 = 1.5;

/// How a press goes. A vertex that it leaves on the tool is draped, and fixed there: one that was
/// under the stencil, is nearer to the tool than `threshold`, and is pulled off it by no yarn of
/// its own or of its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Stencil {
    /// Side of the square [m].
    pub side: f64,
    /// [m]
    pub threshold: f64,
    /// A yarn stretched by more than this [-] pulls a vertex off the tool.
    pub max_strain: f64,
    /// What presses under it.
    pub roller: Roller,
    /// The press; the roller is gone at its end.
    pub press: Control,
    /// Time to settle after it.
    pub settle: Option<Control>,
}

impl Stencil {
    /// Half of its side as vertices are held against it [m]: a hair more, so that a vertex exactly
    /// on the edge counts whatever rounding.
    pub(super) fn half(side: f64) -> f64 {
        0.5 * side * (1.0 + 1e-6)
    }

    /// How far on the flat blank to look for vertices under it, if it is `off` from its vertex [m].
    pub(super) fn reach(side: f64, off: f64) -> f64 {
        REACH * side + if off > Self::half(side) { off } else { 0.0 }
    }
}

/// What a stretched yarn pulls at: a sum of places [m], and its size where the strain is too great.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tie {
    /// Vertices and their weights in the sum.
    pub terms: [(u32, f64); 3],
    /// [m], or [-] where the weights are slopes of a membrane [1/m].
    pub most: f64,
}

/// The yarn edges and the families of membranes at each vertex, with what they are where they are
/// stretched by `max_strain`.
pub(super) fn ties(lamina: &Lamina, max_strain: f64) -> Vec<Vec<Tie>> {
    let mut ties = vec![Vec::new(); lamina.vertex_count()];
    let mut tie = |terms: [(u32, f64); 3], ends: &[u32], length: f64| {
        let most = length * (1.0 + max_strain);
        ends.iter()
            .for_each(|&v| ties[v as usize].push(Tie { terms, most }));
    };
    for (yarn, ends @ [from, to]) in lamina.yarn_edges() {
        let terms = [(from, 1.0), (to, -1.0), (to, 0.0)];
        tie(terms, &ends, yarn.rest_length);
    }
    for membrane in lamina.membranes.iter().filter(|m| !m.has_yarns) {
        for family in [0, 1] {
            let term = |k: usize| (membrane.vertices[k], membrane.gradient[k][family]);
            tie([0, 1, 2].map(term), &membrane.vertices, 1.0);
        }
    }
    ties
}

/// Where the sides of a stencil with this normal run.
fn sides(normal: &Vec3) -> [Vec3; 2] {
    let x_axis = Vec3::x() - normal * normal.x;
    let along = if x_axis.norm() > 0.1 {
        x_axis
    } else {
        Vec3::y() - normal * normal.y
    };
    let along = along.normalize();
    [along, normal.cross(&along)]
}

/// The vertices under the stencil, ascending.
///
/// The stencil is a square of side `side` [m] around `vertex`, its normal that of the tool
/// there, one side along the projection of the x axis; unless its `aim` is another. All cloth of the
/// neighbourhood in the column above and below the square counts; `vertex` always does, unless the aim is so far off that
/// it lies beside the square.
pub fn under_stencil(
    lamina: &Lamina,
    tool: &Tool,
    vertex: u32,
    side: f64,
    aim: Aim,
    position: impl Fn(u32) -> [f64; 3],
) -> Vec<u32> {
    if aim.misses() {
        return Vec::new();
    }
    let mut centre = Vec3::from(position(vertex));
    let mut normal = Vec3::from(tool.distance(centre.into()).1);
    let [mut along, mut across] = sides(&normal);
    if aim != Aim::default() {
        centre += along * aim.offset[0] + across * aim.offset[1];
        let [about_along, about_across] = aim.tilt.map(f64::tan);
        normal = (normal - across * about_along + along * about_across).normalize();
        [along, across] = sides(&normal);
    }
    let half = Stencil::half(side);
    let mut vertices = Vec::new();
    let [off, up] = aim.offset.map(f64::abs);
    let is_aimed_at = off <= half && up <= half;
    for v in lamina.within(vertex, Stencil::reach(side, off.hypot(up))) {
        let offset = Vec3::from(position(v)) - centre;
        let below = offset.dot(&along).abs() <= half && offset.dot(&across).abs() <= half;
        if below || (v == vertex && is_aimed_at) {
            vertices.push(v);
        }
    }
    vertices
}
