//! Length: pulled, hanging and sagging strips.

use super::solve::{Answer, Ask, Fast, Solve};
use crate::cloth::{
    AREAL_MASS, GRAVITY, Piece, evened, fix, hung, laid, mean_at, placed, rigid, section, shearing,
    sheet, strip, yarns_alone,
};
use drape_cloth::fabric::{Curve, Family, Lamina, Material};
use drape_cloth::sim::{PhysicsConfig, Solver, Tension};

/// Points of the tension curves: family, strain, force per width [N/m].
pub const UNIAXIAL: [(Family, f64, f64); 4] = [
    (Family::Warp, 0.005, 1050.0),
    (Family::Warp, 0.02, 14_000.0),
    (Family::Weft, 0.006, 1750.0),
    (Family::Weft, 0.025, 21_000.0),
];

/// Points of the tension curves, the hanging chain, soft sheets, and the catenary.
pub(super) fn asks() -> Vec<Ask> {
    let mut asks: Vec<Ask> = Vec::new();
    for (family, strain, force) in UNIAXIAL {
        asks.push(Box::new(move |solver| {
            let case = format!("tension: {family:?} at strain {strain}").to_lowercase();
            let found = force_at(solver, family, strain, force);
            vec![Answer::new(case, "N/m", [force, found])]
        }));
    }
    let elastic = elastic_stretch(Family::Warp);
    asks.push(Box::new(move |solver| {
        let numbers = [elastic, hanging(solver, Family::Warp)];
        vec![Answer::new("hanging chain: elastic stretch", "-", numbers)]
    }));
    asks.push(Box::new(move |solver| {
        let fast = solver.fast();
        let fast = fast.filter(|fast| fast.solver == Solver::GaussSeidel);
        let answer = |fast: &Fast| {
            let expected = one_pass_stretch(fast.substep) + elastic;
            let numbers = [expected, hanging(fast, Family::Warp)];
            Answer::new("hanging chain: stretch of one pass", "-", numbers)
        };
        fast.map(answer).into_iter().collect()
    }));
    for (name, warp) in [("unidirectional", 600e6), ("biaxial", SOFT)] {
        asks.push(Box::new(move |solver| {
            let [shortest, longest] = soft_columns(solver, warp);
            let answer = |what, found| {
                let case = format!("soft wefts, {name}: {what} column's stretch");
                Answer::new(case, "-", [soft_stretch(), found])
            };
            vec![answer("shortest", shortest), answer("longest", longest)]
        }));
    }
    asks.push(Box::new(|solver| {
        let numbers = [SAG, catenary_sag(solver, 64)];
        vec![Answer::new("catenary: sag", "m", numbers)]
    }));
    asks
}

/// Mean strain of `strip`, of so many edges and `length` [m], that hangs by its upper end.
fn hanging_strain(
    solver: &dyn Solve,
    strip: Lamina,
    edges: usize,
    length: f64,
    physics: PhysicsConfig,
    speed: f64,
) -> f64 {
    let start = hung(&strip, 0.0);
    let piece = Piece::new(strip, physics, start);
    let end = solver.settle(&piece, [speed, 3.0]);
    -mean_at(&piece.lamina, &end, edges).z / length - 1.0
}

/// Mean strain of a strip that hangs with `force` per width [N/m] at its lower end.
fn strain_under(solver: &dyn Solve, family: Family, force: f64) -> f64 {
    let (edges, length) = (10, 0.1);
    let mut strip = evened(strip(family, length, edges));
    let width = length / edges as f64;
    for v in section(&strip, edges) {
        strip.mass[v] = 0.5 * force * width / GRAVITY;
    }
    let mut physics = yarns_alone(200.0);
    physics.tension = Some(Tension::Material);
    hanging_strain(solver, strip, edges, length, physics, 1e-8)
}

/// Force per width [N/m] that strains a strip by `strain`: the weight that does, searched by
/// secants from `first`.
pub fn force_at(solver: &dyn Solve, family: Family, strain: f64, first: f64) -> f64 {
    let (mut from, mut to) = (0.0, first);
    let (mut at_from, mut at_to) = (0.0, strain_under(solver, family, to));
    for _ in 0..8 {
        let slope = (at_to - at_from) / (to - from);
        if (at_to - strain).abs() < 1e-6 * strain || !slope.is_finite() || slope <= 0.0 {
            break;
        }
        (from, at_from) = (to, at_to);
        to = (to + (strain - at_to) / slope).max(1e-6 * first);
        at_to = strain_under(solver, family, to);
    }
    to
}

/// The hanging chain: 64 edges of 5.78 mm.
const CHAIN: (usize, f64) = (64, 0.37);

/// Mean strain of a strip that hangs by its upper end.
pub fn hanging(solver: &dyn Solve, family: Family) -> f64 {
    let strip = strip(family, CHAIN.1, CHAIN.0);
    hanging_strain(solver, strip, CHAIN.0, CHAIN.1, yarns_alone(20.0), 1e-9)
}

/// What its weight strains it by, the law's first slope: rho g L / (2 E t).
pub fn elastic_stretch(family: Family) -> f64 {
    let material = Material::interglas_92125();
    let modulus = material.yarn(family).tension.modulus();
    AREAL_MASS * GRAVITY * CHAIN.1 / (2.0 * modulus * material.thickness())
}

/// What one pass of Gauss-Seidel a substep of `h` [s] leaves, whatever the material:
/// g h^2 N / (2 a).
pub fn one_pass_stretch(h: f64) -> f64 {
    let (edges, length) = CHAIN;
    GRAVITY * h * h * (edges * edges) as f64 / (2.0 * length)
}

/// Modulus of soft wefts, twice that of the sheet's shear [Pa].
const SOFT: f64 = 0.1e6;
/// Width and length of a sheet of soft wefts [m], and its vertices.
const SOFT_SHEET: ([f64; 2], [usize; 2]) = ([0.04, 0.3], [5, 31]);

/// What its weight strains it by: rho g L / (2 E t).
pub fn soft_stretch() -> f64 {
    let thickness = Material::interglas_92125().thickness();
    AREAL_MASS * GRAVITY * SOFT_SHEET.0[1] / (2.0 * SOFT * thickness)
}

/// Least and greatest mean strain of the wefts of a sheet that hangs along them by its first row, its
/// warps of modulus `warp` [Pa]: that it resists shear changes nothing.
pub fn soft_columns(solver: &dyn Solve, warp: f64) -> [f64; 2] {
    let mut material = shearing(0.5 * SOFT);
    material.warp.tension = Curve::line(warp);
    material.weft.tension = Curve::line(SOFT);
    let (size, [columns, rows]) = SOFT_SHEET;
    let mut sheet = sheet(size, [columns, rows], material);
    // Corners at the ends of diagonals are heavier, which draws out the columns that they hang on.
    let mirrored = |v: usize| v + columns - 1 - 2 * (v % columns);
    let even = |v: usize| 0.5 * (sheet.mass[v] + sheet.mass[mirrored(v)]);
    sheet.mass = (0..columns * rows).map(even).collect();
    let mut start = laid(&sheet, |[x, y]| [x, 0.0, -y]);
    start.fixed.extend(0..columns);
    let physics = PhysicsConfig {
        shear: true,
        ..yarns_alone(20.0)
    };
    let piece = Piece::new(sheet, physics, start);
    let end = solver.settle(&piece, [1e-7, 4.0]);
    let fall = |v: usize| piece.start.position[v % columns][2] - end.position[v][2];
    let strains = (columns * (rows - 1)..columns * rows).map(|v| fall(v) / size[1] - 1.0);
    strains.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| {
        [least.min(x), most.max(x)]
    })
}

/// Length and span of the catenary [m].
pub const CATENARY: [f64; 2] = [0.37, 0.30];

/// Its sag [m].
pub const SAG: f64 = 0.095_689;

/// That as found with a strip of `edges` edges.
pub fn catenary_sag(solver: &dyn Solve, edges: usize) -> f64 {
    let [length, span] = CATENARY;
    let strip = rigid(strip(Family::Warp, length, edges));
    let slope = (length * length - span * span).sqrt() / length;
    let mut start = placed(&strip, |s, t| {
        [s * span / length, t, -slope * s.min(length - s)]
    });
    fix(&strip, &mut start, &[0, edges]);
    let piece = Piece::new(strip, yarns_alone(10.0), start);
    let end = solver.settle(&piece, [1e-7, 4.0]);
    -mean_at(&piece.lamina, &end, edges / 2).z
}
