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
        "a grid of {} x {} x {} nodes at spacing {spacing_mm} mm is too large, expected at most \
         {limit} nodes: increase `tool.grid.spacing_mm`, or check the size of the tool",
        dims[0], dims[1], dims[2]
    )]
    GridTooLarge {
        dims: [f64; 3],
        spacing_mm: f64,
        limit: usize,
    },
}
