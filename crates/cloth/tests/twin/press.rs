//! Pressing with 1 N/mm^2.

use super::*;
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Aim, Parameters, Roller, under_stencil};
use drape_cloth::tool::{Hemisphere, Plate};
use drape_cloth::twin::{Hold, PressConfig};

/// A sheet with ripples on a plate, 8 mm high; its yarns keep their length.
fn rippled(config: &TwinConfig) -> (Lamina, Tool, Twin) {
    let plate = tool(Shape::Plate(Plate::default()), 10.0);
    let sheet = lamina([0.12, 0.06], [21, 11]);
    let mut twin = Twin::new(&sheet, config).unwrap();
    let x: Vec<[f64; 3]> = (sheet.rest.iter())
        .map(|&[along, y]| {
            // Along the curve z = a (1 + cos(k x)) by small steps.
            let (a, k, steps) = (0.004, 60.0, 1000);
            let mut x = 0.0f64;
            for _ in 0..steps {
                let slope = a * k * (k * x).sin();
                x += along / steps as f64 / slope.hypot(1.0);
            }
            [x, y, a * (1.0 + (k * x).cos())]
        })
        .collect();
    twin.set_positions(&x);
    (sheet, plate, twin)
}

#[test]
fn pressed_cloth_comes_down_and_stays() {
    for hold in [Hold::Pressure, Hold::Fixed] {
        let (sheet, plate, mut twin) = rippled(&TwinConfig::default());
        let config = PressConfig {
            hold,
            ..PressConfig::default()
        };
        let middle = sheet.vertex_at(5, 10).unwrap();
        let height = |twin: &Twin| plate.distance(twin.position(middle)).0;
        assert!(height(&twin) > 0.007);
        let mut presses = 0;
        let replay = twin.replay(&sheet, &plate, &config, &[middle], 0.018, |_, _| {
            presses += 1
        });
        assert_eq!((presses, replay.unwrap()[0].0), (2, middle));
        let draped: Vec<u32> = twin
            .snapshot()
            .pressed
            .draped
            .ones()
            .map(|v| v as u32)
            .collect();
        assert!(draped.contains(&middle) && draped.len() >= 9, "{draped:?}");
        assert!(height(&twin).abs() < 1e-6, "{}", height(&twin));
        // Draped vertices may still be on their way; those that lie stay.
        let lies = |v: &u32| plate.distance(twin.position(*v)).0 < 1e-6;
        let lying: Vec<u32> = draped.iter().copied().filter(lies).collect();
        assert!(lying.len() >= 9, "{lying:?}");
        let before: Vec<[f64; 3]> = lying.iter().map(|&v| twin.position(v)).collect();
        twin.advance(Some(&plate), 0.05).unwrap();
        for (&v, before) in lying.iter().zip(before) {
            let moved = (Vec3::from(twin.position(v)) - Vec3::from(before)).norm();
            assert!(moved < 1e-5, "{v} moves by {moved} m");
        }
        let energies = twin.energies();
        let off = energies.residual().abs() / energies.size();
        assert!(off < 0.02, "{off}: {energies:?}");
    }
}

/// Pressure on a sheet that lies flat does nothing but press: its force is what the tool bears,
/// and no work is done.
#[test]
fn pressure_on_lying_cloth_does_no_work() {
    let plate = tool(Shape::Plate(Plate::default()), 10.0);
    let sheet = lamina([0.06, 0.06], [11, 11]);
    let mut twin = Twin::new(&sheet, &TwinConfig::default()).unwrap();
    let vertices: Vec<u32> = (0..121).collect();
    let draped = twin.press(&plate, &PressConfig::default(), &vertices);
    let draped = draped.unwrap();
    assert_eq!(draped.len(), 121);
    assert!(twin.speed() < 1e-9, "{}", twin.speed());
    assert!(twin.energies().press.abs() < 1e-9, "{:?}", twin.energies());
}

/// Cloth under pressure is as fast as the roller, no faster.
#[test]
fn pressed_cloth_does_not_outrun_the_roller() {
    let plate = tool(Shape::Plate(Plate::default()), 10.0);
    let sheet = lamina([0.06, 0.06], [11, 11]);
    let weightless = TwinConfig {
        gravity: 0.0,
        damping: 0.0,
        ..TwinConfig::default()
    };
    let mut twin = Twin::new(&sheet, &weightless).unwrap();
    let high: Vec<[f64; 3]> = (twin.positions().iter())
        .map(|x| [x[0], x[1], 0.03])
        .collect();
    twin.set_positions(&high);
    let default = PressConfig::default();
    let config = PressConfig {
        press_s: 0.01,
        roller: Roller {
            speed: 0.5,
            ..default.roller
        },
        ..default
    };
    let vertices: Vec<u32> = (0..121).collect();
    twin.press(&plate, &config, &vertices).unwrap();
    for (x, before) in twin.positions().iter().zip(&high) {
        close(before[2] - x[2], 0.005, 0.01);
    }
}

/// What a lamina has of its own, in the twin as in the fast solver, is what another lamina would have.
#[test]
fn factors_are_those_of_another_lamina() {
    let dome = tool(Shape::Hemisphere(Hemisphere::default()), 4.0);
    let sheet = lamina([0.06, 0.06], [9, 9]);
    let mut own = Parameters {
        tension: [0.5, 2.0],
        compression: [1.5, 0.7],
        bending: [3.0; 2],
        shear: [2.0, 0.5],
        friction: [1.2, 0.8],
        areal_mass: 1.4,
        pressure: 0.6,
        stencil: 1.3,
        ..Parameters::default()
    };
    let end = |sheet: &Lamina, parameters: Parameters, [bending, pressure, side]: [f64; 3]| {
        let config = TwinConfig {
            bending_stiffness: Some([bending * 1e-4; 2]),
            parameters,
            ..TwinConfig::default()
        };
        let mut twin = Twin::new(sheet, &config).unwrap();
        let at = sheet.rest.iter().map(|[x, y]| [*x, *y, 0.0765]);
        twin.set_positions(&at.collect::<Vec<_>>());
        let mut press = PressConfig::default();
        press.roller.pressure *= pressure;
        let replay = twin.replay(sheet, &dome, &press, &[40, 12], side * 0.018, |_, _| ());
        assert!(replay.is_ok());
        twin.positions()
    };
    let mut other = sheet.clone();
    let Material {
        warp, weft, shear, ..
    } = &mut other.material;
    for (k, law) in [warp, weft].into_iter().enumerate() {
        law.tension = law.tension.scaled(own.tension[k]);
        law.compression = law.compression.scaled(own.compression[k]);
        law.static_friction *= own.friction[0];
        law.dynamic_friction *= own.friction[1];
    }
    shear.positive = shear.positive.scaled(own.shear[0]);
    shear.negative = shear.negative.scaled(own.shear[1]);
    other
        .mass
        .iter_mut()
        .for_each(|mass| *mass *= own.areal_mass);
    let apart = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let factors = end(&sheet, own.clone(), [1.0; 3]);
    let scaled = end(&other, Parameters::default(), [3.0, 0.6, 1.3]);
    assert!(
        apart(&factors, &scaled) < 1e-8,
        "{}",
        apart(&factors, &scaled)
    );
    assert!(apart(&factors, &end(&sheet, Parameters::default(), [1.0; 3])) > 1e-4);
    own.offset_mm = [7.0, 0.0];
    assert!(apart(&factors, &end(&sheet, own, [1.0; 3])) > 1e-4);
}

/// The box turns with the tool: on the flank of a dome it takes in as much cloth as on its top.
#[test]
fn box_covers_its_square_on_any_flank() {
    let dome = tool(Shape::Hemisphere(Hemisphere::default()), 4.0);
    let sheet = lamina([0.1, 0.1], [21, 21]);
    for tilt in [0.0f64, 40.0, 80.0] {
        let (sin, cos) = tilt.to_radians().sin_cos();
        let x: Vec<[f64; 3]> = (sheet.rest.iter())
            .map(|[u, v]| [0.075 * sin + u * cos, *v, 0.075 * cos - u * sin])
            .collect();
        let middle = sheet.vertex_at(10, 10).unwrap();
        let found = under_stencil(&sheet, &dome, middle, 0.018, Aim::default(), |v| {
            x[v as usize]
        });
        assert_eq!(found.len(), 9, "{tilt}");
    }
}

/// A roller that is off by more than its side presses where it is, nothing where it should be, and nothing beside the blank.
#[test]
fn stencil_that_is_off_presses_there() {
    let plate = tool(Shape::Plate(Plate::default()), 4.0);
    let sheet = lamina([0.1, 0.1], [21, 21]);
    let middle = sheet.vertex_at(10, 10).unwrap();
    let under = |vertex: u32, offset: [f64; 2]| {
        let aim = Aim {
            offset,
            ..Aim::default()
        };
        under_stencil(&sheet, &plate, vertex, 0.018, aim, |v| {
            let [x, y] = sheet.rest[v as usize];
            [x, y, 0.0]
        })
    };
    let [x, y] = sheet.rest[middle as usize];
    for off in [[0.005, 0.0], [0.03, -0.02], [-0.04, 0.04]] {
        let there = (0..sheet.vertex_count() as u32).find(|&v| {
            let [a, b] = sheet.rest[v as usize];
            (a - x - off[0]).abs() + (b - y - off[1]).abs() < 1e-9
        });
        let found = under(middle, off);
        assert_eq!(found, under(there.unwrap(), [0.0; 2]), "{off:?}");
        assert_eq!(found.len(), 9);
    }
    assert!(under(middle, [0.08, 0.0]).is_empty());
}
