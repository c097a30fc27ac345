//! Membrane triangles against closed forms of their law, and against yarns.
//!
//! Most use a soft, linear fabric with the same branch on both sides: its waves are slow
//! enough for one Gauss-Seidel pass a substep to resolve them.

use drape_cloth::fabric::Curve;
use drape_cloth::math::Vec3;
use drape_cloth::sim::Snapshot;

use super::*;

/// Moduli of warp, weft and shear of the soft fabric [Pa].
const MODULI: [f64; 3] = [0.6e6, 0.9e6, 0.1e6];
const THICKNESS: f64 = 0.35e-3;

fn soft() -> Material {
    let text = include_str!("../../../../configs/materials/interglas-92125.toml");
    let mut text = text.to_string();
    for (from, to) in [
        (
            "[[0.0, 0.0], [0.005, 3.0], [0.02, 40.0]]",
            "[[0, 0], [1, 0.6]]",
        ),
        ("[[0.0, 0.0], [0.02, 0.12]]", "[[0, 0], [1, 0.6]]"),
        (
            "[[0.0, 0.0], [0.006, 5.0], [0.025, 60.0]]",
            "[[0, 0], [1, 0.9]]",
        ),
        ("[[0.0, 0.0], [0.02, 0.0405]]", "[[0, 0], [1, 0.9]]"),
        ("[[0.0, 0.0], [0.1, 0.005]]", "[[0, 0], [1, 0.1]]"),
        ("[[0.0, 0.0], [0.1, 0.0036]]", "[[0, 0], [1, 0.1]]"),
    ] {
        assert!(text.contains(from));
        // Integers are numbers too, but not in TOML.
        text = text.replace(
            from,
            &to.replace("0, 0]", "0.0, 0.0]").replace("[1,", "[1.0,"),
        );
    }
    toml::from_str(&text).unwrap()
}

/// A rectangle of membranes with the warp at `angle` [degrees].
fn membranes(size: [f64; 2], vertices: [usize; 2], angle: f64, material: Material) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        yarn_angle_deg: angle,
        ..BlankConfig::default()
    };
    Lamina::of_membranes(&config, material).unwrap()
}

/// In-plane forces only, strongly damped.
fn in_plane(damping: f64) -> PhysicsConfig {
    PhysicsConfig {
        shear: true,
        gravity: 0.0,
        ..yarns_alone(damping)
    }
}

fn flat(lamina: &Lamina, to: impl Fn([f64; 2]) -> [f64; 2]) -> Snapshot {
    let mut state = placed(lamina, |_, _| [0.0; 3]);
    for (x, rest) in state.position.iter_mut().zip(&lamina.rest) {
        let [u, v] = to(*rest);
        *x = [u, v, 0.0];
    }
    state
}

/// Compliances of the plane law in the frame of the sheet, with the warp at `angle`: strains
/// xx, yy and xy (of the tensor) under a stress xx of 1 Pa.
fn strain_of_unit_stress(angle: f64) -> [f64; 3] {
    let (s, c) = angle.to_radians().sin_cos();
    // Stress in the frame of the yarns, then strain there, turned back.
    let [warp, weft, shear] = [c * c, s * s, -s * c];
    let [e1, e2, e12] = [warp / MODULI[0], weft / MODULI[1], 0.5 * shear / MODULI[2]];
    [
        e1 * c * c + e2 * s * s - 2.0 * e12 * s * c,
        e1 * s * s + e2 * c * c + 2.0 * e12 * s * c,
        (e1 - e2) * s * c + e12 * (c * c - s * s),
    ]
}

/// Patch test: the border of a sheet is strained homogeneously, its inside starts elsewhere.
#[test]
fn homogeneous_deformation_gives_homogeneous_strain() {
    for angle in [0.0, 30.0, 45.0, 110.0] {
        let sheet = membranes([0.03, 0.025], [7, 6], angle, soft());
        let strain = [[2e-3, 1e-3], [-0.5e-3, -1.5e-3]];
        let to = |[x, y]: [f64; 2]| {
            [
                x + strain[0][0] * x + strain[0][1] * y,
                y + strain[1][0] * x + strain[1][1] * y,
            ]
        };
        let truth = flat(&sheet, to);
        let mut state = truth.clone();
        for v in 0..sheet.vertex_count() as u32 {
            if sheet.neighbors(v).count() < 8 {
                state.fixed.insert(v as usize);
            } else {
                let x = &mut state.position[v as usize];
                x[0] += 2e-4 * f64::from(v).sin();
                x[1] += 2e-4 * f64::from(3 * v).cos();
            }
        }
        let model = Model::new(&sheet, &in_plane(2000.0));
        let end = run(&model, &NOWHERE, &state, 1e-6, 0.04);
        let off = (0..sheet.vertex_count())
            .map(|v| (Vec3::from(end.position[v]) - Vec3::from(truth.position[v])).norm());
        // Largest displacement at the border: 4e-5 m.
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 4e-9, "{angle} degrees: {worst:e} m off");
    }
}

/// Both ends of a strip move as uniaxial stress along x demands, its sides are free: along the
/// yarns and in between, all of it strains as the closed form of the plane law says.
#[test]
fn uniaxial_tension_strains_as_the_plane_law() {
    for angle in [0.0, 20.0, 45.0, 90.0] {
        let sheet = membranes([0.04, 0.02], [9, 5], angle, soft());
        let strain = strain_of_unit_stress(angle);
        let stress = 5e-4 / strain[0];
        let [xx, yy, xy] = strain.map(|s| s * stress);
        let truth = flat(&sheet, |[x, y]| [x + xx * x + xy * y, y + xy * x + yy * y]);
        let mut state = flat(&sheet, |[x, y]| [x + xx * x, y]);
        for (v, [x, _]) in sheet.rest.iter().enumerate() {
            if x.abs() > 0.0199 {
                state.fixed.insert(v);
                state.position[v] = truth.position[v];
            }
        }
        let model = Model::new(&sheet, &in_plane(1000.0));
        let end = run(&model, &NOWHERE, &state, 1e-6, 0.06);
        let off = (0..sheet.vertex_count())
            .map(|v| (Vec3::from(end.position[v]) - Vec3::from(truth.position[v])).norm());
        let worst = off.fold(0.0, f64::max);
        // Displacements of up to 1e-5 m, strains of up to 5e-4 that the law takes as small.
        assert!(worst < 1e-8, "{angle} degrees: {worst:e} m off");
    }
}

/// A strip along its warp under its own weight: displacement rho g (L s - s^2 / 2) / (E t).
#[test]
fn hanging_strip_has_the_stiffness_of_the_law() {
    let length = 0.04;
    for (angle, modulus) in [(0.0, MODULI[0]), (90.0, MODULI[1])] {
        let sheet = membranes([length, 0.01], [9, 3], angle, soft());
        let mut state = placed(&sheet, |s, t| [t, 0.0, -s]);
        let top: Vec<usize> = (0..3).map(|row| 9 * row).collect();
        state.fixed.extend(top);
        let physics = PhysicsConfig {
            gravity: 10.0 * GRAVITY,
            ..in_plane(1000.0)
        };
        let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, 1e-6, 0.06);
        for column in 1..9 {
            let s = length * column as f64 / 8.0;
            let weight = AREAL_MASS * 10.0 * GRAVITY * (length * s - 0.5 * s * s);
            let z = (0..3)
                .map(|row| end.position[9 * row + column][2])
                .sum::<f64>()
                / 3.0;
            close(-z - s, weight / (modulus * THICKNESS), 5e-3);
        }
    }
}

/// That of a strip whose width is no whole number of cells: one row of whole cells between
/// two yarns, and membranes on both sides of it.
#[test]
fn yarns_and_membranes_carry_together() {
    let length = 0.04;
    let config = BlankConfig {
        size_mm: [40.0, 12.0],
        cell_mm: Some(5.0),
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    // No shear: the yarns of whole cells carry by themselves.
    let mut material = soft();
    material.shear.locking = None;
    [material.shear.positive, material.shear.negative] = [1e3; 2].map(Curve::line);
    let sheet = Lamina::new(&config, material).unwrap();
    assert!(sheet.diagonals.len() == 8 && sheet.membranes.len() == 32);
    close(sheet.area(), 0.04 * 0.012, 1e-12);
    let mut state = placed(&sheet, |_, _| [0.0; 3]);
    for (v, [x, y]) in sheet.rest.iter().enumerate() {
        state.position[v] = [*y, 0.0, -x - 0.02];
        state.fixed.set(v, *x < -0.0199);
    }
    // A diagonal spring also takes some of the tension, of the order of G / E: nothing for
    // glass, 3 % for the soft fabric.
    let physics = PhysicsConfig {
        shear: false,
        gravity: 10.0 * GRAVITY,
        ..in_plane(1000.0)
    };
    let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, 1e-6, 0.06);
    for column in 1..9 {
        let s = length * f64::from(column) / 8.0;
        let weight = AREAL_MASS * 10.0 * GRAVITY * (length * s - 0.5 * s * s);
        // Rows by the width that they stand for: membranes end at 6 mm, yarns lie at 2.5 mm.
        let mean: f64 = [1.75, 4.25, 4.25, 1.75]
            .into_iter()
            .enumerate()
            .map(|(row, width)| {
                let v = sheet.vertex_at(row, column as usize).unwrap();
                width / 12.0 * (-end.position[v as usize][2] - s)
            })
            .sum();
        close(mean, weight / (MODULI[0] * THICKNESS), 5e-3);
    }
}

/// A cell of two membranes hangs by one corner. Its yarns are stiff, so that it is a rhombus
/// whose sides lie at 90 degrees less gamma: 3 m g a sin((90 - gamma) / 2) = G t a^2 gamma,
/// where m is a third of a triangle's mass.
#[test]
fn sheared_membrane_cell_balances_its_weight() {
    let a = 0.01;
    let cell = membranes([a, a], [2, 2], 0.0, Material::interglas_92125());
    let weight = 300.0 * GRAVITY;
    let physics = PhysicsConfig {
        gravity: weight,
        ..in_plane(200.0)
    };
    let mut state = placed(&cell, |_, _| [0.0; 3]);
    for (v, [x, y]) in cell.rest.iter().enumerate() {
        let half = 0.5f64.sqrt();
        state.position[v] = [half * (x - y), 0.0, -half * (x + y)];
    }
    state.fixed.insert(0);
    let end = run(&Model::new(&cell, &physics), &NOWHERE, &state, 2e-6, 0.6);
    let modulus = cell.material.shear.positive.modulus();
    let moment = |gamma: f64| {
        let pull =
            3.0 * cell.mass[1] * weight * a * (0.25 * std::f64::consts::PI - 0.5 * gamma).sin();
        pull - modulus * THICKNESS * a * a * gamma
    };
    let (mut low, mut high) = (0.0, 0.5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if moment(middle) > 0.0 {
            low = middle
        } else {
            high = middle
        }
    }
    let [o, p, q] = [0, 1, 2].map(|v| Vec3::from(end.position[v]));
    let found = ((p - o).normalize().dot(&(q - o).normalize())).asin();
    close(found, low, 5e-3);
}

/// A cut blank with a hole and membranes all round flies freely: linear momentum is kept to
/// round-off whatever is listed, at a substep at which no yarn pulls hard enough for the solve
/// along lines to give its vertices inertia.
#[test]
fn cut_blank_in_free_flight_keeps_its_momentum() {
    let config = BlankConfig {
        outline: Some(
            concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../assets/outlines/plate-with-hole.csv"
            )
            .into(),
        ),
        cell_mm: Some(12.0),
        yarn_angle_deg: 30.0,
        ..BlankConfig::default()
    };
    let sheet = Lamina::new(&config, Material::interglas_92125()).unwrap();
    assert!(!sheet.membranes.is_empty() && !sheet.yarns.is_empty());
    let mut state = flat(&sheet, |x| x);
    let mut stream = Stream::new(9, Purpose::Evaluation, 0);
    for (x, v) in state.position.iter_mut().zip(&mut state.velocity) {
        x[2] = 0.01 * (30.0 * x[0]).sin();
        *v = [0.5, -0.4, 0.3].map(|mean| mean + 0.3 * stream.normal());
    }
    let momentum = |state: &Snapshot| -> Vec3 {
        let one = |(v, m): (&[f64; 3], &f64)| Vec3::from(*v) * *m;
        state.velocity.iter().zip(&sheet.mass).map(one).sum()
    };
    for bending in [Bending::Off, Bending::Yarns, Bending::Dihedral] {
        for solver in [Solver::Yarn, Solver::GaussSeidel] {
            let physics = PhysicsConfig {
                bending,
                solver,
                ..in_plane(0.0)
            };
            let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, 5e-6, 0.01);
            let off = (momentum(&end) - momentum(&state)).norm() / momentum(&state).norm();
            assert!(off < 1e-10, "{off} for {bending:?}, {solver:?}");
        }
    }
}

/// Force over elongation of a +-45 strip of 80 x 30 mm between rigid clamps at 1 % [N/m], from
/// its energy.
fn bias_stiffness(strip: &Lamina, h: f64, seconds: f64) -> f64 {
    let strain = 0.01;
    let mut state = flat(strip, |[x, y]| [x * (1.0 + strain), y]);
    for (v, [x, y]) in strip.rest.iter().enumerate() {
        if x.abs() > 0.04 - 1e-6 {
            state.fixed.insert(v);
            state.position[v] = [x * (1.0 + strain), *y, 0.0];
        }
    }
    let end = run(
        &Model::new(strip, &in_plane(200.0)),
        &NOWHERE,
        &state,
        h,
        seconds,
    );
    let elongation: f64 = 0.08 * strain;
    2.0 * elastic_energy(strip, &end) / elongation.powi(2)
}

fn bias_strip(cell_mm: f64) -> Lamina {
    let config = BlankConfig {
        size_mm: [80.0, 30.0],
        cell_mm: Some(cell_mm),
        mass: MassModel::Datasheet,
        yarn_angle_deg: 45.0,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

/// A bias strip meshed along its yarns gives way by shear; the same law on triangles that cut
/// across the yarns locks.
#[test]
fn membranes_across_the_yarns_lock() {
    let along = bias_stiffness(&bias_strip(5.0), 1e-5, 0.1);
    let square = membranes([0.08, 0.03], [17, 7], 45.0, Material::interglas_92125());
    let across = bias_stiffness(&square, 1e-5, 0.1);
    assert!(
        across > 2.0 * along,
        "{across} N/m is not far above {along} N/m"
    );
}
