//! The twin against itself: half the time step, a start that is pushed, and every second vertex.

use serde::Serialize;

use super::{Case, Ran, TwinStudyError, fallen, twin_config, unfallen};
use crate::points::{apart_mm, coarser, distance, same_points};
use drape_cloth::twin::TwinConfig;

/// How far the start is pushed [m]: far less than half the step moves it.
const PUSH: f64 = 1e-6;

/// How far a variant of the twin ends from the twin, between the same material points.
#[derive(Clone, Debug, Serialize)]
pub struct SelfComparison {
    /// `half_step`, `pushed_start` or `twice_the_cell`.
    pub name: &'static str,
    /// Of the variant's mesh.
    pub vertices: usize,
    /// The variant's largest stable time step before the presses, times its safety [s].
    pub time_step_s: f64,
    /// Mean and greatest distance after the fall [mm].
    pub initial_mm: [f64; 2],
    /// Summed distance to the tool of the shared points after the fall: the variant's, the
    /// twin's [m].
    pub initial_distance_m: [f64; 2],
    /// Mean and greatest distance after the presses [mm]; none on another mesh, where the same
    /// presses act on other patches.
    pub draped_mm: Option<[f64; 2]>,
    /// Summed distance of the region after them: the variant's, the twin's [m].
    pub left_m: Option<[f64; 2]>,
}

impl Case<'_> {
    /// Holds variants against `twin`, this case's baseline, each on a thread: half the time step
    /// throughout; presses from a start pushed by a micrometre; and, for a plain rectangle with
    /// even numbers of cells, the fall with cells twice as wide.
    ///
    /// # Errors
    /// If a variant diverges.
    pub fn converge(&self, twin: &Ran) -> Result<Vec<SelfComparison>, TwinStudyError> {
        let config = twin_config(&self.scene.config)?;
        let finer = TwinConfig {
            safety: 0.5 * config.safety,
            ..config.clone()
        };
        std::thread::scope(|scope| {
            let half = scope.spawn(|| self.twin("half_step", &finer, 0.0, |_| ()));
            let pushed = scope.spawn(|| self.twin("pushed_start", &config, PUSH, |_| ()));
            let coarse = self.coarser_fall(twin);
            let mut found = Vec::new();
            for ran in [half, pushed] {
                let ran = ran.join().expect("the twin does not panic")?;
                found.push(self.same_mesh(&ran, twin));
            }
            found.extend(coarse?);
            Ok(found)
        })
    }

    fn same_mesh(&self, ran: &Ran, twin: &Ran) -> SelfComparison {
        let all: Vec<[usize; 2]> = (0..twin.initial.len()).map(|v| [v, v]).collect();
        let fallen = |ran: &Ran| distance(&self.scene.tool, 0..all.len(), &ran.initial);
        SelfComparison {
            name: ran.name,
            vertices: all.len(),
            time_step_s: ran.time_step_s,
            initial_mm: apart_mm(&ran.initial, &twin.initial, &all),
            initial_distance_m: [ran, twin].map(fallen),
            draped_mm: Some(apart_mm(&ran.end, &twin.end, &all)),
            left_m: Some([ran.region_left_m, twin.region_left_m]),
        }
    }

    fn coarser_fall(&self, twin: &Ran) -> Result<Option<SelfComparison>, TwinStudyError> {
        let Some(vertices) = coarser(&self.scene.config) else {
            return Ok(None);
        };
        let mut config = self.scene.config.clone();
        config.blank.vertices = vertices;
        let coarse = unfallen(&config)?;
        let settled = fallen(&coarse, &twin_config(&config)?)?;
        let x = settled.positions();
        let pairs = same_points(&coarse.lamina.rest, &self.scene.lamina.rest);
        let tool = &self.scene.tool;
        let side = |side: usize| pairs.iter().map(move |pair| pair[side]);
        Ok(Some(SelfComparison {
            name: "twice_the_cell",
            vertices: x.len(),
            time_step_s: settled.stable_time_step(),
            initial_mm: apart_mm(&x, &twin.initial, &pairs),
            initial_distance_m: [
                distance(tool, side(0), &x),
                distance(tool, side(1), &twin.initial),
            ],
            draped_mm: None,
            left_m: None,
        }))
    }
}
