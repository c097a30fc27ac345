use std::collections::HashSet;

use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape;

use crate::math::{Vec3, from_parry, to_parry};
use crate::mesh::{OrientationFault, TriMesh, border};

/// A foot is on an edge or a corner where the share of the opposite corner is below this.
const ON_FEATURE: f64 = 1e-9;
/// What lies sideways of a border by more than this is beyond it [m]: the welding tolerance
/// of a sheet of a metre.
const SIDEWAYS: f64 = 1e-6;

/// A surface with an upper side that points are measured against.
///
/// Does not model: sheets that are folded on to themselves; there the nearest layer counts.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Triangles with an area.
    facets: shape::TriMesh,
    /// Their numbers in the mesh.
    numbers: Vec<usize>,
    /// Edges on the border, without direction, and their ends.
    border: HashSet<[u32; 2]>,
    border_ends: HashSet<u32>,
}

/// Where a point meets a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The nearest point of the sheet [m].
    pub position: Vec3,
    /// Its triangle, and its share of each corner.
    pub triangle: usize,
    pub weights: [f64; 3],
    /// Distance from there to the point [m].
    pub distance: f64,
    /// That along the sheet's normal, positive on its upper side [m]. Beyond the border
    /// only the part along the normal: what lies sideways is for the contour to measure.
    pub deviation: f64,
    /// The point lies sideways of the border.
    pub is_beyond: bool,
}

/// A mesh that nothing can be measured against.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum SheetError {
    #[error("no triangle has an area")]
    Empty,
    #[error(transparent)]
    Orientation(#[from] OrientationFault),
}

impl Sheet {
    /// Takes a mesh whose triangles run counter-clockwise when seen from its upper side.
    pub fn new(mesh: &TriMesh) -> Result<Self, SheetError> {
        let border = border(mesh)?;
        let has_area = |t: &usize| {
            let [a, b, c] = mesh.corners(*t);
            (b - a).cross(&(c - a)).norm() > 0.0
        };
        let numbers: Vec<usize> = (0..mesh.triangles.len()).filter(has_area).collect();
        let vertices = mesh.vertices.iter().map(to_parry).collect();
        let triangles = numbers.iter().map(|&t| mesh.triangles[t]).collect();
        let oriented = shape::TriMeshFlags::ORIENTED;
        let facets = shape::TriMesh::with_flags(vertices, triangles, oriented);
        Ok(Self {
            facets: facets.map_err(|_| SheetError::Empty)?,
            numbers,
            border: border.iter().map(|&[v, w]| ends(v, w)).collect(),
            border_ends: border.into_iter().flatten().collect(),
        })
    }

    /// Where the point `x` [m], which must be finite, meets the sheet.
    pub fn foot(&self, x: Vec3) -> Foot {
        let (nearest, (facet, location)) = self
            .facets
            .project_local_point_and_get_location(to_parry(&x), false);
        let position = from_parry(nearest.point);
        let weights = location.barycentric_coordinates().unwrap_or([1.0 / 3.0; 3]);
        let facet = facet as usize;
        let (normal, on_border) = self.feature(facet, weights);
        let offset = x - position;
        let (distance, along) = (offset.norm(), offset.dot(&normal));
        let sideways = (distance * distance - along * along).max(0.0).sqrt();
        let is_beyond = on_border && sideways > SIDEWAYS;
        Foot {
            position,
            triangle: self.numbers[facet],
            weights,
            distance,
            deviation: if on_border {
                along
            } else {
                distance.copysign(along)
            },
            is_beyond,
        }
    }

    /// Unit normal where a triangle's corners have these shares, and whether that is on the border.
    fn feature(&self, facet: usize, weights: [f64; 3]) -> (Vec3, bool) {
        let corners = self.facets.indices()[facet];
        let around = self.facets.pseudo_normals().expect("of an oriented mesh");
        let near: Vec<usize> = (0..3).filter(|&k| weights[k] > ON_FEATURE).collect();
        let face = self.facets.triangle(facet as u32).scaled_normal();
        let (normal, on_border) = match near[..] {
            [k] => (
                around.vertices_pseudo_normal[corners[k] as usize],
                self.border_ends.contains(&corners[k]),
            ),
            [k, l] => (
                // The edge from the last corner to the first is the last one.
                around.edges_pseudo_normal[facet][if l == k + 1 { k } else { l }],
                self.border.contains(&ends(corners[k], corners[l])),
            ),
            _ => (face, false),
        };
        let normal = from_parry(normal).try_normalize(1e-12);
        (normal.unwrap_or(from_parry(face).normalize()), on_border)
    }
}

/// An edge without direction.
fn ends(v: u32, w: u32) -> [u32; 2] {
    [v.min(w), v.max(w)]
}
