use std::fmt;
use std::sync::Arc;

use super::{PressedPoint, Rolling};

/// What a robot can press.
pub trait Feasibility: Send + Sync {
    /// Whether it can press a point of the tool at all, in the scene.
    fn allows(&self, point: &PressedPoint) -> bool;

    /// How many points of a path it cannot press as they are joined to strokes.
    fn infeasible(&self, path: &[PressedPoint], rolling: Rolling) -> usize;
}

/// Who presses: a robot that cannot do everything, or nobody in particular.
#[derive(Clone, Default)]
pub struct Robot(pub Option<Arc<dyn Feasibility>>);

impl PartialEq for Robot {
    /// Whether it is the same one.
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }
}

impl fmt::Debug for Robot {
    fn fmt(&self, to: &mut fmt::Formatter) -> fmt::Result {
        to.write_str(if self.0.is_some() {
            "Robot(Some)"
        } else {
            "Robot(None)"
        })
    }
}
