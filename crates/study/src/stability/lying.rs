//! Trials that come to lie on a tool: flat on a plate, or on a slope.

use std::sync::{Arc, LazyLock};

use super::trial::{
    Clock, FRAME, Judge, Refusal, SUBSTEPS, Setting, Trial, flatness_error, physics, size,
};
use crate::cloth::{AREAL_MASS, GRAVITY, laid, rubbing, tool};
use crate::truth;
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::mesh::{TriMesh, write_stl};
use drape_cloth::sim::{Bending, PhysicsConfig, Snapshot};
use drape_cloth::tool::{
    GridConfig, Incline, Plate, Pose, Shape, Source, StlSource, Tool, ToolConfig,
};

/// Damping of episodes [1/s].
const DAMPING: f64 = 50.0;
/// The sheet that most of these trials drop [m], and its vertices a side.
const SIDE: f64 = 0.08;
const VERTICES: usize = 9;

/// A block 200 mm thick under z = 0, 600 mm wide.
static PLATE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let plate = Plate {
        plate_mm: [600.0, 600.0],
        base_mm: 200.0,
    };
    Arc::new(tool(Shape::Plate(plate), Pose::default(), 20.0))
});

fn sheet() -> Lamina {
    crate::cloth::sheet([SIDE; 2], [VERTICES; 2], Material::interglas_92125())
}

/// At `height` over the plate [m], each vertex off by a random hundredth of a cell.
fn over(sheet: &Lamina, height: f64) -> Snapshot {
    let mut stream = Stream::new(2, Purpose::Evaluation, 0);
    let cell = sheet.yarns[0].rest_length;
    laid(sheet, |[x, y]| {
        [x, y, height + 0.01 * cell * stream.normal()]
    })
}

fn flat() -> Judge {
    Box::new(flatness_error)
}

/// All that a scene computes.
fn whole(setting: &Setting) -> PhysicsConfig {
    PhysicsConfig {
        bending: Bending::Yarns,
        ..physics(setting, DAMPING)
    }
}

/// x: substeps, y: pressure [N/mm^2], as weight on a sheet 1 mm over the plate.
pub(super) fn pressure(setting: &Setting) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let start = over(&sheet, 1e-3);
    let physics = PhysicsConfig {
        gravity: 1e6 * setting.y / AREAL_MASS,
        ..whole(setting)
    };
    let clock = Clock::new(0.5, FRAME, setting.x);
    Trial::new(sheet, &physics, Some(PLATE.clone()), start, clock, flat())
}

/// x: substeps, y: vertices a side of a sheet of 370 mm, 0.5 mm over the plate.
pub(super) fn sheet_grid(setting: &Setting) -> Result<Trial, Refusal> {
    let vertices = [setting.y as usize; 2];
    let sheet = crate::cloth::sheet([0.37; 2], vertices, Material::interglas_92125());
    let start = over(&sheet, 5e-4);
    let clock = Clock::new(0.1, FRAME, setting.x);
    let physics = whole(setting);
    Trial::new(sheet, &physics, Some(PLATE.clone()), start, clock, flat())
}

/// x: substeps, y: how deep in the plate the sheet starts [mm].
pub(super) fn overlap(setting: &Setting) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let start = over(&sheet, -1e-3 * setting.y);
    // Thrown out at the speed cap it rises 80 mm, and sinks at 0.2 m/s.
    let clock = Clock::new(1.0, FRAME, setting.x);
    let physics = whole(setting);
    Trial::new(sheet, &physics, Some(PLATE.clone()), start, clock, flat())
}

/// x: substeps, y: speed towards the plate [m/s], from 5 mm above it and tilted
/// by 10 degrees.
pub(super) fn impact(setting: &Setting) -> Result<Trial, Refusal> {
    let cap = PhysicsConfig::default().speed_cap;
    hit(setting, cap)
}

/// The same without a limit of speed.
pub(super) fn uncapped_impact(setting: &Setting) -> Result<Trial, Refusal> {
    hit(setting, 0.0)
}

fn hit(setting: &Setting, speed_cap: f64) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let mut start = over(&sheet, 5e-3 + 0.5 * SIDE * sin);
    for x in &mut start.position {
        *x = [cos * x[0], x[1], x[2] + sin * x[0]];
    }
    start.velocity.fill([0.0, 0.0, -setting.y]);
    let physics = PhysicsConfig {
        speed_cap,
        ..whole(setting)
    };
    let clock = Clock::new(0.5, FRAME, setting.x);
    Trial::new(sheet, &physics, Some(PLATE.clone()), start, clock, flat())
}

/// Ways that a facet of the tool can be bad.
pub(super) const SLIVERS: [&str; 3] = ["needle", "cap", "folded"];

/// x: kind of the bad facets, y: how thin they are [m]. A sheet is dropped on a plate whose
/// upper side has such a facet in its middle, read from an STL file.
pub(super) fn sliver(setting: &Setting) -> Result<Trial, Refusal> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("plate.stl");
    write_stl(&path, &slivered(setting.x as usize, setting.y), "plate")?;
    let source = Source::Stl(StlSource { path, scale: 1e-3 });
    let tool = Tool::new(&ToolConfig {
        source,
        pose: Pose::default(),
        grid: GridConfig {
            spacing_mm: 20.0,
            ..GridConfig::default()
        },
    })?;
    let sheet = sheet();
    let start = over(&sheet, 1e-3);
    let clock = Clock::new(0.5, FRAME, SUBSTEPS);
    Trial::new(
        sheet,
        &whole(setting),
        Some(Arc::new(tool)),
        start,
        clock,
        flat(),
    )
}

/// A block of 600 x 600 x 200 mm under z = 0 with the triangle P Q R in its upper side, `thin`
/// [m] across: a needle with two long sides, a cap with one and two of half the length, or a
/// cap that lies the wrong way round over its neighbour.
fn slivered(kind: usize, thin: f64) -> TriMesh {
    let (half, reach) = (0.3, 0.2);
    let tip = match SLIVERS[kind] {
        "needle" => [reach, thin],
        "cap" => [0.013, thin],
        _ => [0.013, -thin],
    };
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let inner = [[-reach, 0.0], [reach, 0.0], tip];
    let upper = corners
        .iter()
        .chain(&inner)
        .map(|[x, y]| Vec3::new(*x, *y, 0.0));
    let lower = corners.iter().map(|[x, y]| Vec3::new(*x, *y, -0.2));
    // Corners a b c d = 0 1 2 3, then P Q R = 4 5 6, then the corners below = 7 8 9 10.
    let mut triangles = vec![
        [4, 5, 6],
        [0, 1, 5],
        [0, 5, 4],
        [1, 2, 5],
        [5, 2, 6],
        [2, 3, 6],
        [6, 3, 4],
        [3, 0, 4],
        [7, 9, 8],
        [7, 10, 9],
    ];
    for side in 0..4 {
        let next = (side + 1) % 4;
        triangles.push([side, 7 + side, 7 + next]);
        triangles.push([side, 7 + next, next]);
    }
    TriMesh {
        vertices: upper.chain(lower).collect(),
        triangles,
    }
}

/// x: angle of the slope [degrees], y: coefficient of friction, static as dynamic.
pub(super) fn friction(setting: &Setting) -> Result<Trial, Refusal> {
    slide(setting, setting.y, setting.x, SUBSTEPS)
}

/// x: substeps, y: coefficient of friction, on a slope of 25 degrees.
pub(super) fn friction_step(setting: &Setting) -> Result<Trial, Refusal> {
    slide(setting, setting.y, 25.0, setting.x)
}

/// A sheet on a slope, held against Coulomb's law: its mean displacement, over the larger of that
/// one and the size of the sheet.
fn slide(setting: &Setting, mu: f64, degrees: f64, substeps: f64) -> Result<Trial, Refusal> {
    let angle = degrees.to_radians();
    let sheet = crate::cloth::sheet([SIDE; 2], [5; 2], rubbing([mu; 2]));
    let down = [angle.cos(), 0.0, -angle.sin()];
    // Up the slope, so that it slides about the origin as on a tool.
    let start = laid(&sheet, |[x, y]| {
        let s = x - 0.2;
        [down[0] * s, y, down[2] * s]
    });
    let clock = Clock::new(0.3, FRAME, substeps);
    let expected = truth::slid(mu, angle, GRAVITY, clock.seconds());
    let along = move |x: &[f64; 3]| x[0] * down[0] + x[2] * down[2];
    let mean = move |state: &Snapshot| {
        let sum: f64 = state.position.iter().map(along).sum();
        sum / state.position.len() as f64
    };
    let before = mean(&start);
    let judge: Judge = Box::new(move |lamina, state| {
        (mean(state) - before - expected).abs() / expected.max(size(lamina))
    });
    let physics = PhysicsConfig {
        speed_cap: 0.0,
        ..physics(setting, 0.0)
    };
    let incline = Incline {
        angle_deg: degrees,
        plate_mm: [4000.0, 400.0],
        ..Incline::default()
    };
    let incline = tool(Shape::Incline(incline), Pose::default(), 100.0);
    Trial::new(
        sheet,
        &physics,
        Some(Arc::new(incline)),
        start,
        clock,
        judge,
    )
}
