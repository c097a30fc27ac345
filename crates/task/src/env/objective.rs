use drape_cloth::scene::{Scene, summed_surplus};
use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

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

impl Objective {
    /// What a state leaves to bring down [m], where vertices have come from `before` [m].
    pub fn of(
        self,
        scene: &Scene,
        region: &FixedBitSet,
        before: &[[f64; 3]],
        position: &[[f64; 3]],
    ) -> f64 {
        let Scene { lamina, tool, .. } = scene;
        let distance =
            |vertices: &FixedBitSet, x: &[[f64; 3]]| tool.summed_distance(vertices.ones(), x);
        if self == Self::Distance {
            return distance(region, position);
        }
        let mut sheet = region.clone();
        sheet.insert_range(..);
        let sums = |vertices: &FixedBitSet, x: &[[f64; 3]]| {
            let (surplus, yarns) = summed_surplus(lamina, tool, x, vertices);
            ([distance(vertices, x), surplus], yarns)
        };
        let (inside, yarns) = sums(region, position);
        let [all, all_before] = [position, before].map(|x| sums(&sheet, x).0);
        let inside_before = sums(region, before).0;
        let left = |k: usize| {
            let outside = (all[k] - inside[k]) - (all_before[k] - inside_before[k]);
            inside[k] + outside.max(0.0)
        };
        left(0) / region.count_ones(..) as f64 + left(1) / yarns.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::scene::SceneConfig;

    /// Crushing the warps by 2 % costs their surplus wherever it lies: inside the region, or pushed
    /// out of it. What was outside from the start costs nothing.
    #[test]
    fn what_is_pushed_out_of_the_region_is_not_gone() {
        let mut config = SceneConfig::rib();
        config.blank.vertices = [9; 2];
        config.tool.source = drape_cloth::tool::Source::Shape(drape_cloth::tool::Shape::Plate(
            drape_cloth::tool::Plate::default(),
        ));
        config.tool.grid.spacing_mm = Some(20.0);
        config.clamps.clear();
        (config.fall.fall_s, config.fall.settle_s) = (0.0, 0.0);
        let scene = Scene::new(&config, |_| ()).unwrap();
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
        let half = 0.5e-3 * config.blank.size_mm[0];
        let of = |x: &[[f64; 3]]| Objective::Surplus.of(&scene, &region, &start, x);
        // 9 warps, and 5 wefts that are as long as at rest.
        let exact = 9.0 / 14.0 * 0.02 * half;
        for (x, exact) in [(inside, exact), (outside, exact), (over, 0.0)] {
            assert!((of(&x) - exact).abs() < 1e-9, "{} {exact}", of(&x));
        }
    }
}
