use serde::{Deserialize, Serialize};

use drape_cloth::file::ValueError;

/// What a path that is given to a robot costs, as shares of its score. Where paths are polished and proved
/// it is taken off; learning does without: a policy that pays for strokes learns to crush instead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Costs {
    /// Each stroke: presses that are a stencil's side or more apart on the flat blank are of two,
    pub stroke: f64,
    /// each turn by more than 90 degrees within one,
    pub turn: f64,
    /// each metre of the way from press to press there,
    pub metre: f64,
    /// and each inner vertex that ends off the tool, see [`Region::undraped_inner`](super::Region::undraped_inner).
    pub undraped: f64,
}

impl Costs {
    pub(super) fn check(&self) -> Result<(), ValueError> {
        for (key, value) in [
            ("stroke", self.stroke),
            ("turn", self.turn),
            ("metre", self.metre),
            ("undraped", self.undraped),
        ] {
            ValueError::unless_within(key, value, [0.0, 1.0])?;
        }
        Ok(())
    }

    /// Of presses at these places of the flat blank [m], of one stroke up to `join` [m], that have left so many
    /// inner vertices undraped.
    pub(super) fn of(&self, places: &[[f64; 2]], join: f64, undraped: usize) -> f64 {
        let way = |pair: &[[f64; 2]]| [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let ways: Vec<[f64; 2]> = places.windows(2).map(way).collect();
        let is_jump = |[x, y]: [f64; 2]| x.hypot(y) >= join;
        let is_sharp = |pair: &[[f64; 2]]| {
            let [[x, y], [u, v]] = [pair[0], pair[1]];
            // A right angle is none, rounded or not.
            !pair.iter().copied().any(is_jump) && x * u + y * v < -1e-6 * x.hypot(y) * u.hypot(v)
        };
        let jumps = ways.iter().copied().filter(|&way| is_jump(way)).count();
        let strokes = jumps + usize::from(!places.is_empty());
        let turns = ways.windows(2).filter(|pair| is_sharp(pair)).count();
        let metres: f64 = ways.iter().map(|[x, y]| x.hypot(*y)).sum();
        self.stroke * strokes as f64
            + self.turn * turns as f64
            + self.metre * metres
            + self.undraped * undraped as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stroke of three presses 10 mm apart, one turn back in it, a jump of 30 mm and a press.
    #[test]
    fn strokes_turns_and_metres_are_counted() {
        let path = [0.0, 10e-3, 20e-3, 10e-3, 40e-3].map(|x| [x, 0.0]);
        let of = |[stroke, turn, metre, undraped]: [f64; 4], path: &[[f64; 2]]| {
            let costs = Costs {
                stroke,
                turn,
                metre,
                undraped,
            };
            costs.of(path, 20e-3, 3)
        };
        assert_eq!(of([0.0; 4], &path), 0.0);
        assert_eq!(of([1.0, 0.0, 0.0, 0.0], &path), 2.0);
        assert_eq!(of([0.0, 1.0, 0.0, 0.0], &path), 1.0);
        assert!((of([0.0, 0.0, 1.0, 0.0], &path) - 0.06).abs() < 1e-12);
        assert_eq!(of([0.0, 0.0, 0.0, 1.0], &path), 3.0);
        assert_eq!(of([1.0, 1.0, 1.0, 0.0], &[]), 0.0);
        let zigzag: Vec<[f64; 2]> = (0..33)
            .map(|k| [k, k % 2].map(|k| 8.125e-3 * f64::from(k) - 0.13))
            .collect();
        assert_eq!(of([0.0, 1.0, 0.0, 0.0], &zigzag), 0.0);
    }
}
