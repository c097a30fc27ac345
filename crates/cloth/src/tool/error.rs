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
        "the tool is no solid: {count} of its {facets} facets have none behind them, the largest is \
         facet {facet} at ({:.1}, {:.1}, {:.1}) mm: close the holes and undercuts that show its \
         back, or turn it over",
        place_mm[0], place_mm[1], place_mm[2]
    )]
    NoSolid {
        count: usize,
        facets: usize,
        facet: usize,
        place_mm: [f64; 3],
    },
    #[error(
        "the open tool has an undercut: {count} of the {edges} edges of its border hang over other \
         parts of it, the first at ({:.1}, {:.1}, {:.1}) mm: close the mesh",
        place_mm[0], place_mm[1], place_mm[2]
    )]
    Hanging {
        count: usize,
        edges: usize,
        place_mm: [f64; 3],
    },
    #[error("the tool faces downwards, and turned over {0}")]
    TurnedOver(Box<Self>),
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
