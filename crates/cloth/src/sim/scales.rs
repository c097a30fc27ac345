//! Factors on the laws of a model, in the lanes of a group: what its environments differ by.

use super::line::{Direction, LineLaw};
use super::parameters::Parameters;
use crate::math::{Lanes, Real};

/// 1 in the lanes whose environment has no factor of its own.
pub(super) struct Scales<V> {
    /// On compliances in tension and compression of warps and of wefts, and of shear either way.
    pub compliance: [[V; 2]; 3],
    /// On the bending stiffness of warps and of wefts.
    pub bending: [V; 2],
    /// On the compliance of hinges, which bend as both do on average.
    pub hinge: V,
    /// On static and dynamic friction.
    pub friction: [V; 2],
    /// Whether any compliance or bending differs. What is projected constraint by constraint is scaled
    /// only then: along lines that costs nothing.
    pub vary: bool,
}

impl<V: Lanes> Scales<V> {
    pub fn new() -> Self {
        let one = V::of(1.0);
        Self {
            compliance: [[one; 2]; 3],
            bending: [one; 2],
            hinge: one,
            friction: [one; 2],
            vary: false,
        }
    }

    /// Sets those of one lane, or of all; `bending` is the stiffness of warps and of wefts [N m].
    pub fn set(
        &mut self,
        lanes: impl Iterator<Item = usize>,
        [warp, weft]: [f64; 2],
        own: &Parameters,
    ) {
        let both = own.bending[0] * warp + own.bending[1] * weft;
        let hinge = match both > 0.0 {
            true => (warp + weft) / both,
            false => 1.0,
        };
        for lane in lanes {
            for k in 0..2 {
                let [pulled, pushed] = [own.tension[k], own.compression[k]];
                self.compliance[k][0].set(lane, 1.0 / pulled);
                self.compliance[k][1].set(lane, 1.0 / pushed);
                self.compliance[2][k].set(lane, 1.0 / own.shear[k]);
                self.bending[k].set(lane, own.bending[k]);
                self.friction[k].set(lane, own.friction[k]);
            }
            self.hinge.set(lane, hinge);
        }
        let all = self.compliance.iter().flatten().chain(&self.bending);
        let mut factors = all.flat_map(|factor| factor.as_slice());
        self.vary = factors.any(|factor| factor.to_f64() != 1.0);
    }

    /// The law of a line, with these factors.
    #[inline(always)]
    pub fn of_line(&self, direction: Direction, law: LineLaw<V>) -> LineLaw<V> {
        let [pulled, pushed] = self.compliance[direction as usize];
        let [tension, compression] = law.compliance;
        let bending = match direction {
            Direction::Warp => self.bending[0],
            Direction::Weft => self.bending[1],
            Direction::Diagonal => V::of(1.0),
        };
        LineLaw {
            compliance: [tension * pulled, compression * pushed],
            min_warm: law.min_warm * bending,
            // It begins at the same strain.
            limit: match law.limit {
                Some([force, compliance, offset]) => {
                    Some([force / pulled, compliance * pulled, offset])
                }
                None => None,
            },
            bending: match law.bending {
                Some(stiffness) => Some(stiffness * bending),
                None => None,
            },
            ..law
        }
    }

    /// Factors on compliances in a direction, where environments differ.
    #[inline(always)]
    pub fn on_compliance(scales: Option<&Self>, direction: usize) -> Option<[V; 2]> {
        match scales {
            Some(scales) => Some(scales.compliance[direction]),
            None => None,
        }
    }
}
