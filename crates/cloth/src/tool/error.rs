use crate::file::{ReadError, ValueError};
use crate::mesh::OrientationFault;

/// A tool that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    #[error(transparent)]
    Config(#[from] ValueError),
    #[error("cannot read the tool")]
    Read(#[from] ReadError),
    #[error("the tool has no facets")]
    Empty,
    #[error("the tool cannot be told from its outside, repair the mesh: {0}")]
    Orientation(#[from] OrientationFault),
    #[error(
        "a grid of {} x {} x {} nodes at spacing {spacing_mm} mm takes {mib:.0} MiB, expected at most \
         {limit_mib}: {advice}",
        dims[0], dims[1], dims[2]
    )]
    GridTooLarge {
        dims: [f64; 3],
        spacing_mm: f64,
        mib: f64,
        limit_mib: usize,
        /// A spacing that would fit, if there is one.
        advice: String,
    },
}
