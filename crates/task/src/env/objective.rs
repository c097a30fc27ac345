use drape_cloth::measure::{Measures, feet, summed_surplus};
use drape_cloth::scene::Scene;
use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What presses are to bring down [m].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The summed distance of the focus region's vertices to the tool, as in the paper. Cloth that
    /// is crushed on the tool counts as well laid, and what is pushed out of the region as gone.
    Distance,
    /// The mean distance of its vertices and the mean surplus of its yarns (see
    /// [`drape_cloth::scene::surplus`]): what stands off the tool and what is crushed on it. What
    /// there is more of outside than at the start counts as if it were still inside.
    #[default]
    Surplus,
}

/// An objective of one region of a scene, where vertices have come from a known place.
#[derive(Clone)]
pub struct Goal {
    objective: Objective,
    scene: Arc<Scene>,
    region: FixedBitSet,
    /// What there was outside of distance and surplus [m].
    outside: [f64; 2],
    /// Yarns that cross the region.
    yarns: usize,
}

impl Goal {
    /// The objective of `region`, whose vertices come from `before` [m].
    pub fn new(
        objective: Objective,
        scene: Arc<Scene>,
        region: FixedBitSet,
        before: &[[f64; 3]],
    ) -> Self {
        let mut goal = Self {
            objective,
            scene,
            region,
            outside: [0.0; 2],
            yarns: 0,
        };
        if objective == Objective::Surplus {
            let Scene { lamina, tool, .. } = &*goal.scene;
            let Measures {
                distance, surplus, ..
            } = goal.measures(before);
            goal.outside = [distance, surplus].map(|[inside, all]| all - inside);
            goal.yarns = summed_surplus(lamina, &feet(tool, before), &goal.region).1;
        }
        goal
    }

    /// What a state leaves to bring down [m].
    pub fn left(&self, position: &[[f64; 3]]) -> f64 {
        self.left_of(&self.measures(position))
    }

    /// What such measures leave to bring down [m].
    pub(super) fn left_of(&self, measures: &Measures) -> f64 {
        let left = |[inside, all]: [f64; 2], before: f64| {
            let outside = (all - inside) - before;
            inside + outside.max(0.0)
        };
        match self.objective {
            Objective::Distance => measures.distance[0],
            Objective::Surplus => {
                left(measures.distance, self.outside[0]) / self.region.count_ones(..) as f64
                    + left(measures.surplus, self.outside[1]) / self.yarns.max(1) as f64
            }
        }
    }

    /// Those of a state.
    pub(super) fn measures(&self, position: &[[f64; 3]]) -> Measures {
        let Scene { lamina, tool, .. } = &*self.scene;
        Measures::new(lamina, tool, &self.region, position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::Region;
    use drape_cloth::scene::SceneConfig;

    /// A blank of 9 x 9 vertices on a plate.
    fn on_plate() -> Scene {
        let mut config = SceneConfig::rib();
        config.blank.vertices = [9; 2];
        config.tool.source = drape_cloth::tool::Source::Shape(drape_cloth::tool::Shape::Plate(
            drape_cloth::tool::Plate::default(),
        ));
        config.tool.grid.spacing_mm = Some(20.0);
        config.clamps.clear();
        (config.fall.fall_s, config.fall.settle_s) = (0.0, 0.0);
        Scene::new(&config, |_| ()).unwrap()
    }

    /// Of three vertices that are lifted one is of the region's border and one of the sheet's; the
    /// fourth lies just as near as is draped.
    #[test]
    fn undraped_are_inner_vertices_off_the_tool() {
        let scene = on_plate();
        let mut vertices = FixedBitSet::with_capacity(81);
        vertices.insert_range(..45);
        let region = Region {
            rows: 0..5,
            columns: 0..9,
            vertices,
        };
        let flat = scene.lamina.rest.iter().map(|&[x, y]| [x, y, 0.0]);
        let mut at: Vec<[f64; 3]> = flat.collect();
        for (v, height) in [(3, 2e-3), (37, 2e-3), (20, 2e-3), (22, 0.99e-3)] {
            at[v][2] = height;
        }
        assert_eq!(region.undraped_inner(&scene, 1e-3, &at), 1);
        assert_eq!(region.undraped_inner(&scene, 0.5e-3, &at), 2);
    }

    /// Crushing the warps by 2 % costs their surplus wherever it lies: inside the region, or pushed
    /// out of it. What was outside from the start costs nothing.
    #[test]
    fn what_is_pushed_out_of_the_region_is_not_gone() {
        let scene = on_plate();
        // Flat on the plate, every warp crushed by so much in its left and in its right half.
        let flat = |crushed: [f64; 2]| -> Vec<[f64; 3]> {
            let place = |&[x, y]: &[f64; 2]| [x * (1.0 - crushed[usize::from(x > 0.0)]), y, 0.0];
            scene.lamina.rest.iter().map(place).collect()
        };
        let [start, inside, outside, over] =
            [[0.02, 0.01], [0.02, 0.01], [0.0, 0.03], [0.0, 0.01]].map(flat);
        let mut region = FixedBitSet::with_capacity(81);
        for (v, at) in scene.lamina.rest.iter().enumerate() {
            region.set(v, at[0] < 1e-9);
        }
        let half = 0.5e-3 * scene.config.blank.size_mm[0];
        let scene = Arc::new(scene);
        let goal = Goal::new(Objective::Surplus, scene, region, &start);
        // 9 warps, and 5 wefts that are as long as at rest.
        let exact = 9.0 / 14.0 * 0.02 * half;
        for (x, exact) in [(inside, exact), (outside, exact), (over, 0.0)] {
            assert!((goal.left(&x) - exact).abs() < 1e-9, "{exact}");
        }
    }
}
