//! What a device has to do: whole presses in many environments.

use std::sync::Arc;

use super::model::Model;
use super::press::Press;
use super::state::{Pressed, Snapshot};
use super::stencil::Stencil;
use super::stepping::Control;
use crate::fabric::Lamina;
use crate::tool::Tool;

/// What a backend is given once: all that is the same for its environments.
#[derive(Clone)]
pub struct World {
    pub model: Arc<Model>,
    pub tool: Arc<Tool>,
    /// The state after a reset.
    pub start: Arc<Snapshot>,
    /// The blank that is pressed and how; none where nobody presses.
    pub presses: Option<(Arc<Lamina>, Stencil)>,
}

impl World {
    /// A world without presses that starts at rest with every vertex in the origin: load a state
    /// before the first step.
    pub fn new(model: impl Into<Arc<Model>>, tool: impl Into<Arc<Tool>>) -> Self {
        let model = model.into();
        let origin = vec![[0.0; 3]; model.vertex_count()];
        Self {
            model,
            tool: tool.into(),
            start: Snapshot::at_rest(origin).into(),
            presses: None,
        }
    }
}

/// N environments of one [`World`] on a device. Nobody outside reads or writes them vertex by
/// vertex; an environment's result does not depend on its neighbours.
pub trait Backend: Send + Sync {
    /// Number of environments, > 0.
    fn count(&self) -> usize;

    /// Sets the state of one environment.
    fn load(&mut self, environment: usize, snapshot: &Snapshot);

    /// Puts one environment back to the start of the world.
    fn reset(&mut self, environment: usize);

    /// The state of one environment, exactly.
    fn snapshot(&self, environment: usize) -> Snapshot;

    /// Moves all environments by one control step, with at most one press in each.
    fn step(&mut self, control: &Control, presses: &[Press]);

    /// Presses the stencil on a vertex of every environment and lets it settle; where there is
    /// no vertex, time passes all the same. What lay under the stencil is touched, and draped
    /// where it stays on the tool: see [`Stencil`].
    ///
    /// # Panics
    /// If there is not one entry an environment, or the world has no presses.
    fn press(&mut self, vertices: &[Option<u32>]);

    /// Whether every position of an environment is a number within 100 m of the origin.
    fn finite(&self) -> Vec<bool>;

    /// Distance of some vertices to the tool [m], negative inside, [environment][vertex].
    fn distances(&self, vertices: &[u32]) -> Vec<f64>;

    /// What presses have done in each environment.
    fn pressed(&self) -> &[Pressed];

    /// These environments where a GPU has them, for kernels that look at them there.
    #[cfg(feature = "gpu")]
    fn on_gpu(&self) -> Option<&super::gpu::Gpu> {
        None
    }
}
