use crate::file::{ReadError, ValueError};
use crate::math::Vec3;
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
    #[error("the tool cannot be told from its outside, repair the mesh")]
    Orientation(#[from] OrientationFault),
    #[error(
        "the tool is no solid: {count} of its {facets} facets have none behind them, the largest is \
         facet {facet} at ({:.1}, {:.1}, {:.1}) mm: close the holes and undercuts that show its \
         back, turn it over, or give walls that are vertical up to the border a flange",
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
    #[error("the tool faces downwards, and the other way round {0}")]
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

impl ToolError {
    /// The error of a tool that was moved by -`origin` [m].
    pub(super) fn moved_back(mut self, origin: &Vec3) -> Self {
        match &mut self {
            Self::NoSolid { place_mm, .. } | Self::Hanging { place_mm, .. } => {
                *place_mm = (Vec3::from(*place_mm) + origin * 1e3).into();
            }
            Self::TurnedOver(error) => {
                let inner = std::mem::replace(&mut **error, Self::Empty);
                **error = inner.moved_back(origin);
            }
            _ => {}
        }
        self
    }
}
