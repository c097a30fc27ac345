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
