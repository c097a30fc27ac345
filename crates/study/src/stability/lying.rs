//! Trials that come to lie on a tool: flat on a plate, or on a slope.

use std::sync::{Arc, LazyLock};

use super::trial::{Knobs, Trial, Tried, damped, size};
use crate::cloth::{
    AREAL_MASS, GRAVITY, Piece, laid, on_slope, rubbing, sheet, slid, tool, tool_config,
};
use crate::truth;
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::mesh::{TriMesh, write_stl};
use drape_cloth::sim::{Bending, Snapshot};
use drape_cloth::tool::{MeshSource, Plate, Pose, Shape, Source, Tool};

/// The sheet that most of these trials drop [m].
const SIDE: f64 = 0.08;

/// A block 200 mm thick under z = 0, 600 mm wide.
static PLATE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let plate = Plate {
        plate_mm: [600.0, 600.0],
        base_mm: 200.0,
    };
    Arc::new(tool(Shape::Plate(plate), Pose::default(), 20.0))
});

/// A sheet at `height` over the plate [m], each vertex off by a random hundredth of a cell, with
/// all that a scene computes and the damping of episodes.
fn over(side: f64, vertices: usize, height: f64) -> Piece {
    let lamina = sheet([side; 2], [vertices; 2], Material::interglas_92125());
    let mut stream = Stream::new(2, Purpose::Evaluation, 0);
    let cell = lamina.yarns[0].rest_length;
    let start = laid(&lamina, |[x, y]| {
        [x, y, height + 0.01 * cell * stream.normal()]
    });
    Piece::new(lamina, damped(50.0, Bending::Yarns), start).on(&PLATE)
}

/// The larger of two means over the size of the sheet: height off the plane z = 0, and error
/// of the distances between pairs of vertices, which no rigid motion changes.
fn flatness_error(lamina: &Lamina, state: &Snapshot) -> f64 {
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

/// y: pressure [N/mm^2], as weight on a sheet 1 mm over the plate.
pub fn pressure(knobs: &Knobs) -> Tried {
    let mut piece = over(SIDE, 9, 1e-3);
    piece.physics.gravity = 1e6 * knobs.y / AREAL_MASS;
    Trial::new(piece, 0.5, flatness_error)
}

/// y: vertices a side of a sheet of 370 mm, 0.5 mm over the plate.
pub fn sheet_grid(knobs: &Knobs) -> Tried {
    let piece = over(0.37, knobs.y as usize, 5e-4);
    Trial::new(piece, 0.1, flatness_error)
}

/// y: how deep in the plate the sheet starts [mm].
pub fn overlap(knobs: &Knobs) -> Tried {
    // Thrown out at the speed cap it rises 80 mm, and sinks at 0.2 m/s.
    let piece = over(SIDE, 9, -1e-3 * knobs.y);
    Trial::new(piece, 1.0, flatness_error)
}

/// y: speed towards the plate [m/s], from 5 mm above it and tilted by 10 degrees, with the usual
/// limit of speed or without.
pub fn hit(knobs: &Knobs, is_capped: bool) -> Tried {
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let mut piece = over(SIDE, 9, 5e-3 + 0.5 * SIDE * sin);
    for x in &mut piece.start.position {
        *x = [cos * x[0], x[1], x[2] + sin * x[0]];
    }
    piece.start.velocity.fill([0.0, 0.0, -knobs.y]);
    if !is_capped {
        piece.physics.speed_cap = 0.0;
    }
    Trial::new(piece, 0.5, flatness_error)
}

/// Ways that a facet of the tool can be bad.
pub const SLIVERS: [&str; 3] = ["needle", "cap", "folded"];

/// x: kind of the bad facets, y: how thin they are [m]. A sheet is dropped on a plate whose
/// upper side has such a facet in its middle, read from an STL file.
pub fn sliver(knobs: &Knobs) -> Tried {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("plate.stl");
    write_stl(&path, &slivered(knobs.x as usize, knobs.y), "plate")?;
    let source = Source::Mesh(MeshSource { path, scale: 1e-3 });
    let tool = Tool::new(&tool_config(source, Pose::default(), 20.0))?;
    let piece = over(SIDE, 9, 1e-3).on(&tool.into());
    Trial::new(piece, 0.5, flatness_error)
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
    let upper = corners.iter().chain(&inner);
    let upper = upper.map(|[x, y]| Vec3::new(*x, *y, 0.0));
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

/// y: coefficient of friction, static as dynamic. A sheet on a slope of so many `degrees`, held
/// against Coulomb's law: its mean displacement, over the larger of that one and the size of the
/// sheet.
pub fn slide(knobs: &Knobs, degrees: f64) -> Tried {
    const SECONDS: f64 = 0.3;
    let angle = degrees.to_radians();
    let sheet = sheet([SIDE; 2], [5; 2], rubbing([knobs.y; 2]));
    let mut piece = on_slope(sheet, damped(0.0, Bending::Off), angle);
    piece.physics.speed_cap = 0.0;
    let seconds = knobs.frame * knobs.frames(SECONDS) as f64;
    let expected = truth::slid(knobs.y, angle, GRAVITY, seconds);
    let start = piece.start.clone();
    Trial::new(piece, SECONDS, move |lamina, state| {
        (slid(&start, state, angle) - expected).abs() / expected.max(size(lamina))
    })
}
