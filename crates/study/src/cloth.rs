//! Pieces of cloth and tools of the studies whose answers are known.

use std::sync::{Arc, LazyLock};

use drape_cloth::fabric::{BlankConfig, Curve, Family, Lamina, MassModel, Material};
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Bending, PhysicsConfig, Snapshot};
use drape_cloth::tool::{GridConfig, Plate, Pose, Shape, Source, Tool, ToolConfig};

/// Gravity [m/s^2].
pub const GRAVITY: f64 = 9.81;

/// Areal mass of the fabric's data sheet, which all pieces have [kg/m^2].
pub const AREAL_MASS: f64 = 0.280;

/// Yarns and gravity only, without any damping.
pub fn yarns_alone() -> PhysicsConfig {
    PhysicsConfig {
        bending: Bending::Off,
        shear: false,
        friction: false,
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    }
}

/// A tool of `shape`, its distance sampled every `spacing_mm`.
///
/// # Panics
/// If the shape is none; those of the studies are.
pub fn tool(shape: Shape, pose: Pose, spacing_mm: f64) -> Tool {
    let config = ToolConfig {
        source: Source::Shape(shape),
        pose,
        grid: GridConfig {
            spacing_mm,
            ..GridConfig::default()
        },
    };
    Tool::new(&config).expect("the tools of the studies are valid")
}

/// A plate so far below that nothing touches it.
pub static NOWHERE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let pose = Pose {
        translation_mm: [0.0, 0.0, -50_000.0],
        ..Pose::default()
    };
    tool(Shape::Plate(Plate::default()), pose, 100.0).into()
});

/// A rectangle of `size` [m] along its yarns.
///
/// # Panics
/// If it cannot be cut; those of the studies can.
pub fn sheet(size: [f64; 2], vertices: [usize; 2], material: Material) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Lamina::new(&config, material).expect("the blanks of the studies are valid")
}

/// A strip of one cell's width along the yarns of `family`, `edges` long. The yarns that are
/// tested are its two borders, half a cell wide each.
pub fn strip(family: Family, length: f64, edges: usize) -> Lamina {
    let width = length / edges as f64;
    let material = Material::interglas_92125();
    match family {
        Family::Warp => sheet([length, width], [edges + 1, 2], material),
        Family::Weft => sheet([width, length], [2, edges + 1], material),
    }
}

/// A strip with both vertices of every cross-section of the same mass, so that nothing twists
/// it; else the corners at the ends of diagonals are heavier.
pub fn evened(mut strip: Lamina) -> Lamina {
    for k in 0..strip.rows.max(strip.columns) {
        let pair = section(&strip, k);
        let mean = 0.5 * (strip.mass[pair[0]] + strip.mass[pair[1]]);
        for v in pair {
            strip.mass[v] = mean;
        }
    }
    strip
}

/// A piece whose yarns resist compression as tension: closed forms of inextensible yarns mean
/// both.
pub fn rigid(mut lamina: Lamina) -> Lamina {
    for law in [&mut lamina.material.warp, &mut lamina.material.weft] {
        law.compression = law.tension.clone();
    }
    lamina
}

/// The built-in fabric with the same shear modulus [Pa] in both directions.
pub fn shearing(modulus: f64) -> Material {
    let mut material = Material::interglas_92125();
    material.shear.positive = Curve::line(modulus);
    material.shear.negative = Curve::line(modulus);
    material
}

/// The built-in fabric with one coefficient of friction at rest and one in motion.
pub fn rubbing([stick, slide]: [f64; 2]) -> Material {
    let mut material = Material::interglas_92125();
    for law in [&mut material.warp, &mut material.weft] {
        law.static_friction = stick;
        law.dynamic_friction = slide;
    }
    material
}

/// At rest, with each vertex where `at` puts its place on the flat blank.
pub fn laid(lamina: &Lamina, at: impl FnMut([f64; 2]) -> [f64; 3]) -> Snapshot {
    let position = lamina.rest.iter().copied().map(at).collect();
    Snapshot::at_rest(position)
}

/// At rest, with each vertex placed by its coordinates along a strip (from 0) and across it.
pub fn placed(lamina: &Lamina, at: impl Fn(f64, f64) -> [f64; 3]) -> Snapshot {
    let long = usize::from(lamina.rows > lamina.columns);
    let start = lamina.rest[0][long];
    laid(lamina, |r| at(r[long] - start, r[1 - long]))
}

/// The vertices at the end of a strip's `k`-th cross-section.
pub fn section(lamina: &Lamina, k: usize) -> [usize; 2] {
    if lamina.rows > lamina.columns {
        [2 * k, 2 * k + 1]
    } else {
        [k, k + lamina.columns]
    }
}

/// Where a strip's `k`-th cross-section is [m].
pub fn mean_at(lamina: &Lamina, state: &Snapshot, k: usize) -> Vec3 {
    let [a, b] = section(lamina, k).map(|v| Vec3::from(state.position[v]));
    (a + b) * 0.5
}

/// Fixes whole cross-sections of a strip.
pub fn fix(lamina: &Lamina, state: &mut Snapshot, sections: &[usize]) {
    for &k in sections {
        state.fixed.extend(section(lamina, k));
    }
}
