//! Numbers that kernels have left on a GPU as tensors of burn's there, without a copy.

use burn::backend::tensor::FloatTensor;
use burn::tensor::{DType, Device, Int, Shape, Tensor};
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{Cube, CubeBackend};
use burn_fusion::{NoOp, get_client};
use burn_ir::{BackendIr, InitOperationIr, OperationIr};
use drape_cloth::sim::{Buffer, Observations};

/// Distances, and marks as whole numbers, `[row, pixel]`; none if they are not on `device`.
pub fn tensors(seen: &Observations, device: &Device) -> Option<(Tensor<2>, Tensor<2, Int>)> {
    let [distance, marks] = [seen.distance.device()?, seen.marks.device()?];
    if super::device::of_burn(distance.adapter()) != *device {
        return None;
    }
    let shape = [seen.views.len(), seen.pixel_count];
    Some((
        Tensor::from_primitive::<Cube>(tensor(distance, shape, DType::F32)),
        Tensor::from_primitive::<Cube>(tensor(marks, shape, DType::I32)),
    ))
}

/// burn fuses operations lazily: a tensor is registered with what queues them.
fn tensor(buffer: &Buffer, shape: [usize; 2], dtype: DType) -> FloatTensor<Cube> {
    let (device, shape) = (buffer.adapter().device(), Shape::from(shape));
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
