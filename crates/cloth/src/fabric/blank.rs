use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::file::{ReadError, ValueError, is_default};

/// Which areal mass a blank has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MassModel {
    /// The paper's particle masses, where the material has them.
    #[default]
    Paper,
    /// The fabric's data sheet.
    Datasheet,
}

/// Shape, yarn direction and mesh of a blank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BlankConfig {
    /// Sides of a rectangular blank along x and y [mm].
    pub size_mm: [f64; 2],
    /// Vertices along the sides of a rectangular blank. They also give the cell of any other
    /// blank, `size_mm / (vertices - 1)`, unless `cell_mm` does.
    pub vertices: [usize; 2],
    pub mass: MassModel,
    /// File of the outline, see [`Outline`](super::Outline); the rectangle if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outline: Option<PathBuf>,
    /// Side of a cell along warp and weft [mm].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cell_mm: Option<f64>,
    /// Angle of the warp against x [degrees], counter-clockwise from above.
    #[serde(skip_serializing_if = "is_default")]
    pub yarn_angle_deg: f64,
}

impl Default for BlankConfig {
    fn default() -> Self {
        Self {
            size_mm: [370.0, 370.0],
            vertices: [65, 65],
            mass: MassModel::Paper,
            outline: None,
            cell_mm: None,
            yarn_angle_deg: 0.0,
        }
    }
}

/// A blank that cannot be cut.
#[derive(Debug, thiserror::Error)]
pub enum BlankError {
    #[error(transparent)]
    Value(#[from] ValueError),
    /// Cells that are larger than what the outline shows.
    #[error("`blank.{key}` is {found}, expected cells finer than the features of {blank}: {fault}")]
    Coarse {
        key: &'static str,
        found: String,
        /// File of the outline, or what else was cut.
        blank: String,
        fault: CutFault,
    },
    #[error(transparent)]
    Outline(#[from] ReadError),
}

/// What is wrong with a mesh whose cells are too large.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CutFault {
    #[error("no cell lies inside")]
    Empty,
    #[error("the mesh falls into {0} parts")]
    Parts(usize),
    #[error("parts of the mesh hang together by a single vertex")]
    Pinched,
    #[error("the mesh has {found} loops of border, the outline has {expected}")]
    Loops { found: usize, expected: usize },
    #[error("{0} vertices along a side, at most 1025 are possible")]
    Fine(usize),
}

/// Greatest number of vertices along a side.
pub(super) const MAX_VERTICES: usize = 1025;

impl BlankConfig {
    /// Whether the blank is the rectangle, and its sides are yarns.
    pub fn is_plain(&self) -> bool {
        self.outline.is_none() && self.cell_mm.is_none() && self.yarn_angle_deg == 0.0
    }

    /// Checks all values that do not depend on the outline.
    pub(crate) fn check(&self) -> Result<(), ValueError> {
        let is_countable = |n| (2..=MAX_VERTICES).contains(n);
        let is_valid = self.vertices.iter().all(is_countable);
        let found = format!("{:?}", self.vertices);
        let expected = "two numbers from 2 to 1025";
        ValueError::unless(is_valid, "blank.vertices", found, expected)?;
        let is_long = self.size_mm.iter().all(|s| (1.0..=100_000.0).contains(s));
        let found = format!("{:?}", self.size_mm);
        let expected = "two lengths from 1 to 100000 mm";
        ValueError::unless(is_long, "blank.size_mm", found, expected)?;
        if let Some(cell) = self.cell_mm {
            let expected = "a length from 0.01 to 10000 mm";
            let is_valid = (0.01..=10_000.0).contains(&cell);
            ValueError::unless(is_valid, "blank.cell_mm", cell, expected)?;
        }
        let angle = self.yarn_angle_deg;
        let (is_valid, expected) = (angle.abs() <= 360.0, "an angle within +-360 degrees");
        ValueError::unless(is_valid, "blank.yarn_angle_deg", angle, expected)
    }

    /// Sides of a cell along warp and weft [m], infinite where there is no cell.
    pub fn cell(&self) -> [f64; 2] {
        match self.cell_mm {
            Some(cell) => [1e-3 * cell; 2],
            None => {
                [0, 1].map(|k| self.size_mm[k] * 1e-3 / self.vertices[k].saturating_sub(1) as f64)
            }
        }
    }

    /// The error of cells that do not suit the blank.
    pub(super) fn coarse(&self, fault: CutFault) -> BlankError {
        let (key, found) = match self.cell_mm {
            Some(cell) => ("cell_mm", cell.to_string()),
            None => ("vertices", format!("{:?}", self.vertices)),
        };
        if let CutFault::Fine(_) = fault {
            let expected = "cells of which at most 1024 lie along the blank";
            return ValueError::new(&format!("blank.{key}"), found, expected).into();
        }
        let blank = match &self.outline {
            Some(path) => path.display().to_string(),
            None => "the rectangle".into(),
        };
        BlankError::Coarse {
            key,
            found,
            blank,
            fault,
        }
    }
}
