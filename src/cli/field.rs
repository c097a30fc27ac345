//! The fibre field of a run and the pattern of its blank, as `drape export` writes them.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use serde::Serialize;

use super::Failure;
use super::args::positive;
use super::failure::OrInvalid;
use super::picture::Studio;
use super::setup::{absurd, extent};
use super::terminal::Told;
use drape_cloth::fabric::Drape;
use drape_cloth::file::write_atomic;
use drape_cloth::math::Vec3;
use drape_cloth::measure::feet;
use drape_cloth::mesh::{TriMesh, read_mesh};
use drape_cloth::scene::Scene;
use drape_field::{Field, FieldSummary, FlatPattern};
use drape_report::Camera;
use drape_task::path::{DrapingPoint, Frame};

const PICTURE_SIZE: [usize; 2] = [720, 620];
/// Farthest that an element lies from the fabric, unless that is asked for [mm]: half of a thick laminate.
const WITHIN_MM: f64 = 5.0;

/// Writes a field with remarks.
pub(super) type Writer = fn(&Field, &[String]) -> Vec<u8>;

/// The mesh whose elements are asked for.
#[derive(Debug, Default, clap::Args)]
pub struct OntoArgs {
    /// Map the fibre field on to the facets of this STL or PLY file, which is in the frame of --frame
    #[arg(long, value_name = "FILE")]
    pub onto: Option<PathBuf>,

    /// Metres per unit of that file; 0.001 if not given
    #[arg(long, value_name = "METRES", value_parser = positive, requires = "onto")]
    scale: Option<f64>,

    /// How far the middle of an element may lie from the fabric [mm]; 5 if not given
    #[arg(long, value_name = "MM", value_parser = positive, requires = "onto")]
    within: Option<f64>,
}

/// What is printed of a field.
#[derive(Serialize)]
pub(super) struct FieldReport {
    #[serde(flatten)]
    summary: FieldSummary,
    onto: Option<Told>,
    picture: Told,
}

impl FieldReport {
    /// In a line.
    pub fn text(&self) -> String {
        let FieldSummary {
            elements,
            unmapped,
            max_shear_deg,
            mean_shear_deg,
            mean_thickness_factor,
            over_80_deg,
        } = self.summary;
        format!(
            "{elements} elements, {unmapped} without fabric; shear {mean_shear_deg:.1} degrees on average, at most \
             {max_shear_deg:.1}, beyond 80 in {over_80_deg}; {mean_thickness_factor:.3} times as thick; picture in {}",
            self.picture.display()
        )
    }
}

impl OntoArgs {
    /// Reads the mesh, which only formats with elements may have. `formats` are the names of these, if this is another.
    pub fn read(&self, formats: Option<&str>) -> Result<Option<TriMesh>, Failure> {
        let Some(path) = &self.onto else {
            return Ok(None);
        };
        if let Some(formats) = formats {
            let error = anyhow!("`--onto` is for formats with elements, expected one of {formats}");
            return Err(Failure::invalid(error));
        }
        let read = read_mesh(path, self.scale.unwrap_or(1e-3)).or_invalid()?;
        let refused = |fault: String| Err(Failure::invalid(anyhow!("{}: {fault}", path.display())));
        let flat = read.dropped_facet_count;
        if flat > 0 {
            return refused(format!(
                "{flat} facets have no area, expected none, as elements are counted like facets"
            ));
        }
        match absurd(extent(read.mesh.vertices.iter().copied())) {
            Some(size) => refused(format!("the mesh measures {size}: check --scale")),
            None => Ok(Some(read.mesh)),
        }
    }

    /// Writes the field of a blank whose vertices are at `position` [m], in the tool's own frame, and a picture of its shear.
    pub fn write(
        &self,
        mesh: Option<TriMesh>,
        scene: &Scene,
        position: &[[f64; 3]],
        frame: &Frame,
        writer: Writer,
        file: &Path,
    ) -> Result<FieldReport, Failure> {
        let Scene { lamina, tool, .. } = scene;
        let place = |x: [f64; 3]| frame.point(&Vec3::from(x)).into();
        let placed: Vec<[f64; 3]> = tool.in_scene(position).into_iter().map(place).collect();
        let drape = Drape::new(lamina, &placed);
        let thickness = lamina.material.thickness();
        let mut field = Field::new(&drape, &feet(tool, position), lamina.cell(), thickness);
        if let (Some(mesh), Some(path)) = (mesh, &self.onto) {
            let within = 1e-3 * self.within.unwrap_or(WITHIN_MM);
            field = field.onto(mesh, within).or_invalid_in(path.display())?;
        }
        let bytes = writer(&field, &frame.remarks());
        write_atomic(file, |to| to.write_all(&bytes))?;
        let picture = picture(file);
        let studio = Studio::new(scene, Camera::isometric, PICTURE_SIZE);
        studio.shear(position).save_png(&picture)?;
        Ok(FieldReport {
            summary: field.summary(),
            onto: self.onto.as_ref().map(Told::from),
            picture: picture.into(),
        })
    }
}

/// Where the picture of a field's shear goes.
pub(super) fn picture(file: &Path) -> PathBuf {
    file.with_extension("shear.png")
}

/// Writes the pattern of the flat blank, with the strokes of a path.
pub(super) fn write_pattern(
    scene: &Scene,
    points: &[DrapingPoint],
    file: &Path,
) -> Result<(), Failure> {
    let drape = Drape::new(&scene.lamina, &scene.initial.position);
    let clamped: Vec<u32> = scene.initial.fixed.ones().map(|v| v as u32).collect();
    let strokes = points.chunk_by(|a, b| a.stroke == b.stroke);
    let strokes: Vec<Vec<u32>> = strokes
        .map(|stroke| stroke.iter().map(|point| point.vertex).collect())
        .collect();
    let pattern = FlatPattern {
        blank: &drape.flat(),
        warp: drape.warp,
        clamped: &clamped,
        strokes: &strokes,
    };
    let text = pattern.dxf().with_context(|| file.display().to_string())?;
    Ok(write_atomic(file, |to| to.write_all(text.as_bytes()))?)
}
