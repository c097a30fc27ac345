//! Gradients of all processes of a cluster, summed.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Tensor, TensorData};
use drape_task::cluster::Cluster;

/// Sums `numbers` and the gradients of `module` over all processes: to the same bits in each of them.
pub fn sum<M: Module>(
    cluster: &Cluster,
    module: &M,
    gradients: &mut GradientsParams,
    numbers: &mut [f32],
) {
    if cluster.size() == 1 {
        return;
    }
    let mut all = Flat {
        gradients,
        numbers: numbers.to_vec(),
    };
    module.visit(&mut all);
    let mut all = all.numbers;
    cluster.sum(&mut all);
    let (sums, rest) = all.split_at(numbers.len());
    numbers.copy_from_slice(sums);
    module.visit(&mut Replaced { gradients, rest });
}

struct Flat<'a> {
    gradients: &'a GradientsParams,
    numbers: Vec<f32>,
}

impl ModuleVisitor for Flat<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(param.id) {
            let numbers = gradient.into_data().try_into_vec::<f32>();
            self.numbers.extend(numbers.expect("gradients are f32"));
        }
    }
}

struct Replaced<'a> {
    gradients: &'a mut GradientsParams,
    rest: &'a [f32],
}

impl ModuleVisitor for Replaced<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(old) = self.gradients.remove::<D>(param.id) {
            let shape = old.dims();
            let (own, rest) = self.rest.split_at(shape.iter().product());
            self.rest = rest;
            let data = TensorData::new(own.to_vec(), shape);
            let new = Tensor::<D>::from_data(data, &old.device());
            self.gradients.register(param.id, new);
        }
    }
}
