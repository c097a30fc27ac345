//! Pictures for pages that cannot draw.

use drape_cloth::math::Vec3;
use drape_report::{CLOTH_BIAS, Camera, ColorMap, Drawing, TOOL};
use serde::Deserialize;

use super::moment::Moment;
use super::shade::Shade;

/// Longest side of a picture [px].
const MOST: usize = 1024;

/// How a page looks at a scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// From the eye into the scene, and what is upright.
    pub direction: [f64; 3],
    pub up: [f64; 3],
    /// The box that fills the picture [m].
    pub low: [f64; 3],
    pub high: [f64; 3],
    /// [px]
    pub size: [usize; 2],
    /// Values of the first and of the last colour.
    pub range: [f64; 2],
}

/// A picture as PNG; none of what cannot be looked at.
pub fn picture(moment: &Moment, shade: Shade, look: &Look) -> Option<Vec<u8>> {
    let stage = moment.stage.as_ref()?;
    let [direction, up, low, high] = [look.direction, look.up, look.low, look.high].map(Vec3::from);
    let is_seen = direction.cross(&up).norm() > 1e-9 && (high - low).norm().is_normal();
    let size = look.size.map(|side| side.clamp(1, MOST));
    if !is_seen {
        return None;
    }
    let mut drawing = Drawing::new(&Camera::new(direction, up, low, high), size);
    drawing.mesh(&stage.tool, |_| TOOL, 0.0);
    let [from, to] = look.range;
    let share = |value: &f32| (f64::from(*value) - from) / (to - from);
    let values = shade.values(stage, &moment.position, &moment.advice);
    let colors: Vec<_> = values
        .iter()
        .map(|v| ColorMap::Distance.at(share(v)))
        .collect();
    let sheet = stage.scene.lamina.mesh(&moment.position);
    drawing.mesh(&sheet, |v| colors[v], CLOTH_BIAS);
    drawing.image().png().ok()
}
