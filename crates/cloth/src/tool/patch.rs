//! Bodies made from a patch: an upper face, a skirt below its border, a flat bottom.

use std::f64::consts::FRAC_PI_2;

use crate::math::Vec3;
use crate::mesh::TriMesh;

/// A disc-shaped upper face.
pub(super) struct Patch {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Border vertices, counter-clockwise seen from above.
    border: Vec<u32>,
}

impl Patch {
    /// A grid of `columns` × `rows` vertices; `point` maps (u, v) ∈ [−1, 1]² to a position
    /// [m], u along the columns. Quads are split along the diagonal that runs away from the
    /// middle, so that a symmetric surface gets a symmetric mesh.
    pub fn grid(columns: usize, rows: usize, point: impl Fn(f64, f64) -> Vec3) -> Self {
        let along = |i: usize, count: usize| 2.0 * i as f64 / (count - 1) as f64 - 1.0;
        let vertices = (0..rows)
            .flat_map(|j| (0..columns).map(move |i| (i, j)))
            .map(|(i, j)| point(along(i, columns), along(j, rows)))
            .collect();
        let index = |i: usize, j: usize| (j * columns + i) as u32;
        let mut triangles = Vec::with_capacity(2 * (columns - 1) * (rows - 1));
        for j in 0..rows - 1 {
            for i in 0..columns - 1 {
                let [a, b] = [index(i, j), index(i + 1, j)];
                let [d, c] = [index(i, j + 1), index(i + 1, j + 1)];
                if (2 * i + 2 > columns) == (2 * j + 2 > rows) {
                    triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        let border = (0..columns - 1)
            .map(|i| index(i, 0))
            .chain((0..rows - 1).map(|j| index(columns - 1, j)))
            .chain((1..columns).rev().map(|i| index(i, rows - 1)))
            .chain((1..rows).rev().map(|j| index(0, j)))
            .collect();
        Self {
            vertices,
            triangles,
            border,
        }
    }

    /// Rings round a pole: `rings[k]` is a closed ring, counter-clockwise seen from above;
    /// all have the same number of points, the last is the border.
    pub fn rings(pole: Vec3, rings: &[Vec<Vec3>]) -> Self {
        let segments = rings[0].len();
        let mut vertices = vec![pole];
        vertices.extend(rings.iter().flatten());
        let index = |ring: usize, s: usize| (1 + ring * segments + s % segments) as u32;
        let mut triangles: Vec<[u32; 3]> = (0..segments)
            .map(|s| [0, index(0, s), index(0, s + 1)])
            .collect();
        for k in 1..rings.len() {
            for s in 0..segments {
                let [a, b] = [index(k - 1, s), index(k - 1, s + 1)];
                let [d, c] = [index(k, s), index(k, s + 1)];
                triangles.extend([[a, d, c], [a, c, b]]);
            }
        }
        let border = (0..segments).map(|s| index(rings.len() - 1, s)).collect();
        Self {
            vertices,
            triangles,
            border,
        }
    }

    /// Height of its lowest vertex [m].
    pub fn lowest(&self) -> f64 {
        let heights = self.vertices.iter().map(|vertex| vertex.z);
        heights.fold(f64::INFINITY, f64::min)
    }

    /// Closes the patch by a vertical skirt down to the height `bottom` [m] and a fan round
    /// the middle of the bottom. Adds one vertex for each border vertex, and one more.
    pub fn into_body(self, bottom: f64) -> TriMesh {
        let (mut vertices, mut triangles, border) = (self.vertices, self.triangles, self.border);
        let ring = vertices.len() as u32;
        let count = border.len() as u32;
        let centre = ring + count;
        let lowered = |i: &u32| {
            let v: Vec3 = vertices[*i as usize];
            Vec3::new(v.x, v.y, bottom)
        };
        let bottom_ring: Vec<Vec3> = border.iter().map(lowered).collect();
        let middle = bottom_ring.iter().sum::<Vec3>() / f64::from(count);
        vertices.extend(bottom_ring);
        vertices.push(middle);
        for s in 0..count {
            let next = (s + 1) % count;
            let [a, b] = [border[s as usize], border[next as usize]];
            let [c, d] = [ring + s, ring + next];
            triangles.extend([[a, c, d], [a, d, b], [c, centre, d]]);
        }
        TriMesh {
            vertices,
            triangles,
        }
    }
}

/// A mound on a plate: the upper half of a body that lies along x.
///
/// The mound's half-width at `x` is `half_width(x)` [m] and its section there a half circle;
/// its outline has to be star-shaped about the origin. `half_size` is half the plate's size
/// along x and y [m]; the outline has to fit inside.
pub(super) fn mound(
    half_size: [f64; 2],
    segments_per_side: usize,
    rings: usize,
    half_width: impl Fn(f64) -> f64,
) -> Patch {
    let [x, y] = half_size;
    let corners = [[x, -y], [x, y], [-x, y], [-x, -y]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let plate_border: Vec<Vec3> = (0..4)
        .flat_map(|side| (0..segments_per_side).map(move |s| (side, s)))
        .map(|(side, s)| {
            let [from, to] = [corners[side], corners[(side + 1) % 4]];
            from + (to - from) * (s as f64 / segments_per_side as f64)
        })
        .collect();
    let outline: Vec<Vec3> = plate_border
        .iter()
        .map(|p| p * outline_share(*p, &half_width))
        .collect();

    let height = |p: Vec3| (half_width(p.x).powi(2) - p.y.powi(2)).max(0.0).sqrt();
    let pole = Vec3::new(0.0, 0.0, height(Vec3::zeros()));
    let mut all: Vec<Vec<Vec3>> = (1..rings)
        .map(|k| {
            // Rings crowd towards the rim, where the mound is steep.
            let share = (FRAC_PI_2 * k as f64 / rings as f64).sin();
            let raised = |p: &Vec3| {
                let p = p * share;
                Vec3::new(p.x, p.y, height(p))
            };
            outline.iter().map(raised).collect()
        })
        .collect();
    all.push(outline);
    all.push(plate_border);
    Patch::rings(pole, &all)
}

/// Share of the distance from the origin to `p` at which the outline |y| = `half_width(x)` lies.
fn outline_share(p: Vec3, half_width: &impl Fn(f64) -> f64) -> f64 {
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (inside + outside);
        let q = p * middle;
        if q.y.abs() < half_width(q.x) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    0.5 * (inside + outside)
}
