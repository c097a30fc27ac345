//! The symmetries of an image: a fabric whose warp and weft are alike drapes a mirrored tool in mirrored presses, so that what
//! has been shown once is shown in up to eight ways to a network that has no weights of places.

use drape_cloth::sim::{Observation, Observations};
use drape_task::env::{ImageShape, Terrain};

/// Transposes an image, then turns its rows and its columns round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symmetry {
    shape: ImageShape,
    transposed: bool,
    /// Rows, columns.
    reversed: [bool; 2],
}

impl Symmetry {
    /// All that keep the shape, the identity first.
    pub fn all(shape: ImageShape) -> Vec<Self> {
        let count = if shape.rows == shape.columns { 8 } else { 4 };
        let of = |k: usize| Self {
            shape,
            transposed: k & 4 != 0,
            reversed: [k & 1 != 0, k & 2 != 0],
        };
        (0..count).map(of).collect()
    }

    /// The pixel whose content comes to this one.
    fn source(self, pixel: usize) -> usize {
        let ImageShape { rows, columns } = self.shape;
        let mut at = [pixel / columns, pixel % columns];
        for ((at, count), reversed) in at.iter_mut().zip([rows, columns]).zip(self.reversed) {
            if reversed {
                *at = count - 1 - *at;
            }
        }
        if self.transposed {
            at.swap(0, 1);
        }
        at[0] * columns + at[1]
    }

    fn image<T: Copy>(self, of: &[T]) -> impl Iterator<Item = T> {
        (0..of.len()).map(move |pixel| of[self.source(pixel)])
    }

    /// The terrain as it is then seen.
    pub fn terrain(self, terrain: &Terrain) -> Terrain {
        let count = terrain.height.len();
        let inside = (0..count).filter(|&pixel| terrain.inside.contains(self.source(pixel)));
        let [down, along] = self
            .reversed
            .map(|reversed| if reversed { -1.0 } else { 1.0 });
        let turned = |[a, b]: [f32; 2]| match self.transposed {
            true => [along * b, down * a],
            false => [along * a, down * b],
        };
        let mut seen = terrain.clone();
        seen.inside.clear();
        inside.for_each(|pixel| seen.inside.insert(pixel));
        seen.height = self.image(&terrain.height).collect();
        seen.slope = self.image(&terrain.slope).map(turned).collect();
        seen
    }
}

/// Moves of tasks on `scenes` scenes, each as one of `symmetries` shows it, by its number; their views count scenes, then
/// symmetries.
pub fn turned(
    moves: &[(Observation, u32)],
    symmetries: &[Symmetry],
    numbers: &[usize],
    scenes: usize,
) -> (Observations, Vec<u32>) {
    let (mut views, mut distance, mut marks) = (Vec::new(), Vec::new(), Vec::new());
    let mut actions = Vec::new();
    for (&(seen, action), &number) in moves.iter().zip(numbers) {
        let symmetry = symmetries[number];
        views.push((number * scenes) as u16 + seen.view);
        distance.extend(symmetry.image(seen.distance));
        marks.extend(symmetry.image(seen.marks));
        let comes = |pixel: &u32| symmetry.source(*pixel as usize) == action as usize;
        let action = (0..seen.marks.len() as u32).find(comes);
        actions.push(action.expect("it is a pixel"));
    }
    (Observations::new(views, distance, marks), actions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixedbitset::FixedBitSet;

    /// Heights of a plane lie, and slopes point, as in the image that is turned: where a step to the next column goes up, the
    /// normal points back.
    #[test]
    fn slopes_turn_with_heights() {
        let shape = ImageShape {
            rows: 3,
            columns: 3,
        };
        let mut inside = FixedBitSet::with_capacity(9);
        inside.insert(1);
        let plane = |pixel: usize| 2.0 * (pixel % 3) as f32 + 5.0 * (pixel / 3) as f32;
        let terrain = Terrain {
            inside,
            height: (0..9).map(plane).collect(),
            slope: vec![[-2.0, -5.0]; 9],
        };
        let all = Symmetry::all(shape);
        let mut heights: Vec<Vec<f32>> = Vec::new();
        for (number, symmetry) in all.iter().enumerate() {
            let seen = symmetry.terrain(&terrain);
            let [along, down] = [1, 3].map(|step| seen.height[step] - seen.height[0]);
            assert_eq!(seen.slope, vec![[-along, -down]; 9], "{symmetry:?}");
            assert!(!heights.contains(&seen.height));
            let marks: Vec<u8> = (0..9).collect();
            let distance: Vec<f32> = terrain.height.clone();
            let row = Observation {
                view: 1,
                distance: &distance,
                marks: &marks,
            };
            let (turned, actions) = turned(&[(row, 1)], &all, &[number], 2);
            let turned = turned.row(0);
            assert_eq!(turned.view, 2 * number as u16 + 1);
            assert_eq!(turned.distance, seen.height);
            // The pixel that was pressed is the one that was inside.
            assert_eq!(turned.marks[actions[0] as usize], 1);
            assert!(seen.inside.ones().eq([actions[0] as usize]));
            heights.push(seen.height);
        }
        assert_eq!(heights[0], terrain.height);
        let oblong = ImageShape {
            rows: 3,
            columns: 4,
        };
        assert_eq!(Symmetry::all(oblong).len(), 4);
    }
}
