//! What a device has to do: whole presses in many environments, and what tasks ask after them.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::model::Model;
use super::observations::{Column, Observations};
use super::parameters::Own;
use super::press::Press;
use super::state::Snapshot;
use super::stencil::Stencil;
use super::stepping::Control;
use super::view::View;
use crate::fabric::Lamina;
use crate::measure::Measures;
use crate::tool::Tool;

/// What a backend is given once: all that its environments share, and what they choose from by
/// what they have of their [`Own`].
#[derive(Clone)]
pub struct World {
    /// Topology, laws and stages.
    pub model: Arc<Model>,
    pub tools: Vec<Arc<Tool>>,
    /// States after a reset.
    pub starts: Vec<Arc<Snapshot>>,
    /// The blank that is pressed and how; none where nobody presses.
    pub presses: Option<(Arc<Lamina>, Stencil)>,
    /// What is seen and measured, in images of the same size; none where nobody looks.
    pub views: Vec<Arc<View>>,
}

impl World {
    /// A world without presses that starts at rest with every vertex in the origin: load a state
    /// before the first step.
    pub fn new(model: impl Into<Arc<Model>>, tool: impl Into<Arc<Tool>>) -> Self {
        let model = model.into();
        let origin = vec![[0.0; 3]; model.vertex_count()];
        Self {
            model,
            tools: vec![tool.into()],
            starts: vec![Snapshot::at_rest(origin).into()],
            presses: None,
            views: Vec::new(),
        }
    }

    /// The blank that is pressed, and how.
    pub(super) fn pressed(&self) -> &(Arc<Lamina>, Stencil) {
        self.presses.as_ref().expect("a world with presses")
    }

    /// Whether `state` is one of this world: of its size, finite, of parts and parameters that it has.
    pub fn fits(&self, state: &Snapshot) -> bool {
        let own = &state.own;
        let has = |number: u16, count: usize| usize::from(number) < count.max(1);
        has(own.tool, self.tools.len())
            && has(own.start, self.starts.len())
            && has(own.view, self.views.len())
            && own.parameters.check().is_ok()
            && self.model.fits(state)
    }
}

/// What is found after presses in all environments.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Observed {
    pub seen: Observations,
    /// Whether every position is a number within 100 m of the origin `[environment]`.
    pub finite: Vec<bool>,
    /// How many vertices of its view are left to be pressed `[environment]`, see [`Mask`](super::Mask).
    pub left: Vec<usize>,
}

impl Observed {
    /// All of some, one after the other.
    ///
    /// # Panics
    /// If there is none.
    pub fn joined(mut all: Vec<Self>) -> Self {
        if all.len() == 1 {
            return all.remove(0);
        }
        Self {
            finite: all.iter().flat_map(|one| &one.finite).copied().collect(),
            left: all.iter().flat_map(|one| &one.left).copied().collect(),
            seen: Observations::joined(all.into_iter().map(|one| one.seen).collect()),
        }
    }
}

/// N environments of one [`World`] on a device. Nobody outside reads or writes them vertex by
/// vertex; an environment's result does not depend on its neighbours.
pub trait Backend: Send + Sync {
    /// Number of environments, > 0.
    fn count(&self) -> usize;

    /// Sets one environment, with what it has of its own.
    fn load(&mut self, environment: usize, snapshot: &Snapshot);

    /// Puts one environment to its start, with something of its own that fits the world.
    fn reset(&mut self, environment: usize, own: &Own);

    /// One environment, exactly.
    fn snapshot(&self, environment: usize) -> Snapshot;

    /// Moves all environments by one control step, with at most one press in each.
    fn step(&mut self, control: &Control, presses: &[Press]);

    /// Presses the stencil on a vertex of every environment and lets it settle; where there is
    /// no vertex, time passes all the same. What lay under the stencil is touched, and draped
    /// where it stays on the tool: see [`Stencil`]. Gives where these vertices were, or the origin,
    /// `[environment, xyz]` [m].
    ///
    /// # Panics
    /// If there is not one entry an environment, or the world has no presses.
    fn press(&mut self, vertices: &[Option<u32>]) -> Column<f64>;

    /// Whether every position of an environment is a number within 100 m of the origin.
    fn finite(&self) -> Vec<bool>;

    /// What is seen of all environments.
    ///
    /// # Panics
    /// If the world has no presses or no views.
    fn observe(&self) -> Observed;

    /// Measures some environments, ascending, in their views.
    ///
    /// # Panics
    /// If the world has no presses or no views.
    fn measure(&self, environments: &[usize]) -> Vec<Measures>;
}
