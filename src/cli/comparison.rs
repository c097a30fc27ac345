//! A scene with and without self-collision.

use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use super::Failure;
use super::picture::{Studio, View};
use super::setup::set_up;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::{Scene, Summary};
use drape_cloth::sim::SelfCollision;
use drape_report::{CLOTH, Camera, Drawing, Image, TOOL};

/// Width and height of each of the four pictures [px].
const SIZE: [usize; 2] = [760, 480];
/// Width of a line in a section [px].
const LINE: f64 = 2.0;

/// The scene without self-collision.
#[derive(Debug, Serialize)]
pub(super) struct Compared {
    #[serde(flatten)]
    pub summary: Summary,
    /// Wall time of setting it up [s].
    pub seconds: f64,
}

/// Sets `scene` up once more without self-collision and writes self-collision.png: on the left
/// as it was, on the right without; above from the side, below cut through the middle of the
/// blank, with the same eye.
pub(super) fn compare(
    scene: &Scene,
    summary: &Summary,
    place: &str,
    json: bool,
    folder: &Path,
) -> Result<Compared, Failure> {
    let mut config = scene.config.clone();
    config.physics.self_collision = SelfCollision::Off;
    let start = Instant::now();
    let other = set_up(&config, place, json)?;
    let without = Compared {
        summary: other.summary(&other.initial),
        seconds: start.elapsed().as_secs_f64(),
    };

    let mut points = section_points(&scene.lamina.mesh(&scene.initial.position));
    points.extend(section_points(&other.lamina.mesh(&other.initial.position)));
    let inf = Vec3::repeat(f64::INFINITY);
    let bounds = (points.iter()).fold((inf, -inf), |(low, high), x| (low.inf(x), high.sup(x)));
    let columns = [
        ("as configured", scene, summary),
        ("without self-collision", &other, &without.summary),
    ]
    .map(|(title, shown, summary)| {
        let count = summary.self_intersections;
        let caption = format!("{title}: {count} self-intersections");
        let above = Studio::new(scene, View::Isometric, SIZE).distance(&shown.initial, &caption);
        let below = section(shown, bounds);
        stacked(&[above, below])
    });
    Image::beside(&columns).save_png(&folder.join("self-collision.png"))?;
    Ok(without)
}

/// The lamina and its tool cut by the plane x = 0 or y = 0 of the blank, whichever runs along
/// its longer side.
fn section(scene: &Scene, bounds: (Vec3, Vec3)) -> Image {
    let lamina = scene.lamina.mesh(&scene.initial.position);
    let normal = across(&lamina);
    let centre = middle(&lamina);
    let mut picture = Drawing::new(&Camera::new(normal, Vec3::z(), bounds), SIZE);
    for (mesh, color) in [(&lamina, CLOTH), (&scene.tool.mesh, TOOL)] {
        for points in cut(mesh, normal, centre) {
            picture.line(&points, LINE, color);
        }
    }
    picture.image()
}

fn section_points(lamina: &TriMesh) -> Vec<Vec3> {
    let (normal, centre) = (across(lamina), middle(lamina));
    cut(lamina, normal, centre).flatten().collect()
}

/// The horizontal axis along which the mesh is shorter.
fn across(mesh: &TriMesh) -> Vec3 {
    let (low, high) = mesh.bounds();
    let size = high - low;
    if size.x < size.y {
        -Vec3::x()
    } else {
        Vec3::y()
    }
}

fn middle(mesh: &TriMesh) -> Vec3 {
    let (low, high) = mesh.bounds();
    (low + high) / 2.0
}

/// Where the plane through `centre` with this normal cuts the triangles of a mesh.
fn cut(mesh: &TriMesh, normal: Vec3, centre: Vec3) -> impl Iterator<Item = [Vec3; 2]> + '_ {
    (0..mesh.triangles.len()).filter_map(move |t| {
        let corners = mesh.corners(t);
        let height = corners.map(|x| (x - centre).dot(&normal));
        let mut ends = (0..3).filter_map(|k| {
            let (i, j) = (k, (k + 1) % 3);
            let crosses = (height[i] < 0.0) != (height[j] < 0.0);
            let share = height[i] / (height[i] - height[j]);
            crosses.then(|| corners[i] + (corners[j] - corners[i]) * share)
        });
        Some([ends.next()?, ends.next()?])
    })
}

/// The images one below the other; all as wide as the first.
fn stacked(images: &[Image]) -> Image {
    let mut all = images[0].clone();
    for image in &images[1..] {
        all.pixels.extend_from_slice(&image.pixels);
        all.height += image.height;
    }
    all
}
