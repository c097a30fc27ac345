use super::grid::{DistanceGrid, GridAxes};
use super::solid::{Tool, exact_in_lanes, unit};
use crate::math::{Lanes, Tables};

/// The tools of a group of environments.
pub(crate) enum Tools<'a, V> {
    /// The same in every lane.
    One(&'a Tool),
    /// One a lane.
    Each(Box<EachTool<'a, V>>),
}

/// A tool in every lane.
pub(crate) struct EachTool<'a, V> {
    tools: Vec<&'a Tool>,
    tables: Tables<'a>,
    axes: GridAxes<V>,
}

impl<'a, V: Lanes> Tools<'a, V> {
    /// The tools of all lanes, of which `used` are looked at; the others take the first.
    pub fn new(used: usize, of: impl Fn(usize) -> &'a Tool) -> Self {
        let first = of(0);
        if (1..used).all(|lane| std::ptr::eq(of(lane), first)) {
            return Self::One(first);
        }
        let own = |lane: usize| if lane < used { of(lane) } else { first };
        let tools: Vec<&Tool> = (0..V::COUNT).map(own).collect();
        let each = |of: &dyn Fn(&DistanceGrid) -> f64| {
            let mut all = V::zero();
            for (lane, tool) in tools.iter().enumerate() {
                all.set(lane, of(&tool.grid));
            }
            all
        };
        let axes = GridAxes {
            origin: [0, 1, 2].map(|a| each(&|grid| grid.origin[a])),
            spacing: each(&|grid| grid.spacing),
            inverse_spacing: each(&|grid| 1.0 / grid.spacing),
            last: [0, 1, 2].map(|a| each(&|grid| (grid.dims[a] - 1) as f64)),
        };
        let grids = tools.iter().map(|tool| &tool.grid);
        Self::Each(Box::new(EachTool {
            tables: Tables::new(grids.map(|grid| (&*grid.samples, grid.strides()))),
            tools,
            axes,
        }))
    }

    /// [`Tool::distance`] in every lane, inlined for the instruction set in use.
    #[inline(always)]
    pub fn distance(&self, x: [V; 3]) -> (V, [V; 3]) {
        match self {
            Self::One(tool) => tool.distance_in_lanes(x),
            Self::Each(each) => each.distance(x),
        }
    }
}

impl<V: Lanes> EachTool<'_, V> {
    #[inline(always)]
    pub fn distance(&self, x: [V; 3]) -> (V, [V; 3]) {
        let (cell, t, beyond) = self.axes.locate(x);
        let (phi, gradient) =
            self.axes
                .interpolate(V::look_up_in_each(&self.tables, cell), t, beyond);
        let normal = unit(gradient);
        if self.tools.iter().any(|tool| tool.sharp.is_some()) {
            return exact_in_lanes(|lane| self.tools[lane], x, phi, normal);
        }
        (phi, normal)
    }
}
