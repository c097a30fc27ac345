use rayon::prelude::*;

use super::rules::Task;
use super::task::Observation;
use drape_cloth::sim::Backend;

#[cfg(feature = "gpu")]
use super::look::{Look, Sight};
#[cfg(feature = "gpu")]
use std::sync::OnceLock;

/// What all environments of a task show.
pub(super) enum Views {
    Host {
        now: Vec<Observation>,
        /// Of each environment before it was reset last.
        last: Vec<Option<Observation>>,
    },
    #[cfg(feature = "gpu")]
    Gpu(Box<OnGpu>),
}

/// What they show where their cloth is on a GPU. The host looks only when it is asked.
#[cfg(feature = "gpu")]
pub(super) struct OnGpu {
    look: Look,
    now: OnceLock<Sight>,
    /// After the last step, before any environment was reset.
    last: Option<Sight>,
    /// The same on the host.
    now_read: OnceLock<Vec<Observation>>,
    last_read: OnceLock<Vec<Observation>>,
}

/// How an environment is after a press.
#[derive(Clone, Copy)]
pub(super) struct After {
    pub finite: bool,
    /// Every vertex of the region has been under the stencil.
    pub is_over: bool,
}

impl Views {
    /// Of environments that are all at their start.
    pub fn new(task: &Task, cloth: &dyn Backend) -> Self {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = cloth.on_gpu() {
            return Self::Gpu(Box::new(OnGpu {
                look: Look::new(task, gpu),
                now: OnceLock::new(),
                last: None,
                now_read: OnceLock::new(),
                last_read: OnceLock::new(),
            }));
        }
        Self::Host {
            now: vec![task.observation.clone(); cloth.count()],
            last: vec![None; cloth.count()],
        }
    }

    /// What one environment shows.
    pub fn now(&self, index: usize, task: &Task, cloth: &dyn Backend) -> &Observation {
        #[cfg(not(feature = "gpu"))]
        let _ = (task, cloth);
        match self {
            Self::Host { now, .. } => &now[index],
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => {
                let read = || views.now(task, cloth).read(there(cloth));
                &views.now_read.get_or_init(read)[index]
            }
        }
    }

    /// What one environment showed before it was reset last.
    ///
    /// # Panics
    /// If no step has ended an episode there. On a GPU it is what was shown after the last step, if there was one.
    pub fn last(&self, index: usize, cloth: &dyn Backend) -> &Observation {
        #[cfg(not(feature = "gpu"))]
        let _ = cloth;
        match self {
            Self::Host { last, .. } => last[index].as_ref().expect("an episode has ended"),
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => {
                let last = views.last.as_ref().expect("an episode has ended");
                &views.last_read.get_or_init(|| last.read(there(cloth)))[index]
            }
        }
    }

    /// Panics unless every action is allowed; on a GPU only if the host has looked.
    pub fn check(&self, actions: &[u32]) {
        let seen = match self {
            Self::Host { now, .. } => Some(now),
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => views.now_read.get(),
        };
        for (seen, &action) in seen.into_iter().flatten().zip(actions) {
            let allowed = seen.mask.contains(action as usize);
            assert!(allowed, "action {action} is masked out");
        }
    }

    /// Lets all show what they show now, whatever happens to the cloth.
    pub fn keep(&self, task: &Task, cloth: &dyn Backend) {
        #[cfg(not(feature = "gpu"))]
        let _ = (task, cloth);
        match self {
            Self::Host { .. } => {}
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => _ = views.now(task, cloth),
        }
    }

    /// Numbers the scene that all show.
    pub fn set_scene(&mut self, scene: u16) {
        match self {
            Self::Host { now, .. } => now.iter_mut().for_each(|now| now.scene = scene),
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => views.forget(),
        }
    }

    /// Looks at all environments after a press. One that is not finite still shows what it showed, but on a GPU,
    /// where nobody looks at it before it is reset.
    pub fn look(&mut self, task: &Task, cloth: &dyn Backend) -> Vec<After> {
        match self {
            Self::Host { now, .. } => {
                let finite = cloth.finite();
                let distances = cloth.distances(&task.seen);
                let distances = distances.par_chunks(task.seen.len());
                let pressed = cloth.pressed();
                let all = now.par_iter_mut().zip(distances).zip(pressed);
                let seen = all
                    .zip(&finite)
                    .map(|(((now, distance), pressed), &finite)| {
                        if finite {
                            *now = task.observe(pressed, distance);
                        }
                        After {
                            finite,
                            is_over: task.is_over(pressed),
                        }
                    });
                seen.collect()
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => {
                let gpu = there(cloth);
                let diverged = gpu.diverged();
                let (sight, untouched) = views.look.at(gpu, cloth.count(), task.scene_index);
                views.last = Some(sight.clone());
                views.last_read = OnceLock::new();
                views.forget();
                views.now = OnceLock::from(sight);
                let all = gpu.read(&[&diverged, &untouched]);
                let is_zero = |bytes: &[u8; 4]| u32::from_le_bytes(*bytes) == 0;
                let [finite, over] = [0, 1].map(|k| all[k].as_chunks().0.iter().map(is_zero));
                let after = |(finite, is_over)| After { finite, is_over };
                finite.zip(over).map(after).collect()
            }
        }
    }

    /// One environment goes on from elsewhere, where it showed `from`; keeps what it showed in the end if
    /// its episode `ended`.
    pub fn change(&mut self, index: usize, from: &Observation, ended: bool) {
        match self {
            Self::Host { now, last } => {
                let before = std::mem::replace(&mut now[index], from.clone());
                if ended {
                    last[index] = Some(before);
                }
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(views) => views.forget(),
        }
    }

    /// What all show, and what they showed after the last step before any was reset, where this is on a GPU.
    #[cfg(feature = "gpu")]
    pub fn sights(&self, task: &Task, cloth: &dyn Backend) -> Option<[Sight; 2]> {
        match self {
            Self::Host { .. } => None,
            Self::Gpu(views) => {
                let now = views.now(task, cloth);
                Some([now, views.last.as_ref().unwrap_or(now)].map(Sight::clone))
            }
        }
    }
}

#[cfg(feature = "gpu")]
impl OnGpu {
    fn now(&self, task: &Task, cloth: &dyn Backend) -> &Sight {
        let look = || {
            self.look
                .at(there(cloth), cloth.count(), task.scene_index)
                .0
        };
        self.now.get_or_init(look)
    }

    fn forget(&mut self) {
        self.now = OnceLock::new();
        self.now_read = OnceLock::new();
    }
}

#[cfg(feature = "gpu")]
fn there(cloth: &dyn Backend) -> &drape_cloth::sim::Gpu {
    cloth.on_gpu().expect("cloth stays where it is")
}
