//! Motion: what flight keeps and what the integrator damps.

use super::solve::{Answer, Ask, Fast, Solve};
use crate::cloth::{Piece, laid, momenta, placed, rigid, sheet, yarns_alone};
use drape_cloth::fabric::{Curve, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::sim::{Bending, Snapshot};

/// Flight and oscillation, of which the twin has none of its own.
pub(super) fn asks() -> Vec<Ask> {
    let flights: Ask = Box::new(|solver| {
        let Some(fast) = solver.fast() else {
            return Vec::new();
        };
        let [linear, angular, expected] = flight(fast, 10.0, 0.0, 0.0);
        let [stretched, ..] = flight(fast, 0.0, 0.064, 0.3);
        let cases = [
            ("flight: linear momentum kept", [1.0, linear]),
            ("flight: angular momentum kept", [1.0, angular]),
            (
                "flight: the same as implicit Euler keeps it",
                [expected, angular],
            ),
            (
                "flight of stretched yarns: linear momentum kept",
                [1.0, stretched],
            ),
        ];
        cases
            .map(|(case, numbers)| Answer::new(case, "-", numbers))
            .into()
    });
    let breathing: Ask = Box::new(|solver| {
        let case = "oscillation: amplitude kept in a substep";
        let answer = |fast: &Fast| Answer::new(case, "-", oscillation(fast, 0.5));
        solver.fast().map(answer).into_iter().collect()
    });
    vec![flights, breathing]
}

/// A sheet that flies and spins about its normal for half a second: what is left of linear and of
/// angular momentum, and what implicit Euler leaves of the latter, (1 + 2 h omega^2 t)^(-1/2), for
/// inner forces have no moment about the positions at the end of a substep, but these are not those
/// at its start. It starts with waves of the
/// amplitude `waves` over the wavelength, 0.06 stretches edges by up to 8 %, and with random
/// velocities of the deviation `noise` [m/s].
pub fn flight(fast: &Fast, omega: f64, waves: f64, noise: f64) -> [f64; 3] {
    let mut stream = Stream::new(1, Purpose::Evaluation, 0);
    let lamina = sheet([0.1, 0.08], [7, 6], Material::interglas_92125());
    let length = 0.157;
    let wave = |x: f64| waves * length * (std::f64::consts::TAU * x / length).sin();
    let mut start = laid(&lamina, |[x, y]| [x, y, wave(x)]);
    for (v, [x, y]) in lamina.rest.iter().enumerate() {
        let even = [0.5 - omega * y, omega * x - 0.4, 0.3];
        start.velocity[v] = even.map(|even| even + noise * stream.normal());
    }
    let mut piece = Piece::new(lamina, yarns_alone(0.0), start);
    (piece.physics.shear, piece.physics.gravity) = (true, 0.0);
    piece.physics.bending = Bending::Yarns;
    let seconds = 0.5;
    let end = fast.run(&piece, seconds);
    // About the centre of mass, so that flight itself has none.
    let centred = |state: &Snapshot| {
        let masses = &piece.lamina.mass;
        let [linear, angular] = momenta(&piece.lamina, state);
        let places = state.position.iter().zip(masses);
        let sum: Vec3 = places.map(|(x, m)| Vec3::from(*x) * *m).sum();
        let centre = sum / masses.iter().sum::<f64>();
        [linear, angular - centre.cross(&linear)]
    };
    let ([p0, l0], [p1, l1]) = (centred(&piece.start), centred(&end));
    let t = (seconds / fast.substep).round() * fast.substep;
    [
        1.0 - (p1 - p0).norm() / p0.norm(),
        l1.dot(&l0) / l0.norm_squared(),
        (1.0 + 2.0 * fast.substep * omega * omega * t).powf(-0.5),
    ]
}

/// 1 / sqrt(1 + omega^2 h^2), and the share of its amplitude that an oscillation keeps in a
/// substep: a single cell that breathes along its warps, so stiff that omega h is `pace`.
pub fn oscillation(fast: &Fast, pace: f64) -> [f64; 2] {
    let (a, h) = (0.01, fast.substep);
    let mut material = Material::interglas_92125();
    let thickness = material.thickness();
    let mut cell = sheet([a, a], [2, 2], material.clone());
    let [m0, m1] = [cell.mass[0], cell.mass[1]];
    let reduced = m0 * m1 / (m0 + m1);
    // k = E t b / a with half the cell for a yarn.
    let k = reduced * (pace / h).powi(2);
    material.warp.tension = Curve::line(k / (0.5 * thickness));
    cell.material = material;
    let cell = rigid(cell);
    let start = placed(&cell, |s, t| [(1.0 + 1e-5) * s, t, 0.0]);
    let mut piece = Piece::new(cell, yarns_alone(0.0), start);
    piece.physics.gravity = 0.0;
    let energy = |state: &Snapshot| {
        let c = state.position[1][0] - state.position[0][0] - a;
        let v = state.velocity[1][0] - state.velocity[0][0];
        0.5 * (k * c * c + reduced * v * v)
    };
    let start = energy(&piece.start);
    let steps = 8;
    for _ in 0..steps {
        piece.start = fast.run(&piece, h);
    }
    let kept = (energy(&piece.start) / start).powf(0.5 / f64::from(steps));
    [(1.0 + pace * pace).powf(-0.5), kept]
}
