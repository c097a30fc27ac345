use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use crate::file::ValueError;
use crate::math::{Purpose, Stream, Vec3};
use crate::mesh::{MOST_FACETS, TriMesh};

use super::patch::{Patch, mound};

/// A tool given by a formula.
///
/// All are closed bodies that face outwards. The working surface is centred on the z axis;
/// the plate round it lies at z = 0, and the body reaches `base_mm` further down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Shape {
    Rib(Rib),
    Hemisphere(Hemisphere),
    DoubleDome(DoubleDome),
    Plate(Plate),
    Cylinder(Cylinder),
    Incline(Incline),
    Trough(Trough),
    Saddle(Saddle),
    Hills(Hills),
}

impl Shape {
    /// What `kind` may be.
    pub const KINDS: [&str; 9] = [
        "rib",
        "hemisphere",
        "double-dome",
        "plate",
        "cylinder",
        "incline",
        "trough",
        "saddle",
        "hills",
    ];
}

/// A rib with a curved crest that crosses a plate along x:
/// z = H (1 − k (x/X)²) (1 − (y/B)²)³ for |y| < B, and 0 beside it, where X is half the
/// plate's size along x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rib {
    /// H, height in the middle of the crest.
    pub height_mm: f64,
    /// B.
    pub half_width_mm: f64,
    /// k, the share of the height that the crest loses towards its ends. 0 ≤ k < 1.
    pub crest_drop: f64,
    /// Size of the plate along x and y.
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Vertices of the upper face along x and y.
    pub vertex_counts: [usize; 2],
}

/// A hemisphere on a plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hemisphere {
    pub radius_mm: f64,
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Segments round the dome, a multiple of 4.
    pub segment_count: usize,
    /// Rings of facets from rim to pole.
    pub ring_count: usize,
}

/// Two hemispheres on a plate, joined by a waist: a simplified form of the double dome on
/// which woven fabrics are compared.
///
/// The upper half of a body of revolution about x: hemispheres of radius R centred at
/// x = ±c, and between them the radius (R + w)/2 − (R − w)/2 · cos(πx/c), which meets both
/// with a common tangent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DoubleDome {
    /// R.
    pub radius_mm: f64,
    /// w, radius half-way between the domes. R/2 ≤ w ≤ R.
    pub waist_radius_mm: f64,
    /// 2c.
    pub centre_distance_mm: f64,
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Segments round the outline, a multiple of 4.
    pub segment_count: usize,
    /// Rings of facets from rim to middle.
    pub ring_count: usize,
}

/// A flat plate, its upper side at z = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plate {
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
}

/// The upper half of a cylinder along x, on a base of the same footprint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cylinder {
    pub radius_mm: f64,
    pub length_mm: f64,
    pub base_mm: f64,
    /// Segments of the half circle.
    pub segment_count: usize,
}

/// A plane turned about y: it passes through the origin and falls towards +x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Incline {
    /// 0 ≤ angle ≤ 80.
    pub angle_deg: f64,
    /// Footprint along x and y.
    pub plate_mm: [f64; 2],
    /// Thickness at the lower end.
    pub base_mm: f64,
}

/// A groove across a plate along x: z = −D (1 − (y/B)²)³ for |y| < B, and 0 beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Trough {
    /// D.
    pub depth_mm: f64,
    /// B.
    pub half_width_mm: f64,
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Vertices of the upper face along x and y.
    pub vertex_counts: [usize; 2],
}

/// A hyperbolic paraboloid, z = H ((x/X)² − (y/Y)²), where X and Y are half the plate's sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Saddle {
    /// H, by which two sides rise and the others fall.
    pub height_mm: f64,
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Vertices of the upper face along x and y.
    pub vertex_counts: [usize; 2],
}

/// A smooth random height field: z = Σ h exp(−|p − c|² / 2 r²), with heights h drawn between −H/3 and H, radii r between
/// R and 2 R, and centres c on the inner half of the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hills {
    /// Of the draw.
    pub seed: u32,
    /// Hills, hollows among them.
    pub hill_count: usize,
    /// H.
    pub height_mm: f64,
    /// R.
    pub radius_mm: f64,
    pub plate_mm: [f64; 2],
    pub base_mm: f64,
    /// Vertices of the upper face along x and y.
    pub vertex_counts: [usize; 2],
}

impl Default for Rib {
    /// 4575 vertices and 9146 triangles.
    fn default() -> Self {
        Self {
            height_mm: 60.0,
            half_width_mm: 100.0,
            crest_drop: 0.5,
            plate_mm: [480.0, 440.0],
            base_mm: 20.0,
            vertex_counts: [77, 56],
        }
    }
}

impl Default for Hemisphere {
    fn default() -> Self {
        Self {
            radius_mm: 75.0,
            plate_mm: [400.0, 400.0],
            base_mm: 20.0,
            segment_count: 128,
            ring_count: 32,
        }
    }
}

impl Default for DoubleDome {
    fn default() -> Self {
        Self {
            radius_mm: 60.0,
            waist_radius_mm: 45.0,
            centre_distance_mm: 140.0,
            plate_mm: [480.0, 320.0],
            base_mm: 20.0,
            segment_count: 192,
            ring_count: 32,
        }
    }
}

impl Default for Plate {
    fn default() -> Self {
        Self {
            plate_mm: [480.0, 440.0],
            base_mm: 20.0,
        }
    }
}

impl Default for Cylinder {
    fn default() -> Self {
        Self {
            radius_mm: 100.0,
            length_mm: 400.0,
            base_mm: 20.0,
            segment_count: 96,
        }
    }
}

impl Default for Incline {
    fn default() -> Self {
        Self {
            angle_deg: 20.0,
            plate_mm: [400.0, 400.0],
            base_mm: 20.0,
        }
    }
}

impl Default for Trough {
    fn default() -> Self {
        Self {
            depth_mm: 40.0,
            half_width_mm: 100.0,
            plate_mm: [400.0, 400.0],
            base_mm: 20.0,
            vertex_counts: [65, 65],
        }
    }
}

impl Default for Saddle {
    fn default() -> Self {
        Self {
            height_mm: 40.0,
            plate_mm: [400.0, 400.0],
            base_mm: 20.0,
            vertex_counts: [65, 65],
        }
    }
}

impl Default for Hills {
    fn default() -> Self {
        Self {
            seed: 1,
            hill_count: 4,
            height_mm: 60.0,
            radius_mm: 40.0,
            plate_mm: [400.0, 400.0],
            base_mm: 20.0,
            vertex_counts: [81, 81],
        }
    }
}

impl Default for Shape {
    fn default() -> Self {
        Self::Rib(Rib::default())
    }
}

impl Shape {
    /// Builds the mesh [m].
    ///
    /// # Errors
    /// Names the first key whose value makes no body.
    pub fn mesh(&self) -> Result<TriMesh, ValueError> {
        match self {
            Self::Rib(shape) => shape.mesh(),
            Self::Hemisphere(shape) => shape.mesh(),
            Self::DoubleDome(shape) => shape.mesh(),
            Self::Plate(shape) => shape.mesh(),
            Self::Cylinder(shape) => shape.mesh(),
            Self::Incline(shape) => shape.mesh(),
            Self::Trough(shape) => shape.mesh(),
            Self::Saddle(shape) => shape.mesh(),
            Self::Hills(shape) => shape.mesh(),
        }
    }
}

impl Rib {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let [half_x, half_y] = plate(self.plate_mm, self.base_mm)?;
        let height = height("height_mm", self.height_mm)?;
        let half_width = length("half_width_mm", self.half_width_mm)?;
        within("half_width_mm", self.half_width_mm, 0.0, half_y * 1e3)?;
        let drop = self.crest_drop;
        let expected = "at least 0 and below 1";
        ValueError::unless((0.0..1.0).contains(&drop), "crest_drop", drop, expected)?;
        let half = [half_x, half_y];
        let patch = heights(half, self.vertex_counts, |u, v| {
            height * (1.0 - drop * u * u) * flank(v * half_y / half_width)
        });
        Ok(patch?.into_body(-self.base_mm * 1e-3))
    }
}

impl Trough {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let half = plate(self.plate_mm, self.base_mm)?;
        let depth = height("depth_mm", self.depth_mm)?;
        let half_width = length("half_width_mm", self.half_width_mm)?;
        within("half_width_mm", self.half_width_mm, 0.0, half[1] * 1e3)?;
        let patch = heights(half, self.vertex_counts, |_, v| {
            -depth * flank(v * half[1] / half_width)
        });
        Ok(patch?.into_body(-depth - self.base_mm * 1e-3))
    }
}

impl Saddle {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let half = plate(self.plate_mm, self.base_mm)?;
        let height = height("height_mm", self.height_mm)?;
        let patch = heights(half, self.vertex_counts, |u, v| height * (u * u - v * v));
        Ok(patch?.into_body(-height - self.base_mm * 1e-3))
    }
}

impl Hills {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let half = plate(self.plate_mm, self.base_mm)?;
        let height = height("height_mm", self.height_mm)?;
        let radius = length("radius_mm", self.radius_mm)?;
        count("hill_count", self.hill_count, 1)?;
        let mut stream = Stream::new(self.seed.into(), Purpose::Scenes, 0);
        let mut drawn = |least: f64, most: f64| least + (most - least) * stream.uniform();
        let hills: Vec<[f64; 4]> = (0..self.hill_count)
            .map(|_| {
                let centre = half.map(|half| 0.5 * half * drawn(-1.0, 1.0));
                let [rise, radius] = [drawn(-height / 3.0, height), drawn(radius, 2.0 * radius)];
                [centre[0], centre[1], rise, radius]
            })
            .collect();
        let patch = heights(half, self.vertex_counts, |u, v| {
            let [x, y] = [u * half[0], v * half[1]];
            let hill = |[cx, cy, rise, radius]: &[f64; 4]| {
                rise * (-0.5 * ((x - cx).powi(2) + (y - cy).powi(2)) / radius.powi(2)).exp()
            };
            hills.iter().map(hill).sum()
        })?;
        let bottom = patch.lowest().min(0.0) - self.base_mm * 1e-3;
        Ok(patch.into_body(bottom))
    }
}

impl Hemisphere {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let half_size = plate(self.plate_mm, self.base_mm)?;
        let radius = height("radius_mm", self.radius_mm)?;
        let room = half_size[0].min(half_size[1]) * 1e3;
        within("radius_mm", self.radius_mm, 0.0, room)?;
        let half_width = |x: f64| (radius.powi(2) - x.powi(2)).max(0.0).sqrt();
        let counts = [self.segment_count, self.ring_count];
        Ok(dome(half_size, counts, half_width)?.into_body(-self.base_mm * 1e-3))
    }
}

impl DoubleDome {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let half_size = plate(self.plate_mm, self.base_mm)?;
        let radius = height("radius_mm", self.radius_mm)?;
        let centre = 0.5 * length("centre_distance_mm", self.centre_distance_mm)?;
        let waist = length("waist_radius_mm", self.waist_radius_mm)?;
        let room = (half_size[0] - centre).min(half_size[1]) * 1e3;
        within("radius_mm", self.radius_mm, 0.0, room)?;
        // With a thinner waist the outline would no longer be star-shaped.
        let [min, max] = [0.5 * self.radius_mm, self.radius_mm];
        within("waist_radius_mm", self.waist_radius_mm, min, max)?;
        let half_width = |x: f64| {
            let beyond = x.abs() - centre;
            if beyond < 0.0 {
                0.5 * (radius + waist) - 0.5 * (radius - waist) * (PI * x / centre).cos()
            } else {
                (radius.powi(2) - beyond.powi(2)).max(0.0).sqrt()
            }
        };
        let counts = [self.segment_count, self.ring_count];
        Ok(dome(half_size, counts, half_width)?.into_body(-self.base_mm * 1e-3))
    }
}

impl Plate {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let [x, y] = plate(self.plate_mm, self.base_mm)?;
        let patch = Patch::grid(2, 2, |u, v| Vec3::new(u * x, v * y, 0.0));
        Ok(patch.into_body(-self.base_mm * 1e-3))
    }
}

impl Cylinder {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let radius = height("radius_mm", self.radius_mm)?;
        let half_length = 0.5 * length("length_mm", self.length_mm)?;
        let base = length("base_mm", self.base_mm)?;
        count("segment_count", self.segment_count, 3)?;
        let patch = Patch::grid(2, self.segment_count + 1, |u, v| {
            let angle = v * FRAC_PI_2;
            // The ends of the half circle lie at height 0 exactly, as does the base.
            let height = if v.abs() == 1.0 { 0.0 } else { angle.cos() };
            Vec3::new(u * half_length, radius * angle.sin(), radius * height)
        });
        Ok(patch.into_body(-base))
    }
}

impl Incline {
    fn mesh(&self) -> Result<TriMesh, ValueError> {
        let [x, y] = plate(self.plate_mm, self.base_mm)?;
        within("angle_deg", self.angle_deg, 0.0, 80.0)?;
        let slope = self.angle_deg.to_radians().tan();
        let patch = Patch::grid(2, 2, |u, v| Vec3::new(u * x, v * y, -u * x * slope));
        Ok(patch.into_body(-x * slope - self.base_mm * 1e-3))
    }
}

/// Half the plate's size [m]; checks the plate's size and the base.
fn plate([x, y]: [f64; 2], base_mm: f64) -> Result<[f64; 2], ValueError> {
    length("base_mm", base_mm)?;
    Ok([0.5 * length("plate_mm", x)?, 0.5 * length("plate_mm", y)?])
}

/// Checks a length [mm] and converts it to [m]. Aircraft wings fit, metres mistaken for
/// micrometres do not.
fn length(key: &str, mm: f64) -> Result<f64, ValueError> {
    positive(key, mm, 1e5)
}

/// Checks a height [mm] and converts it to [m]: no blank hangs higher.
fn height(key: &str, mm: f64) -> Result<f64, ValueError> {
    positive(key, mm, 1e4)
}

fn positive(key: &str, mm: f64, max: f64) -> Result<f64, ValueError> {
    let expected = format!("above 0 and at most {max}");
    ValueError::unless(mm > 0.0 && mm <= max, key, mm, expected)?;
    Ok(mm * 1e-3)
}

fn within(key: &str, found: f64, min: f64, max: f64) -> Result<(), ValueError> {
    let expected = format!("between {min} and {max}");
    ValueError::unless((min..=max).contains(&found), key, found, expected)
}

/// Refuses more vertices of the upper face, each with two facets, than a mesh may have.
fn product(key: &str, counts: [usize; 2]) -> Result<(), ValueError> {
    let [found, most] = [counts[0] * counts[1], MOST_FACETS / 2];
    let shown = format!("{} x {} = {found} vertices", counts[0], counts[1]);
    ValueError::unless(found <= most, key, shown, format!("at most {most}"))
}

fn count(key: &str, found: usize, min: usize) -> Result<(), ValueError> {
    let expected = format!("between {min} and 4096");
    ValueError::unless((min..=4096).contains(&found), key, found, expected)
}

/// The upper face of a plate of which half the size is given, at the height `z` [m] for shares (u, v) ∈ [−1, 1]² of that.
fn heights(
    [half_x, half_y]: [f64; 2],
    vertex_counts: [usize; 2],
    z: impl Fn(f64, f64) -> f64,
) -> Result<Patch, ValueError> {
    for found in vertex_counts {
        count("vertex_counts", found, 2)?;
    }
    product("vertex_counts", vertex_counts)?;
    let [columns, rows] = vertex_counts;
    Ok(Patch::grid(columns, rows, |u, v| {
        Vec3::new(u * half_x, v * half_y, z(u, v))
    }))
}

/// What a flank keeps of the height at a share of its half-width.
fn flank(share: f64) -> f64 {
    (1.0 - share.powi(2)).max(0.0).powi(3)
}

/// A [`mound`] of so many segments and rings.
fn dome(
    half_size: [f64; 2],
    [segments, rings]: [usize; 2],
    half_width: impl Fn(f64) -> f64,
) -> Result<Patch, ValueError> {
    count("segment_count", segments, 8)?;
    let (is_valid, expected) = (segments.is_multiple_of(4), "a multiple of 4");
    ValueError::unless(is_valid, "segment_count", segments, expected)?;
    count("ring_count", rings, 2)?;
    product("segment_count", [segments, rings])?;
    Ok(mound(half_size, segments / 4, rings, half_width))
}

#[cfg(test)]
pub(super) mod tests;
