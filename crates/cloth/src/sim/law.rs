//! Force laws of edges: two or three straight branches.

use super::physics::{PhysicsConfig, Tension};
use crate::fabric::{Lamina, Yarn};
use crate::math::Lanes;

/// Where a line runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Warp,
    Weft,
    Diagonal,
}

/// Below this squared length [m^2] an edge has no direction, and nothing pulls along it.
pub(super) const MIN_SQUARE: f64 = 1e-20;

/// Compliance of an edge [m/N] for each sign of its strain.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeLaw {
    pub tension: f64,
    pub compression: f64,
}

impl EdgeLaw {
    /// The law of tensile and compressive stiffness [N/m].
    pub fn of_stiffness([tension, compression]: [f64; 2]) -> Self {
        Self {
            tension: 1.0 / tension,
            compression: 1.0 / compression,
        }
    }

    /// Compliance in tension and in compression, with the factors of environments that differ.
    #[inline(always)]
    pub fn in_lanes<V: Lanes>(&self, factors: Option<[V; 2]>) -> [V; 2] {
        let own = [V::of(self.tension), V::of(self.compression)];
        match factors {
            Some([pulled, pushed]) => [own[0] * pulled, own[1] * pushed],
            None => own,
        }
    }
}

/// The compliance of the sign of `c`, of those in tension and in compression.
#[inline(always)]
pub(super) fn branch<V: Lanes>([tension, compression]: [V; 2], c: V) -> V {
    V::select(c.lt(V::zero()), compression, tension)
}

/// Compliance of a yarn beyond the strain limit, as a share of that in tension. At the limit's
/// force times ten it adds a hundredth of the limit. 0 would make the system of a yarn between
/// clamps singular.
pub(super) const LIMITED: f64 = 1e-3;

/// The law of an edge beyond a tension, its strain limit or the knee of the material's law:
/// C = offset + compliance * force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// Tension at which it begins [N].
    pub force: f64,
    /// [m/N]
    pub compliance: f64,
    /// [m]; such that there the law is continuous.
    pub offset: f64,
}

impl Limit {
    /// Of an edge without one.
    pub const NONE: Self = Self {
        force: f64::INFINITY,
        compliance: 1.0,
        offset: 0.0,
    };

    /// Beyond a growth of an edge by `stretch` [m], `share` of the compliance that it has before.
    fn new(law: EdgeLaw, stretch: f64, share: f64) -> Self {
        Self {
            force: stretch / law.tension,
            compliance: share * law.tension,
            offset: stretch * (1.0 - share),
        }
    }

    /// Of the edges of a yarn, where the scene lists one. A strain limit takes the knee's place.
    pub fn of_yarn(
        law: EdgeLaw,
        lamina: &Lamina,
        physics: &PhysicsConfig,
        yarn: &Yarn,
    ) -> Option<Self> {
        if let Some(strain) = physics.strain_limit {
            return Some(Self::new(law, strain * yarn.rest_length, LIMITED));
        }
        match physics.tension {
            None | Some(Tension::FirstBranch) => None,
            Some(Tension::Material) => {
                let kinks = lamina.material.yarn(yarn.family).tension.kinks();
                let [strain, slope] = *kinks.first()?;
                Some(Self::new(law, strain * yarn.rest_length, 1.0 / slope))
            }
        }
    }
}
