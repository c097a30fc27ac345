use super::cloth::Cloth;
use super::collision::Layers;
use super::line::{Along, Chain};
use super::lines::{Direction, Lines};
use super::model::Pass;
use super::press::Press;
use crate::math::{Lanes, Vec3x};

/// Where the lanes of a [`Cloth`] come from: it supplies the loops of the stages, and nothing
/// else.
pub(super) trait Storage {
    /// A number in every lane.
    type V: Lanes;
    /// A line in every lane.
    type Line: Chain<Self::V>;

    fn cloth(&mut self) -> &mut Cloth<Self::V>;

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
    fn put(&mut self, direction: Direction, i: usize);

    /// Finds what [`Storage::weft_pull`] tells, where that is not at hand.
    fn warm_start_wefts(&mut self);

    /// What its weft's forces of the last substep pull at a vertex where it is predicted [N], and
    /// the sum of their |force density| [N/m].
    fn weft_pull(&self, lines: &Lines, place: usize) -> (Vec3x<Self::V>, Self::V);

    /// Projects constraints that are no lines, one after the other.
    fn project(&mut self, passes: &[Pass]);

    /// Keeps the vertices of a plate below this height over the tool, or over what layers of
    /// cloth lie beneath them [m]; `compliance` as in [`super::press::hold_down`].
    fn hold_down(&mut self, layers: Option<&Layers>, plate: &Press, height: f64, compliance: f64);

    /// Keeps the layers of the cloth apart.
    fn separate(&mut self, layers: &Layers);
}
