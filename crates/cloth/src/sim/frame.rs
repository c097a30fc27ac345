use super::physics::PhysicsConfig;
use super::scales::Scales;
use super::stepping::Control;
use crate::math::Lanes;

/// What is the same for all vertices in a substep.
pub(super) struct Frame<V> {
    /// Duration [s].
    pub h: f64,
    /// Motion under gravity in it [m].
    pub fall: f64,
    /// v = rate (x - p) [1/s].
    pub rate: f64,
    /// Largest speed [m/s], 0 for none.
    pub speed_cap: f64,
    /// Static and dynamic coefficient.
    pub friction: Option<[V; 2]>,
}

impl<V: Lanes> Frame<V> {
    /// Of the substeps of a control step, where the model has this friction.
    #[inline(always)]
    pub fn new(
        physics: &PhysicsConfig,
        friction: Option<[f64; 2]>,
        scales: &Scales<V>,
        control: &Control,
    ) -> Self {
        let h = control.dt / control.substeps as f64;
        let [stick, slide] = scales.friction;
        Self {
            h,
            fall: -h * h * physics.gravity,
            rate: 1.0 / h / (1.0 + h * physics.damping),
            speed_cap: physics.speed_cap,
            friction: match friction {
                Some(of_model) => Some([V::of(of_model[0]) * stick, V::of(of_model[1]) * slide]),
                None => None,
            },
        }
    }
}
