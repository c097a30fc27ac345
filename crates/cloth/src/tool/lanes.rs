use std::sync::Arc;

use super::grid::Grids;
use super::solid::{Tool, unit};
use crate::math::Lanes;

/// The tools that environments choose from, their samples one after the other.
pub(crate) struct Atlas {
    tools: Vec<Arc<Tool>>,
    /// Of several: a single one's are its own.
    samples: Vec<f32>,
    /// Where those of each begin.
    first: Vec<usize>,
}

/// A tool in every lane.
pub(crate) struct Tools<'a, V> {
    tools: Vec<&'a Tool>,
    grids: Grids<'a, V>,
    /// How near distances may have to be exact [m]; 0 where they never have.
    reach: V,
}

impl Atlas {
    pub fn new(tools: &[Arc<Tool>]) -> Self {
        let mut atlas = Self {
            tools: tools.to_vec(),
            samples: Vec::new(),
            first: vec![0],
        };
        if let [_, _, ..] = tools {
            atlas.first.clear();
            for tool in tools {
                atlas.first.push(atlas.samples.len());
                atlas.samples.extend(&tool.grid.samples);
            }
        }
        atlas
    }

    /// Those of all lanes, of which the first `used` are looked at, by their numbers.
    pub fn in_lanes<V: Lanes>(&self, used: usize, of: impl Fn(usize) -> usize) -> Tools<'_, V> {
        let numbers = (0..V::COUNT).map(|lane| of(if lane < used { lane } else { 0 }));
        let numbers: Vec<usize> = numbers.collect();
        let tools: Vec<&Tool> = numbers.iter().map(|&k| &*self.tools[k]).collect();
        let samples = match &self.tools[..] {
            [one] => &one.grid.samples,
            _ => &self.samples,
        };
        let mut reach = V::zero();
        for (lane, tool) in tools.iter().enumerate() {
            reach.set(lane, tool.sharp.as_ref().map_or(0.0, |sharp| sharp.reach));
        }
        let grids = numbers.iter().zip(&tools);
        let grids = grids.map(|(&k, tool)| (self.first[k], &tool.grid));
        Tools {
            grids: Grids::new(samples, grids),
            tools,
            reach,
        }
    }
}

impl<V: Lanes> Tools<'_, V> {
    /// The tool of a lane.
    pub fn of(&self, lane: usize) -> &Tool {
        self.tools[lane]
    }

    /// [`Tool::distance`] in every lane, inlined for the instruction set in use.
    #[inline(always)]
    pub fn distance(&self, x: [V; 3]) -> (V, [V; 3]) {
        let (phi, gradient) = self.grids.sample(x);
        let normal = unit(gradient);
        match V::any(phi.max(-phi).lt(self.reach)) {
            true => self.exact(x, phi, normal),
            false => (phi, normal),
        }
    }

    /// The exact distance and normal of the lanes in sharp cells of their tools, and what was
    /// interpolated in the others.
    #[inline(never)]
    fn exact(&self, x: [V; 3], mut phi: V, mut normal: [V; 3]) -> (V, [V; 3]) {
        for (lane, tool) in self.tools.iter().enumerate() {
            let x = x.map(|x| x.get(lane));
            if let Some((exact, n)) = tool.exact(x, phi.get(lane)) {
                phi.set(lane, exact);
                for (component, n) in normal.iter_mut().zip(&n) {
                    component.set(lane, *n);
                }
            }
        }
        (phi, normal)
    }
}
