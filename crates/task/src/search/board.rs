//! Changes of an order: pieces and strokes are reversed or put elsewhere, presses shifted, dropped, put in.

use crate::env::Task;
use drape_cloth::math::Stream;

/// Bytes of the states that may be kept of a round.
const MOST_BYTES: usize = 512 << 20;

/// Where orders are changed: the flat blank.
pub(super) struct Board {
    /// Vertices of the region.
    vertices: Vec<u32>,
    rest: Vec<[f64; 2]>,
    /// Vertices beside each, of the region.
    beside: Vec<Vec<u32>>,
    /// Presses nearer than this are of one stroke [m].
    join: f64,
}

impl Board {
    pub fn new(task: &Task) -> Self {
        let lamina = &task.scene.lamina;
        let vertices: Vec<u32> = task
            .region_vertices()
            .filter(|&v| task.action(v).is_some())
            .collect();
        let mut is_inside = vec![false; lamina.vertex_count()];
        vertices.iter().for_each(|&v| is_inside[v as usize] = true);
        let beside = |v: u32| {
            lamina
                .neighbors(v)
                .filter(|&w| is_inside[w as usize])
                .collect()
        };
        Self {
            beside: (0..lamina.vertex_count() as u32).map(beside).collect(),
            rest: lamina.rest.clone(),
            join: task.config.join_distance(),
            vertices,
        }
    }

    /// Presses between two states that are kept, so that those of so many lists fit into the memory.
    pub fn stride(&self, lists: usize) -> usize {
        let presses = self.vertices.len().div_ceil(5);
        let state = 150 * self.rest.len();
        (lists * presses * state).div_ceil(MOST_BYTES).max(1)
    }

    fn apart(&self, a: u32, b: u32) -> f64 {
        let [[x0, y0], [x1, y1]] = [a, b].map(|v| self.rest[v as usize]);
        (x1 - x0).hypot(y1 - y0)
    }

    /// Where each stroke begins, and the length of the order.
    fn strokes(&self, order: &[u32]) -> Vec<usize> {
        let is_new = |k: &usize| *k == 0 || self.apart(order[k - 1], order[*k]) > self.join;
        let mut begins: Vec<usize> = (0..order.len()).filter(is_new).collect();
        begins.push(order.len());
        begins
    }

    /// An order that differs by one to three moves.
    pub fn changed(&self, order: &[u32], stream: &mut Stream) -> Vec<u32> {
        let mut new = order.to_vec();
        let count = 1 + [0, 0, 0, 1, 1, 2][stream.below(6)];
        for _ in 0..count {
            self.change(&mut new, stream);
        }
        if new == order {
            self.change(&mut new, stream);
        }
        new
    }

    fn change(&self, order: &mut Vec<u32>, stream: &mut Stream) {
        let n = order.len();
        // Moves leave something that a piece of four can be put beside.
        if n < 5 {
            let vertex = self.vertices[stream.below(self.vertices.len())];
            return order.push(vertex);
        }
        match stream.below(20) {
            // A piece is reversed,
            0..3 => {
                let from = stream.below(n - 1);
                let to = (from + 2 + stream.below(11)).min(n);
                order[from..to].reverse();
            }
            // put elsewhere,
            3..8 => {
                let from = stream.below(n - 3);
                let piece: Vec<u32> = order.drain(from..from + 1 + stream.below(4)).collect();
                self.put(order, piece, stream);
            }
            // a stroke is reversed, or put elsewhere,
            8..11 => {
                let strokes = self.strokes(order);
                let k = stream.below(strokes.len() - 1);
                let own = strokes[k]..strokes[k + 1];
                if stream.below(3) == 0 || own.len() == n {
                    order[own].reverse();
                } else {
                    let piece: Vec<u32> = order.drain(own).collect();
                    self.put(order, piece, stream);
                }
            }
            // a press is shifted,
            11..15 => {
                let k = stream.below(n);
                let beside = &self.beside[order[k] as usize];
                if !beside.is_empty() {
                    order[k] = beside[stream.below(beside.len())];
                }
            }
            // one or two are dropped,
            15..18 => {
                let k = stream.below(n - 1);
                order.drain(k..k + 1 + stream.below(2));
            }
            // one is put in: half way to the next, or anywhere.
            18 => {
                let k = stream.below(n - 1);
                let [a, b] = [order[k], order[k + 1]].map(|v| self.rest[v as usize]);
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                let off = |&v: &u32| {
                    let [x, y] = self.rest[v as usize];
                    (x - middle[0]).hypot(y - middle[1])
                };
                let all = self.vertices.iter().copied();
                let nearest = all.min_by(|a, b| off(a).total_cmp(&off(b)));
                order.insert(k + 1, nearest.expect("a region has vertices"));
            }
            _ => {
                let vertex = self.vertices[stream.below(self.vertices.len())];
                self.put(order, vec![vertex], stream);
            }
        }
    }

    /// Puts a piece, either way round, beside a press that is near to one of its ends, or anywhere.
    fn put(&self, order: &mut Vec<u32>, mut piece: Vec<u32>, stream: &mut Stream) {
        let (first, last) = (piece[0], piece[piece.len() - 1]);
        let place = match stream.below(4) {
            0 => stream.below(order.len() + 1),
            _ => {
                let mut nearest = (f64::INFINITY, 0, false);
                for (k, &v) in order.iter().enumerate() {
                    for (end, is_last) in [(first, false), (last, true)] {
                        let off = self.apart(v, end) + 0.7 * self.join * stream.uniform();
                        if off < nearest.0 {
                            nearest = (off, k, is_last);
                        }
                    }
                }
                let (_, k, is_last) = nearest;
                // Behind it the piece begins with that end, before it it ends so.
                let is_behind = stream.below(2) == 0;
                if is_last == is_behind {
                    piece.reverse();
                }
                k + usize::from(is_behind)
            }
        };
        order.splice(place..place, piece);
    }
}
