//! One environment in many lanes: lines that share no vertex are solved side by side.
//!
//! The state lies in the order of the warps, bundled by length: along a warp from number to number,
//! another warp in every lane. Wefts and rows of diagonals are copied out, solved and copied back;
//! where warps and wefts cross in a full square, that is a transposition if the lanes have one.

use std::ops::Range;

use super::line::{Chain, Line, LineLaw};
use super::lines::Lines;
use crate::math::{Lanes, Vec3x, WIDEST};

/// A line in every lane. Shorter ones are filled up with edges that are not there.
pub(super) struct Bundle<V> {
    vertices: Vec<u32>,
    edges: Range<usize>,
    law: LineLaw<V>,
    /// 1 in the lanes that have an edge, else 0.
    has_edge: Vec<V>,
}

impl<V: Lanes> Bundle<V> {
    /// Of `lines`, longest first, at most one a lane; their vertices begin at number `first`,
    /// their forces at number `edge`.
    fn new(lines: &[&Line], first: usize, edge: usize) -> Self {
        let longest = lines[0].vertices.len();
        let mut bundle = Self {
            vertices: (first as u32..(first + longest) as u32).collect(),
            edges: edge..edge + longest - 1,
            law: LineLaw {
                rest: [V::of(1.0); 2],
                compliance: [V::of(1.0); 2],
                min_warm: V::zero(),
                limit: None,
                bending: None,
            },
            has_edge: vec![V::zero(); longest - 1],
        };
        for (lane, line) in lines.iter().enumerate() {
            let own: LineLaw<f64> = line.law();
            for k in 0..2 {
                bundle.law.rest[k].set(lane, own.rest[k]);
                bundle.law.compliance[k].set(lane, own.compliance[k]);
            }
            bundle.law.min_warm.set(lane, own.min_warm);
            if let Some(limit) = own.limit {
                let all = bundle.law.limit.get_or_insert([V::of(1.0); 3]);
                for (all, limit) in all.iter_mut().zip(limit) {
                    all.set(lane, limit);
                }
            }
            if let Some(stiffness) = own.bending {
                let all = bundle.law.bending.get_or_insert(V::zero());
                all.set(lane, stiffness);
            }
            for has_edge in &mut bundle.has_edge[..line.vertices.len() - 1] {
                has_edge.set(lane, 1.0);
            }
        }
        bundle
    }
}

impl<V: Lanes> Chain<V> for Bundle<V> {
    #[inline(always)]
    fn vertices(&self) -> &[u32] {
        &self.vertices
    }
    #[inline(always)]
    fn edges(&self) -> Range<usize> {
        self.edges.clone()
    }
    #[inline(always)]
    fn law(&self) -> LineLaw<V> {
        self.law
    }
    #[inline(always)]
    fn of_edge(&self, j: usize, x: Vec3x<V>) -> Vec3x<V> {
        x.scale(self.has_edge[j])
    }
    #[inline(always)]
    fn has_edge(&self, j: usize) -> V {
        self.has_edge[j]
    }
}

/// Where the vertices of a bundle that crosses the warps are in the state.
pub(super) struct Places {
    /// Number and lane, as number * lanes + lane, of every vertex and lane of the bundle.
    slots: Vec<u32>,
    /// Parts of it in their order along the bundle.
    parts: Vec<Part>,
}

enum Part {
    /// As many vertices as there are lanes, from the first on: number j of them is in every
    /// lane of the bundle what lane j is of these numbers of the state.
    Square(usize, Vec<u32>),
    /// Any others.
    Single(Range<usize>),
}

impl Places {
    fn new<V: Lanes>(slots: Vec<u32>) -> Self {
        let lanes = V::COUNT;
        let count = slots.len() / lanes;
        let mut parts = Vec::new();
        let mut i = 0;
        while i < count {
            if V::TRANSPOSE.is_some()
                && let Some(numbers) = square(&slots[i * lanes..], lanes)
            {
                parts.push(Part::Square(i, numbers));
                i += lanes;
                continue;
            }
            match parts.last_mut() {
                Some(Part::Single(range)) => range.end += 1,
                _ => parts.push(Part::Single(i..i + 1)),
            }
            i += 1;
        }
        Self { slots, parts }
    }

    /// Copies the `K` components of the bundle's vertices out of the state, or `BACK` into it.
    #[inline(always)]
    pub fn copy<V: Lanes, const K: usize, const BACK: bool>(
        &self,
        state: &mut [V],
        bundle: &mut [V],
    ) {
        for part in &self.parts {
            match part {
                Part::Square(first, numbers) => {
                    for k in 0..K {
                        let mut block = [V::zero(); WIDEST];
                        for (j, (block, number)) in block.iter_mut().zip(numbers).enumerate() {
                            *block = match BACK {
                                true => bundle[K * (first + j) + k],
                                false => state[K * *number as usize + k],
                            };
                        }
                        let transpose = V::TRANSPOSE.expect("squares are for that");
                        transpose(&mut block[..V::COUNT]);
                        for (j, (block, number)) in block.iter().zip(numbers).enumerate() {
                            match BACK {
                                true => state[K * *number as usize + k] = *block,
                                false => bundle[K * (first + j) + k] = *block,
                            }
                        }
                    }
                }
                Part::Single(range) => {
                    let (state, bundle) = (V::flat_mut(state), V::flat_mut(bundle));
                    let slots = self.slots[range.start * V::COUNT..].chunks_exact(V::COUNT);
                    let vertices = bundle[K * V::COUNT * range.start..K * V::COUNT * range.end]
                        .chunks_exact_mut(K * V::COUNT);
                    for (slots, vertex) in slots.zip(vertices) {
                        for (lane, &slot) in slots.iter().enumerate() {
                            let state =
                                &mut state[component::<V, K>(slot)..][..(K - 1) * V::COUNT + 1];
                            for k in 0..K {
                                match BACK {
                                    true => state[k * V::COUNT] = vertex[k * V::COUNT + lane],
                                    false => vertex[k * V::COUNT + lane] = state[k * V::COUNT],
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Where the first of the `K` components of a slot is.
#[inline(always)]
fn component<V: Lanes, const K: usize>(slot: u32) -> usize {
    let slot = slot as usize;
    slot / V::COUNT * K * V::COUNT + slot % V::COUNT
}

/// The numbers in the state of which the first vertices of a bundle are the transposition.
fn square(slots: &[u32], lanes: usize) -> Option<Vec<u32>> {
    if slots.len() < lanes * lanes {
        return None;
    }
    let numbers: Vec<u32> = slots[..lanes].iter().map(|s| s / lanes as u32).collect();
    let fits = |(i, &slot): (usize, &u32)| {
        let [j, lane] = [i / lanes, i % lanes];
        slot == numbers[lane] * lanes as u32 + j as u32
    };
    let all = slots[..lanes * lanes].iter().enumerate().all(fits);
    all.then_some(numbers)
}

/// The lines of a model, bundled.
pub(super) struct Fold<V> {
    pub warps: Vec<Bundle<V>>,
    pub wefts: Vec<(Bundle<V>, Places)>,
    pub diagonals: Vec<(Bundle<V>, Places)>,
    /// Numbers in the state; the last holds no vertex and is as immovable as all such.
    pub count: usize,
    /// Numbers for forces.
    pub edge_count: usize,
    /// Vertices of the longest line.
    pub longest: usize,
    /// Number and lane of each vertex.
    pub vertices: Vec<[u32; 2]>,
    /// Number and lane of each edge's force.
    pub edges: Vec<[u32; 2]>,
}

impl<V: Lanes> Fold<V> {
    pub fn new(lines: &Lines) -> Self {
        let vertex_count = lines.warps.iter().map(|line| line.vertices.len()).sum();
        let mut fold = Self {
            warps: Vec::new(),
            wefts: Vec::new(),
            diagonals: Vec::new(),
            count: 0,
            edge_count: 0,
            longest: lines.longest,
            vertices: vec![[0; 2]; vertex_count],
            edges: vec![[0; 2]; lines.edge_count],
        };
        for lines in by_length(&lines.warps).chunks(V::COUNT) {
            let bundle = Bundle::new(lines, fold.count, fold.edge_count);
            for (lane, line) in lines.iter().enumerate() {
                for (&v, number) in line.vertices.iter().zip(&bundle.vertices) {
                    fold.vertices[v as usize] = [*number, lane as u32];
                }
            }
            fold.place_forces(lines);
            fold.count += bundle.vertices.len();
            fold.warps.push(bundle);
        }
        for lines in by_length(&lines.wefts).chunks(V::COUNT) {
            let bundle = Bundle::new(lines, 0, fold.edge_count);
            let places = fold.places(lines);
            fold.place_forces(lines);
            fold.wefts.push((bundle, places));
        }
        for lines in by_length(&lines.diagonals).chunks(V::COUNT) {
            let places = fold.places(lines);
            fold.diagonals.push((Bundle::new(lines, 0, 0), places));
        }
        fold.count += 1;
        fold
    }

    /// Gives the forces of a bundle of `lines` room.
    fn place_forces(&mut self, lines: &[&Line]) {
        for (lane, line) in lines.iter().enumerate() {
            for (j, edge) in line.edges.clone().enumerate() {
                self.edges[edge] = [(self.edge_count + j) as u32, lane as u32];
            }
        }
        self.edge_count += lines[0].vertices.len() - 1;
    }

    fn places(&self, lines: &[&Line]) -> Places {
        let lanes = V::COUNT as u32;
        let nowhere = self.count as u32 * lanes;
        let slot = |i: usize, lane: usize| {
            let vertex = lines.get(lane).and_then(|line| line.vertices.get(i));
            vertex.map_or(nowhere, |&v| {
                let [number, lane] = self.vertices[v as usize];
                number * lanes + lane
            })
        };
        let along = 0..lines[0].vertices.len();
        let slots = along.flat_map(|i| (0..V::COUNT).map(move |lane| (i, lane)));
        Places::new::<V>(slots.map(|(i, lane)| slot(i, lane)).collect())
    }
}

/// Longest first, otherwise in their order.
fn by_length(lines: &[Line]) -> Vec<&Line> {
    let mut sorted: Vec<&Line> = lines.iter().collect();
    sorted.sort_by_key(|line| std::cmp::Reverse(line.vertices.len()));
    sorted
}
