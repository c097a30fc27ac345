use std::collections::HashMap;

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
    faces: Vec<Vec3>,
    edges: HashMap<[u32; 2], Feature>,
    corners: Vec<Feature>,
}

/// An edge or a corner: sum of the normals around it, and whether it is on the border.
#[derive(Clone, Copy, Debug, Default)]
struct Feature {
    normal: Vec3,
    on_border: bool,
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
    /// The same along the sheet's normal, positive on its upper side [m]. Beyond the border
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
        let mut faces = Vec::new();
        let mut numbers = Vec::new();
        let mut edges: HashMap<[u32; 2], Feature> = HashMap::new();
        let mut corners = vec![Feature::default(); mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let x = mesh.corners(t);
            let cross = (x[1] - x[0]).cross(&(x[2] - x[0]));
            let Some(normal) = cross.try_normalize(0.0) else {
                continue;
            };
            numbers.push(t);
            faces.push(normal);
            for k in 0..3 {
                let [v, w] = [triangle[k], triangle[(k + 1) % 3]];
                edges.entry(ends(v, w)).or_default().normal += normal;
                // Weighed with the angle, the sum does not depend on how a fan is cut.
                let (p, q) = (x[(k + 1) % 3] - x[k], x[(k + 2) % 3] - x[k]);
                corners[v as usize].normal += normal * p.angle(&q);
            }
        }
        for [v, w] in border {
            edges.entry(ends(v, w)).or_default().on_border = true;
            corners[v as usize].on_border = true;
            corners[w as usize].on_border = true;
        }
        let vertices = mesh.vertices.iter().map(to_parry).collect();
        let triangles = numbers.iter().map(|&t| mesh.triangles[t]).collect();
        let facets = shape::TriMesh::new(vertices, triangles).map_err(|_| SheetError::Empty)?;
        Ok(Self {
            facets,
            numbers,
            faces,
            edges,
            corners,
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
        let Feature { normal, on_border } = self.feature(facet, weights);
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

    /// Unit normal where a triangle's corners have these shares.
    fn feature(&self, facet: usize, weights: [f64; 3]) -> Feature {
        let corners = self.facets.indices()[facet];
        let near: Vec<u32> = (0..3)
            .filter(|&k| weights[k] > ON_FEATURE)
            .map(|k| corners[k])
            .collect();
        let found = match near[..] {
            [v] => self.corners[v as usize],
            [v, w] => self.edges[&ends(v, w)],
            _ => Feature::default(),
        };
        Feature {
            normal: found
                .normal
                .try_normalize(1e-12)
                .unwrap_or(self.faces[facet]),
            on_border: found.on_border,
        }
    }
}

/// An edge without direction.
fn ends(v: u32, w: u32) -> [u32; 2] {
    [v.min(w), v.max(w)]
}
