//! Vertices of elements in blocks of lanes.

use crate::math::Vec3;

/// Lanes of a block, the same on every machine, so that sums come in the same order. Loops over
/// fewer are unrolled before the compiler gets to vectorise them (8: 300 us a step of the standard
/// sheet instead of 185), more spill (32: 250 us).
pub(super) const WIDTH: usize = 16;

/// One number a lane.
pub(super) type Lane = [f64; WIDTH];

/// A vector of the sheet: x, y and z of every vertex, padded to whole blocks.
pub(super) type Field = [Vec<f64>; 3];

/// A vector of `count` zeros.
pub(super) fn zeros(count: usize) -> Field {
    std::array::from_fn(|_| vec![0.0; count.next_multiple_of(WIDTH)])
}

/// The vector of a vertex.
#[inline(always)]
pub(super) fn at(field: &Field, vertex: usize) -> Vec3 {
    Vec3::new(field[0][vertex], field[1][vertex], field[2][vertex])
}

/// The elements of a block: which they are, and their vertices.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// The first lanes' elements; less than [`WIDTH`] in the last block.
    pub elements: Vec<usize>,
    /// Unused lanes repeat the first element.
    pub vertices: [[u32; WIDTH]; 3],
    /// Vertices of each corner follow one another, so that they are loaded at once.
    pub is_row: bool,
}

/// Packs elements into blocks, those with consecutive vertices together.
pub(super) fn pack(elements: &[[u32; 3]]) -> Vec<Block> {
    let mut order: Vec<usize> = (0..elements.len()).collect();
    let shape = |e: usize| {
        let [a, b, c] = elements[e].map(i64::from);
        [b - a, c - a]
    };
    order.sort_by_key(|&e| (shape(e), elements[e][0]));
    let mut blocks = Vec::new();
    let mut rest = Vec::new();
    let follows =
        |a: &usize, b: &usize| shape(*a) == shape(*b) && elements[*a][0] + 1 == elements[*b][0];
    for run in order.chunk_by(follows) {
        let rows = run.chunks_exact(WIDTH);
        rest.extend_from_slice(rows.remainder());
        blocks.extend(rows.map(|row| block(elements, row, true)));
    }
    rest.sort_by_key(|&e| (elements[e], e));
    blocks.extend(rest.chunks(WIDTH).map(|some| block(elements, some, false)));
    blocks.sort_by_key(|block| block.vertices[0][0]);
    blocks
}

fn block(elements: &[[u32; 3]], some: &[usize], is_row: bool) -> Block {
    let of = |lane: usize| elements[*some.get(lane).unwrap_or(&some[0])];
    Block {
        elements: some.to_vec(),
        vertices: std::array::from_fn(|corner| std::array::from_fn(|lane| of(lane)[corner])),
        is_row,
    }
}

impl Block {
    /// What the vertices of a corner have.
    #[inline(always)]
    pub fn load(&self, x: &[f64], corner: usize) -> Lane {
        let vertices = &self.vertices[corner];
        let mut lane = [0.0; WIDTH];
        if self.is_row {
            let first = vertices[0] as usize;
            lane.copy_from_slice(&x[first..first + WIDTH]);
        } else {
            for (to, &v) in lane.iter_mut().zip(vertices) {
                *to = x[v as usize];
            }
        }
        lane
    }

    /// Adds to what the vertices of a corner have.
    #[inline(always)]
    pub fn add(&self, f: &mut [f64], corner: usize, lane: &Lane) {
        let vertices = &self.vertices[corner];
        if self.is_row {
            let first = vertices[0] as usize;
            let f = &mut f[first..first + WIDTH];
            for l in 0..WIDTH {
                f[l] += lane[l];
            }
        } else {
            let used = self.elements.len();
            for (&v, add) in vertices.iter().zip(lane).take(used) {
                f[v as usize] += add;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_has_one_lane_with_its_vertices() {
        let count = 2 * WIDTH as u32 + 4;
        let mut elements: Vec<[u32; 3]> = (0..count).map(|v| [v, v + 1, v + 60]).collect();
        elements.extend((3..6).map(|v| [v, v + 59, v + 60]));
        let blocks = pack(&elements);
        assert_eq!(blocks.iter().filter(|b| b.is_row).count(), 2);
        let mut found = vec![0; elements.len()];
        for block in &blocks {
            for (lane, &element) in block.elements.iter().enumerate() {
                found[element] += 1;
                let vertices = block.vertices.map(|corner| corner[lane]);
                assert_eq!(vertices, elements[element]);
            }
        }
        assert_eq!(found, vec![1; elements.len()]);
    }

    #[test]
    fn loads_and_sums_go_to_their_vertices() {
        let count = WIDTH as u32 + 3;
        let elements: Vec<[u32; 3]> = (0..count).map(|v| [v, v + 1, v + 22]).collect();
        let x: Vec<f64> = (0..64).map(f64::from).collect();
        let mut sum = vec![0.0; 64];
        for block in pack(&elements) {
            for corner in 0..3 {
                let lane = block.load(&x, corner);
                for (value, vertex) in lane.iter().zip(block.vertices[corner]) {
                    assert_eq!(*value, f64::from(vertex));
                }
                block.add(&mut sum, corner, &[1.0; WIDTH]);
            }
        }
        let mut expected = vec![0.0; 64];
        for v in elements.iter().flatten() {
            expected[*v as usize] += 1.0;
        }
        assert_eq!(sum, expected);
    }
}
