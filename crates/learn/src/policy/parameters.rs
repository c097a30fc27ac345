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

/// All parameters of `network`, in its order.
pub fn save(network: &impl Module) -> Vec<u8> {
    postcard::to_allocvec(&collect(network)).expect("parameters can be written")
}

/// `network` with the parameters in `bytes`, or why it cannot take them.
pub fn load<M: Module>(network: M, bytes: &[u8]) -> Result<M, String> {
    let found: Vec<Parameter> = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
    let labels = |all: &[Parameter]| -> Vec<String> {
        let label = |p: &Parameter| format!("`{}` {:?}", p.name, p.shape);
        all.iter().map(label).collect()
    };
    let (own, others) = (labels(&collect(&network)), labels(&found));
    if own != others {
        let differ = own.iter().zip(&others).find(|(own, other)| own != other);
        return Err(match differ {
            Some((own, other)) => format!("the network has {own}, found {other}"),
            None => format!(
                "the network has {} tensors, found {}",
                own.len(),
                others.len()
            ),
        });
    }
    for Parameter {
        name,
        shape,
        numbers,
    } in &found
    {
        let (count, expected) = (numbers.len(), shape.iter().product::<usize>());
        if count != expected {
            return Err(format!("`{name}` has {count} numbers, expected {expected}"));
        }
        if !numbers.iter().all(|x| x.is_finite()) {
            return Err(format!("`{name}` holds a number that is not finite"));
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
