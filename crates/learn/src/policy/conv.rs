//! 3x3 convolutions on a CPU, with one image in each SIMD lane.
//!
//! Any number of channels then fills the lanes, weights are the same in all of them, pooling and
//! ReLU need no shuffles, and what an image gets does not depend on how wide the lanes are.
//! Numbers are fused by [`Lanes::mul_add`] in one order, so bits depend neither on the
//! instruction set nor on the number of threads.

use drape_cloth::math::Lanes;

/// The plane of one channel: an image with a border of zeros, its sides extended by zeros to even
/// numbers. A channel's plane follows the other's; a row is contiguous.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    pub rows: usize,
    pub columns: usize,
}

impl Plane {
    /// Pixels of the image.
    pub fn pixels(self) -> usize {
        self.rows * self.columns
    }

    /// Numbers of a plane.
    pub fn len(self) -> usize {
        (self.rows.next_multiple_of(2) + 2) * self.stride()
    }

    /// Numbers of a row.
    pub fn stride(self) -> usize {
        self.columns.next_multiple_of(2) + 2
    }

    /// Where a pixel of the image is in the plane of `channel`.
    pub fn at(self, channel: usize, row: usize, column: usize) -> usize {
        channel * self.len() + (row + 1) * self.stride() + column + 1
    }

    /// The image of half the sides, without an odd last row and column.
    pub fn pooled(self) -> Self {
        Self {
            rows: self.rows / 2,
            columns: self.columns / 2,
        }
    }

    /// The image of half the sides, with them.
    pub fn halved(self) -> Self {
        Self {
            rows: self.rows.div_ceil(2),
            columns: self.columns.div_ceil(2),
        }
    }
}

/// Weights `[block of N outputs][input][tap][output]`, as [`convolve`] reads them.
pub struct Weights<const N: usize> {
    inputs: usize,
    outputs: usize,
    blocks: Vec<[[f32; N]; 9]>,
    bias: Vec<[f32; N]>,
}

impl<const N: usize> Weights<N> {
    /// Weights by output, input and tap, and a bias an output or none at all.
    pub fn new(
        outputs: usize,
        inputs: usize,
        weight: impl Fn(usize, usize, usize) -> f32,
        bias: &[f32],
    ) -> Self {
        let (weight, count) = (&weight, outputs.div_ceil(N));
        // Outputs that fill the last block up have weights of another and are not looked at.
        let output = |block: usize, n: usize| (block * N + n).min(outputs - 1);
        let block = |block| {
            (0..inputs).map(move |input| {
                std::array::from_fn(|tap| {
                    std::array::from_fn(|n| weight(output(block, n), input, tap))
                })
            })
        };
        let bias_of = |o: usize| bias.get(o).copied().unwrap_or(0.0);
        Self {
            inputs,
            outputs,
            blocks: (0..count).flat_map(block).collect(),
            bias: (0..count)
                .map(|block| std::array::from_fn(|n| bias_of(output(block, n))))
                .collect(),
        }
    }
}

/// Convolves the planes `input` where `rows` x `columns` pixels are wanted, in squares of 2 x 2,
/// and gives output, first row, first column and the square, row by row, to `finish`.
#[inline(always)]
pub fn convolve<V: Lanes<Scalar = f32>, const N: usize>(
    input: &[V],
    plane: Plane,
    [rows, columns]: [usize; 2],
    weights: &Weights<N>,
    mut finish: impl FnMut(usize, usize, usize, [V; 4]),
) {
    for row in (0..rows).step_by(2) {
        let blocks = weights.blocks.chunks_exact(weights.inputs);
        for (block, (taps, bias)) in blocks.zip(&weights.bias).enumerate() {
            let outputs = block * N..weights.outputs;
            for column in (0..columns).step_by(2) {
                let start = row * plane.stride() + column;
                let squares = square(input, plane, start, taps, bias);
                for (output, square) in outputs.clone().zip(squares) {
                    finish(output, row, column, square);
                }
            }
        }
    }
}

/// 2 x 2 pixels of N outputs; `start` is where the first one's window begins. Inputs are added up
/// one after the other, in registers.
#[inline(always)]
fn square<V: Lanes<Scalar = f32>, const N: usize>(
    input: &[V],
    plane: Plane,
    start: usize,
    taps: &[[[f32; N]; 9]],
    bias: &[f32; N],
) -> [[V; 4]; N] {
    let stride = plane.stride();
    let mut sums = bias.map(|bias| [V::splat(bias); 4]);
    for (input, taps) in input.chunks_exact(plane.len()).zip(taps) {
        for dy in 0..3 {
            let upper: &[V; 4] = window(input, start + dy * stride);
            let lower: &[V; 4] = window(input, start + (dy + 1) * stride);
            for dx in 0..3 {
                let x = [upper[dx], upper[dx + 1], lower[dx], lower[dx + 1]];
                for (sum, &weight) in sums.iter_mut().zip(&taps[3 * dy + dx]) {
                    let weight = V::splat(weight);
                    for (sum, x) in sum.iter_mut().zip(x) {
                        *sum = x.mul_add(weight, *sum);
                    }
                }
            }
        }
    }
    sums
}

#[inline(always)]
fn window<V, const N: usize>(numbers: &[V], start: usize) -> &[V; N] {
    let window = numbers[start..].first_chunk();
    window.expect("a window ends within its plane")
}

/// Pixels that are summed up before the sums leave the registers.
const RUN: usize = 64;

/// Adds to `sums` `[block of O outputs][block of I inputs][tap][input][output]` what each lane
/// says about the weights: the sum, over pixels, of the input under a tap times the gradient of
/// the output. [`at_weight`] finds a weight's sum.
#[allow(
    clippy::needless_range_loop,
    reason = "two indices show what the registers hold"
)]
#[inline(always)]
pub fn correlate<V: Lanes<Scalar = f32>, const I: usize, const O: usize>(
    input: &[V],
    gradient: &[V],
    plane: Plane,
    sums: &mut [V],
) {
    let [inputs, outputs] = [input, gradient].map(|planes| planes.len() / plane.len());
    let run = (RUN / plane.columns).max(1);
    for first in (0..plane.rows).step_by(run) {
        let rows = first..(first + run).min(plane.rows);
        let mut sums = sums.chunks_exact_mut(I * O);
        for output in (0..outputs).step_by(O) {
            for input_from in (0..inputs).step_by(I) {
                for tap in 0..9 {
                    let sums = sums.next().expect("there is a sum for every weight");
                    let mut sum: [[V; O]; I] = std::array::from_fn(|i| *window(sums, i * O));
                    for row in rows.clone() {
                        // Channels that fill a block up are others, and nobody looks at their sums.
                        let g: [&[V]; O] = std::array::from_fn(|o| {
                            let output = (output + o).min(outputs - 1);
                            &gradient[plane.at(output, row, 0)..][..plane.columns]
                        });
                        let x: [&[V]; I] = std::array::from_fn(|i| {
                            let input_at = (input_from + i).min(inputs - 1);
                            let start = (row + tap / 3) * plane.stride() + tap % 3;
                            &input[input_at * plane.len() + start..][..plane.columns]
                        });
                        for column in 0..plane.columns {
                            let g: [V; O] = std::array::from_fn(|o| g[o][column]);
                            for i in 0..I {
                                let x = x[i][column];
                                for o in 0..O {
                                    sum[i][o] = x.mul_add(g[o], sum[i][o]);
                                }
                            }
                        }
                    }
                    for (to, from) in sums.iter_mut().zip(sum.as_flattened()) {
                        *to = *from;
                    }
                }
            }
        }
    }
}

/// Number of sums that [`correlate`] adds to.
pub fn sum_count<const I: usize, const O: usize>(inputs: usize, outputs: usize) -> usize {
    9 * inputs.next_multiple_of(I) * outputs.next_multiple_of(O)
}

/// Where [`correlate`] has the sum of a weight.
pub fn at_weight<const I: usize, const O: usize>(
    inputs: usize,
    [output, input, tap]: [usize; 3],
) -> usize {
    let block = output / O * inputs.div_ceil(I) + input / I;
    ((block * 9 + tap) * I + input % I) * O + output % O
}
