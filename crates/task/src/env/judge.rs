use rayon::prelude::*;

use super::rules::Task;
use drape_cloth::sim::{Backend, Snapshot};

/// Judges how episodes have ended: where their cloth is, if that is a GPU.
pub(super) struct Judge {
    #[cfg(feature = "gpu")]
    region: Option<drape_cloth::sim::GpuRegion>,
}

/// How an episode has ended.
pub(super) struct Judged {
    /// What is left of the objective [m].
    pub left: f64,
    /// See [`Task::is_believable`].
    pub is_believable: bool,
    /// The cloth, where it was asked for.
    pub state: Option<Snapshot>,
}

impl Judge {
    pub fn new(task: &Task, cloth: &dyn Backend) -> Self {
        #[cfg(not(feature = "gpu"))]
        let _ = (task, cloth);
        Self {
            #[cfg(feature = "gpu")]
            region: (cloth.on_gpu())
                .map(|gpu| gpu.region(&task.scene.lamina, &task.region.vertices)),
        }
    }

    /// Judges some environments, which `keep` their states.
    pub fn judge(
        &self,
        task: &Task,
        cloth: &dyn Backend,
        ended: &[usize],
        keep: bool,
    ) -> Vec<Judged> {
        #[cfg(feature = "gpu")]
        if let (Some(gpu), Some(region)) = (cloth.on_gpu(), &self.region) {
            let measured = gpu.measured(region, ended).into_iter().zip(ended);
            let judged = measured.map(|(measured, &index)| Judged {
                left: task
                    .goal
                    .left_of([0, 1].map(|k| [measured.distance[k], measured.surplus[k]])),
                is_believable: task.can_be(measured.strain, measured.depth),
                state: keep.then(|| cloth.snapshot(index)),
            });
            return judged.collect();
        }
        let states: Vec<Snapshot> = ended.iter().map(|&index| cloth.snapshot(index)).collect();
        let judged = states.into_par_iter().map(|state| {
            let is_believable = task.is_believable(&state);
            Judged {
                left: if is_believable {
                    task.objective(&state)
                } else {
                    f64::NAN
                },
                is_believable,
                state: keep.then_some(state),
            }
        });
        judged.collect()
    }
}
