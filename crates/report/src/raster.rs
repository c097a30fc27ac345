//! A visibility buffer: first each sample learns what it sees, then each pixel is shaded
//! once per thing its samples see. Shading therefore costs the same however many layers lie
//! behind each other, and edges are smooth at the price of depth tests alone. Samples live
//! only as long as their band of rows is drawn, in memory that stays in the cache.

use super::{Color, Image};
use std::ops::Range;

/// A vertex as the grid sees it.
pub(super) struct Vertex {
    /// Samples from the left and from the top, depth away from the eye [m].
    pub position: [f32; 3],
    /// Right, up, towards the eye; unit length or zero.
    pub normal: [f32; 3],
    /// Red, green, blue, 0 to 255.
    pub color: [f32; 3],
}

/// A triangle that at least one sample may see.
struct Facet {
    corners: [u32; 3],
    /// Change of the second and third barycentric coordinate per sample in x and in y.
    gradients: [[f32; 2]; 2],
    /// 1 where the front is seen, -1 where the back is.
    side: f32,
    /// Rows of samples that it may cover.
    rows: Range<usize>,
}

/// All samples within `radius` of the segment between `ends`, whose depth they take.
struct Capsule {
    ends: [[f32; 3]; 2],
    radius: f32,
    color: Color,
    /// Rows of samples that it may cover.
    rows: Range<usize>,
}

/// What a sample sees: a facet's number, or a flat colour above [`FLAT`].
type Seen = u32;
const FLAT: Seen = 0xff00_0000;

fn flat([r, g, b]: Color) -> Seen {
    FLAT | Seen::from(r) << 16 | Seen::from(g) << 8 | Seen::from(b)
}

/// Rows of samples which are drawn at a time. 32 rows of 1280 samples take 330 kB, which
/// fits the second cache of any processor; 16 and 64 rows are no faster.
const BAND_ROWS: usize = 32;

/// The samples of some rows.
struct Band {
    rows: Range<usize>,
    /// Samples per row.
    width: usize,
    /// Depth of what is seen [m], shape `[rows, width]`.
    depth: Vec<f32>,
    seen: Vec<Seen>,
}

impl Band {
    /// Starts afresh at other rows.
    fn clear(&mut self, rows: Range<usize>, background: Seen) {
        let count = rows.len() * self.width;
        self.rows = rows;
        self.depth.clear();
        self.depth.resize(count, f32::INFINITY);
        self.seen.clear();
        self.seen.resize(count, background);
    }

    /// The part of `rows` which is in the band.
    fn overlap(&self, rows: &Range<usize>) -> Range<usize> {
        rows.start.max(self.rows.start)..rows.end.min(self.rows.end)
    }

    /// Number of the first sample of a row.
    fn start(&self, y: usize) -> usize {
        (y - self.rows.start) * self.width
    }

    fn facet(&mut self, id: Seen, facet: &Facet, p: [[f32; 3]; 3]) {
        let rows = self.overlap(&facet.rows);
        if rows.is_empty() {
            return;
        }
        let [second, third] = facet.gradients;
        let slope = [0, 1]
            .map(|axis| second[axis] * (p[1][2] - p[0][2]) + third[axis] * (p[2][2] - p[0][2]));
        let depth = p.map(|p| p[2]);
        let nearest = depth.into_iter().fold(f32::INFINITY, f32::min);
        let farthest = depth.into_iter().fold(f32::NEG_INFINITY, f32::max);
        for_each_span(p, self.width, rows, |y, xs| {
            let row = self.start(y);
            let samples = row + xs.start..row + xs.end;
            let dx = xs.start as f32 + 0.5 - p[0][0];
            let dy = y as f32 + 0.5 - p[0][1];
            let mut z = p[0][2] + slope[0] * dx + slope[1] * dy;
            let seen = &mut self.seen[samples.clone()];
            for (depth, seen) in self.depth[samples].iter_mut().zip(seen) {
                // Rounding must not throw a steep triangle out of its own range.
                let here = z.max(nearest).min(farthest);
                if here < *depth {
                    *depth = here;
                    *seen = id;
                }
                z += slope[0];
            }
        });
    }

    fn capsule(&mut self, capsule: &Capsule) {
        let ([a, b], radius) = (capsule.ends, capsule.radius);
        let left = centers(a[0].min(b[0]) - radius, self.width);
        let right = centers(a[0].max(b[0]) + radius, self.width);
        let d = [b[0] - a[0], b[1] - a[1]];
        let length_squared = (d[0] * d[0] + d[1] * d[1]).max(f32::MIN_POSITIVE);
        for y in self.overlap(&capsule.rows) {
            for x in left..right {
                let p = [x as f32 + 0.5 - a[0], y as f32 + 0.5 - a[1]];
                let t = ((p[0] * d[0] + p[1] * d[1]) / length_squared).clamp(0.0, 1.0);
                let q = [p[0] - t * d[0], p[1] - t * d[1]];
                let depth = a[2] + t * (b[2] - a[2]);
                let i = self.start(y) + x;
                if q[0] * q[0] + q[1] * q[1] <= radius * radius && depth < self.depth[i] {
                    self.depth[i] = depth;
                    self.seen[i] = flat(capsule.color);
                }
            }
        }
    }
}

/// Twice as many samples as pixels each way; sample centres are at half numbers.
pub(super) struct Grid {
    width: usize,
    height: usize,
    background: Seen,
    vertices: Vec<Vertex>,
    facets: Vec<Facet>,
    capsules: Vec<Capsule>,
}

impl Grid {
    /// A grid for a picture of `width` by `height` pixels, empty but for its background.
    pub(super) fn new(width: usize, height: usize, background: Color) -> Self {
        Self {
            width: 2 * width,
            height: 2 * height,
            background: flat(background),
            vertices: Vec::new(),
            facets: Vec::new(),
            capsules: Vec::new(),
        }
    }

    /// Adds triangles, given as numbers of `vertices`.
    pub(super) fn mesh(&mut self, vertices: impl Iterator<Item = Vertex>, triangles: &[[u32; 3]]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(vertices);
        for triangle in triangles {
            self.facet(triangle.map(|i| first + i));
        }
    }

    fn facet(&mut self, corners: [u32; 3]) {
        let p = self.positions(corners);
        let [dx1, dy1] = [p[1][0] - p[0][0], p[1][1] - p[0][1]];
        let [dx2, dy2] = [p[2][0] - p[0][0], p[2][1] - p[0][1]];
        let twice_area = dx1 * dy2 - dx2 * dy1;
        // Seen edge-on, without area, or not finite; 1e-6 of a sample is never hit anyway.
        let drawn = twice_area.abs() > 1e-6 && twice_area.is_finite();
        if !drawn || !p.as_flattened().iter().all(|x| x.is_finite()) {
            return;
        }
        let [y0, y1, y2] = p.map(|p| p[1]);
        self.facets.push(Facet {
            corners,
            gradients: [
                [dy2 / twice_area, -dx2 / twice_area],
                [-dy1 / twice_area, dx1 / twice_area],
            ],
            // The y axis points down: counter-clockwise in space is negative here.
            side: -twice_area.signum(),
            rows: centers(y0.min(y1).min(y2), self.height)
                ..centers(y0.max(y1).max(y2), self.height),
        });
    }

    fn positions(&self, corners: [u32; 3]) -> [[f32; 3]; 3] {
        corners.map(|i| self.vertices[i as usize].position)
    }

    /// Adds all samples within `radius` of the segment between `ends`, whose depth they
    /// take; two equal ends make a disc.
    pub(super) fn capsule(&mut self, ends: [[f32; 3]; 2], radius: f32, color: Color) {
        let finite = ends.as_flattened().iter().all(|x| x.is_finite());
        if !finite || radius.is_nan() {
            return;
        }
        let [y0, y1] = ends.map(|end| end[1]);
        let rows =
            centers(y0.min(y1) - radius, self.height)..centers(y0.max(y1) + radius, self.height);
        self.capsules.push(Capsule {
            ends,
            radius,
            color,
            rows,
        });
    }

    /// Draws all that was added. `light` gives the brightness, 0 to 1, for a normal that is
    /// on the side of the eye and need not have unit length.
    pub(super) fn resolve(&self, light: impl Fn([f32; 3]) -> f32) -> Image {
        let mut image = Image::new(self.width / 2, self.height / 2, [0; 3]);
        if image.pixels.is_empty() {
            return image;
        }
        let mut band = Band {
            rows: 0..0,
            width: self.width,
            depth: Vec::new(),
            seen: Vec::new(),
        };
        let parts = image.pixels.chunks_mut(BAND_ROWS / 2 * image.width);
        for (part, first) in parts.zip((0..self.height).step_by(BAND_ROWS)) {
            let rows = first..(first + BAND_ROWS).min(self.height);
            band.clear(rows, self.background);
            for (id, facet) in self.facets.iter().enumerate() {
                band.facet(id as Seen, facet, self.positions(facet.corners));
            }
            for capsule in &self.capsules {
                band.capsule(capsule);
            }
            self.shade_band(&band, part, &light);
        }
        image
    }

    /// Averages the samples of each pixel of a band.
    fn shade_band(&self, band: &Band, pixels: &mut [Color], light: impl Fn([f32; 3]) -> f32) {
        let rows = pixels.chunks_exact_mut(self.width / 2);
        let seen = band.seen.chunks_exact(2 * self.width);
        for ((row, seen), y) in rows.zip(seen).zip(band.rows.clone().step_by(2)) {
            let (upper, lower) = seen.split_at(self.width);
            let seen = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            for (x, (pixel, (upper, lower))) in row.iter_mut().zip(seen).enumerate() {
                let seen = [upper[0], upper[1], lower[0], lower[1]];
                let [x, y] = [2 * x as u32, y as u32].map(|c| c as f32);
                *pixel = if seen[1..] == [seen[0]; 3] {
                    self.shade(seen[0], x + 1.0, y + 1.0, &light)
                } else {
                    let at = |k: usize, dx: f32, dy: f32| {
                        self.shade(seen[k], x + dx, y + dy, &light).map(u16::from)
                    };
                    let colors = [
                        at(0, 0.5, 0.5),
                        at(1, 1.5, 0.5),
                        at(2, 0.5, 1.5),
                        at(3, 1.5, 1.5),
                    ];
                    let sum = |c: usize| colors.iter().map(|color| color[c]).sum::<u16>();
                    std::array::from_fn(|c| ((sum(c) + 2) / 4) as u8)
                };
            }
        }
    }

    fn shade(&self, seen: Seen, x: f32, y: f32, light: impl Fn([f32; 3]) -> f32) -> Color {
        if seen >= FLAT {
            let [_, r, g, b] = seen.to_be_bytes();
            return [r, g, b];
        }
        let facet = &self.facets[seen as usize];
        let v = facet.corners.map(|i| &self.vertices[i as usize]);
        let d = [x - v[0].position[0], y - v[0].position[1]];
        let w = facet.gradients.map(|g| g[0] * d[0] + g[1] * d[1]);
        let w = [1.0 - w[0] - w[1], w[0], w[1]];
        let mix = |a: [f32; 3]| w[0] * a[0] + w[1] * a[1] + w[2] * a[2];
        let normal = |c: usize| facet.side * mix(v.map(|v| v.normal[c]));
        let light = light([normal(0), normal(1), normal(2)]);
        // A cast saturates: the middle of a pixel may be a hair outside the triangle.
        std::array::from_fn(|c| (light * mix(v.map(|v| v.color[c])) + 0.5) as u8)
    }
}

/// Calls `paint(y, xs)` for those of the `rows`, which `p` must reach, and those columns
/// out of `width` whose sample centres lie in triangle `p`.
///
/// Both triangles at an edge compute the same crossing of that edge with a row, and a
/// centre on it belongs to the right one: no sample is drawn twice, none is left out.
fn for_each_span(
    mut p: [[f32; 3]; 3],
    width: usize,
    rows: Range<usize>,
    mut paint: impl FnMut(usize, Range<usize>),
) {
    p.sort_unstable_by(|a, b| a[1].total_cmp(&b[1]));
    let [top, middle, bottom] = p;
    let edge = |a: [f32; 3], b: [f32; 3]| {
        let slope = (b[0] - a[0]) / (b[1] - a[1]);
        move |y: f32| a[0] + (y - a[1]) * slope
    };
    let long = edge(top, bottom);
    let (upper, lower) = (edge(top, middle), edge(middle, bottom));
    for y in rows {
        let row = y as f32 + 0.5;
        let short = if row < middle[1] {
            upper(row)
        } else {
            lower(row)
        };
        let (left, right) = (long(row).min(short), long(row).max(short));
        let xs = centers(left, width)..centers(right, width);
        if !xs.is_empty() {
            paint(y, xs);
        }
    }
}

/// Number of sample centres, out of `limit`, below coordinate `x`: the first one that is
/// not. Casts saturate, and are many times faster here than `ceil`, which is a call on
/// processors of the x86-64 baseline.
fn centers(x: f32, limit: usize) -> usize {
    let from_first = x - 0.5;
    let whole = from_first as u32;
    let rest = u32::from(whole as f32 != from_first && from_first > 0.0);
    (whole.saturating_add(rest) as usize).min(limit)
}
