use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use drape_cloth::file::{ReadError, read_bytes};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::mesh_points;

use super::text;

/// Largest file that is read [MiB].
const MOST_MIB: u64 = 2048;
/// Farthest that a point lies from the origin [m].
const FAR: f64 = 1e3;
/// Points that are narrower than this share of their length lie on a line.
const THIN: f64 = 1e-6;

/// Points that a scanner saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// In the frame of the scanner [m], at least three and not on a line.
    pub points: Vec<Vec3>,
    /// The file that they were read from.
    pub source: PathBuf,
    /// Points of the file that were left out, as a coordinate of theirs is no number.
    pub dropped_count: usize,
}

impl Cloud {
    /// Reads the points of an STL, PLY or text file whose unit is `scale` metres. What it is, its content
    /// tells. Text has x, y and z on each line, and perhaps more, which is ignored; what stands above the
    /// first point, and comments, are no points.
    ///
    /// # Errors
    /// Says which file, and which facet, vertex or line, counted from 1. Fewer than three points, or points
    /// on a line, are refused.
    pub fn read(path: &Path, scale: f64) -> Result<Self, ReadError> {
        let bytes = read_bytes(path, MOST_MIB)?;
        let points = match mesh_points(&bytes, scale) {
            Ok(Some(points)) => Ok(points),
            Ok(None) => text::points(&bytes, scale),
            Err(fault) => Err(fault),
        };
        let checked = points.and_then(|points| Self::new(points, path));
        checked.map_err(|fault| ReadError::fault(path, fault))
    }

    /// Points of a file [m], those that are no numbers included.
    fn new(mut points: Vec<Vec3>, source: &Path) -> Result<Self, String> {
        let all = points.len();
        points.retain(|x| x.iter().all(|x| x.is_finite()));
        let (count, dropped_count) = (points.len(), all - points.len());
        if count < 3 {
            let without = match dropped_count {
                0 => String::new(),
                count => format!(" beside {count} whose coordinates are no numbers"),
            };
            return Err(format!(
                "has {count} points{without}, expected those of a blank"
            ));
        }
        if let Some(far) = points.iter().position(|x| x.amax() > FAR) {
            let found = points[far].as_slice();
            return Err(format!(
                "a point is at {found:?} m, expected coordinates within +-{FAR} m: check its unit"
            ));
        }
        let (first, longest) = (points[0], |from: Vec3| {
            let squares = points.iter().map(move |x| (x - from).norm_squared());
            let farthest = squares.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            farthest.expect("there are points").0
        });
        let end = points[longest(first)];
        let along = points[longest(end)] - end;
        let width = |x: &Vec3| (x - end).cross(&along).norm();
        let widest = points.iter().map(width).fold(0.0, f64::max);
        if widest <= THIN * along.norm_squared() {
            let found = match along.norm() > 0.0 {
                true => "lie on a line",
                false => "are one and the same",
            };
            return Err(format!(
                "all {count} points {found}, expected those of a blank"
            ));
        }
        Ok(Self {
            points,
            source: source.into(),
            dropped_count,
        })
    }
}

/// One point for each cube of a grid with points in it, their mean, in the order of the cubes: evenly dense
/// wherever the scanner looked longest, and with less noise. `side` > 0 of the cubes [m].
pub(crate) fn thinned(points: &[Vec3], side: f64) -> Vec<Vec3> {
    let mut cubes: BTreeMap<[i64; 3], (Vec3, f64)> = BTreeMap::new();
    for x in points {
        let cube = cubes.entry(cube(x, side)).or_default();
        *cube = (cube.0 + x, cube.1 + 1.0);
    }
    cubes
        .into_values()
        .map(|(sum, count)| sum / count)
        .collect()
}

/// The cube of a grid that a point lies in.
pub(crate) fn cube(x: &Vec3, side: f64) -> [i64; 3] {
    [0, 1, 2].map(|k| (x[k] / side).floor() as i64)
}
