//! The bound on the time step.

use super::*;
use drape_cloth::math::{Purpose, Stream};

/// A sheet under tension everywhere, between frames that are held, and set trembling.
fn trembling(config: &TwinConfig) -> Twin {
    let sheet = lamina([0.05, 0.05], [9, 9]);
    let mut twin = Twin::new(&sheet, config).unwrap();
    let x: Vec<[f64; 3]> = (twin.positions().iter())
        .map(|x| [1.003 * x[0], 1.003 * x[1], 0.0])
        .collect();
    twin.set_positions(&x);
    for (v, rest) in sheet.rest.iter().enumerate() {
        if is_border(rest) {
            twin.fix(v as u32);
        }
    }
    let mut stream = Stream::new(7, Purpose::Evaluation, 0);
    let v: Vec<[f64; 3]> = (0..x.len())
        .map(|_| std::array::from_fn(|_| 1e-3 * (stream.uniform() - 0.5)))
        .collect();
    twin.set_velocities(&v);
    twin
}

fn is_border(rest: &[f64; 2]) -> bool {
    rest.iter().any(|r| r.abs() > 0.025 - 1e-9)
}

/// True highest frequency of the trembling sheet [rad/s]: power iteration on differences of
/// forces, which pull() gives vertex by vertex.
fn highest_frequency() -> f64 {
    let config = TwinConfig {
        gravity: 0.0,
        ..bare()
    };
    let mut twin = trembling(&config);
    let sheet = lamina([0.05, 0.05], [9, 9]);
    let free: Vec<usize> = (0..sheet.vertex_count())
        .filter(|&v| !is_border(&sheet.rest[v]))
        .collect();
    let x = twin.positions();
    let mut u: Vec<[f64; 3]> = vec![[0.0; 3]; x.len()];
    for &v in &free {
        // Neighbours against each other, and some of all else.
        let [row, column] = sheet.place(v as u32);
        let sign = if (row + column) % 2 == 0 { 1.0 } else { -1.0 };
        u[v] = [sign, 0.8 * sign + 0.1 * row as f64, 0.1 * column as f64];
    }
    let mut square = 0.0;
    for _ in 0..300 {
        let norm = u.iter().flatten().map(|u| u * u).sum::<f64>().sqrt();
        let h = 1e-7 / norm;
        let mut at = |h: f64| {
            let moved: Vec<[f64; 3]> = (x.iter().zip(&u))
                .map(|(x, u)| std::array::from_fn(|k| x[k] + h * u[k]))
                .collect();
            twin.set_positions(&moved);
            let pull = |v: usize| twin.pull(&[v as u32]);
            (0..x.len()).map(pull).collect::<Vec<_>>()
        };
        let (there, back) = (at(h), at(-h));
        for &v in &free {
            for k in 0..3 {
                u[v][k] = -(there[v][k] - back[v][k]) / (2.0 * h * sheet.mass[v]);
            }
        }
        square = u.iter().flatten().map(|u| u * u).sum::<f64>().sqrt() / norm;
        for u in u.iter_mut().flatten() {
            *u /= square * norm;
        }
    }
    square.sqrt()
}

/// The bound lies above the true highest frequency, and not far.
#[test]
fn time_step_is_below_the_true_limit_and_near_it() {
    let config = TwinConfig {
        gravity: 0.0,
        safety: 1.0,
        ..bare()
    };
    let limit = 2.0 / highest_frequency();
    let found = trembling(&config).stable_time_step();
    eprintln!("{found} of {limit}");
    assert!(found <= limit, "{found} is more than {limit}");
    assert!(found > 0.7 * limit, "{found} is far below {limit}");
}

#[test]
fn stable_below_the_limit_and_reported_beyond() {
    let limit = 2.0 / highest_frequency();
    let with = |share: f64| {
        let config = TwinConfig {
            gravity: 0.0,
            ..bare()
        };
        let safe = TwinConfig {
            safety: 1.0,
            ..config.clone()
        };
        let safety = share * limit / trembling(&safe).stable_time_step();
        trembling(&TwinConfig { safety, ..config })
    };
    let mut stable = with(0.9);
    stable.advance(None, 0.02).unwrap();
    let end = stable.energies();
    assert!(end.residual().abs() < 0.01 * end.initial, "{end:?}");
    let error = with(1.2).advance(None, 0.02).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("the twin diverged after 0.00"),
        "{error}"
    );
}

/// Inertia 100 times as large, steps 10 times as long; weight stays.
#[test]
fn mass_scaling_lengthens_the_step_by_its_root() {
    let sheet = lamina([0.05, 0.05], [9, 9]);
    let [plain, scaled] = [1.0, 100.0].map(|factor| {
        let config = TwinConfig::default().accelerated(factor);
        Twin::new(&sheet, &config).unwrap()
    });
    close(
        scaled.stable_time_step(),
        10.0 * plain.stable_time_step(),
        1e-12,
    );
    close(scaled.pull(&[7])[2], plain.pull(&[7])[2], 1e-12);
}

/// Beyond the knee of the tension law yarns are stiffer, and the step shortens by itself.
#[test]
fn stiffer_branches_shorten_the_step() {
    let sheet = lamina([0.05, 0.05], [9, 9]);
    let mut twin = Twin::new(&sheet, &bare()).unwrap();
    let before = twin.stable_time_step();
    for (v, rest) in sheet.rest.iter().enumerate() {
        if rest[0].abs() > 0.025 - 1e-9 {
            twin.drive(v as u32, [rest[0].signum(), 0.0, 0.0]);
        }
    }
    // Two ends at 1 m/s each: 1 % after 0.25 ms.
    twin.advance(None, 0.25e-3).unwrap();
    let after = twin.stable_time_step();
    assert!(after < 0.7 * before, "{after} after {before}");
}
