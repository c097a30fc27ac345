use std::sync::Arc;

use super::*;
use crate::fabric::{BlankConfig, Material, Membrane};
use crate::math::Vec3;
use crate::measure::shear;
use crate::sim::{
    Backend, Bending, BendingStiffness, Control, Cpu, Model, Precision, Snapshot, Solver, World,
};
use crate::tool::{GridConfig, Plate, Pose, Shape, Source, Tool, ToolConfig};

/// Stiffening at once, as a bias extension gives it; softening, as friction between yarns does;
/// and both.
const CURVES: [&str; 3] = [
    "[[0.0, 0.0], [0.1, 0.005], [0.4, 0.03], [0.7, 0.3], [0.9, 2.0]]",
    "[[0.0, 0.0], [0.05, 0.02], [0.3, 0.03], [1.2, 0.05]]",
    "[[0.0, 0.0], [0.02, 0.004], [0.5, 0.02], [1.0, 1.0]]",
];

const FAR_BELOW: f64 = -50_000.0;

fn nowhere() -> Arc<Tool> {
    let config = ToolConfig {
        source: Source::Shape(Shape::Plate(Plate::default())),
        pose: Pose {
            translation_mm: [0.0, 0.0, FAR_BELOW],
            ..Pose::default()
        },
        grid: GridConfig {
            spacing_mm: Some(100.0),
            ..GridConfig::default()
        },
    };
    Tool::new(&config).unwrap().into()
}

/// A fabric of these laws of shear, whose yarns neither stretch nor shorten.
fn fabric(positive: &str, negative: &str) -> Material {
    let curve = |text: &str| -> Curve {
        let text = format!("points = {text}");
        let mut table: toml::Table = toml::from_str(&text).unwrap();
        table.remove("points").unwrap().try_into().unwrap()
    };
    let mut material = Material::interglas_92125();
    material.shear.positive = curve(positive);
    material.shear.negative = curve(negative);
    for yarn in [&mut material.warp, &mut material.weft] {
        yarn.tension = Curve::line(1e12);
        yarn.compression = Curve::line(1e12);
    }
    material.check().unwrap();
    material
}

fn cell(material: Material, vertices: [usize; 2], size_mm: [f64; 2]) -> Lamina {
    let config = BlankConfig {
        size_mm,
        vertices,
        ..BlankConfig::default()
    };
    Lamina::new(&config, material).unwrap()
}

/// Where cloth comes to rest.
fn rest(lamina: &Lamina, physics: &PhysicsConfig, start: &Snapshot, rate: f64) -> Snapshot {
    let world = World::new(Model::new(lamina, physics), nowhere());
    let mut cloth = Cpu::new(&world, 1, Precision::F64);
    cloth.load(0, start);
    let substeps = (rate / 10.0) as usize;
    for _ in 0..40 {
        cloth.step(&Control::new(0.1, substeps, substeps), &[]);
        if cloth.snapshot(0).v_rms() < 1e-9 {
            break;
        }
    }
    cloth.snapshot(0)
}

fn physics(solver: Solver, gravity: f64) -> PhysicsConfig {
    PhysicsConfig {
        solver,
        bending: Bending::Yarns,
        // Nothing bends in a cell, but only stiff yarns keep the compression of the lower sides.
        bending_stiffness: BendingStiffness::NewtonMetre(1.0),
        friction: false,
        speed_cap: 0.0,
        gravity,
        ..PhysicsConfig::default()
    }
}

/// A square cell that hangs by one corner: at rest the lower one and half of those beside it pull at
/// the vertical diagonal with dE/dl = t tau(gamma) l / cos gamma, whatever the substep. By its
/// diagonal, and by the angle of its halves.
#[test]
fn hanging_cell_has_the_shear_of_the_curve() {
    let side = 0.01;
    let mut wrong = Vec::new();
    for (k, text) in CURVES.iter().enumerate() {
        let other = CURVES[(k + 1) % 3];
        for (sign, angle) in [
            (1.0, 0.03),
            (1.0, 0.35),
            (1.0, 0.8),
            (-1.0, 0.2),
            (-1.0, 0.75),
        ] {
            let material = match sign > 0.0 {
                true => fabric(text, other),
                false => fabric(other, text),
            };
            let curve = match sign > 0.0 {
                true => &material.shear.positive,
                false => &material.shear.negative,
            };
            let length = side * (2.0 + 2.0 * f64::sin(angle)).sqrt();
            let force = material.thickness() * curve.stress(angle) * length / f64::cos(angle);
            let whole = cell(material, [2, 2], [1e3 * side; 2]);
            let mut halves = whole.clone();
            halves.diagonals.clear();
            halves.membranes = (halves.triangles.iter())
                .map(|&half| {
                    let corners = half.map(|v| halves.rest[v as usize]);
                    Membrane::of_yarns(half, corners, halves.warp)
                })
                .collect();
            for mut cell in [whole, halves] {
                // The mesh's own diagonal where it gets longer, the other one else.
                let [top, bottom] = if sign > 0.0 { [0, 3] } else { [1, 2] };
                let beside: f64 =
                    cell.mass.iter().sum::<f64>() - cell.mass[top] - cell.mass[bottom];
                let gravity = 20.0;
                let scale = force / gravity / (cell.mass[bottom] + 0.5 * beside);
                cell.mass.iter_mut().for_each(|mass| *mass *= scale);
                let place = |v: usize| Vec3::new(cell.rest[v][0], cell.rest[v][1], 0.0);
                let (from, down) = (place(top), (place(bottom) - place(top)).normalize());
                let across = Vec3::new(-down.y, down.x, 0.0);
                // Nearly there: let go at rest, a cell under a flat curve would swing through itself.
                let sine = f64::sin(0.9 * angle);
                let [narrow, long] = [1.0 - sine, 1.0 + sine].map(f64::sqrt);
                let at = |r: &[f64; 2]| {
                    let r = Vec3::new(r[0], r[1], 0.0) - from;
                    [narrow * r.dot(&across), 0.0, -long * r.dot(&down)]
                };
                let mut start = Snapshot::at_rest(cell.rest.iter().map(at).collect());
                start.fixed.insert(top);
                // Halves are solved one after the other, which errs with the square of the substep.
                let (rates, tolerances) = match cell.membranes.is_empty() {
                    true => ([600.0, 1200.0], [2e-6; 2]),
                    false => ([6000.0, 24_000.0], [1e-3, 1e-4]),
                };
                for (solver, rate, tolerance) in [
                    (Solver::Yarn, rates[0], tolerances[0]),
                    (Solver::Yarn, rates[1], tolerances[1]),
                    (Solver::GaussSeidel, 12_000.0, 2e-3),
                ] {
                    let end = rest(&cell, &physics(solver, gravity), &start, rate);
                    let found = shear(&cell, &end.position);
                    let found = 0.5 * (found[0] + found[1]);
                    let off = found - sign * angle;
                    if off.abs() >= tolerance {
                        wrong.push(format!(
                            "{text}, {solver:?} at {rate}/s, {} halves: {off:e} off {angle}, {} m/s",
                            cell.membranes.len(),
                            end.v_rms()
                        ));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The force is the slope of the energy by the diagonal's length, and what it grows by with that is
/// positive; beyond the greatest angle it goes on growing.
#[test]
fn diagonal_has_the_force_of_the_curve() {
    let material = fabric(CURVES[0], CURVES[1]);
    let lamina = cell(material.clone(), [5, 5], [20.0, 36.0]);
    let law = shear_curve(&lamina, &PhysicsConfig::default()).unwrap();
    let [a, b] = lamina.cell();
    let (rest, thickness) = (a.hypot(b), material.thickness());
    let length = |angle: f64| (a * a + b * b + 2.0 * a * b * angle.sin()).sqrt();
    for k in -130..=130 {
        let angle = 0.01 * f64::from(k);
        let shear = &material.shear;
        let (curve, modulus) = match angle < 0.0 {
            true => (&shear.negative, shear.negative.modulus()),
            false => (&shear.positive, shear.positive.modulus()),
        };
        let stress = curve.stress(angle.abs()) * angle.signum();
        let expected = thickness * stress * length(angle) / angle.cos();
        let answer = law.of_diagonal(length(angle).powi(2), 1.0 / rest);
        let at_rest = 2.0 * law.per_growth * modulus * thickness;
        let found = (length(angle) / rest - answer.without_force) * rest * answer.slope * at_rest;
        let off = (found - expected).abs();
        assert!(
            off <= 1e-9 * expected.abs() + 1e-12,
            "{found}, not {expected} at {angle}"
        );
        assert!(answer.slope > 0.3, "{} at {angle}", answer.slope);
    }
    let far = law.of_diagonal((1.2 * (a + b)).powi(2), 1.0 / rest);
    assert!(far.without_force < (a + b) / rest && far.slope.is_finite());
    let none = law.of_diagonal(0.0, 1.0 / rest);
    assert!(none.without_force > 0.0 && none.slope.is_finite());
}

/// A straight curve in many points, to the bit the law of two; a point that bends it is felt.
#[test]
fn straight_points_cost_nothing() {
    let two = fabric("[[0.0, 0.0], [0.1, 0.005]]", "[[0.0, 0.0], [1.0, 0.05]]");
    let many = "[[0.0, 0.0], [0.1, 0.005], [0.4, 0.02], [0.7, 0.035]]";
    let many = fabric(many, "[[0.0, 0.0], [1.0, 0.05], [3.0, 0.15]]");
    let law = |material| {
        shear_curve(
            &cell(material, [3, 3], [20.0; 2]),
            &PhysicsConfig::default(),
        )
    };
    assert!(law(two).is_none() && law(many).is_none());
    assert!(law(fabric(CURVES[0], CURVES[0])).is_some());
}

/// A sheet whose wefts are as soft as its shear hangs by its first row: columns are longer by
/// rho g L^2 / (2 E t), 8.83 mm, all alike, and hang straight down.
#[test]
fn soft_wefts_hang_straight_and_even() {
    let mut material = Material::interglas_92125();
    material.thickness_mm = 0.5;
    material.areal_mass_g_m2.paper = Some(1000.0);
    material.shear.positive = Curve::line(50e3);
    material.shear.negative = Curve::line(50e3);
    for (warp, weft) in [(600e6, 0.1e6), (0.2e6, 0.1e6)] {
        material.warp.tension = Curve::line(warp);
        material.weft.tension = Curve::line(weft);
        let mut sheet = cell(material.clone(), [5, 31], [40.0, 300.0]);
        assert!(sheet.diagonals.is_empty());
        let mut start = Snapshot::at_rest(sheet.rest.iter().map(|r| [r[0], 0.0, -r[1]]).collect());
        let top = sheet.rest[0][1];
        start.fixed.extend(0..5);
        // Corners at the ends of diagonals are heavier.
        for row in 0..31 {
            for column in 0..3 {
                let pair = [5 * row + column, 5 * row + 4 - column];
                let mean = 0.5 * (sheet.mass[pair[0]] + sheet.mass[pair[1]]);
                for v in pair {
                    sheet.mass[v] = mean;
                }
            }
        }
        let physics = PhysicsConfig {
            bending: Bending::Off,
            damping: 50.0,
            ..physics(Solver::Yarn, 9.81)
        };
        let end = rest(&sheet, &physics, &start, 6000.0);
        let expected = 9.81 * 0.3 * 0.3 / (2.0 * 0.1e6 * 0.5e-3);
        for column in 0..5 {
            let last = end.position[150 + column];
            let longer = -top - last[2] - 0.3;
            let aside = last[0] - sheet.rest[column][0];
            assert!(
                (longer / expected - 1.0).abs() < 1e-6,
                "{longer}, not {expected}"
            );
            assert!(aside.abs() < 1e-9, "{aside} m aside");
        }
    }
}
