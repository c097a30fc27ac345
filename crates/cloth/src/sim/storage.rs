use super::cloth::Cloth;
use super::collision::Layers;
use super::line::{Along, Chain, Direction};
use super::lines::Lines;
use super::membrane::Element;
use super::model::Pass;
use crate::math::{Lanes, Vec3x};
use crate::tool::Tools;

/// Where the lanes of a [`Cloth`] come from: where an environment's numbers are, and what the loops
/// of the stages run over.
pub(super) trait Storage: Send + Sync {
    /// A number in every lane.
    type V: Lanes;
    /// A line in every lane.
    type Line: Chain<Self::V>;

    /// Number of environments.
    fn lanes(&self) -> usize;

    /// Place and lane of a vertex of environment `lane`.
    fn slot(&self, lane: usize, vertex: usize) -> [usize; 2];

    /// That of the force of a yarn edge.
    fn edge_slot(&self, lane: usize, edge: usize) -> [usize; 2];

    fn cloth(&self) -> &Cloth<Self::V>;

    fn cloth_mut(&mut self) -> &mut Cloth<Self::V>;

    /// Readies an environment for another state, whose layers lie on these sides of each other.
    fn clear(&mut self, lane: usize, sides: &[u64]);

    /// The sides on which layers of the cloth lie to each other, where they touch.
    fn sides(&self, _lane: usize) -> Vec<u64> {
        Vec::new()
    }

    /// Starts a control step.
    fn start(&mut self) {}

    /// Distance to the tool [m], negative inside, of vertices listed for each environment; or of the
    /// same in all, if there is one list. `[environment][vertex]`
    fn distances(&self, tools: &Tools<Self::V>, vertices: &[&[u32]]) -> Vec<Vec<f64>>;

    /// How many lines run in a direction.
    fn count(&self, lines: &Lines, direction: Direction) -> usize;

    /// Warp `i`, whose vertices lie in the cloth as they are.
    fn warp<'a>(
        &'a mut self,
        lines: &'a Lines,
        i: usize,
    ) -> (&'a Self::Line, &'a mut Cloth<Self::V>);

    /// Line `i` that crosses the warps, with its state; what is changed of it has to be
    /// [`Storage::put`] back.
    fn take<'a>(
        &'a mut self,
        lines: &'a Lines,
        direction: Direction,
        i: usize,
    ) -> Along<'a, Self::V, Self::Line>;

    /// Takes in where line `i`, which was taken last, has moved to.
    #[inline(always)]
    fn put(&mut self, _direction: Direction, _i: usize) {}

    /// Finds what [`Storage::weft_pull`] tells, as far as that is not at hand.
    #[inline(always)]
    fn warm_start(&mut self, _membranes: &[Vec<Element>]) {}

    /// What the forces of its weft and its membranes in the last substep pull at a vertex where it is
    /// predicted [N], and their stress, of edges the sum of |force density| [N/m].
    fn weft_pull(&self, lines: &Lines, place: usize) -> (Vec3x<Self::V>, Self::V);

    /// Projects constraints that are no lines, one after the other.
    #[inline(always)]
    fn project(&mut self, _passes: &[Pass]) {}

    /// Projects membranes along their yarns.
    #[inline(always)]
    fn stretch_membranes(&mut self, _membranes: &[Vec<Element>]) {}

    /// How high over the tool the cloth beneath a vertex of environment `lane` reaches [m].
    #[inline(always)]
    fn beneath(&self, _layers: &Layers, _lane: usize, _vertex: usize) -> f64 {
        unreachable!("layers that touch are computed in a group");
    }

    /// Keeps the layers of the cloth apart.
    #[inline(always)]
    fn separate(&mut self, _layers: &Layers) {
        unreachable!("layers that touch are computed in a group");
    }
}
