//! The finite-element twin against closed forms: numbers which nobody in this project chose.

mod balance;
mod contact;
mod press;
mod shapes;
mod stability;

use drape_cloth::fabric::{BlankConfig, Family, Lamina, MassModel, Material};
use drape_cloth::tool::{GridConfig, Pose, Shape, Source, Tool, ToolConfig};
use drape_cloth::twin::{Twin, TwinConfig};

const GRAVITY: f64 = 9.81;
const AREAL_MASS: f64 = 0.280;

fn tool(shape: Shape, spacing_mm: f64) -> Tool {
    Tool::new(&ToolConfig {
        source: Source::Shape(shape),
        pose: Pose::default(),
        grid: GridConfig {
            spacing_mm: Some(spacing_mm),
            ..GridConfig::default()
        },
    })
    .unwrap()
}

/// A blank of `size` [m] with the areal mass of the data sheet.
fn lamina(size: [f64; 2], vertices: [usize; 2]) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

/// A strip along the yarns of a family, one cell wide and `edges` long.
fn strip(family: Family, length: f64, edges: usize) -> Lamina {
    let width = length / edges as f64;
    match family {
        Family::Warp => lamina([length, width], [edges + 1, 2]),
        Family::Weft => lamina([width, length], [2, edges + 1]),
    }
}

/// Coordinate of each vertex along the strip, from 0.
fn along(strip: &Lamina) -> Vec<f64> {
    let axis = usize::from(strip.rows > strip.columns);
    let start = strip.rest[0][axis];
    strip.rest.iter().map(|r| r[axis] - start).collect()
}

/// Nothing but the material: no damping, no friction.
fn bare() -> TwinConfig {
    TwinConfig {
        damping: 0.0,
        viscosity: 0.0,
        friction: false,
        ..TwinConfig::default()
    }
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found / expected - 1.0).abs() <= tolerance,
        "{found} is not {expected} within {tolerance}"
    );
}
