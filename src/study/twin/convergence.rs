//! The twin against itself: half the time step, and every second vertex.

use serde::Serialize;

use super::{Case, Ran, TwinStudyError, fallen, twin_config};
use crate::reference::TwinConfig;
use crate::scene::{Scene, SceneConfig, SceneError};
use crate::study::points::{coarser, deviation, same_points, summed};

/// How far a variant of the twin ends from the twin, between the same material points.
#[derive(Clone, Debug, Serialize)]
pub struct Variant {
    /// `half_step` or `twice_the_cell`.
    pub name: &'static str,
    pub vertices: usize,
    /// Mean and greatest after the fall [mm].
    pub initial_mm: [f64; 2],
    /// Summed distance to the tool of these points after the fall, and the twin's of them [m].
    pub initial_distance_m: [f64; 2],
    /// Mean and greatest after the presses [mm]; none on another mesh, where the same presses act
    /// on other patches.
    pub draped_mm: Option<[f64; 2]>,
    /// Summed distance of the region after them, and the twin's [m].
    pub left_m: Option<[f64; 2]>,
}

impl Case<'_> {
    /// Computes variants of `twin`, which is this case's baseline: with half the time step, and,
    /// for a plain rectangle with an even number of cells, the fall with cells twice as wide.
    pub fn converge(&self, twin: &Ran) -> Result<Vec<Variant>, TwinStudyError> {
        let config = twin_config(&self.scene.config)?;
        let finer = TwinConfig {
            safety: 0.5 * config.safety,
            ..config.clone()
        };
        let all: Vec<[usize; 2]> = (0..twin.initial.len()).map(|v| [v, v]).collect();
        let half = self.twin("half_step", &finer)?;
        let tool = &self.scene.tool;
        let apart = |ran: &Ran| {
            let draped = deviation(&ran.end, &twin.end, &all);
            [deviation(&ran.initial, &twin.initial, &all), draped]
        };
        let [initial_mm, draped_mm] = apart(&half);
        let mut variants = vec![Variant {
            name: half.name,
            vertices: all.len(),
            initial_mm,
            initial_distance_m: [&half.initial, &twin.initial].map(|x| summed(tool, x, &all, 0)),
            draped_mm: Some(draped_mm),
            left_m: Some([half.region_left_m, twin.region_left_m]),
        }];
        if let Some(vertices) = coarser(&self.scene.config) {
            let mut config = self.scene.config.clone();
            config.blank.vertices = vertices;
            let coarse = unfallen(&config)?;
            let positions = fallen(&coarse, &twin_config(&config)?)?.positions();
            let pairs = same_points(&coarse.lamina.rest, &self.scene.lamina.rest);
            variants.push(Variant {
                name: "twice_the_cell",
                vertices: positions.len(),
                initial_mm: deviation(&positions, &twin.initial, &pairs),
                initial_distance_m: [
                    summed(tool, &positions, &pairs, 0),
                    summed(tool, &twin.initial, &pairs, 1),
                ],
                draped_mm: None,
                left_m: None,
            });
        }
        Ok(variants)
    }
}

/// A scene before its fall, with the durations of the fall, for [`fallen`].
pub fn unfallen(config: &SceneConfig) -> Result<Scene, SceneError> {
    let mut hung = config.clone();
    (hung.fall.fall_s, hung.fall.settle_s) = (0.0, 0.0);
    let mut hung = Scene::new(&hung, |_| ())?;
    hung.config = config.clone();
    Ok(hung)
}
