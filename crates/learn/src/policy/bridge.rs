//! Numbers that kernels have left on a GPU as tensors of burn's there, without a copy.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{DType, Int, Shape, Tensor};
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{Cube, CubeBackend};
use burn_fusion::{NoOp, get_client};
use burn_ir::{BackendIr, InitOperationIr, OperationIr};
use drape_cloth::sim::Buffer;
use drape_task::env::Sight;

/// Numbers `[environment, pixel]`.
pub fn floats(sight: &Sight, buffer: &Buffer) -> Tensor<2> {
    Tensor::from_primitive::<Cube>(tensor(sight, buffer, DType::F32))
}

/// Whole numbers `[environment, pixel]`.
pub fn whole_numbers(sight: &Sight, buffer: &Buffer) -> Tensor<2, Int> {
    Tensor::from_primitive::<Cube>(tensor(sight, buffer, DType::I32))
}

/// burn fuses operations lazily: a tensor is registered with what queues them.
fn tensor(sight: &Sight, buffer: &Buffer, dtype: DType) -> FloatTensor<Cube> {
    let (device, shape) = (sight.adapter.device(), Shape::from(sight.shape));
    let handle = CubeBackend::float_tensor_handle(CubeTensor::new_contiguous(
        device.client(),
        device.clone(),
        shape.clone(),
        buffer.handle().clone(),
        dtype,
    ));
    let client = get_client::<CubeBackend>(&device);
    let init = InitOperationIr::create(shape, dtype, || client.register_tensor_handle(handle));
    let init = OperationIr::Init(init);
    let mut made = client.register(
        burn_fusion::custom::StreamId::current(),
        init,
        NoOp::<CubeBackend>::new(),
    );
    made.pop().expect("one tensor is made")
}
