//! Convolutions one after the other and their gradients, group of images by group: what one
//! convolution writes the next one reads from the cache. Threads share the groups.

use super::conv::{Plane, Weights, at_weight, convolve, correlate, sum_count};
#[cfg(target_arch = "x86_64")]
use drape_cloth::math::{F32x8, F32x16};
use drape_cloth::math::{Isa, Kernel, Lanes, Portable};
use rayon::prelude::*;
use std::sync::{Arc, Mutex};

/// One 3x3 convolution with stride 1, padding 1 and bias.
#[derive(Clone, Copy, Debug)]
pub struct NetworkStage {
    pub inputs: usize,
    pub outputs: usize,
    pub kind: StageKind,
}

/// What comes before and after a convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageKind {
    /// ReLU.
    Plain,
    /// No ReLU; the last stage only.
    Linear,
    /// ReLU and 2x2 max-pooling, which leaves out an odd last row and column.
    Pool,
    /// ReLU, which a [`StageKind::Up`] takes later, and 2x2 max-pooling of all rows and columns.
    Down,
    /// Pixels become squares of 2 x 2, to which what the last [`StageKind::Down`] without an `Up` has
    /// kept is added. ReLU after the convolution.
    Up,
}

impl NetworkStage {
    fn weight_count(self) -> usize {
        9 * self.inputs * self.outputs
    }
}

/// From the gradient of the features to that of the parameters.
pub type Pullback = Arc<dyn Fn(&[f32]) -> Vec<f32> + Send + Sync>;

/// Images whose gradients are added up before those of others: as many as the widest lanes.
const UNIT: usize = 16;

/// Features `[image, output, row, column]` of `images` `[image, input, row, column]` through
/// `stages`, at least one, and how their gradient becomes that of `parameters`, which are, stage
/// after stage, the weights `[output, input, tap]` and the biases. `plane` is that of the images;
/// no stage may leave it without pixels.
pub fn forward(
    stages: Vec<NetworkStage>,
    plane: Plane,
    parameters: &[f32],
    images: &[f32],
    isa: Isa,
) -> (Vec<f32>, Pullback) {
    // So many outputs at once, each with four pixels, are what the registers hold.
    match isa {
        Isa::Portable => run::<Portable, 2>(stages, plane, parameters, images),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => run::<F32x8, 2>(stages, plane, parameters, images),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => run::<F32x16, 4>(stages, plane, parameters, images),
    }
}

fn run<V: Lanes<Scalar = f32>, const N: usize>(
    stages: Vec<NetworkStage>,
    plane: Plane,
    parameters: &[f32],
    images: &[f32],
) -> (Vec<f32>, Pullback) {
    const { assert!(UNIT.is_multiple_of(V::COUNT)) };
    let net = Net::<N>::new(stages, plane, parameters);
    let [seen, wide] = [net.input_width(), net.feature_width()];
    let count = parameters.len();
    let mut features = vec![0.0; images.len() / seen * wide];
    let groups = images.par_chunks(V::COUNT * seen);
    let groups = groups.zip(features.par_chunks_mut(V::COUNT * wide));
    let kept: Vec<Kept<V>> = groups
        .with_max_len(1)
        .map(|(images, features)| {
            let mut kept = Kept {
                planes: Vec::new(),
                stages: Vec::new(),
            };
            V::vectorize(Forward {
                net: &net,
                images,
                features,
                kept: &mut kept,
            });
            kept
        })
        .collect();
    let pullback = move |gradient: &[f32]| {
        // New memory for every group would cost as much time as a tenth of the work.
        let scratches = Mutex::new(Vec::<Scratch<V>>::new());
        let scratches = || scratches.lock().expect("no thread panics with the lock");
        let units = kept.par_chunks(UNIT / V::COUNT);
        let units = units.zip(gradient.par_chunks(UNIT * wide));
        let sums: Vec<Vec<f32>> = units
            .with_max_len(1)
            .map(|(kept, gradient)| {
                let mut sums = vec![0.0; count];
                let mut scratch = scratches().pop().unwrap_or_else(|| Scratch {
                    gradient: Vec::new(),
                    own: Vec::new(),
                    skipped: Vec::new(),
                });
                for (kept, gradient) in kept.iter().zip(gradient.chunks(V::COUNT * wide)) {
                    V::vectorize(Backward {
                        net: &net,
                        gradient,
                        kept,
                        sums: &mut sums,
                        scratch: &mut scratch,
                    });
                }
                scratches().push(scratch);
                sums
            })
            .collect();
        // In the order of the images, whichever thread had them.
        let mut total = vec![0.0; count];
        for sums in sums {
            total.iter_mut().zip(sums).for_each(|(t, sum)| *t += sum);
        }
        total
    };
    (features, Arc::new(pullback))
}

/// Stages with the weights of both directions.
struct Net<const N: usize> {
    stages: Vec<NetworkStage>,
    /// Of what each stage convolves, and of what it gives.
    planes: Vec<[Plane; 2]>,
    forward: Vec<Weights<N>>,
    backward: Vec<Weights<N>>,
}

impl<const N: usize> Net<N> {
    fn new(stages: Vec<NetworkStage>, mut plane: Plane, mut parameters: &[f32]) -> Self {
        let (mut planes, mut skipped) = (Vec::new(), Vec::new());
        let (mut forward, mut backward) = (Vec::new(), Vec::new());
        for stage in &stages {
            if stage.kind == StageKind::Up {
                plane = skipped.pop().expect("every Up has its Down");
            }
            let next = match stage.kind {
                StageKind::Plain | StageKind::Linear | StageKind::Up => plane,
                StageKind::Pool => plane.pooled(),
                StageKind::Down => {
                    skipped.push(plane);
                    plane.halved()
                }
            };
            planes.push([plane, next]);
            plane = next;
            let (inputs, outputs) = (stage.inputs, stage.outputs);
            let (weight, rest) = parameters.split_at(stage.weight_count());
            let (bias, rest) = rest.split_at(outputs);
            parameters = rest;
            let weight = |o: usize, i: usize, tap: usize| weight[(o * inputs + i) * 9 + tap];
            forward.push(Weights::new(outputs, inputs, weight, bias));
            let mirrored = |i, o, tap| weight(o, i, 8 - tap);
            backward.push(Weights::new(inputs, outputs, mirrored, &[]));
        }
        Self {
            stages,
            planes,
            forward,
            backward,
        }
    }

    fn input_width(&self) -> usize {
        self.stages[0].inputs * self.planes[0][0].pixels()
    }

    fn feature_plane(&self) -> (usize, Plane) {
        let last = self.stages.len() - 1;
        (self.stages[last].outputs, self.planes[last][1])
    }

    fn feature_width(&self) -> usize {
        let (channels, plane) = self.feature_plane();
        channels * plane.pixels()
    }
}

/// What a group's gradients need.
struct Kept<V> {
    /// Planes that were convolved and those that came of it.
    planes: Vec<Vec<V>>,
    stages: Vec<KeptStage<V>>,
}

/// What the gradients of a stage need.
struct KeptStage<V> {
    /// What it has convolved, by its number among the planes.
    input: usize,
    /// What came of it before pooling, likewise; none if only the maxima count or there is no ReLU.
    output: Option<usize>,
    /// Of each pooled pixel the one of its four that it is, or -1 where none is above 0.
    winners: Vec<V>,
}

struct Forward<'a, V, const N: usize> {
    net: &'a Net<N>,
    images: &'a [f32],
    features: &'a mut [f32],
    kept: &'a mut Kept<V>,
}

impl<V: Lanes<Scalar = f32>, const N: usize> Kernel for Forward<'_, V, N> {
    #[inline(always)]
    fn run(self) {
        let (net, Kept { planes, stages }) = (self.net, self.kept);
        let (inputs, plane) = (net.stages[0].inputs, net.planes[0][0]);
        let mut x = vec![V::zero(); inputs * plane.len()];
        fill(&mut x, plane, inputs, self.images);
        planes.push(x);
        let mut skipped: Vec<usize> = Vec::new();
        for (k, stage) in net.stages.iter().enumerate() {
            let [plane, next] = net.planes[k];
            if stage.kind == StageKind::Up {
                let kept = skipped.pop().expect("every Up has its Down");
                let (coarse, coarse_plane) = (&planes[planes.len() - 1], net.planes[k - 1][1]);
                planes.push(spread(coarse, coarse_plane, &planes[kept], plane));
            }
            let input = planes.len() - 1;
            let x = &*planes[input];
            let zeros = |plane: Plane| vec![V::zero(); stage.outputs * plane.len()];
            let (mut y, mut winners) = (zeros(next), Vec::new());
            let mut whole = Vec::new();
            let weights = &net.forward[k];
            match stage.kind {
                StageKind::Pool | StageKind::Down => {
                    winners = vec![V::zero(); stage.outputs * next.pixels()];
                    if stage.kind == StageKind::Down {
                        whole = zeros(plane);
                    }
                    let size = [2 * next.rows, 2 * next.columns];
                    convolve(
                        x,
                        plane,
                        size,
                        weights,
                        |output, row, column, mut square| {
                            if stage.kind == StageKind::Down {
                                square = square.map(|x| V::zero().max(x));
                                if column + 1 == plane.columns {
                                    (square[1], square[3]) = (V::zero(), V::zero());
                                }
                                if row + 1 == plane.rows {
                                    (square[2], square[3]) = (V::zero(), V::zero());
                                }
                                put(&mut whole, plane, [output, row, column], square);
                            }
                            let (row, column) = (row / 2, column / 2);
                            let pixel = output * next.pixels() + row * next.columns + column;
                            (y[next.at(output, row, column)], winners[pixel]) = max(square);
                        },
                    );
                }
                StageKind::Plain | StageKind::Up | StageKind::Linear => {
                    let size = [next.rows, next.columns];
                    convolve(
                        x,
                        plane,
                        size,
                        weights,
                        |output, row, column, mut square| {
                            if stage.kind != StageKind::Linear {
                                square = square.map(|x| V::zero().max(x));
                            }
                            put(&mut y, next, [output, row, column], square);
                        },
                    );
                    clear_extension(&mut y, next);
                }
            }
            let output = match stage.kind {
                StageKind::Linear | StageKind::Pool => None,
                _ => Some(planes.len()),
            };
            if stage.kind == StageKind::Down {
                skipped.push(planes.len());
                planes.push(whole);
            }
            planes.push(y);
            stages.push(KeptStage {
                input,
                output,
                winners,
            });
        }
        let (x, (_, plane)) = (&planes[planes.len() - 1], net.feature_plane());
        let images = self.features.chunks_exact_mut(net.feature_width());
        for (lane, features) in images.enumerate() {
            let rows = features.chunks_exact_mut(plane.columns).enumerate();
            for (row, features) in rows {
                let from = &x[plane.at(row / plane.rows, row % plane.rows, 0)..];
                for (feature, from) in features.iter_mut().zip(from) {
                    *feature = from.as_slice()[lane];
                }
            }
        }
    }
}

struct Backward<'a, V, const N: usize> {
    net: &'a Net<N>,
    gradient: &'a [f32],
    kept: &'a Kept<V>,
    /// Gradients of the parameters, to which those of this group are added.
    sums: &'a mut [f32],
    /// Memory to work in; what is in it does not matter.
    scratch: &'a mut Scratch<V>,
}

/// Gradients of what a stage gives, of what its convolution gives, and of what was kept for
/// stages further up.
struct Scratch<V> {
    gradient: Vec<V>,
    own: Vec<V>,
    skipped: Vec<Vec<V>>,
}

impl<V: Lanes<Scalar = f32>, const N: usize> Kernel for Backward<'_, V, N> {
    #[inline(always)]
    fn run(self) {
        let (net, mut sums) = (self.net, self.sums);
        let (channels, plane) = net.feature_plane();
        let Scratch {
            gradient,
            own,
            skipped,
        } = self.scratch;
        let planes = part(gradient, channels * plane.len());
        planes.fill(V::zero());
        fill(planes, plane, channels, self.gradient);
        let mut skips = 0;
        for (k, stage) in net.stages.iter().enumerate().rev() {
            let ([plane, next], kept) = (net.planes[k], &self.kept.stages[k]);
            let x = &self.kept.planes[kept.input];
            let own = part(own, stage.outputs * plane.len());
            let output = kept.output.map(|output| &*self.kept.planes[output]);
            let below = |gradient: V, y: V| V::select(V::zero().lt(y), gradient, V::zero());
            match (stage.kind, output) {
                (StageKind::Plain | StageKind::Up, Some(y)) => {
                    let pairs = gradient.iter().zip(y);
                    for (own, (gradient, y)) in own.iter_mut().zip(pairs) {
                        *own = below(*gradient, *y);
                    }
                }
                (StageKind::Down, Some(y)) => {
                    clear_border(own, plane, next);
                    unpool(gradient, next, &kept.winners, own, plane);
                    skips -= 1;
                    for (own, (gradient, y)) in own.iter_mut().zip(skipped[skips].iter().zip(y)) {
                        *own = *own + below(*gradient, *y);
                    }
                }
                (StageKind::Pool, _) => {
                    clear_border(own, plane, next);
                    unpool(gradient, next, &kept.winners, own, plane);
                }
                _ => own.copy_from_slice(&gradient[..own.len()]),
            }
            let (rest, biases) = sums.split_at_mut(sums.len() - stage.outputs);
            for (bias, own) in biases.iter_mut().zip(own.chunks_exact(plane.len())) {
                let sum = own.iter().fold(V::zero(), |sum, x| sum + *x);
                sum.as_slice().iter().for_each(|x| *bias += x);
            }
            let (rest, weights) = rest.split_at_mut(rest.len() - stage.weight_count());
            sums = rest;
            // Four inputs fill the registers, and images have three.
            match stage.inputs % 4 {
                0 => add_weights::<V, 4, N>(x, own, plane, *stage, weights),
                _ => add_weights::<V, 3, N>(x, own, plane, *stage, weights),
            }
            if k == 0 {
                break;
            }
            let planes = part(gradient, stage.inputs * plane.len());
            let size = [plane.rows, plane.columns];
            convolve(
                own,
                plane,
                size,
                &net.backward[k],
                |input, row, column, square| {
                    put(planes, plane, [input, row, column], square);
                },
            );
            if stage.kind == StageKind::Up {
                clear_extension(planes, plane);
                if skipped.len() == skips {
                    skipped.push(Vec::new());
                }
                part(&mut skipped[skips], planes.len()).copy_from_slice(planes);
                let coarse = net.planes[k - 1][1];
                let planes = part(gradient, stage.inputs * coarse.len());
                gather(&skipped[skips], plane, planes, coarse);
                skips += 1;
            }
        }
    }
}

/// The first `count` of some numbers, of which there may have to be more.
#[inline(always)]
fn part<V: Lanes<Scalar = f32>>(numbers: &mut Vec<V>, count: usize) -> &mut [V] {
    if numbers.len() < count {
        numbers.resize(count, V::zero());
    }
    &mut numbers[..count]
}

/// Puts zeros wherever the squares of `pooled` pixels do not reach.
#[inline(always)]
fn clear_border<V: Lanes<Scalar = f32>>(planes: &mut [V], plane: Plane, pooled: Plane) {
    for planes in planes.chunks_exact_mut(plane.len()) {
        for (row, numbers) in planes.chunks_exact_mut(plane.stride()).enumerate() {
            if (1..=2 * pooled.rows).contains(&row) {
                numbers[0] = V::zero();
                numbers[2 * pooled.columns + 1..].fill(V::zero());
            } else {
                numbers.fill(V::zero());
            }
        }
    }
}

/// Planes whose pixels are those of `kept` and of the `coarse` squares around them.
#[inline(always)]
fn spread<V: Lanes<Scalar = f32>>(
    coarse: &[V],
    coarse_plane: Plane,
    kept: &[V],
    plane: Plane,
) -> Vec<V> {
    let mut all = kept.to_vec();
    for channel in 0..kept.len() / plane.len() {
        for row in 0..plane.rows {
            let from = &coarse[coarse_plane.at(channel, row / 2, 0)..];
            let to = &mut all[plane.at(channel, row, 0)..][..plane.columns];
            for (column, to) in to.iter_mut().enumerate() {
                *to = *to + from[column / 2];
            }
        }
    }
    all
}

/// Sums the gradients of the pixels that [`spread`] has added a coarse one to.
#[inline(always)]
fn gather<V: Lanes<Scalar = f32>>(fine: &[V], plane: Plane, coarse: &mut [V], coarse_plane: Plane) {
    for channel in 0..coarse.len() / coarse_plane.len() {
        for row in 0..coarse_plane.rows {
            let [upper, lower] =
                [0, 1].map(|k| &fine[plane.at(channel, 2 * row + k, 0)..][..plane.stride() - 2]);
            let to = &mut coarse[coarse_plane.at(channel, row, 0)..][..coarse_plane.columns];
            for (column, to) in to.iter_mut().enumerate() {
                let pair = 2 * column..2 * column + 2;
                let [[a, b], [c, d]] =
                    [upper, lower].map(|fine| [fine[pair.start], fine[pair.end - 1]]);
                *to = (a + b) + (c + d);
            }
        }
    }
}

/// Puts images `[image, channel, row, column]` into planes of zeros.
#[inline(always)]
fn fill<V: Lanes<Scalar = f32>>(planes: &mut [V], plane: Plane, channels: usize, images: &[f32]) {
    for (lane, image) in images.chunks_exact(channels * plane.pixels()).enumerate() {
        for (row, image) in image.chunks_exact(plane.columns).enumerate() {
            let to = &mut planes[plane.at(row / plane.rows, row % plane.rows, 0)..];
            for (to, from) in to.iter_mut().zip(image) {
                to.as_mut_slice()[lane] = *from;
            }
        }
    }
}

/// The greatest of four numbers above 0, and which it is: the first of equals, -1 for none. What is not
/// finite gives NaN, so that nobody takes a network that has diverged for one that is sure.
#[inline(always)]
fn max<V: Lanes<Scalar = f32>>(numbers: [V; 4]) -> (V, V) {
    let [a, b, c, d] = numbers;
    let sum = (a + b) + (c + d);
    let mut best = (V::zero(), V::splat(-1.0));
    for (x, index) in numbers.into_iter().zip([0.0, 1.0, 2.0, 3.0]) {
        let is_above = best.0.lt(x);
        best.0 = V::select(is_above, x, best.0);
        best.1 = V::select(is_above, V::splat(index), best.1);
    }
    best.0 = sum.mul_add(V::zero(), best.0);
    best
}

/// Gives the gradient of pooled pixels to their winners.
#[inline(always)]
fn unpool<V: Lanes<Scalar = f32>>(
    gradient: &[V],
    pooled: Plane,
    winners: &[V],
    own: &mut [V],
    plane: Plane,
) {
    for (row, winners) in winners.chunks_exact(pooled.columns).enumerate() {
        let (channel, row) = (row / pooled.rows, row % pooled.rows);
        let gradient = &gradient[pooled.at(channel, row, 0)..];
        for (column, (winner, gradient)) in winners.iter().zip(gradient).enumerate() {
            // Nobody wins below 0; what the first to win has taken is not left to the others.
            let mut rest = V::select(winner.lt(V::zero()), V::zero(), *gradient);
            let mut square = [V::zero(); 4];
            for (share, bound) in square.iter_mut().zip([0.5, 1.5, 2.5, 3.5]) {
                let has_won = winner.lt(V::splat(bound));
                *share = V::select(has_won, rest, V::zero());
                rest = V::select(has_won, V::zero(), rest);
            }
            put(own, plane, [channel, 2 * row, 2 * column], square);
        }
    }
}

/// Writes a square of 2 x 2 pixels.
#[inline(always)]
fn put<V: Copy>(
    planes: &mut [V],
    plane: Plane,
    [channel, row, column]: [usize; 3],
    [a, b, c, d]: [V; 4],
) {
    let start = plane.at(channel, row, column);
    let square = &mut planes[start..start + plane.stride() + 2];
    (square[0], square[1]) = (a, b);
    (square[plane.stride()], square[plane.stride() + 1]) = (c, d);
}

/// Puts zeros again where images of odd sides have been extended.
#[inline(always)]
fn clear_extension<V: Lanes<Scalar = f32>>(planes: &mut [V], plane: Plane) {
    for planes in planes.chunks_exact_mut(plane.len()) {
        if plane.columns % 2 == 1 {
            let column = planes.iter_mut().skip(plane.columns + 1);
            column.step_by(plane.stride()).for_each(|x| *x = V::zero());
        }
        planes[plane.at(0, plane.rows, 0) - 1..].fill(V::zero());
    }
}

/// Adds the gradients of the weights of a stage, image after image.
#[inline(always)]
fn add_weights<V: Lanes<Scalar = f32>, const I: usize, const O: usize>(
    x: &[V],
    gradient: &[V],
    plane: Plane,
    NetworkStage {
        inputs, outputs, ..
    }: NetworkStage,
    weights: &mut [f32],
) {
    let mut sums = vec![V::zero(); sum_count::<I, O>(inputs, outputs)];
    correlate::<V, I, O>(x, gradient, plane, &mut sums);
    for (index, weight) in weights.iter_mut().enumerate() {
        let place = [index / 9 / inputs, index / 9 % inputs, index % 9];
        let sum = &sums[at_weight::<I, O>(inputs, place)];
        sum.as_slice().iter().for_each(|x| *weight += x);
    }
}

#[cfg(test)]
mod tests;
