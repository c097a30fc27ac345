use super::physics::PhysicsConfig;
use super::stepping::Control;

/// What is the same for all vertices in a substep.
pub(super) struct Frame {
    /// Duration [s].
    pub h: f64,
    /// Motion under gravity in it [m].
    pub fall: f64,
    /// v = rate (x - p) [1/s].
    pub rate: f64,
    /// Largest speed [m/s], 0 for none.
    pub speed_cap: f64,
    /// Static and dynamic coefficient.
    pub friction: Option<[f64; 2]>,
}

impl Frame {
    /// Of the substeps of a control step.
    pub fn new(physics: &PhysicsConfig, friction: Option<[f64; 2]>, control: &Control) -> Self {
        let h = control.dt / control.substeps as f64;
        Self {
            h,
            fall: -h * h * physics.gravity,
            rate: 1.0 / h / (1.0 + h * physics.damping),
            speed_cap: physics.speed_cap,
            friction,
        }
    }
}
