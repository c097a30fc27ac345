//! Bending: the heavy elastica.

use super::solve::{Answer, Ask, Solve};
use crate::cloth::{AREAL_MASS, GRAVITY, clamped, mean_at, strip};
use crate::truth;
use drape_cloth::fabric::{Family, Material};

/// The elastica theta'' = -Gamma (1 - s) cos theta, Gamma = w L^3 / D with the weight w per
/// area: Gamma, drop and reach of the tip over the length.
pub const ELASTICA: [[f64; 3]; 7] = [
    [1.0, 0.12347, 0.99125],
    [5.0, 0.49591, 0.84666],
    [8.0, 0.64063, 0.72442],
    [10.0, 0.70020, 0.65635],
    [20.0, 0.82988, 0.44523],
    [50.0, 0.90792, 0.24501],
    [100.0, 0.93752, 0.15922],
];

/// A heavy strip that is clamped level.
pub struct Cantilever {
    pub family: Family,
    /// Bending stiffness per width [N m].
    pub stiffness: f64,
    /// Free length [m].
    pub length: f64,
    /// Edges, the clamped one among them.
    pub edges: usize,
}

/// Where a cantilever comes to rest: drop and reach of the tip over the length, and how fast it
/// still is [m/s].
pub struct Bent {
    pub tip: [f64; 2],
    pub v_rms: f64,
}

/// Cantilevers, the stiffer ones of fewer edges, and what stiffness the built-in fabric shows.
pub(super) fn asks() -> Vec<Ask> {
    let mut asks: Vec<Ask> = Vec::new();
    for [gamma, drop, reach] in ELASTICA {
        asks.push(Box::new(move |solver| {
            let length = 0.2f64;
            let strip = Cantilever {
                family: Family::Warp,
                stiffness: AREAL_MASS * GRAVITY * length.powi(3) / gamma,
                length,
                edges: if gamma > 10.0 { 48 } else { 24 },
            };
            let tip = strip.sink(solver).tip;
            let known = [("drop", drop), ("reach", reach)].into_iter().zip(tip);
            let answer = |((what, expected), found)| {
                let case = format!("cantilever {gamma}: {what}");
                Answer::new(case, "-", [expected, found])
            };
            known.map(answer).collect()
        }));
    }
    for family in [Family::Warp, Family::Weft] {
        asks.push(Box::new(move |solver| {
            let stiffness = Material::interglas_92125().bending_stiffness(family);
            // The angle at which bending length is half the length (Peirce).
            let length = (8.0 * stiffness / (AREAL_MASS * GRAVITY)).cbrt();
            let strip = Cantilever {
                family,
                stiffness,
                length,
                edges: 24,
            };
            let found = stiffness_shown(strip.sink(solver).tip[0], length);
            let case = format!("bimodulus: stiffness of the {family:?}").to_lowercase();
            vec![Answer::new(case, "N m", [stiffness, found])]
        }));
    }
    asks
}

impl Cantilever {
    /// Lets the strip sink until it is still, damped near the critical damping of the swing of a
    /// hanging strip.
    pub fn sink(&self, solver: &dyn Solve) -> Bent {
        let edge = self.length / (self.edges as f64 - 0.5);
        let strip = strip(self.family, edge * self.edges as f64, self.edges);
        let swing = (GRAVITY / self.length).sqrt();
        let piece = clamped(strip, edge, self.stiffness, 2.0 * swing);
        let end = solver.settle(&piece, [1e-9 * swing * self.length, 160.0 / swing]);
        let tip = mean_at(&piece.lamina, &end, self.edges) / self.length;
        Bent {
            tip: [-tip.z, tip.x],
            v_rms: end.v_rms(),
        }
    }
}

/// Bending stiffness [N m] that a strip of `length` [m] shows by the drop of its tip: that of the
/// elastica which sinks as far.
pub fn stiffness_shown(drop: f64, length: f64) -> f64 {
    let falls_short = |gamma: f64| truth::along(&truth::elastica(gamma.exp()), 1.0)[1] < drop;
    let [low, _] = truth::halved([1e-3f64.ln(), 1e4f64.ln()], 40, falls_short);
    AREAL_MASS * GRAVITY * length.powi(3) / low.exp()
}
