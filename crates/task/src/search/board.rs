//! Changes of an order: pieces and strokes are reversed or put elsewhere, extended and joined, presses shifted,
//! dropped, put in.

use std::f64::consts::FRAC_PI_3;

use crate::env::Task;
use drape_cloth::math::Stream;

/// Bytes of the states that may be kept of a round.
const MOST_BYTES: usize = 512 << 20;

/// Where orders are changed: the flat blank.
pub(super) struct Board {
    /// Vertices of the region.
    vertices: Vec<u32>,
    rest: Vec<[f64; 2]>,
    /// Vertices beside each, of the region,
    beside: Vec<Vec<u32>>,
    /// and those that a stroke may go on to from it.
    near: Vec<Vec<u32>>,
    /// Presses nearer than this are of one stroke [m].
    join: f64,
}

impl Board {
    pub fn new(task: &Task) -> Self {
        let lamina = &task.scene.lamina;
        let vertices: Vec<u32> = task
            .pressable_vertices()
            .filter(|&v| task.action(v).is_some())
            .collect();
        let mut board = Self {
            beside: vec![Vec::new(); lamina.vertex_count()],
            near: vec![Vec::new(); lamina.vertex_count()],
            rest: lamina.rest.clone(),
            join: task.config.rolling().join_distance,
            vertices,
        };
        for &v in &board.vertices {
            let all = || board.vertices.iter().copied().filter(move |&w| w != v);
            let is_beside = |&w: &u32| lamina.neighbors(v).any(|other| other == w);
            board.beside[v as usize] = all().filter(is_beside).collect();
            board.near[v as usize] = all().filter(|&w| board.apart(v, w) < board.join).collect();
        }
        board
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

    /// By how much the way from `a` over `b` to `c` turns [rad].
    fn turn(&self, a: u32, b: u32, c: u32) -> f64 {
        let [a, b, c] = [a, b, c].map(|v| self.rest[v as usize]);
        let ([x0, y0], [x1, y1]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        (x0 * y1 - y0 * x1).atan2(x0 * x1 + y0 * y1).abs()
    }

    /// Where each stroke begins, and the length of the order.
    fn strokes(&self, order: &[u32]) -> Vec<usize> {
        let is_new = |k: &usize| *k == 0 || self.apart(order[k - 1], order[*k]) >= self.join;
        let mut begins: Vec<usize> = (0..order.len()).filter(is_new).collect();
        begins.push(order.len());
        begins
    }

    /// An order that differs by one to three moves. `off` is how far each vertex has ended off the tool.
    pub fn changed(&self, order: &[u32], off: &[f64], stream: &mut Stream) -> Vec<u32> {
        let mut new = order.to_vec();
        let count = 1 + [0, 0, 0, 1, 1, 2][stream.below(6)];
        for _ in 0..count {
            self.change(&mut new, off, stream);
        }
        if new == order {
            self.change(&mut new, off, stream);
        }
        new
    }

    fn change(&self, order: &mut Vec<u32>, off: &[f64], stream: &mut Stream) {
        let n = order.len();
        // Moves leave something that a piece of four can be put beside.
        if n < 5 {
            let vertex = self.vertices[stream.below(self.vertices.len())];
            return order.push(vertex);
        }
        match stream.below(24) {
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
            // extended,
            11 => self.extend(order, stream),
            // joined to the next by what lies between,
            12 => {
                let strokes = self.strokes(order);
                let next = strokes[stream.below(strokes.len() - 1)];
                if next > 0 {
                    let between = self.between(order[next - 1], order[next]);
                    order.splice(next..next, between);
                }
            }
            // or to another;
            13 => self.join(order, stream),
            // a press is shifted,
            14..18 => {
                let k = stream.below(n);
                let beside = &self.beside[order[k] as usize];
                if !beside.is_empty() {
                    order[k] = beside[stream.below(beside.len())];
                }
            }
            // one or two are dropped,
            18..23 => {
                let k = stream.below(n - 1);
                order.drain(k..k + 1 + stream.below(2));
            }
            // one is put in where the cloth is off the tool.
            _ => {
                let vertex = self.lacking(off, stream);
                self.put(order, vec![vertex], stream);
            }
        }
    }

    /// Puts in a press ahead of one end of a stroke.
    fn extend(&self, order: &mut Vec<u32>, stream: &mut Stream) {
        let strokes = self.strokes(order);
        let k = stream.below(strokes.len() - 1);
        let own = &order[strokes[k]..strokes[k + 1]];
        let (end, before, place) = match stream.below(2) {
            0 => (own[0], own[1 % own.len()], strokes[k]),
            _ => (
                own[own.len() - 1],
                own[own.len().saturating_sub(2)],
                strokes[k + 1],
            ),
        };
        let is_ahead = |v: &u32| self.turn(before, end, *v) < FRAC_PI_3;
        let near = self.near[end as usize].iter().copied();
        let ahead: Vec<u32> = near.filter(is_ahead).collect();
        if !ahead.is_empty() {
            order.insert(place, ahead[stream.below(ahead.len())]);
        }
    }

    /// Joins a stroke, either way round, to the end of another that is near, by what lies between.
    fn join(&self, order: &mut Vec<u32>, stream: &mut Stream) {
        let strokes = self.strokes(order);
        if strokes.len() < 3 {
            return;
        }
        let k = stream.below(strokes.len() - 1);
        let mut piece: Vec<u32> = order.drain(strokes[k]..strokes[k + 1]).collect();
        let strokes = self.strokes(order);
        let mut nearest = (f64::INFINITY, 0, 0, 0);
        for own in strokes.windows(2) {
            // Before the first press of another, or behind its last.
            for (place, at) in [(own[0], own[0]), (own[1], own[1] - 1)] {
                for end in [0, piece.len() - 1] {
                    let off = self.apart(order[at], piece[end]);
                    let off = off + self.join * stream.uniform();
                    if off < nearest.0 {
                        nearest = (off, place, at, end);
                    }
                }
            }
        }
        let (_, place, at, end) = nearest;
        let is_behind = place > at;
        if is_behind != (end == 0) {
            piece.reverse();
        }
        let between = match is_behind {
            true => 0..0,
            false => piece.len()..piece.len(),
        };
        let ways = match is_behind {
            true => self.between(order[at], piece[0]),
            false => self.between(piece[piece.len() - 1], order[at]),
        };
        piece.splice(between, ways);
        order.splice(place..place, piece);
    }

    /// Vertices on the straight way from one to another, so that both are of one stroke.
    fn between(&self, a: u32, b: u32) -> Vec<u32> {
        let parts = (self.apart(a, b) / (0.9 * self.join)).ceil() as usize;
        let [[x0, y0], [x1, y1]] = [a, b].map(|v| self.rest[v as usize]);
        let nearest = |part: usize| {
            let share = part as f64 / parts as f64;
            let [x, y] = [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
            let off = |&v: &u32| {
                let at = self.rest[v as usize];
                (at[0] - x).hypot(at[1] - y)
            };
            let all = self.vertices.iter().copied();
            let nearest = all.min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.expect("a region has vertices")
        };
        (1..parts).map(nearest).collect()
    }

    /// A vertex, the more likely the farther it is off.
    fn lacking(&self, off: &[f64], stream: &mut Stream) -> u32 {
        let all = || self.vertices.iter().copied();
        let mut left = stream.uniform() * all().map(|v| off[v as usize]).sum::<f64>();
        let found = all().find(|&v| {
            left -= off[v as usize];
            left < 0.0
        });
        found.unwrap_or_else(|| self.vertices[stream.below(self.vertices.len())])
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
