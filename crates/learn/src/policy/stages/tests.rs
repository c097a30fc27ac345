use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Images of `rows` x `columns` pixels through convolutions `(outputs, pool)`.
struct Case {
    images: usize,
    size: [usize; 2],
    inputs: usize,
    layers: &'static [(usize, bool)],
}

/// Odd sides, single pixels, channels that fill no vector, images that fill none.
const CASES: [Case; 6] = [
    Case {
        images: 1,
        size: [1, 1],
        inputs: 1,
        layers: &[(1, false)],
    },
    Case {
        images: 3,
        size: [1, 6],
        inputs: 2,
        layers: &[(3, false), (1, false)],
    },
    Case {
        images: 17,
        size: [5, 3],
        inputs: 3,
        layers: &[(5, true)],
    },
    Case {
        images: 2,
        size: [9, 7],
        inputs: 3,
        layers: &[(8, false), (8, true), (3, false), (5, true)],
    },
    Case {
        images: 33,
        size: [2, 3],
        inputs: 1,
        layers: &[(2, true), (4, false)],
    },
    Case {
        images: 2,
        size: [5, 66],
        inputs: 4,
        layers: &[(1, true), (6, true)],
    },
];

impl Case {
    fn stages(&self) -> Vec<Stage> {
        let mut inputs = self.inputs;
        let stage = |&(outputs, pool): &(usize, bool)| Stage {
            inputs: std::mem::replace(&mut inputs, outputs),
            outputs,
            pool,
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
        let pools = stages.iter().filter(|stage| stage.pool).count();
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
        for stage in case.stages() {
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
                sum.max(0.0)
            };
            let step = if stage.pool { 2 } else { 1 };
            let mut y = Vec::new();
            for output in 0..stage.outputs {
                for row in 0..rows / step {
                    for column in 0..columns / step {
                        let square = (0..step * step).map(|k| {
                            pixel(output, row * step + k / step, column * step + k % step)
                        });
                        y.push(square.fold(0.0, f64::max));
                    }
                }
            }
            (rows, columns, x) = (rows / step, columns / step, y);
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
