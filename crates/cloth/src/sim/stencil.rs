//! Where the stencil presses, and what stays on the tool after it.

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

/// The next vertices on the yarns of each vertex, and the length between them [m] beyond which
/// the yarn is stretched by more than `max_strain`.
pub(super) fn ties(lamina: &Lamina, max_strain: f64) -> Vec<Vec<(u32, f64)>> {
    let mut ties = vec![Vec::new(); lamina.vertex_count()];
    for yarn in &lamina.yarns {
        let length = yarn.rest_length * (1.0 + max_strain);
        for pair in yarn.vertices.windows(2) {
            ties[pair[0] as usize].push((pair[1], length));
            ties[pair[1] as usize].push((pair[0], length));
        }
    }
    ties
}

/// The vertices under the stencil, ascending.
///
/// The stencil is a square of side `side` [m] around `vertex`, its normal that of the tool
/// there, one side along the projection of the x axis. All cloth of the neighbourhood in the
/// column above and below the square counts; `vertex` always does.
pub fn under_stencil(
    lamina: &Lamina,
    tool: &Tool,
    vertex: u32,
    side: f64,
    position: impl Fn(u32) -> [f64; 3],
) -> Vec<u32> {
    let centre = Vec3::from(position(vertex));
    let normal = Vec3::from(tool.distance(centre.into()).1);
    let x_axis = Vec3::x() - normal * normal.x;
    let along = if x_axis.norm() > 0.1 {
        x_axis
    } else {
        Vec3::y() - normal * normal.y
    };
    let along = along.normalize();
    let across = normal.cross(&along);
    // A hair more than half, so that a vertex exactly on the edge counts whatever rounding.
    let half = 0.5 * side * (1.0 + 1e-6);
    let mut vertices = Vec::new();
    for v in lamina.within(vertex, REACH * side) {
        let offset = Vec3::from(position(v)) - centre;
        let below = offset.dot(&along).abs() <= half && offset.dot(&across).abs() <= half;
        if below || v == vertex {
            vertices.push(v);
        }
    }
    vertices
}
