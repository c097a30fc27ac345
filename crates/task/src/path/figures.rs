use serde::Serialize;

use super::strokes::{PressedPoint, Rolling, stroke_points};
use drape_cloth::math::mean_and_deviation;

/// Change of direction from which on a stroke turns [degrees]: less comes from the tool's curvature
/// and from the places of vertices. From the second on a turn is sharp.
const TURNS: [f64; 2] = [30.0, 90.0];

/// What a path asks of a robot: counts and lengths, or their means over several paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PathFigures {
    /// Strokes and single presses; between two of them the robot jumps.
    pub strokes: f64,
    /// Vertices that are pressed.
    pub presses: f64,
    /// Straight ways from the end of each stroke to the start of the next, summed [m].
    pub jump_m: f64,
    /// Straight ways between the points of strokes, summed [m].
    pub length_m: f64,
    /// Changes of direction within strokes by more than 30 and by more than 90 degrees.
    pub turns: f64,
    pub sharp_turns: f64,
}

impl PathFigures {
    /// Of points that are joined to strokes as [`super::strokes`] joins them.
    pub fn new(points: &[PressedPoint], rolling: Rolling) -> Self {
        let mut figures = Self {
            presses: points.len() as f64,
            ..Self::default()
        };
        let mut last: Option<PressedPoint> = None;
        for stroke in stroke_points(points, rolling) {
            figures.strokes += 1.0;
            if let Some(last) = last {
                figures.jump_m += (stroke[0].position - last.position).norm();
            }
            last = stroke.last().copied();
            let ways = stroke
                .windows(2)
                .map(|pair| pair[1].position - pair[0].position);
            let ways: Vec<_> = ways.filter(|way| way.norm() > 0.0).collect();
            figures.length_m += ways.iter().map(|way| way.norm()).sum::<f64>();
            for pair in ways.windows(2) {
                let angle = pair[0].angle(&pair[1]).to_degrees();
                // A right angle of rounded coordinates is none beyond it.
                let [turns, sharp] = TURNS.map(|least| f64::from(angle > least + 1e-6));
                figures.turns += turns;
                figures.sharp_turns += sharp;
            }
        }
        figures
    }

    /// Of many paths on average.
    pub fn mean(all: &[Self]) -> Self {
        let of = |value: fn(&Self) -> f64| {
            mean_and_deviation(&all.iter().map(value).collect::<Vec<_>>())[0]
        };
        Self {
            strokes: of(|f| f.strokes),
            presses: of(|f| f.presses),
            jump_m: of(|f| f.jump_m),
            length_m: of(|f| f.length_m),
            turns: of(|f| f.turns),
            sharp_turns: of(|f| f.sharp_turns),
        }
    }

    /// As in lines for people.
    pub fn text(&self) -> String {
        format!(
            "{:.0} presses in {:.0} strokes, {:.2} m in contact, {:.2} m of jumps, {:.0} turns ({:.0} \
             sharp)",
            self.presses, self.strokes, self.length_m, self.jump_m, self.turns, self.sharp_turns
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: right, up (a right angle), back down (180 degrees), a jump by 4 in 3, two by 45
    /// degrees, then a single press.
    #[test]
    fn figures_of_a_path_by_hand() {
        let places = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [1.0, 0.0],
            [5.0, 3.0],
            [6.0, 3.0],
            [7.0, 4.0],
            [7.0, 9.0],
        ];
        let point = |[x, y]: [f64; 2]| PressedPoint {
            vertex: 0,
            position: [x, y, 2.0].into(),
            normal: [0.0, 0.0, 1.0].into(),
        };
        let points = places.map(point);
        let found = PathFigures::new(&points, Rolling::joining(1.5));
        let expected = PathFigures {
            strokes: 3.0,
            presses: 8.0,
            jump_m: 10.0,
            length_m: 4.0 + 2f64.sqrt(),
            turns: 3.0,
            sharp_turns: 1.0,
        };
        assert_eq!(found, expected);
        let both = PathFigures::mean(&[found, PathFigures::default()]);
        assert_eq!((both.strokes, both.jump_m), (1.5, 5.0));
        assert_eq!(
            PathFigures::new(&[], Rolling::joining(1.0)),
            PathFigures::default()
        );
    }
}
