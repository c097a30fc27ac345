//! What a sheet is coloured by.

use drape_cloth::fabric::Drape;
use drape_cloth::measure::crushed;
use serde::Deserialize;

use super::stage::Stage;

/// A quantity of every vertex, in the unit that is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shade {
    /// Distance to the tool [mm].
    #[default]
    Distance,
    /// The greatest share of its length that a yarn there has too much [%].
    Surplus,
    /// By how much the angle between the yarns has closed [degrees].
    Shear,
    /// By how much the warp has turned, seen from above [degrees].
    Angle,
    /// Strain along the warp and along the weft [%].
    Warp,
    Weft,
    /// What has become of it: the marks tell.
    Progress,
    /// Probability that the policy presses there next [%].
    Policy,
}

impl Shade {
    /// The quantity `[vertex]` of a sheet `at` these places [m], for which a policy has this advice.
    pub fn values(self, stage: &Stage, at: &[[f64; 3]], advice: &[f32]) -> Vec<f32> {
        let (lamina, tool) = (&stage.scene.lamina, &stage.scene.tool);
        match self {
            Self::Distance => {
                let distance = |&x: &[f64; 3]| (1e3 * tool.distance(x).0.max(0.0)) as f32;
                at.iter().map(distance).collect()
            }
            Self::Surplus => {
                let shares = crushed(lamina, tool, at).into_iter();
                shares.map(|share| (1e2 * share) as f32).collect()
            }
            Self::Progress => vec![0.0; at.len()],
            Self::Policy => match advice.len() == at.len() {
                true => advice.iter().map(|p| 1e2 * p).collect(),
                false => vec![0.0; at.len()],
            },
            Self::Shear | Self::Angle | Self::Warp | Self::Weft => self.of_yarns(stage, at),
        }
    }

    /// The mean over the triangles at each vertex.
    fn of_yarns(self, stage: &Stage, at: &[[f64; 3]]) -> Vec<f32> {
        let lamina = &stage.scene.lamina;
        let drape = Drape::new(lamina, at);
        let [cos, sin] = lamina.warp;
        let mut sums = vec![[0.0; 2]; at.len()];
        for (t, corners) in lamina.triangles.iter().enumerate() {
            let tangents = drape.tangents(t);
            let warp = tangents.warp;
            let value = match self {
                Self::Warp => 1e2 * tangents.strain()[0],
                Self::Weft => 1e2 * tangents.strain()[1],
                Self::Angle => {
                    let turned = (cos * warp.y - sin * warp.x).atan2(cos * warp.x + sin * warp.y);
                    turned.to_degrees()
                }
                _ => tangents.shear().to_degrees(),
            };
            for &v in corners {
                sums[v as usize][0] += value;
                sums[v as usize][1] += 1.0;
            }
        }
        let mean = |[sum, count]: [f64; 2]| (sum / f64::max(count, 1.0)) as f32;
        sums.into_iter().map(mean).collect()
    }
}
