//! What the deviation of two drapes looks like.

use std::collections::BTreeSet;

use super::{Surveyed, is_inside};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::{TriMesh, border};
use drape_cloth::tool::Tool;
use drape_report::{CLOTH_BIAS, Camera, Color, ColorMap, Drawing, Image, PATH, TOOL, creased};

/// Width and height of each view [px].
const SIZE: [usize; 2] = [760, 600];
/// Width of the region's outline [px].
const LINE: f64 = 2.4;
/// Free space round the drape, as a share of its longest side.
const MARGIN: f64 = 0.03;
/// Finest range of the colours [mm]: rounding of STL files shows below it.
const MIN_RANGE: f64 = 1e-3;

/// The smallest of 1, 2 and 5 times a power of ten which is no less than the 95th percentile of a distance [mm].
pub fn range(p95: f64) -> f64 {
    let least = p95.max(MIN_RANGE);
    let power = 10f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    // A hair below still counts: 2 shall not become 5 by rounding.
    let fits = steps.iter().find(|step| **step >= least * (1.0 - 1e-9));
    *fits.unwrap_or(&steps[3])
}

/// Drape `a` from the side and from above, coloured by its signed distance from `b` up to
/// `range` [mm], over the tool, with the outline of the `region` [m on the flat blank].
pub fn deviation(
    a: &Surveyed,
    b: &Surveyed,
    tool: Option<&Tool>,
    region: Option<[f64; 4]>,
    range: f64,
) -> Image {
    let feet = a.feet(b).into_iter();
    let deviations: Vec<f64> = feet.map(|foot| 1e3 * foot.deviation).collect();
    let outline = region.map_or(Vec::new(), |region| outline(a, region));
    let title = "signed distance of A from B [mm], positive on B's upper side";
    let tool = tool.map(|tool| &tool.mesh);
    signed(&a.mesh, &deviations, range, title, tool, &outline)
}

/// A surface from the side and from above over the tool, coloured by signed distances of its vertices up to `range` [mm],
/// as the tool where they are NaN; `title` says what they are. Lines of `outline` are drawn on it.
pub fn signed(
    mesh: &TriMesh,
    deviations: &[f64],
    range: f64,
    title: &str,
    tool: Option<&TriMesh>,
    outline: &[[Vec3; 2]],
) -> Image {
    let color = |d: &f64| match d.is_nan() {
        true => TOOL,
        false => ColorMap::Deviation.at(0.5 + 0.5 * d / range),
    };
    let colors: Vec<Color> = deviations.iter().map(color).collect();
    let tool = tool.map(creased);
    let (low, high) = mesh.bounds();
    let margin = Vec3::repeat(MARGIN * (high - low).max());
    let bounds = (low - margin, high + margin);

    let views = [Camera::isometric(bounds), Camera::top(bounds)].map(|camera| {
        let mut picture = Drawing::new(&camera, SIZE);
        if let Some(tool) = &tool {
            picture.mesh(tool, |_| TOOL, 0.0);
        }
        picture.mesh(mesh, |v| colors[v], CLOTH_BIAS);
        for points in outline {
            picture.line(points, LINE, PATH);
        }
        picture.image()
    });
    let mut ticks = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| format!("{}", share * range));
    if deviations.iter().any(|d| *d < -range) {
        ticks[0].insert_str(0, "≤ ");
    }
    if deviations.iter().any(|d| *d > range) {
        ticks[4].insert_str(0, "≥ ");
    }
    Image::beside(&views).with_color_bar(ColorMap::Deviation, title, &ticks)
}

/// Edges of the draped mesh between triangles inside and outside of the region.
fn outline(a: &Surveyed, region: [f64; 4]) -> Vec<[Vec3; 2]> {
    let Some(drape) = &a.drape else {
        return Vec::new();
    };
    let inside = |&t: &usize| is_inside(region, drape.rest_centre(t));
    let inside = (0..drape.triangles.len()).filter(inside);
    let part = TriMesh {
        vertices: a.mesh.vertices.clone(),
        triangles: inside.map(|t| a.mesh.triangles[t]).collect(),
    };
    let [all, part] = [&a.mesh, &part].map(|mesh| border(mesh).unwrap_or_default());
    let all: BTreeSet<[u32; 2]> = all.into_iter().collect();
    let within = part.iter().filter(|edge| !all.contains(*edge));
    within
        .map(|edge| edge.map(|v| a.mesh.vertices[v as usize]))
        .collect()
}
