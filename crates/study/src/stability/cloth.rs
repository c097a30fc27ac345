//! The pieces of cloth and the tools of the trials.

use std::sync::{Arc, LazyLock};

use fixedbitset::FixedBitSet;

use super::trial::{Refusal, Setting};
use drape_cloth::fabric::{BlankConfig, Curve, Lamina, MassModel, Material};
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Bending, PhysicsConfig, Snapshot};
use drape_cloth::tool::{GridConfig, Incline, Plate, Pose, Shape, Source, Tool, ToolConfig};

pub(super) const GRAVITY: f64 = 9.81;
/// Of the data sheet [kg/m^2].
pub(super) const AREAL_MASS: f64 = 0.280;
/// Frame where no other is asked for [s], and its substeps.
pub(super) const FRAME: f64 = 1.0 / 60.0;
pub(super) const SUBSTEPS: f64 = 20.0;

/// A blank of `size` [m] of `material`.
pub(super) fn blank(
    size: [f64; 2],
    vertices: [usize; 2],
    material: Material,
) -> Result<Lamina, Refusal> {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Ok(Lamina::new(&config, material)?)
}

/// A strip along y with `edges` edges and two vertices across, rows 0 to `edges` at distance
/// s from its end. The two of a row weigh the same, so that the strip does not twist under
/// its weight; else the corners at the ends of diagonals are heavier.
pub(super) fn strip(
    width: f64,
    length: f64,
    edges: usize,
    material: Material,
) -> Result<Lamina, Refusal> {
    let mut lamina = blank([width, length], [2, edges + 1], material)?;
    for row in lamina.mass.chunks_exact_mut(2) {
        let mean = 0.5 * (row[0] + row[1]);
        row.fill(mean);
    }
    Ok(lamina)
}

/// The built-in fabric with the yarn moduli times `factor` (warp, weft), in tension and in
/// compression.
pub(super) fn scaled(factor: [f64; 2]) -> Material {
    let mut material = Material::interglas_92125();
    for (law, factor) in [&mut material.warp, &mut material.weft]
        .into_iter()
        .zip(factor)
    {
        law.tension = law.tension.scaled(factor);
        law.compression = law.compression.scaled(factor);
    }
    material
}

/// The built-in fabric with yarns of one modulus [Pa], tension as compression.
pub(super) fn of_modulus(modulus: f64) -> Material {
    let mut material = Material::interglas_92125();
    for law in [&mut material.warp, &mut material.weft] {
        law.tension = Curve::line(modulus);
        law.compression = Curve::line(modulus);
    }
    material
}

/// The default physics with one damping [1/s], without bending.
pub(super) fn physics(setting: &Setting, damping: f64) -> PhysicsConfig {
    PhysicsConfig {
        solver: setting.solver,
        bending: Bending::Off,
        damping,
        ..PhysicsConfig::default()
    }
}

/// At rest, with each vertex where `at` puts its place (x, y) on the flat blank.
pub(super) fn placed(lamina: &Lamina, mut at: impl FnMut([f64; 2]) -> [f64; 3]) -> Snapshot {
    let position: Vec<_> = lamina.rest.iter().map(|&rest| at(rest)).collect();
    Snapshot {
        velocity: vec![[0.0; 3]; position.len()],
        fixed: FixedBitSet::with_capacity(position.len()),
        force_density: Vec::new(),
        sides: Vec::new(),
        position,
    }
}

/// Longest side of the flat blank [m].
pub(super) fn size(lamina: &Lamina) -> f64 {
    let [x, y] = lamina.rest[0];
    2.0 * x.abs().max(y.abs())
}

/// Mean distance of the vertices from `expected` over the size of the sheet.
pub(super) fn mean_error(lamina: &Lamina, state: &Snapshot, expected: &[[f64; 3]]) -> f64 {
    let apart = |(a, b): (&[f64; 3], &[f64; 3])| (Vec3::from(*a) - Vec3::from(*b)).norm();
    let sum: f64 = state.position.iter().zip(expected).map(apart).sum();
    sum / expected.len() as f64 / size(lamina)
}

/// The larger of two means over the size of the sheet: height off the plane z = 0, and error
/// of the distances between pairs of vertices, which no rigid motion changes.
pub(super) fn flatness_error(lamina: &Lamina, state: &Snapshot) -> f64 {
    let count = lamina.vertex_count();
    let height: f64 = state.position.iter().map(|x| x[2].abs()).sum();
    // All pairs of a small sheet; of a large one, those among some vertices.
    let stride = count.div_ceil(200);
    let chosen: Vec<usize> = (0..count).step_by(stride).collect();
    let (mut sum, mut pairs) = (0.0, 0);
    for (i, &a) in chosen.iter().enumerate() {
        for &b in &chosen[..i] {
            let [p, q] = [a, b].map(|v| Vec3::from(state.position[v]));
            let [r, s] = [a, b].map(|v| lamina.rest[v]);
            let rest = (r[0] - s[0]).hypot(r[1] - s[1]);
            sum += ((p - q).norm() - rest).abs();
            pairs += 1;
        }
    }
    (height / count as f64).max(sum / f64::from(pairs)) / size(lamina)
}

/// A tool from its configuration.
pub(super) fn tool(source: Source, z: f64, spacing_mm: f64) -> Result<Arc<Tool>, Refusal> {
    let config = ToolConfig {
        source,
        pose: Pose {
            translation_mm: [0.0, 0.0, 1e3 * z],
            ..Pose::default()
        },
        grid: GridConfig {
            spacing_mm,
            ..GridConfig::default()
        },
    };
    Ok(Arc::new(Tool::new(&config)?))
}

/// A plate so far below that nothing touches it.
pub(super) static NOWHERE: LazyLock<Arc<Tool>> =
    LazyLock::new(|| built(Shape::Plate(Plate::default()), -50.0, 100.0));

/// A block 200 mm thick under z = 0, 600 mm wide.
pub(super) static PLATE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let plate = Plate {
        plate_mm: [600.0, 600.0],
        base_mm: 200.0,
    };
    built(Shape::Plate(plate), 0.0, 20.0)
});

fn built(shape: Shape, z: f64, spacing_mm: f64) -> Arc<Tool> {
    tool(Source::Shape(shape), z, spacing_mm).expect("the tools of the study are valid")
}

/// A slope of `degrees` that falls towards +x, 4 m long.
pub(super) fn incline(degrees: f64) -> Result<Arc<Tool>, Refusal> {
    let incline = Incline {
        angle_deg: degrees,
        plate_mm: [4000.0, 400.0],
        ..Incline::default()
    };
    tool(Source::Shape(Shape::Incline(incline)), 0.0, 100.0)
}
