use super::raster::{Grid, Vertex};
use super::{BACKGROUND, Camera, Color, Image};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;

/// Cloth counts as this much nearer to the eye than it is [m], so that the tool does not
/// shine through its facets where they cut a corner of the tool.
pub const CLOTH_BIAS: f64 = 3e-3;
/// Facets that share a vertex are shaded as one smooth surface up to this angle: cosine of
/// 35 degrees, more than the steps of a finely cut dome and less than the edge of a plate.
const CREASE: f64 = 0.82;
/// Light that reaches every surface; the key light adds the rest up to 1.
const AMBIENT: f32 = 0.3;

/// Direction to the key light: right, up, towards the eye; unit length. It stands above the
/// left shoulder, low enough that a wrinkle has a bright and a dark side.
const KEY_LIGHT: [f32; 3] = [-0.36, 0.48, 0.8];

/// Width of the line along a stroke, and of that of a jump between two [px].
const STROKE: f64 = 1.6;
const JUMP: f64 = 0.5;

/// Colours of a mesh.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// One colour everywhere.
    Uniform(Color),
    /// A colour per vertex, mixed in between.
    PerVertex(&'a [Color]),
}

/// A mesh to be seen. Both of its sides are lit.
#[derive(Clone, Copy, Debug)]
pub struct Item<'a> {
    /// What is seen. Triangles without area and those with a coordinate that is not finite
    /// are left out.
    pub mesh: &'a TriMesh,
    /// Its colours.
    pub paint: Paint<'a>,
    /// How much nearer to the eye than it is the mesh counts as [m]: a millimetre keeps
    /// cloth above the tool it lies on.
    pub depth_bias: f64,
}

/// A flat sign of fixed size in the picture, at a place in the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A filled disc.
    Disc {
        /// Its centre [m].
        center: Vec3,
        /// Its radius [px].
        radius: f64,
        /// Its colour, not shaded.
        color: Color,
    },
    /// A line from each point to the next, with round joints.
    Line {
        /// Its points [m]; those that are not finite interrupt it.
        points: Vec<Vec3>,
        /// Its width [px].
        width: f64,
        /// Its colour, not shaded.
        color: Color,
    },
}

/// What a camera looks at.
#[derive(Clone, Debug)]
pub struct Drawing<'a> {
    /// Meshes; which one is in front is decided by depth, not by order.
    pub items: Vec<Item<'a>>,
    /// Signs on them; at equal depth the earlier one is in front.
    pub marks: Vec<Mark>,
    /// How much nearer to the eye than they are the marks count as [m]. A disc has the
    /// depth of its centre, so this must exceed its radius on steep cloth.
    pub mark_bias: f64,
    /// Colour where nothing is seen.
    pub background: Color,
}

impl Default for Drawing<'_> {
    fn default() -> Self {
        Self {
            items: Vec::new(),
            marks: Vec::new(),
            mark_bias: 0.01,
            background: BACKGROUND,
        }
    }
}

impl<'a> Drawing<'a> {
    /// Adds a mesh.
    ///
    /// # Panics
    ///
    /// [`Drawing::render`] panics where `paint` holds less than one colour per vertex, or a
    /// triangle names a vertex that does not exist.
    pub fn add(&mut self, mesh: &'a TriMesh, paint: Paint<'a>, depth_bias: f64) {
        self.items.push(Item {
            mesh,
            paint,
            depth_bias,
        });
    }

    /// Adds a path of strokes [m]: a disc on every point, the last one larger, a line along each
    /// stroke, and a thin one from there to the next.
    pub fn add_path(&mut self, strokes: &[Vec<Vec3>], color: Color) {
        let points = strokes.concat();
        // At equal depth the earlier mark is in front: discs before the lines.
        for (i, &center) in points.iter().enumerate().rev() {
            let radius = if i + 1 == points.len() { 5.0 } else { 2.5 };
            self.marks.push(Mark::Disc {
                center,
                radius,
                color,
            });
        }
        let line = |points, width| Mark::Line {
            points,
            width,
            color,
        };
        let strokes = strokes.iter().filter(|stroke| stroke.len() > 1);
        self.marks
            .extend(strokes.map(|stroke| line(stroke.clone(), STROKE)));
        self.marks.push(line(points, JUMP));
    }

    /// The picture of the scene, `width` by `height` pixels, 2 x 2 samples in each.
    pub fn render(&self, camera: &Camera, width: usize, height: usize) -> Image {
        let mut grid = Grid::new(width, height, self.background);
        let view = camera.view(2 * width, 2 * height);
        for item in &self.items {
            let normals = item.mesh.vertex_normals();
            let vertices = item.mesh.vertices.iter().zip(&normals).enumerate();
            let vertices = vertices.map(|(i, (position, normal))| {
                let mut position = view.project(position);
                position[2] -= item.depth_bias as f32;
                let color = match item.paint {
                    Paint::Uniform(color) => color,
                    Paint::PerVertex(colors) => colors[i],
                };
                Vertex {
                    position,
                    normal: view.rotate(normal).map(|x| x as f32),
                    color: color.map(f32::from),
                }
            });
            grid.mesh(vertices, &item.mesh.triangles);
        }
        let place = |point: &Vec3| {
            let [x, y, depth] = view.project(point);
            [x, y, depth - self.mark_bias as f32]
        };
        for mark in &self.marks {
            // A radius of r pixels is 2 r samples, and so is a line that is 2 r wide.
            match mark {
                Mark::Disc {
                    center,
                    radius,
                    color,
                } => grid.capsule([place(center); 2], 2.0 * *radius as f32, *color),
                Mark::Line {
                    points,
                    width,
                    color,
                } => {
                    for pair in points.windows(2) {
                        grid.capsule([place(&pair[0]), place(&pair[1])], *width as f32, *color);
                    }
                }
            }
        }
        grid.resolve(light)
    }
}

/// Brightness from 0 to 1 of a surface whose `normal` (right, up, towards the eye; of any
/// length) is on the side that is seen. Without a normal: ambient light only.
fn light(normal: [f32; 3]) -> f32 {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = dot(normal, normal).sqrt().max(f32::MIN_POSITIVE);
    AMBIENT + (1.0 - AMBIENT) * (dot(normal, KEY_LIGHT) / length).max(0.0)
}

/// The same surface, where facets at an angle share no vertex and hence no normal.
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
#[path = "drawing_tests.rs"]
mod tests;
