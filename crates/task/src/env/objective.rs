use drape_cloth::scene::{Scene, surplus};
use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

/// What presses are to bring down, in the focus region [m].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The sum of its vertices' distances to the tool, as in the paper. Cloth that is crushed on
    /// the tool counts as well laid.
    Distance,
    /// The mean distance of its vertices and the mean surplus of its yarns (see
    /// [`surplus`]): what stands off the tool and what is crushed on it.
    #[default]
    Surplus,
}

impl Objective {
    /// What a state leaves to bring down [m].
    pub fn of(self, scene: &Scene, region: &FixedBitSet, position: &[[f64; 3]]) -> f64 {
        let Scene { lamina, tool, .. } = scene;
        let distance = |v: usize| tool.distance(position[v]).0.max(0.0);
        let sum: f64 = region.ones().map(distance).sum();
        match self {
            Self::Distance => sum,
            Self::Surplus => {
                sum / region.count_ones(..) as f64 + surplus(lamina, tool, position, region)
            }
        }
    }
}
