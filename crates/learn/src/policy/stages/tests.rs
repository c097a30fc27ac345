use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Images of `rows` x `columns` pixels through convolutions `(outputs, kind)`.
struct Case {
    images: usize,
    size: [usize; 2],
    inputs: usize,
    layers: &'static [(usize, StageKind)],
}

/// Odd sides, single pixels, channels that fill no vector, images that fill none.
const CASES: [Case; 9] = {
    use StageKind::*;
    const fn case(
        images: usize,
        size: [usize; 2],
        inputs: usize,
        layers: &'static [(usize, StageKind)],
    ) -> Case {
        Case {
            images,
            size,
            inputs,
            layers,
        }
    }
    [
        case(1, [1, 1], 1, &[(1, Plain)]),
        case(3, [1, 6], 2, &[(3, Plain), (1, Plain)]),
        case(17, [5, 3], 3, &[(5, Pool)]),
        case(
            2,
            [9, 7],
            3,
            &[(8, Plain), (8, Pool), (3, Plain), (5, Pool)],
        ),
        case(33, [2, 3], 1, &[(2, Pool), (4, Plain)]),
        case(2, [5, 66], 4, &[(1, Pool), (6, Pool)]),
        case(1, [1, 1], 2, &[(4, Down), (4, Up), (3, Linear)]),
        case(
            17,
            [5, 6],
            3,
            &[(4, Down), (4, Plain), (5, Up), (1, Linear)],
        ),
        case(
            2,
            [9, 7],
            8,
            &[
                (5, Plain),
                (3, Down),
                (3, Down),
                (3, Plain),
                (3, Up),
                (6, Up),
                (2, Linear),
            ],
        ),
    ]
};

impl Case {
    fn stages(&self) -> Vec<NetworkStage> {
        let mut inputs = self.inputs;
        let stage = |&(outputs, kind): &(usize, StageKind)| NetworkStage {
            inputs: std::mem::replace(&mut inputs, outputs),
            outputs,
            kind,
        };
        self.layers.iter().map(stage).collect()
    }

    /// Parameters, images and a gradient of the features.
    fn numbers(&self) -> [Vec<f32>; 3] {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw =
            |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random::<f32>() - 0.4).collect() };
        let stages = self.stages();
        let count = stages.iter().map(|s| s.weight_count() + s.outputs);
        // Every Up has its Down, so only pools make images smaller here.
        let pools = stages.iter().filter(|stage| stage.kind == StageKind::Pool);
        let pools = pools.count();
        let features = stages[stages.len() - 1].outputs * (self.size[0] >> pools);
        [
            draw(count.sum()),
            draw(self.images * self.inputs * self.size[0] * self.size[1]),
            draw(self.images * features * (self.size[1] >> pools)),
        ]
    }

    fn run(&self, isa: Isa) -> [Vec<f32>; 2] {
        let [parameters, images, gradient] = self.numbers();
        let [rows, columns] = self.size;
        let plane = Plane { rows, columns };
        let (features, pullback) = forward(self.stages(), plane, &parameters, &images, isa);
        [features, pullback(&gradient)]
    }
}

/// Features by the definition, in f64.
fn plain(case: &Case, parameters: &[f64], images: &[f32]) -> Vec<f64> {
    let mut all = Vec::new();
    for image in images.chunks(images.len() / case.images) {
        let mut x: Vec<f64> = image.iter().map(|&x| x.into()).collect();
        let ([mut rows, mut columns], mut at) = (case.size, 0);
        let mut kept = Vec::new();
        for stage in case.stages() {
            if stage.kind == StageKind::Up {
                let (finer, [down, right]): (Vec<f64>, [usize; 2]) = kept.pop().unwrap();
                let sum = finer.iter().enumerate().map(|(k, kept)| {
                    let (row, column) = (k / right, k % right);
                    let (channel, row) = (row / down, row % down);
                    kept + x[(channel * rows + row / 2) * columns + column / 2]
                });
                (x, [rows, columns]) = (sum.collect(), [down, right]);
            }
            let weight = &parameters[at..];
            let bias = &weight[stage.weight_count()..];
            at += stage.weight_count() + stage.outputs;
            let pixel = |output: usize, row: usize, column: usize| {
                let mut sum = bias[output];
                for input in 0..stage.inputs {
                    for tap in 0..9 {
                        let (row, column) = (row + tap / 3, column + tap % 3);
                        if (1..=rows).contains(&row) && (1..=columns).contains(&column) {
                            let x = x[(input * rows + row - 1) * columns + column - 1];
                            sum += weight[(output * stage.inputs + input) * 9 + tap] * x;
                        }
                    }
                }
                match stage.kind {
                    StageKind::Linear => sum,
                    _ => sum.max(0.0),
                }
            };
            let mut whole = Vec::new();
            for output in 0..stage.outputs {
                for row in 0..rows {
                    whole.extend((0..columns).map(|column| pixel(output, row, column)));
                }
            }
            let halved = match stage.kind {
                StageKind::Pool => [rows / 2, columns / 2],
                StageKind::Down => [rows.div_ceil(2), columns.div_ceil(2)],
                _ => {
                    x = whole;
                    continue;
                }
            };
            let [down, right] = halved;
            x = vec![0.0; stage.outputs * down * right];
            for (k, &number) in whole.iter().enumerate() {
                let (row, column) = (k / columns, k % columns);
                let (output, row, column) = (row / rows, row % rows / 2, column / 2);
                if row < down && column < right {
                    let best = &mut x[(output * down + row) * right + column];
                    *best = number.max(*best);
                }
            }
            if stage.kind == StageKind::Down {
                kept.push((whole, [rows, columns]));
            }
            [rows, columns] = halved;
        }
        all.extend(x);
    }
    all
}

/// Compares with f64, up to rounding relative to numbers of order one.
fn assert_close(found: f32, expected: f64, tolerance: f64, place: &str) {
    let error = (f64::from(found) - expected).abs();
    assert!(
        error < tolerance * (1.0 + expected.abs()),
        "{place}: {error}"
    );
}

#[test]
fn features_are_those_of_the_definition() {
    for (index, case) in CASES.iter().enumerate() {
        let [parameters, images, _] = case.numbers();
        let parameters: Vec<f64> = parameters.iter().map(|&x| x.into()).collect();
        let expected = plain(case, &parameters, &images);
        let [found, _] = case.run(Isa::best());
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert_close(*found, expected, 1e-5, &format!("case {index}"));
        }
    }
}

#[test]
fn gradients_are_those_of_finite_differences() {
    let h = 1e-6;
    for (index, case) in CASES.iter().enumerate() {
        let [parameters, images, gradient] = case.numbers();
        let mut parameters: Vec<f64> = parameters.iter().map(|&x| x.into()).collect();
        let [_, found] = case.run(Isa::best());
        for (k, found) in found.iter().enumerate() {
            let at = parameters[k];
            let [above, below] = [h, -h].map(|h| {
                parameters[k] = at + h;
                let features = plain(case, &parameters, &images);
                let products = features.iter().zip(&gradient);
                products.map(|(f, g)| f * f64::from(*g)).sum::<f64>()
            });
            parameters[k] = at;
            let expected = (above - below) / (2.0 * h);
            assert_close(*found, expected, 1e-4, &format!("case {index}, {k}"));
        }
    }
}

#[test]
fn bits_depend_on_neither_instruction_set_nor_threads() {
    for case in &CASES {
        let expected = case.run(Isa::Portable);
        assert!(expected.iter().flatten().all(|x| x.is_finite()));
        for isa in Isa::available() {
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                let found = pool.build().unwrap().install(|| case.run(isa));
                assert_eq!(found, expected, "{isa:?}, {threads} threads");
            }
        }
    }
}
