//! Free ways between strokes: straight in joints where nothing stands there, else found by two trees that grow towards
//! each other (RRT-Connect, Kuffner and LaValle 2000), from samples that are the same every time.

use super::arm::{Arm, Joints};
use super::workcell::Cell;

/// Steps at which a way is looked at [rad], and by which trees grow.
const LOOK: f64 = 0.03;
const GROW: f64 = 0.3;
/// By which samples go beyond both ends of a way [rad].
const ROOM: f64 = 1.5;
/// Samples at most.
pub(crate) const SAMPLES: u64 = 1500;

/// Poses and what each grew from, the first from itself.
struct Tree(Vec<(Joints, usize)>);

impl Tree {
    fn nearest(&self, to: &Joints) -> usize {
        let apart = |k: &usize| distance(&self.0[*k].0, to);
        let all = 0..self.0.len();
        all.min_by(|a, b| apart(a).total_cmp(&apart(b)))
            .expect("a tree has a root")
    }

    /// From the root to a pose.
    fn way(&self, mut k: usize) -> Vec<Joints> {
        let mut way = vec![self.0[k].0];
        while self.0[k].1 != k {
            k = self.0[k].1;
            way.push(self.0[k].0);
        }
        way.reverse();
        way
    }
}

fn distance(a: &Joints, b: &Joints) -> f64 {
    (0..6).map(|j| (a[j] - b[j]).powi(2)).sum::<f64>().sqrt()
}

impl Cell {
    /// The corners of a free way between two poses, both left out; none if none was found.
    pub(crate) fn transfer(
        &self,
        from: &Joints,
        to: &Joints,
        station: usize,
    ) -> Option<Vec<Joints>> {
        if self.is_free(from, to, station, LOOK) {
            return Some(Vec::new());
        }
        if !self.is_clear(from, station) || !self.is_clear(to, station) {
            return None;
        }
        // First not far beyond both ends, as a joint that turns twice has much room that leads nowhere; then anywhere.
        [ROOM, f64::INFINITY]
            .into_iter()
            .find_map(|room| self.two_trees(from, to, station, room))
    }

    /// Two trees from samples within `room` [rad] of both ends.
    fn two_trees(
        &self,
        from: &Joints,
        to: &Joints,
        station: usize,
        room: f64,
    ) -> Option<Vec<Joints>> {
        let mut trees = [Tree(vec![(*from, 0)]), Tree(vec![(*to, 0)])];
        let ranges = std::array::from_fn(|j| {
            let [min, max] = self.arm.joints[j].limits;
            [
                min.max(from[j].min(to[j]) - room),
                max.min(from[j].max(to[j]) + room),
            ]
        });
        for k in 0..SAMPLES {
            let side = (k % 2) as usize;
            let sample = Arm::spread(k + 1, &ranges);
            let Some(grown) = self.grow(&mut trees[side], &sample, station) else {
                continue;
            };
            let target = trees[side].0[grown].0;
            let other = &mut trees[1 - side];
            let mut met = None;
            while let Some(next) = self.grow(other, &target, station) {
                if distance(&other.0[next].0, &target) < 1e-9 {
                    met = Some(next);
                    break;
                }
            }
            if let Some(met) = met {
                let (mut here, mut there) = (trees[side].way(grown), trees[1 - side].way(met));
                there.reverse();
                here.extend(&there[1..]);
                if side == 1 {
                    here.reverse();
                }
                let way = self.shorter(here, station);
                return Some(way[1..way.len() - 1].to_vec());
            }
        }
        None
    }

    /// Grows a tree by one step towards a pose.
    fn grow(&self, tree: &mut Tree, to: &Joints, station: usize) -> Option<usize> {
        let from = tree.nearest(to);
        let start = tree.0[from].0;
        let far = distance(&start, to);
        if far < 1e-9 {
            return None;
        }
        let share = (GROW / far).min(1.0);
        let next = match share {
            1.0 => *to,
            _ => std::array::from_fn(|j| start[j] + share * (to[j] - start[j])),
        };
        self.is_free(&start, &next, station, LOOK).then(|| {
            tree.0.push((next, from));
            tree.0.len() - 1
        })
    }

    /// Leaves out corners that need not be: from each the farthest that can be gone to straight is the next.
    fn shorter(&self, mut way: Vec<Joints>, station: usize) -> Vec<Joints> {
        let mut a = 0;
        while a + 2 < way.len() {
            let others = (a + 2..way.len()).rev();
            let mut free = others.filter(|&b| self.is_free(&way[a], &way[b], station, LOOK));
            if let Some(b) = free.next() {
                way.drain(a + 1..b);
            }
            a += 1;
        }
        way
    }
}
