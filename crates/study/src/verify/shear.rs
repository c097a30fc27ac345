//! Shear in the plane: picture frame, a curve of several slopes, and bias extension.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

use super::solve::{Answer, Ask, Solve};
use crate::cloth::{Piece, elastic_energy, laid, rigid, shearing, sheet, yarns_alone};
use crate::study::Effort;
use drape_cloth::fabric::{BlankConfig, Curve, Lamina, MassModel, Material};
use drape_cloth::math::Vec3;
use drape_cloth::measure::shear;
use drape_cloth::sim::{Bending, BendingStiffness, PhysicsConfig, Snapshot};

/// Shear stiffness G h of the test pieces [N/m].
const SHEAR_STIFFNESS: f64 = 17.5;

/// Picture frame, hanging cells and bias extension; the specimen of the latter is coarser where it has to be quick.
pub(super) fn asks(effort: Effort) -> Vec<Ask> {
    let frame: Ask = Box::new(|solver| {
        let at = |d: f64| {
            let case = format!("picture frame: shear at {:.0} mm", 1e3 * d);
            let angles = [frame_angle(d), picture_frame(solver, d, 20)];
            Answer::new(case, "deg", angles.map(f64::to_degrees))
        };
        [0.02, 0.04, 0.06].map(at).into()
    });
    let curve: Ask = Box::new(|solver| {
        let at = |degrees: f64| {
            let found = hanging_cell(solver, degrees.to_radians()).to_degrees();
            let case = format!("curve of five points: shear at {degrees:.0} deg");
            Answer::new(case, "deg", [degrees, found])
        };
        [4.0, 20.0, 35.0, 50.0].map(at).into()
    });
    let cells = effort.pick(5, 10);
    // The diagonals of the mesh along the pull and across it.
    let bias = [(45.0, "across"), (-45.0, "along")].map(|(turn, diagonals)| -> Ask {
        Box::new(move |solver| {
            let drawn = draw_out(solver, specimen(cells, turn), &[0.01, 0.02, 0.03]);
            let answers = drawn.iter().flat_map(|&[d, shear, pull]| {
                let [gamma, force] = bias_extension(d);
                let d = 1e3 * d;
                let of =
                    |what| format!("bias extension, diagonals {diagonals}: {what} at {d:.0} mm");
                let angles = [gamma, shear].map(f64::to_degrees);
                [
                    Answer::new(of("shear"), "deg", angles),
                    Answer::new(of("force"), "N", [force, pull]),
                ]
            });
            answers.collect()
        })
    });
    [frame, curve].into_iter().chain(bias).collect()
}

/// The built-in fabric with that stiffness in both directions.
fn fabric() -> Material {
    shearing(SHEAR_STIFFNESS / Material::interglas_92125().thickness())
}

/// Weightless yarns that resist shear, with `damping` [1/s].
fn sheared(damping: f64) -> PhysicsConfig {
    let mut physics = yarns_alone(damping);
    (physics.shear, physics.gravity) = (true, 0.0);
    physics
}

/// Moves the fixed vertices evenly to `target` within `seconds`, then waits until all is still.
fn pull(solver: &dyn Solve, piece: &mut Piece, target: &Snapshot, seconds: f64) {
    let fixed = piece.start.fixed.clone();
    for v in fixed.ones() {
        let [x, to] = [&piece.start, target].map(|s| Vec3::from(s.position[v]));
        piece.start.velocity[v] = ((to - x) / seconds).into();
    }
    piece.start = solver.run(piece, seconds);
    for v in fixed.ones() {
        piece.start.position[v] = target.position[v];
        piece.start.velocity[v] = [0.0; 3];
    }
    piece.start = solver.settle(piece, [1e-6, 1.0]);
}

/// Angle by which the yarns at a vertex have left the right one [rad]: between the directions to
/// its neighbours along warp and weft, in the middle of both sides.
pub fn shear_at(lamina: &Lamina, state: &Snapshot, vertex: u32) -> Option<f64> {
    // Between the neighbours along an axis of the mesh, 1 that of the warps.
    let direction = |axis: usize| {
        let at = |step: isize| {
            let mut place = lamina.place(vertex);
            place[axis] = place[axis].checked_add_signed(step)?;
            let is_there = place[0] < lamina.rows && place[1] < lamina.columns;
            let v = is_there.then(|| lamina.vertex_at(place[0], place[1]))??;
            Some(Vec3::from(state.position[v as usize]))
        };
        Some((at(1)? - at(-1)?).normalize())
    };
    let (warp, weft) = (direction(1)?, direction(0)?);
    Some(FRAC_PI_2 - warp.dot(&weft).clamp(-1.0, 1.0).acos())
}

/// Mean absolute shear [rad] of the vertices whose places on the flat blank are `inside`.
fn mean_shear(lamina: &Lamina, state: &Snapshot, inside: impl Fn([f64; 2]) -> bool) -> f64 {
    let chosen = (0..lamina.vertex_count()).filter(|&v| inside(lamina.rest[v]));
    let angles = chosen.filter_map(|v| shear_at(lamina, state, v as u32));
    let angles: Vec<f64> = angles.map(f64::abs).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}

/// A measured kind of curve: soft, then stiffer and stiffer as yarns touch. rad and MPa.
const CURVE: [[f64; 2]; 5] = [
    [0.0, 0.0],
    [0.1, 0.005],
    [0.4, 0.03],
    [0.7, 0.3],
    [0.9, 2.0],
];

/// Shear [rad] of a square cell of inextensible yarns that hangs by a corner and whose weight shears
/// it to `angle` [rad]: the corner below and half of those beside it pull at the diagonal of length l
/// with dE/dl = t tau(angle) l / cos angle.
pub fn hanging_cell(solver: &dyn Solve, angle: f64) -> f64 {
    let (side, gravity) = (0.01, 200.0);
    let mut material = fabric();
    material.shear.positive = Curve::new(CURVE.to_vec());
    let mut cell = rigid(sheet([side; 2], [2; 2], material));
    let material = &cell.material;
    let length = side * (2.0 + 2.0 * angle.sin()).sqrt();
    let stress = material.shear.positive.stress(angle);
    let force = material.thickness() * stress * length / angle.cos();
    let scale = force / gravity / (cell.mass[3] + 0.5 * (cell.mass[1] + cell.mass[2]));
    cell.mass.iter_mut().for_each(|mass| *mass *= scale);
    let [first, last] = [0, 3].map(|v: usize| Vec3::new(cell.rest[v][0], cell.rest[v][1], 0.0));
    let down = (last - first).normalize();
    let mut start = laid(&cell, |[x, y]| {
        let r = Vec3::new(x, y, 0.0) - first;
        [r.x * -down.y + r.y * down.x, 0.0, -r.dot(&down)]
    });
    start.fixed.insert(0);
    let physics = PhysicsConfig {
        // Nothing bends in a cell, but only stiff yarns keep the compression of the lower sides.
        bending: Bending::Yarns,
        bending_stiffness: BendingStiffness::NewtonMetre(1.0),
        gravity,
        ..sheared(50.0)
    };
    let piece = Piece::new(cell, physics, start);
    let end = solver.settle(&piece, [1e-7, 2.0]);
    let found = shear(&piece.lamina, &end.position);
    0.5 * (found[0] + found[1])
}

/// Side of the picture frame [m].
const FRAME: f64 = 0.2;

/// Shear angle of a picture frame drawn out by `d` [m] along its diagonal [rad].
pub fn frame_angle(d: f64) -> f64 {
    FRAC_PI_2 - 2.0 * (0.5f64.sqrt() + d / (2.0 * FRAME)).acos()
}

/// Mean shear [rad] inside a picture frame of `cells` x `cells` that is drawn out to `d` [m].
pub fn picture_frame(solver: &dyn Solve, d: f64, cells: usize) -> f64 {
    let lamina = sheet([FRAME; 2], [cells + 1; 2], fabric());
    // Both families turn towards the first bias direction.
    let (sin, cos) = (0.5 * frame_angle(d)).sin_cos();
    let target = laid(&lamina, |[x, y]| {
        [cos * x + sin * y, sin * x + cos * y, 0.0]
    });
    let mut start = laid(&lamina, |[x, y]| [x, y, 0.0]);
    for v in 0..lamina.vertex_count() as u32 {
        if lamina.neighbors(v).count() < 8 {
            start.fixed.insert(v as usize);
        }
    }
    let mut piece = Piece::new(lamina, sheared(50.0), start);
    pull(solver, &mut piece, &target, 0.5);
    mean_shear(&piece.lamina, &piece.start, |_| true)
}

/// Length and width of the bias specimen between its clamps [m].
pub const SPECIMEN: [f64; 2] = [0.17, 0.05];

/// Shear angle [rad] and force [N] of the bias specimen drawn out by `d` [m], by the kinematics
/// of inextensible yarns: the middle shears by the angle, two zones by half of it and those at
/// the clamps not at all, and the force does the work of a linear law.
pub fn bias_extension(d: f64) -> [f64; 2] {
    let [length, width] = SPECIMEN;
    let free = length - width;
    let gamma = FRAC_PI_2 - 2.0 * ((free + d) / (SQRT_2 * free)).acos();
    let area = width * length - 1.25 * width * width;
    let lever = free * (FRAC_PI_4 - 0.5 * gamma).sin();
    [gamma, SQRT_2 * SHEAR_STIFFNESS * gamma * area / lever]
}

/// The specimen, its yarns at 45 degrees, cut through whole cells: its borders are diagonals of
/// cells, half the width is `cells` half diagonals. `turn` +45 or -45 puts the mesh's diagonals
/// along or across the pull.
pub fn specimen(cells: usize, turn: f64) -> Lamina {
    let half_diagonal = 0.5 * SPECIMEN[1] / cells as f64;
    let config = BlankConfig {
        size_mm: SPECIMEN.map(|s| 1e3 * s),
        cell_mm: Some(1e3 * half_diagonal * SQRT_2),
        mass: MassModel::Datasheet,
        yarn_angle_deg: turn,
        ..BlankConfig::default()
    };
    Lamina::new(&config, fabric()).expect("the specimen can be cut")
}

/// Draws `lamina` out by each of `extensions` [m] in turn, ascending. Gives each, the mean shear of
/// the middle zone [rad], and the pull at a clamp, or else the slope of the elastic energy [N]; NaN
/// where the specimen does not come to rest.
pub fn draw_out(solver: &dyn Solve, lamina: Lamina, extensions: &[f64]) -> Vec<[f64; 3]> {
    let half = 0.5 * SPECIMEN[0];
    let mut start = laid(&lamina, |[x, y]| [x, y, 0.0]);
    for (v, [x, _]) in lamina.rest.iter().enumerate() {
        start.fixed.set(v, x.abs() > half - 1e-9);
    }
    let left = |v: &u32| lamina.rest[*v as usize][0] < 1e-9 - half;
    let clamp: Vec<u32> = (0..lamina.vertex_count() as u32).filter(left).collect();
    let mut piece = Piece::new(lamina, sheared(400.0), start);
    let mut last = 0.0;
    let mut to = |piece: &mut Piece, d: f64| {
        let seconds = 0.02 * (1e3 * (d - last)).max(1.0);
        last = d;
        let target = laid(&piece.lamina, |[x, y]| [x + 0.5 * d * x.signum(), y, 0.0]);
        pull(solver, piece, &target, seconds);
        piece.start.clone()
    };
    let step = 0.5e-3;
    // The middle zone ends where yarns reach a clamp.
    let middle = 0.5 * (SPECIMEN[0] - SPECIMEN[1]) - 1e-6;
    let mut found = Vec::new();
    for &d in extensions {
        let before = to(&mut piece, d - step);
        let at = to(&mut piece, d);
        let pull = solver.pull(&piece, &clamp);
        let after = to(&mut piece, d + step);
        let lamina = &piece.lamina;
        let slope = || {
            let [low, high] = [&before, &after].map(|s| elastic_energy(lamina, s));
            (high - low) / (2.0 * step)
        };
        let rests = [&before, &at, &after].iter().all(|s| s.v_rms() < 1e-3);
        let if_at_rest = |x: f64| if rests { x } else { f64::NAN };
        let shear = mean_shear(lamina, &at, |[x, y]| x.abs() + y.abs() < middle);
        let force = pull.map_or_else(slope, |[x, ..]| x);
        found.push([d, if_at_rest(shear), if_at_rest(force)]);
    }
    found
}
