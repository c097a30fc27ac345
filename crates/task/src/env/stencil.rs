use drape_cloth::fabric::Lamina;
use drape_cloth::math::Vec3;
use drape_cloth::tool::Tool;

/// How far on the flat blank to look for vertices under the stencil, in stencil sides: under
/// a wrinkle more cloth lies below the stencil than its own size.
const REACH: f64 = 1.5;

/// The vertices under the stencil, ascending, and the highest of them over the tool [m].
///
/// The stencil is a square of side `side` [m] around `vertex`, its normal that of the tool
/// there, one side along the projection of the x axis. All cloth of the neighbourhood in the
/// column above and below the square counts; `vertex` always does.
pub(super) fn under_stencil(
    lamina: &Lamina,
    tool: &Tool,
    vertex: u32,
    side: f64,
    position: impl Fn(u32) -> [f64; 3],
) -> (Vec<u32>, f64) {
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
    let mut height: f64 = 0.0;
    for v in lamina.within(vertex, REACH * side) {
        let x = position(v);
        let offset = Vec3::from(x) - centre;
        let below = offset.dot(&along).abs() <= half && offset.dot(&across).abs() <= half;
        if below || v == vertex {
            vertices.push(v);
            height = height.max(tool.distance(x).0);
        }
    }
    (vertices, height)
}
