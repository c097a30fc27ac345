use super::camera::Projection;
use super::{BACKGROUND, Camera, Color, Image};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use std::ops::Range;

/// Cloth counts as this much nearer to the eye than it is [m], so that the tool does not
/// shine through its facets where they cut a corner of the tool.
pub const CLOTH_BIAS: f64 = 3e-3;
/// Marks likewise [m]. A disc has the depth of its centre, so this must exceed its radius on
/// steep cloth.
const MARK_BIAS: f32 = 0.01;
/// Facets that share a vertex are shaded as one smooth surface up to this angle: cosine of
/// 35 degrees, more than the steps of a finely cut dome and less than the edge of a plate.
const CREASE: f64 = 0.82;
/// Light that reaches every surface; the key light adds the rest up to 1.
const AMBIENT: f32 = 0.3;

/// Direction to the key light: right, up, towards the eye; unit length. Low enough that a wrinkle
/// has a bright and a dark side.
const KEY_LIGHT: [f32; 3] = [-0.36, 0.48, 0.8];

/// Width of the line along a stroke, and of that of a jump between two [px].
const STROKE: f64 = 1.6;
const JUMP: f64 = 0.5;

/// What a camera sees, in 2 x 2 samples per pixel with sample centres at half numbers. What is
/// in front is decided by depth; at equal depth what was drawn first stays.
#[derive(Clone)]
pub struct Drawing {
    view: Projection,
    samples: Image,
    /// Depth of what is seen [m], shape `[height, width]` of the samples.
    depth: Vec<f32>,
}

/// Samples from the left and from the top, depth away from the eye [m], red, green, blue.
type Vertex = [f32; 6];

impl Drawing {
    /// The empty background in a picture of `width` by `height` pixels.
    pub fn new(camera: &Camera, [width, height]: [usize; 2]) -> Self {
        let (width, height) = (2 * width, 2 * height);
        Self {
            view: camera.view(width, height),
            samples: Image::new(width, height, BACKGROUND),
            depth: vec![f32::INFINITY; width * height],
        }
    }

    /// The picture.
    pub fn image(&self) -> Image {
        self.samples.reduced(2)
    }

    /// Draws a mesh whose both sides are lit. `color` is that of each vertex, mixed in between;
    /// the mesh counts as `bias` nearer to the eye than it is [m]. Triangles without area and
    /// those with a coordinate that is not finite are left out.
    pub fn mesh(&mut self, mesh: &TriMesh, color: impl Fn(usize) -> Color, bias: f64) {
        let vertices = mesh.vertices.iter().zip(mesh.vertex_normals()).enumerate();
        let vertices = vertices.map(|(i, (position, normal))| {
            let [x, y, depth] = self.view.project(position);
            let normal = self.view.rotate(&normal).map(|x| x as f32);
            // As lit from the front and from the back.
            let color = color(i).map(f32::from);
            [1.0, -1.0].map(|side| {
                let [r, g, b] = color.map(|c| c * light(normal.map(|x| side * x)));
                [x, y, depth - bias as f32, r, g, b]
            })
        });
        let vertices: Vec<[Vertex; 2]> = vertices.collect();
        for corners in &mesh.triangles {
            self.triangle(corners.map(|v| &vertices[v as usize]));
        }
    }

    fn triangle(&mut self, sides: [&[Vertex; 2]; 3]) {
        let [a, b, c] = sides.map(|[front, _]| front);
        let [dx1, dy1] = [b[0] - a[0], b[1] - a[1]];
        let [dx2, dy2] = [c[0] - a[0], c[1] - a[1]];
        let twice_area = dx1 * dy2 - dx2 * dy1;
        // Seen edge-on, without area, or not finite; 1e-6 of a sample is never hit anyway.
        let finite = [a, b, c].iter().all(|v| v.iter().all(|x| x.is_finite()));
        if !(finite && twice_area.is_finite() && twice_area.abs() > 1e-6) {
            return;
        }
        // The y axis points down: counter-clockwise in space is negative here.
        let p = sides.map(|side| side[usize::from(twice_area > 0.0)]);
        // Depth and colour grow evenly over the triangle, but rounding must not throw a steep
        // one out of its own range.
        let of = |k: usize| p.map(|v| v[k + 2]);
        let low: [f32; 4] = std::array::from_fn(|k| of(k).into_iter().fold(f32::MAX, f32::min));
        let high: [f32; 4] = std::array::from_fn(|k| of(k).into_iter().fold(f32::MIN, f32::max));
        let slopes: [[f32; 2]; 4] = std::array::from_fn(|k| {
            let [at, next, last] = of(k);
            let [d1, d2] = [next - at, last - at];
            [
                (d1 * dy2 - d2 * dy1) / twice_area,
                (d2 * dx1 - d1 * dx2) / twice_area,
            ]
        });
        let (width, height) = (self.samples.width, self.samples.height);
        for_each_span(p, width, height, |y, xs| {
            let dy = y as f32 + 0.5 - p[0][1];
            for x in xs {
                let dx = x as f32 + 0.5 - p[0][0];
                let at = |k: usize| {
                    let value = p[0][k + 2] + slopes[k][0] * dx + slopes[k][1] * dy;
                    value.max(low[k]).min(high[k])
                };
                let i = y * width + x;
                if at(0) < self.depth[i] {
                    self.depth[i] = at(0);
                    self.samples.pixels[i] = [1, 2, 3].map(|k| (at(k) + 0.5) as u8);
                }
            }
        });
    }

    /// Draws a flat disc around `center` [m] with a radius in pixels.
    pub fn disc(&mut self, center: Vec3, radius: f64, color: Color) {
        self.line(&[center; 2], 2.0 * radius, color);
    }

    /// Draws a flat line with round joints, `width` [px] wide, from each of the `points` [m] to
    /// the next; those that are not finite interrupt it.
    pub fn line(&mut self, points: &[Vec3], width: f64, color: Color) {
        for pair in points.windows(2) {
            let ends = [0, 1].map(|k| self.view.project(&pair[k]));
            self.capsule(ends, width as f32, color);
        }
    }

    /// Draws all samples within `radius` of the segment between `ends`, whose depth they take.
    fn capsule(&mut self, [a, b]: [[f32; 3]; 2], radius: f32, color: Color) {
        if ![a, b].as_flattened().iter().all(|x| x.is_finite()) {
            return;
        }
        let span = |k: usize, limit: usize| {
            centers(a[k].min(b[k]) - radius, limit)..centers(a[k].max(b[k]) + radius, limit)
        };
        let (width, height) = (self.samples.width, self.samples.height);
        let d = [b[0] - a[0], b[1] - a[1]];
        let length_squared = (d[0] * d[0] + d[1] * d[1]).max(f32::MIN_POSITIVE);
        for y in span(1, height) {
            for x in span(0, width) {
                let p = [x as f32 + 0.5 - a[0], y as f32 + 0.5 - a[1]];
                let t = ((p[0] * d[0] + p[1] * d[1]) / length_squared).clamp(0.0, 1.0);
                let q = [p[0] - t * d[0], p[1] - t * d[1]];
                let depth = a[2] + t * (b[2] - a[2]) - MARK_BIAS;
                let i = y * width + x;
                if q[0] * q[0] + q[1] * q[1] <= radius * radius && depth < self.depth[i] {
                    self.depth[i] = depth;
                    self.samples.pixels[i] = color;
                }
            }
        }
    }

    /// Draws a path of strokes [m]: a disc on every point, the last one larger, a line along
    /// each stroke, and a thin one from there to the next.
    pub fn path(&mut self, strokes: &[Vec<Vec3>], color: Color) {
        let points = strokes.concat();
        for (i, &center) in points.iter().enumerate().rev() {
            let radius = if i + 1 == points.len() { 5.0 } else { 2.5 };
            self.disc(center, radius, color);
        }
        for stroke in strokes {
            self.line(stroke, STROKE, color);
        }
        self.line(&points, JUMP, color);
    }
}

/// Calls `paint(y, xs)` for those rows out of `height` and those columns out of `width` whose
/// sample centres lie in triangle `p`.
///
/// Both triangles at an edge compute the same crossing of that edge with a row, and a
/// centre on it belongs to the right one: no sample is drawn twice, none is left out.
fn for_each_span(
    mut p: [Vertex; 3],
    width: usize,
    height: usize,
    mut paint: impl FnMut(usize, Range<usize>),
) {
    p.sort_unstable_by(|a, b| a[1].total_cmp(&b[1]));
    let [top, middle, bottom] = p;
    let edge = |a: Vertex, b: Vertex| {
        let slope = (b[0] - a[0]) / (b[1] - a[1]);
        move |y: f32| a[0] + (y - a[1]) * slope
    };
    let long = edge(top, bottom);
    let (upper, lower) = (edge(top, middle), edge(middle, bottom));
    for y in centers(top[1], height)..centers(bottom[1], height) {
        let row = y as f32 + 0.5;
        let short = match row < middle[1] {
            true => upper(row),
            false => lower(row),
        };
        let (left, right) = (long(row).min(short), long(row).max(short));
        paint(y, centers(left, width)..centers(right, width));
    }
}

/// Number of sample centres, out of `limit`, below coordinate `x`: the first one that is not.
fn centers(x: f32, limit: usize) -> usize {
    // The cast saturates.
    ((x - 0.5).ceil() as usize).min(limit)
}

/// Brightness from 0 to 1 of a surface whose `normal` (right, up, towards the eye; of any
/// length) is on the side that is seen. Without a normal: ambient light only.
fn light(normal: [f32; 3]) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = dot(normal, normal).sqrt().max(f32::MIN_POSITIVE);
    AMBIENT + (1.0 - AMBIENT) * (dot(normal, KEY_LIGHT) / length).max(0.0)
}

/// This surface, where facets at an angle share no vertex and hence no normal.
pub fn creased(mesh: &TriMesh) -> TriMesh {
    // Copies of each vertex with the normal of the facet that needed it first.
    let mut copies: Vec<Vec<(Vec3, u32)>> = vec![Vec::new(); mesh.vertices.len()];
    let mut creased = TriMesh::default();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
        let normal = normal.unwrap_or_default();
        creased.triangles.push(triangle.map(|v| {
            let copies = &mut copies[v as usize];
            let smooth = copies.iter().find(|(n, _)| n.dot(&normal) > CREASE);
            if let Some((_, copy)) = smooth {
                return *copy;
            }
            let copy = creased.vertices.len() as u32;
            creased.vertices.push(mesh.vertices[v as usize]);
            copies.push((normal, copy));
            copy
        }));
    }
    creased
}

#[cfg(test)]
mod tests;
