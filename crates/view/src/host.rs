use std::sync::Arc;

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::scene::{Fabric, Scene, SceneConfig};
use drape_cloth::sim::Snapshot;
use drape_cloth::tool::ToolConfig;
use drape_task::env::{Draping, EnvConfig};
use drape_task::recording::Recording;
use serde_json::Value;

use super::moment::Rival;

/// A scene and the task on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    pub scene: SceneConfig,
    pub env: EnvConfig,
}

/// Another tool or material that a page may choose, by its name.
#[derive(Clone, Debug)]
pub enum Offer {
    Tool(String, ToolConfig),
    Material(String, Fabric),
}

/// Is told, while a blank falls, the scene without its initial state, the share that is done, and how to get at the
/// cloth.
pub type Watch<'a> = &'a mut dyn FnMut(&Scene, f64, &dyn Fn() -> Snapshot);

/// Whoever runs a session: what it knows of runs, policies and files.
pub trait Host {
    /// Why a scene cannot be set up or nothing can be written.
    type Error: ToString;

    /// The error of a value that is out of range.
    fn refuse(&self, error: ValueError) -> Self::Error;

    /// Lets the blank of a scene fall.
    fn set_up(&mut self, spec: &Spec, watch: Watch) -> Result<Arc<Scene>, Self::Error>;

    /// The probability of each allowed press, by action; none if there is no policy for this task.
    fn advise(&self, draping: &Draping) -> Option<Vec<f32>>;

    /// What others come to in this task. Called on a thread of its own.
    fn rivals(&self, scene: &Arc<Scene>, spec: &Spec) -> Box<dyn FnOnce() -> Vec<Rival> + Send>;

    /// Writes presses as a recording and as a sequence, beside their task. Gives the names.
    fn save_presses(
        &mut self,
        of: (&Spec, &Lamina),
        made: &Recording,
    ) -> Result<Vec<String>, Self::Error>;

    /// Writes a task that can be trained. Gives its name.
    fn save_task(&mut self, spec: &Spec) -> Result<String, Self::Error>;

    /// Curves of trainings, as they are now: a list of objects with `name` and lists of [step, value] a curve.
    fn curves(&self) -> Value;

    /// What is shown beside the presses, step by step.
    fn beside(&self) -> Option<&Recording>;

    /// Tools and materials to choose from.
    fn offers(&self) -> &[Offer];
}
