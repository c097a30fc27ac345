//! Parameters as bytes. burn's own records are not used: they carry random identifiers (the
//! same network gives other bytes in each run), and another network's are not always refused.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

/// One tensor of parameters.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Parameter {
    /// Where it is in the network, such as `Compact.stem.weight`.
    name: String,
    shape: Vec<usize>,
    /// Row by row.
    numbers: Vec<f32>,
}

impl Parameter {
    fn label(&self) -> String {
        format!("`{}` {:?}", self.name, self.shape)
    }
}

/// Parameters that cannot be taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    #[error("parameters cannot be read")]
    Unreadable(#[from] postcard::Error),
    #[error("the network has {expected}, found {found}")]
    Mismatch { expected: String, found: String },
    #[error("`{name}` has {found} numbers where its shape needs {expected}")]
    Length {
        name: String,
        expected: usize,
        found: usize,
    },
    #[error("`{name}` holds a number that is not finite")]
    NotFinite { name: String },
}

/// All parameters of `network`, in its order.
pub fn save(network: &impl Module) -> Vec<u8> {
    postcard::to_allocvec(&collect(network)).expect("parameters can be written")
}

/// `network` with the parameters in `bytes`.
pub fn load<M: Module>(network: M, bytes: &[u8]) -> Result<M, ParameterError> {
    let found: Vec<Parameter> = postcard::from_bytes(bytes)?;
    let expected = collect(&network);
    let mismatch = |expected, found| Err(ParameterError::Mismatch { expected, found });
    if expected.len() != found.len() {
        let tensors = |all: &[Parameter]| format!("{} tensors", all.len());
        return mismatch(tensors(&expected), tensors(&found));
    }
    for (expected, found) in expected.into_iter().zip(&found) {
        if (&expected.name, &expected.shape) != (&found.name, &found.shape) {
            return mismatch(expected.label(), found.label());
        }
        if expected.numbers.len() != found.numbers.len() {
            return Err(ParameterError::Length {
                name: expected.name,
                expected: expected.numbers.len(),
                found: found.numbers.len(),
            });
        }
        if !found.numbers.iter().all(|x| x.is_finite()) {
            let name = expected.name;
            return Err(ParameterError::NotFinite { name });
        }
    }
    Ok(network.map(&mut Replacer(found.into_iter())))
}

fn collect(network: &impl Module) -> Vec<Parameter> {
    let mut collector = Collector::default();
    network.visit(&mut collector);
    collector.parameters
}

#[derive(Default)]
struct Collector {
    path: Vec<String>,
    parameters: Vec<Parameter>,
}

impl ModuleVisitor for Collector {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let value = param.val();
        self.parameters.push(Parameter {
            name: self.path.join("."),
            shape: value.dims().to_vec(),
            numbers: value
                .into_data()
                .try_into_vec()
                .expect("parameters are f32"),
        });
    }
}

struct Replacer(std::vec::IntoIter<Parameter>);

impl ModuleMapper for Replacer {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Parameter { shape, numbers, .. } = self.0.next().expect("counts were compared");
        param.map(|old| {
            let new = Tensor::from_data(TensorData::new(numbers, shape), &old.device());
            new.set_require_grad(old.is_require_grad())
        })
    }
}
