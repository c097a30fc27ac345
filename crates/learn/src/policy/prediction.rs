use burn::tensor::Tensor;

/// What a network says about a batch of observations.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// One number a pixel `[batch, pixel]`, before masking.
    pub logits: Tensor<2>,
    /// Expected return `[batch]`, in units of the reward scale.
    pub value: Tensor<1>,
}
