use super::model::Model;
use super::press::Press;
use super::state::Snapshot;
use super::stepping::Control;
use crate::tool::Tool;

/// Environments of the same model that move in lockstep on the CPU.
pub(super) trait Group: Send + Sync {
    /// Number of environments.
    fn lanes(&self) -> usize;

    /// Sets the cloth of one lane.
    fn load(&mut self, lane: usize, snapshot: &Snapshot);

    /// Writes the cloth of one lane, exactly.
    fn save(&self, lane: usize, snapshot: &mut Snapshot);

    /// Position of a vertex [m].
    fn position(&self, lane: usize, vertex: u32) -> [f64; 3];

    /// Puts a vertex `at` a place [m].
    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]);

    /// Stops a vertex where it is, for good.
    fn fix(&mut self, lane: usize, vertex: u32);

    /// Moves all lanes by one control step; plates count their environments from the first lane.
    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, plates: &[Press]);

    /// Whether every position of a lane is a number within 100 m of the origin, lane by lane.
    fn finite(&self) -> Vec<bool>;

    /// Distance of some vertices to the tool [m], negative inside, [vertex][lane]. A lane's are
    /// the same bits in any company.
    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64>;
}
