//! Bending: the heavy elastica.

use super::solve::Solve;
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

impl Cantilever {
    /// A strip of 0.2 m along the warp whose stiffness makes its number `gamma`.
    pub fn of(gamma: f64, edges: usize) -> Self {
        let length = 0.2f64;
        Self {
            family: Family::Warp,
            stiffness: AREAL_MASS * GRAVITY * length.powi(3) / gamma,
            length,
            edges,
        }
    }

    /// A strip with the stiffness of the built-in fabric, as long as makes its number `gamma`.
    pub fn of_fabric(family: Family, gamma: f64, edges: usize) -> Self {
        let stiffness = Material::interglas_92125().bending_stiffness(family);
        Self {
            family,
            stiffness,
            length: (gamma * stiffness / (AREAL_MASS * GRAVITY)).cbrt(),
            edges,
        }
    }

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
