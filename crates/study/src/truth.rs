//! Closed forms. None of this knows the simulator.

/// The bracket of where `is_below` stops to hold, halved so often.
pub fn halved(
    [mut low, mut high]: [f64; 2],
    times: usize,
    is_below: impl Fn(f64) -> bool,
) -> [f64; 2] {
    for _ in 0..times {
        let middle = 0.5 * (low + high);
        match is_below(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    [low, high]
}

/// Lengths [m] from the fixed end of a hanging chain to each of its vertices, that end first.
///
/// Edges of length `edge` and compliance `compliance` [m/N] carry the weight of all vertices
/// below them; `mass` is that of each vertex [kg], the fixed one included.
pub fn hanging(mass: &[f64], edge: f64, compliance: f64, gravity: f64) -> Vec<f64> {
    let mut load: f64 = mass.iter().sum::<f64>() * gravity;
    let mut length = 0.0;
    let lengths = mass.iter().enumerate().map(|(i, m)| {
        if i > 0 {
            length += edge + compliance * load;
        }
        load -= m * gravity;
        length
    });
    lengths.collect()
}

/// Coordinates [m] of a catenary of `length` over a level `span` at arc length s from its
/// middle: along the span, and above the lowest point.
pub fn catenary(span: f64, length: f64, s: f64) -> [f64; 2] {
    // length = 2 a sinh(span / 2 a); its right side falls with a.
    let is_long = |a: f64| 2.0 * a * (span / (2.0 * a)).sinh() > length;
    let [a, _] = halved([0.05 * span, 100.0 * span], 200, is_long);
    [a * (s / a).asinh(), a.hypot(s) - a]
}

/// Steps of the elastica over its length.
const ELASTICA_STEPS: usize = 4000;

/// Shape of a heavy strip of length 1 that is clamped level: reach and drop at arc lengths
/// i / `ELASTICA_STEPS` from the clamp. `gamma` = w L^3 / D, at most 1e4.
///
/// phi is the angle to the vertical and u the arc length from the tip: phi'' = gamma u sin
/// phi, phi'(0) = 0, phi(1) = pi / 2. From the tip phi only grows: the logarithm of its value
/// there is bisected, which falls like exp(-2/3 sqrt gamma).
pub fn elastica(gamma: f64) -> Vec<[f64; 2]> {
    let right = std::f64::consts::FRAC_PI_2;
    let is_short = |tip: f64| angles(gamma, tip.exp())[ELASTICA_STEPS] < right;
    let [low, _] = halved([-200.0, right.ln()], 100, is_short);
    let mut phi = angles(gamma, low.exp());
    phi.reverse();
    let step = 1.0 / ELASTICA_STEPS as f64;
    let mut at = [0.0, 0.0];
    let mut shape = vec![at];
    for pair in phi.windows(2) {
        let middle = 0.5 * (pair[0] + pair[1]);
        at = [at[0] + step * middle.sin(), at[1] + step * middle.cos()];
        shape.push(at);
    }
    shape
}

/// phi from the tip on, by Runge and Kutta's method of fourth order. Beyond pi / 2 it goes on
/// straight: that it is too large is all that is asked then.
fn angles(gamma: f64, tip: f64) -> Vec<f64> {
    let h = 1.0 / ELASTICA_STEPS as f64;
    let slope = |u: f64, [phi, rate]: [f64; 2]| [rate, gamma * u * phi.min(2.0).sin()];
    let mut y = [tip, 0.0];
    let mut phi = vec![tip];
    for i in 0..ELASTICA_STEPS {
        let u = i as f64 * h;
        let along = |k: [f64; 2], part: f64| [y[0] + part * h * k[0], y[1] + part * h * k[1]];
        let a = slope(u, y);
        let b = slope(u + 0.5 * h, along(a, 0.5));
        let c = slope(u + 0.5 * h, along(b, 0.5));
        let d = slope(u + h, along(c, 1.0));
        for k in 0..2 {
            y[k] += h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]);
        }
        phi.push(y[0]);
    }
    phi
}

/// Point of a curve from [`elastica`] at arc length s, 0 to 1.
pub fn along(shape: &[[f64; 2]], s: f64) -> [f64; 2] {
    let at = s * (shape.len() - 1) as f64;
    let i = (at as usize).min(shape.len() - 2);
    let part = at - i as f64;
    [0, 1].map(|k| shape[i][k] + part * (shape[i + 1][k] - shape[i][k]))
}

/// Way [m] of a body after `t` with the velocity `v0`, acceleration `g` and drag `c` per mass
/// [1/s], all along one axis.
pub fn dragged(v0: f64, g: f64, c: f64, t: f64) -> f64 {
    if c == 0.0 {
        return v0 * t + 0.5 * g * t * t;
    }
    let terminal = g / c;
    terminal * t + (v0 - terminal) * -(-c * t).exp_m1() / c
}

/// Way [m] down a slope of `angle` [rad] from rest under Coulomb friction `mu`.
pub fn slid(mu: f64, angle: f64, g: f64, t: f64) -> f64 {
    let acceleration = g * (angle.sin() - mu * angle.cos());
    0.5 * acceleration.max(0.0) * t * t
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found - expected).abs() < tolerance,
            "{found} is not {expected}"
        );
    }

    #[test]
    fn elastica_has_its_limits() {
        // Small deflections fall as gamma / 8; without stiffness the strip hangs.
        close(along(&elastica(1e-3), 1.0)[1], 1e-3 / 8.0, 1e-8);
        assert!(along(&elastica(1e4), 1.0)[1] > 0.98);
    }

    #[test]
    fn catenary_has_its_sag_and_span() {
        let [x, z] = catenary(0.30, 0.37, 0.185);
        close(x, 0.15, 1e-9);
        close(z, 0.095689, 1e-6);
    }

    #[test]
    fn hanging_chain_is_stretched_by_what_is_below() {
        let found = hanging(&[1.0, 2.0, 3.0], 1.0, 0.01, 10.0);
        for (found, expected) in found.iter().zip([0.0, 1.5, 2.8]) {
            close(*found, expected, 1e-12);
        }
    }

    #[test]
    fn drag_and_friction_in_their_limits() {
        close(dragged(1.0, -2.0, 0.0, 3.0), -6.0, 1e-12);
        close(dragged(1.0, -2.0, 1e-6, 3.0), -6.0, 1e-4);
        close(dragged(1.0, -2.0, 1e9, 3.0), 0.0, 1e-8);
        close(
            slid(0.0, std::f64::consts::FRAC_PI_6, 10.0, 2.0),
            10.0,
            1e-12,
        );
        assert_eq!(slid(0.6, std::f64::consts::FRAC_PI_6, 10.0, 2.0), 0.0);
    }
}
