//! Adam (Kingma and Ba 2015) over a module's parameters, with the gradient's global norm.
//!
//! burn has an Adam, but its records come in random order and take a network's file for a
//! state; and its clipping by norm looks at each tensor by itself.

use super::sections::{decode, encode};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;

/// Running moments of the gradient: one tensor a parameter, flat, in the network's order.
#[derive(Clone, Debug)]
pub struct Adam {
    epsilon: f64,
    step_count: u32,
    moments: Vec<Moments>,
}

/// The first and the second moment.
type Moments = [Tensor<1>; 2];

/// [`Adam`] as numbers.
#[derive(Serialize, Deserialize)]
struct Stored {
    step_count: u32,
    moments: Vec<[Vec<f32>; 2]>,
}

impl Adam {
    /// Zero moments for the parameters of `module`.
    pub fn new<M: Module>(module: &M, epsilon: f64) -> Self {
        let mut zeros = Zeros(Vec::new());
        module.visit(&mut zeros);
        Self {
            epsilon,
            step_count: 0,
            moments: zeros.0,
        }
    }

    /// Moves the parameters of `module` against `gradients` times `scale`.
    pub fn step<M: Module>(
        &mut self,
        module: M,
        gradients: GradientsParams,
        scale: f64,
        learning_rate: f64,
    ) -> M {
        self.step_count += 1;
        let t = self.step_count as f64;
        module.map(&mut Step {
            gradients,
            scale,
            // Kingma and Ba, end of Section 2: both bias corrections in the step size.
            first_correction: 1.0 - BETA_1.powf(t),
            second_correction: 1.0 - BETA_2.powf(t),
            learning_rate,
            epsilon: self.epsilon,
            moments: self.moments.iter_mut(),
        })
    }

    /// All moments and the number of steps.
    pub fn save(&self) -> Vec<u8> {
        let numbers = |x: &Tensor<1>| x.to_data().try_into_vec().expect("moments are f32");
        let pairs = self.moments.iter();
        encode(&Stored {
            step_count: self.step_count,
            moments: pairs.map(|pair| pair.each_ref().map(numbers)).collect(),
        })
    }

    /// These moments replaced by those that [`Adam::save`] wrote; fails with a reason if they
    /// are of another network.
    pub fn loaded(&self, bytes: &[u8]) -> Result<Self, String> {
        let stored: Stored = decode(bytes)?;
        let fits = |(own, stored): (&Moments, &[Vec<f32>; 2])| {
            stored.iter().all(|x| x.len() == own[0].dims()[0])
        };
        let mut pairs = self.moments.iter().zip(&stored.moments);
        if self.moments.len() != stored.moments.len() || !pairs.all(fits) {
            return Err("moments are of another network".to_owned());
        }
        let restore = |(own, stored): (&Moments, [Vec<f32>; 2])| {
            stored.map(|numbers| {
                let shape = [numbers.len()];
                Tensor::from_data(TensorData::new(numbers, shape), &own[0].device())
            })
        };
        let pairs = self.moments.iter().zip(stored.moments);
        Ok(Self {
            epsilon: self.epsilon,
            step_count: stored.step_count,
            moments: pairs.map(restore).collect(),
        })
    }
}

/// Euclidean norm of all gradients of `module` together.
pub fn global_norm<M: Module>(module: &M, gradients: &GradientsParams) -> f32 {
    let mut squares = Squares {
        gradients,
        sums: Vec::new(),
    };
    module.visit(&mut squares);
    let total: f32 = Tensor::cat(squares.sums, 0).sum().into_scalar();
    total.sqrt()
}

struct Zeros(Vec<Moments>);

impl ModuleVisitor for Zeros {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let value = param.val().inner();
        let zeros = Tensor::zeros([value.dims().iter().product::<usize>()], &value.device());
        self.0.push([zeros.clone(), zeros]);
    }
}

struct Squares<'a> {
    gradients: &'a GradientsParams,
    sums: Vec<Tensor<1>>,
}

impl ModuleVisitor for Squares<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(param.id) {
            self.sums.push(gradient.square().sum());
        }
    }
}

struct Step<'a> {
    gradients: GradientsParams,
    scale: f64,
    first_correction: f64,
    second_correction: f64,
    learning_rate: f64,
    epsilon: f64,
    moments: std::slice::IterMut<'a, Moments>,
}

impl ModuleMapper for Step<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let moments = self.moments.next();
        let [first, second] = moments.expect("one pair of moments a parameter");
        let Some(gradient) = self.gradients.remove::<D>(param.id) else {
            return param;
        };
        let g = gradient.reshape([-1]) * self.scale;
        let m = first.clone() * BETA_1 + g.clone() * (1.0 - BETA_1);
        let v = second.clone() * BETA_2 + g.square() * (1.0 - BETA_2);
        (*first, *second) = (m.clone(), v.clone());
        let deviation = (v / self.second_correction).sqrt() + self.epsilon;
        let delta = m * (self.learning_rate / self.first_correction) / deviation;
        param.map(|old| {
            let new = old.clone().inner();
            let shape = new.dims();
            Tensor::from_inner(new - delta.reshape(shape)).set_require_grad(old.is_require_grad())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[derive(Module, Debug)]
    struct Two {
        a: Param<Tensor<1>>,
        b: Param<Tensor<2>>,
    }

    /// Parameters with gradients (3) and (0, 4): the norm is 5.
    fn two() -> (Two, GradientsParams) {
        let device = Device::flex().autodiff();
        let two = Two {
            a: Param::from_tensor(Tensor::from_floats([1.0], &device)),
            b: Param::from_tensor(Tensor::from_floats([[2.0, 3.0]], &device)),
        };
        let b = two.b.val() * Tensor::from_floats([[0.0, 4.0]], &device);
        let loss = (two.a.val() * 3.0).sum() + b.sum();
        let gradients = GradientsParams::from_grads(loss.backward(), &two);
        (two, gradients)
    }

    fn numbers(two: &Two) -> [f32; 3] {
        let a: Vec<f32> = two.a.val().into_data().try_into_vec().unwrap();
        let b: Vec<f32> = two.b.val().into_data().try_into_vec().unwrap();
        [a[0], b[0], b[1]]
    }

    #[test]
    fn norm_is_over_all_parameters() {
        let (two, gradients) = two();
        assert_eq!(global_norm(&two, &gradients), 5.0);
    }

    #[test]
    fn two_steps_by_hand() {
        let (module, gradients) = two();
        let mut adam = Adam::new(&module, 1e-8);
        // The first step is the learning rate in the gradient's sign, whatever its size.
        let module = adam.step(module, gradients, 0.2, 0.1);
        for (found, expected) in numbers(&module).iter().zip([0.9, 2.0, 2.9]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        // Then gradients 0: m = 0.9 * 0.1 g, v = 0.999 * 0.001 g².
        let device = Device::flex();
        let mut zeros = GradientsParams::new();
        zeros.register(module.a.id, Tensor::<1>::zeros([1], &device));
        zeros.register(module.b.id, Tensor::<2>::zeros([1, 2], &device));
        let module = adam.step(module, zeros, 1.0, 0.1);
        let step = 0.1 * (0.09 / 0.19) / (0.000999f32 / 0.001999).sqrt();
        for (found, expected) in numbers(&module).iter().zip([0.9 - step, 2.0, 2.9 - step]) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }

    #[test]
    fn foreign_state_is_refused() {
        let (module, _) = two();
        let adam = Adam::new(&module, 1e-8);
        let mut short = adam.clone();
        short.moments.pop();
        assert!(adam.loaded(&short.save()).is_err());
        assert!(adam.loaded(&[]).is_err());
        assert!(adam.loaded(&adam.save()).is_ok());
    }
}
