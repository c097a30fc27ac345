use std::sync::Arc;

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::scene::{Fabric, Scene, SceneConfig};
use drape_cloth::sim::Snapshot;
use drape_cloth::tool::ToolConfig;
use drape_task::env::{Draping, EnvConfig};
use drape_task::path::PressedPoint;
use drape_task::recording::{RecordedFrame, Recording};
use serde::Serialize;
use serde_json::Value;

use super::robot::{RobotJob, RobotPlace};

/// A scene and the task on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    pub scene: SceneConfig,
    pub env: EnvConfig,
}

/// Other tools and materials that a page may choose, by their names.
#[derive(Clone, Debug, Default)]
pub struct Offers {
    pub tools: Vec<(String, ToolConfig)>,
    pub materials: Vec<(String, Fabric)>,
}

/// What others have come to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rival {
    pub name: String,
    pub score: f64,
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

    /// Lets the blank of a scene fall. Tells what is odd about it.
    fn set_up(
        &mut self,
        spec: &Spec,
        watch: Watch,
    ) -> Result<(Arc<Scene>, Vec<String>), Self::Error>;

    /// The probability of each allowed press, by action; none if there is no policy for this task.
    fn advise(&self, draping: &Draping) -> Option<Vec<f32>>;

    /// What others come to in this task. Called on a thread of its own.
    fn rivals(&self, draping: &Draping) -> Box<dyn FnOnce() -> Vec<Rival> + Send>;

    /// Writes presses on a blank as a recording and as a sequence, beside their task. Gives the names.
    fn save_presses(
        &mut self,
        spec: &Spec,
        lamina: &Lamina,
        made: &Recording,
    ) -> Result<Vec<String>, Self::Error>;

    /// Writes a task that can be trained. Gives its name.
    fn save_task(&mut self, spec: &Spec) -> Result<String, Self::Error>;

    /// Curves of trainings, as they are now: a list of objects with `name` and lists of [step, value] a curve.
    fn curves(&self) -> Value;

    /// Vertices to go through: of a recording, or of the best path that a run has found so far.
    fn path(&mut self, draping: &Draping) -> Result<Vec<u32>, Self::Error>;

    /// What is shown beside them at first, step by step.
    fn beside(&self, draping: &Draping) -> Vec<RecordedFrame>;

    /// Whether a robot is shown before anybody asks for it.
    fn has_robot(&self) -> bool;

    /// How a robot makes these presses, where it stands or there; whether it moves if it is to `plan`, or else only what it
    /// reaches.
    fn robot(
        &self,
        draping: &Draping,
        points: &[PressedPoint],
        place: Option<RobotPlace>,
        plan: bool,
    ) -> RobotJob;

    /// Tools and materials to choose from.
    fn offers(&self) -> &Offers;
}
