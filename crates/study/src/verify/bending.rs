//! Bending: the heavy elastica.

use super::solve::{Piece, Solve};
use crate::cloth::{AREAL_MASS, GRAVITY, fix, mean_at, placed, rigid, strip, yarns_alone};
use crate::truth;
use drape_cloth::fabric::{Family, Material};
use drape_cloth::sim::{Bending, BendingStiffness, PhysicsConfig};

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
#[derive(Clone, Copy, Debug)]
pub struct Cantilever {
    pub family: Family,
    pub bending: Bending,
    /// Bending stiffness per width [N m].
    pub stiffness: f64,
    /// Free length [m].
    pub length: f64,
    /// Edges, the clamped one among them.
    pub edges: usize,
}

/// Where a cantilever comes to rest.
#[derive(Clone, Debug)]
pub struct Bent {
    /// Reach and drop of every cross-section from the clamp on, over the free length.
    pub profile: Vec<[f64; 2]>,
    pub v_rms: f64,
}

impl Bent {
    /// Drop and reach of the tip over the length.
    pub fn tip(&self) -> [f64; 2] {
        let [reach, drop] = self.profile[self.profile.len() - 1];
        [drop, reach]
    }
}

impl Cantilever {
    /// A strip of 0.2 m along the warp whose stiffness makes its number `gamma`.
    pub fn of(gamma: f64, edges: usize) -> Self {
        let length = 0.2f64;
        Self {
            family: Family::Warp,
            bending: Bending::Yarns,
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
            bending: Bending::Yarns,
            stiffness,
            length: (gamma * stiffness / (AREAL_MASS * GRAVITY)).cbrt(),
            edges,
        }
    }

    /// Lets the strip sink until it is still.
    ///
    /// The first edge is the clamp: bending begins where the curvature of its second vertex
    /// does, half an edge from either end, so the free length counts from the middle of that
    /// edge. Yarns resist compression as tension: the elastica keeps its length.
    pub fn sink(&self, solver: &dyn Solve) -> Bent {
        let edge = self.length / (self.edges as f64 - 0.5);
        let strip = rigid(strip(self.family, edge * self.edges as f64, self.edges));
        let mut state = placed(&strip, |s, t| [s - 0.5 * edge, t, 0.0]);
        fix(&strip, &mut state, &[0, 1]);
        // Near the critical damping of the swing of a hanging strip.
        let swing = (GRAVITY / self.length).sqrt();
        let physics = PhysicsConfig {
            bending: self.bending,
            bending_stiffness: BendingStiffness::NewtonMetre(self.stiffness),
            damping: 2.0 * swing,
            ..yarns_alone()
        };
        let piece = &Piece::new(&strip, physics);
        let end = solver.settle(piece, &state, [1e-9 * swing * self.length, 160.0 / swing]);
        let profile = (1..=self.edges).map(|k| {
            let x = mean_at(&strip, &end, k) / self.length;
            [x.x, -x.z]
        });
        Bent {
            profile: profile.collect(),
            v_rms: end.v_rms(),
        }
    }
}

/// Bending stiffness [N m] that a strip of `length` [m] shows by the drop of its tip: that of the
/// elastica which sinks as far.
pub fn stiffness_shown(drop: f64, length: f64) -> f64 {
    let (mut low, mut high) = (1e-3f64.ln(), 1e4f64.ln());
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if truth::along(&truth::elastica(middle.exp()), 1.0)[1] < drop {
            low = middle;
        } else {
            high = middle;
        }
    }
    AREAL_MASS * GRAVITY * length.powi(3) / low.exp()
}

/// Profile of the elastica, reach and drop over the length, for a curve.
pub fn elastica(gamma: f64) -> Vec<[f64; 2]> {
    let shape = truth::elastica(gamma);
    (0..=100)
        .map(|k| truth::along(&shape, f64::from(k) / 100.0))
        .collect()
}
