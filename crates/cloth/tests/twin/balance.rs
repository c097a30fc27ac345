//! Momentum and energy.

use super::*;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::tool::Hemisphere;

/// In free flight, crumpled, stretched and vibrating, momentum and angular momentum stay to
/// round-off.
#[test]
fn free_flight_keeps_momentum() {
    let sheet = lamina([0.06, 0.05], [11, 9]);
    let config = TwinConfig {
        gravity: 0.0,
        viscosity: 0.06,
        ..bare()
    };
    let mut twin = Twin::new(&sheet, &config).unwrap();
    let mut stream = Stream::new(2, Purpose::Evaluation, 0);
    let mut noise = |size: f64| size * (stream.uniform() - 0.5);
    let positions: Vec<[f64; 3]> = (twin.positions().iter())
        .map(|x| [x[0] + noise(2e-4), x[1] + noise(2e-4), x[2] + noise(2e-3)])
        .collect();
    let velocities: Vec<[f64; 3]> = (positions.iter())
        .map(|x| {
            [
                1.0 - 30.0 * x[1] + noise(1.0),
                30.0 * x[0],
                2.0 + noise(1.0),
            ]
        })
        .collect();
    twin.set_positions(&positions);
    twin.set_velocities(&velocities);
    let momenta = |twin: &Twin| {
        let mut sum = [0.0; 6];
        for ((x, v), m) in twin
            .positions()
            .iter()
            .zip(twin.velocities())
            .zip(&sheet.mass)
        {
            for k in 0..3 {
                let (a, b) = ((k + 1) % 3, (k + 2) % 3);
                sum[k] += m * v[k];
                // Positions are half a step ahead of velocities: x times v is the same there
                // and half a step back.
                sum[3 + k] += m * (x[a] * v[b] - x[b] * v[a]);
            }
        }
        sum
    };
    twin.advance(None, 1e-5).unwrap();
    let before = momenta(&twin);
    twin.advance(None, 0.02).unwrap();
    let after = momenta(&twin);
    let size = sheet.mass.iter().sum::<f64>();
    for k in 0..6 {
        let off = (after[k] - before[k]).abs() / size;
        assert!(off < 1e-11, "{k}: {} became {}", before[k], after[k]);
    }
}

/// A sheet that snaps back from tension and trembles on without any damping. The laws have a
/// kink at rest, a hundred times as stiff in tension as in compression, at which central
/// differences near their limit gain energy; the error goes with the step.
#[test]
fn undamped_vibration_keeps_its_energy_with_small_steps() {
    let sheet = lamina([0.1, 0.08], [11, 9]);
    let off = |safety: f64| {
        let config = TwinConfig {
            gravity: 0.0,
            safety,
            ..bare()
        };
        let mut twin = Twin::new(&sheet, &config).unwrap();
        let stretched: Vec<[f64; 3]> = (twin.positions().iter())
            .map(|x| [x[0] * 1.004, x[1] * 1.005, x[2]])
            .collect();
        twin.set_positions(&stretched);
        let start = twin.energies();
        assert!(start.stretch > 0.0 && start.kinetic == 0.0);
        twin.advance(None, 0.02).unwrap();
        let end = twin.energies();
        assert!(end.kinetic > 0.05 * start.stretch);
        end.residual().abs() / start.initial
    };
    let (coarse, fine) = (off(0.4), off(0.1));
    assert!(coarse < 0.02 && fine < 0.002, "{coarse}, {fine}");
}

/// A fall on to a hemisphere with friction and both kinds of damping: every joule is found.
#[test]
fn fall_on_a_tool_balances_its_energy() {
    let shape = Hemisphere {
        radius_mm: 40.0,
        plate_mm: [200.0, 200.0],
        ..Hemisphere::default()
    };
    let tool = tool(Shape::Hemisphere(shape), 4.0);
    let sheet = lamina([0.12, 0.12], [21, 21]);
    let config = TwinConfig {
        damping: 5.0,
        ..TwinConfig::default()
    };
    let mut twin = Twin::new(&sheet, &config).unwrap();
    let above: Vec<[f64; 3]> = (twin.positions().iter())
        .map(|x| [x[0], x[1], 0.045])
        .collect();
    twin.set_positions(&above);
    for _ in 0..4 {
        twin.advance(Some(&tool), 0.05).unwrap();
        let now = twin.energies();
        let off = now.residual().abs() / now.size();
        eprintln!("{off:.2e} {now:?}");
        assert!(off < 0.01, "{off}: {now:?}");
    }
    let end = twin.energies();
    assert!(end.contact > 0.0 && end.friction > 0.0 && end.damping > 0.0);
    assert!(end.viscosity > 0.0 && end.bending > 0.0 && end.shear > 0.0);
    let depth = (twin.positions().into_iter())
        .map(|x| tool.distance(x).0)
        .fold(f64::INFINITY, f64::min);
    assert!(depth > -1e-4, "{depth}");
}
