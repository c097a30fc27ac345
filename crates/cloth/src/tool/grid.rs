use rayon::prelude::*;

use crate::math::{Lanes, Tables, Vec3};

use super::error::ToolError;
use super::surface::{Surface, winding};

/// Most nodes of a grid: 256 MiB of samples.
const MAX_NODES: usize = 64 << 20;
/// Spacing if none is given [mm], and most nodes of such a grid.
const USUAL_MM: f64 = 4.0;
const USUAL_NODES: f64 = 16e6;

/// Signed distance to a tool on a regular grid [m], negative inside.
///
/// Exact at the nodes but for rounding to f32. Between them the trilinear interpolant errs by up to
/// h²/8 times the sum of the surface's curvatures (0.04 mm beside a cylinder of radius 50 mm at
/// spacing h = 4 mm), and by about h/2 at sharp edges. [`super::Tool::grid_error`] measures it.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceGrid {
    /// Position of the first node [m].
    pub(super) origin: Vec3,
    /// Distance between neighbouring nodes [m].
    pub(super) spacing: f64,
    /// Nodes along x, y and z; at least 2 each.
    pub(super) dims: [usize; 3],
    /// Signed distances [m] at the nodes, x running fastest, then y.
    pub(super) samples: Vec<f32>,
}

impl DistanceGrid {
    /// Nodes along x, y and z of a grid over a box, as whole numbers.
    pub(super) fn nodes(extent: Vec3, spacing: f64) -> Vec3 {
        extent.map(|extent| (extent / spacing - 1e-9).ceil().max(1.0) + 1.0)
    }

    /// Spacing for a box of this extent [m] if nobody gives one [mm]: doubled for large tools, whose
    /// grids would take minutes.
    pub(super) fn usual_spacing_mm(extent: Vec3) -> f64 {
        let mut mm = USUAL_MM;
        while Self::nodes(extent, 1e-3 * mm).product() > USUAL_NODES {
            mm *= 2.0;
        }
        mm
    }

    /// Distance between neighbouring nodes [m].
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// How many nodes it has.
    pub fn node_count(&self) -> usize {
        self.samples.len()
    }

    /// Position of the first node [m], nodes along each axis, and distances there [m], x running
    /// fastest, then y.
    #[cfg(feature = "gpu")]
    pub(crate) fn parts(&self) -> ([f64; 3], [usize; 3], &[f32]) {
        (self.origin.into(), self.dims, &self.samples)
    }

    /// Samples the distance to `surface` over the box from `low` to `high` [m], rounded up
    /// to whole cells of size `spacing` [m]. In parallel; the result does not depend on the
    /// number of threads.
    ///
    /// # Errors
    /// More than 64 Mi nodes, or a box or spacing that is not finite and positive.
    pub(super) fn new(
        surface: &Surface,
        low: Vec3,
        high: Vec3,
        spacing: f64,
    ) -> Result<Self, ToolError> {
        let nodes_at = |spacing: f64| Self::nodes(high - low, spacing);
        let nodes = nodes_at(spacing);
        // The product is taken in f64, which cannot wrap; NaN fails the comparison.
        let fits = |nodes: Vec3| nodes.product() <= MAX_NODES as f64;
        if !(spacing > 0.0 && fits(nodes)) {
            // In whole millimetres, up to the coarsest spacing that there is.
            let fitting = (1..=1000).find(|&mm| fits(nodes_at(1e-3 * f64::from(mm))));
            let size = "check the size of the tool";
            return Err(ToolError::GridTooLarge {
                dims: nodes.into(),
                spacing_mm: spacing * 1e3,
                mib: nodes.product() * size_of::<f32>() as f64 / f64::from(1 << 20),
                limit_mib: (MAX_NODES * size_of::<f32>()) >> 20,
                advice: fitting.map_or(size.into(), |mm| {
                    format!("set `tool.grid.spacing_mm` to {mm} or more, or {size}")
                }),
            });
        }
        let dims = [nodes.x as usize, nodes.y as usize, nodes.z as usize];
        let mut grid = Self {
            origin: low,
            spacing,
            dims,
            samples: vec![0.0; dims.iter().product()],
        };
        let node =
            |i: usize, j: usize, k: usize| low + Vec3::new(i as f64, j as f64, k as f64) * spacing;
        let columns: Vec<Vec<(f64, i32)>> = (0..dims[0] * dims[1])
            .into_par_iter()
            .map(|column| {
                let x = node(column % dims[0], column / dims[0], 0);
                surface.crossings(x.x, x.y)
            })
            .collect();
        grid.samples
            .par_chunks_mut(dims[0])
            .enumerate()
            .for_each(|(row, samples)| {
                let (j, k) = (row % dims[1], row / dims[1]);
                // What was nearest to the node before bounds the search for the next one.
                let mut near = None;
                for (i, sample) in samples.iter_mut().enumerate() {
                    let x = node(i, j, k);
                    let bound = near.map_or(f64::MAX, |p: Vec3| (p - x).norm() * (1.0 + 1e-9));
                    let (distance, point) = surface.nearest(x, bound);
                    near = Some(point);
                    let inside = winding(&columns[j * dims[0] + i], x.z) > 0;
                    *sample = if inside { -distance } else { distance } as f32;
                }
            });
        Ok(grid)
    }

    /// Position of a node [m], by its number.
    pub(super) fn position(&self, node: usize) -> Vec3 {
        let [x, y, _] = self.dims;
        let [i, j, k] = [node % x, node / x % y, node / (x * y)].map(|n| n as f64);
        self.origin + Vec3::new(i, j, k) * self.spacing
    }

    /// Numbers of the corners of the cell with this first node.
    pub(super) fn corners(&self, first: usize) -> [usize; 8] {
        let [x, y, _] = self.dims;
        std::array::from_fn(|n| first + (n & 1) + (n >> 1 & 1) * x + (n >> 2) * x * y)
    }

    /// Signed distance [m] at `x` [m] and its gradient, see `Grids::sample`.
    pub fn sample<V: Lanes>(&self, x: [V; 3]) -> (V, [V; 3]) {
        Grids::new(&self.samples, std::iter::repeat_n((0, self), V::COUNT)).sample(x)
    }
}

/// A grid in every lane.
pub(super) struct Grids<'a, V> {
    /// Its first node [m].
    origin: [V; 3],
    /// [m], and its inverse.
    spacing: V,
    inverse_spacing: V,
    /// Number of the last node along each axis.
    last: [V; 3],
    tables: Tables<'a>,
}

/// Values at the ends of the edges of a cell along x.
type Edges<V> = [[V; 2]; 4];

impl<'a, V: Lanes> Grids<'a, V> {
    /// One for each lane, where its own samples begin among `samples`.
    pub fn new<'g>(
        samples: &'a [f32],
        all: impl Iterator<Item = (usize, &'g DistanceGrid)> + Clone,
    ) -> Self {
        let table = |(first, grid): (usize, &DistanceGrid)| {
            let [x, y, _] = grid.dims;
            (first..first + grid.samples.len(), [x, x * y])
        };
        let mut grids = Self {
            origin: [V::zero(); 3],
            spacing: V::zero(),
            inverse_spacing: V::zero(),
            last: [V::zero(); 3],
            tables: Tables::new(samples, all.clone().map(table)),
        };
        for (lane, (_, grid)) in all.enumerate() {
            grids.spacing.set(lane, grid.spacing);
            grids.inverse_spacing.set(lane, 1.0 / grid.spacing);
            for a in 0..3 {
                grids.origin[a].set(lane, grid.origin[a]);
                grids.last[a].set(lane, (grid.dims[a] - 1) as f64);
            }
        }
        grids
    }

    /// Signed distance [m] at `x` [m] and its gradient, by trilinear interpolation, in every
    /// lane.
    ///
    /// Beyond the box: the value at the nearest point of the box plus the distance to that
    /// point (never too small, by the triangle inequality), and the gradient of just that.
    /// Continuous; finite for all numbers (coordinates beyond 1e15 m are clamped, so that
    /// their squares are finite). NaN in gives NaN out. f32 differs from f64 by about 1e-7 m
    /// within a metre of the tool.
    #[inline(always)]
    pub fn sample(&self, x: [V; 3]) -> (V, [V; 3]) {
        let (cell, t, beyond) = self.locate(x);
        self.interpolate(V::look_up(&self.tables, cell), t, beyond)
    }

    /// The cell of a point, where in it that is, from 0 to 1, and how far beyond the grid [m].
    #[inline(always)]
    fn locate(&self, x: [V; 3]) -> ([V; 3], [V; 3], [V; 3]) {
        let (zero, one, horizon) = (V::zero(), V::of(1.0), V::of(1e15));
        let mut cell = [zero; 3];
        let mut t = [zero; 3];
        let mut beyond = [zero; 3];
        for a in 0..3 {
            // The bounds come first, since a comparison with NaN yields the second operand.
            let offset = horizon.min((-horizon).max(x[a])) - self.origin[a];
            let last = self.last[a];
            let u = last.min(zero.max(offset * self.inverse_spacing));
            cell[a] = u.floor().min(last - one);
            t[a] = u - cell[a];
            beyond[a] = offset - (last * self.spacing).min(zero.max(offset));
        }
        (cell, t, beyond)
    }

    /// Value and gradient, of what the edges of the cell have at their ends.
    #[inline(always)]
    fn interpolate(&self, v: Edges<V>, t: [V; 3], beyond: [V; 3]) -> (V, [V; 3]) {
        let (zero, inverse_spacing) = (V::zero(), self.inverse_spacing);
        let lerp = |a: V, b: V, t: V| a + (b - a) * t;
        // Along x on four edges, then along y on two faces, then along z.
        let mut d = [zero; 4];
        let mut e = [zero; 4];
        for (k, [near, far]) in v.into_iter().enumerate() {
            d[k] = far - near;
            e[k] = near + d[k] * t[0];
        }
        let f = [lerp(e[0], e[1], t[1]), lerp(e[2], e[3], t[1])];
        let inside = lerp(f[0], f[1], t[2]);
        let gradient = [
            lerp(lerp(d[0], d[1], t[1]), lerp(d[2], d[3], t[1]), t[2]) * inverse_spacing,
            lerp(e[1] - e[0], e[3] - e[2], t[2]) * inverse_spacing,
            (f[1] - f[0]) * inverse_spacing,
        ];
        let [bx, by, bz] = beyond;
        let square = bx * bx + by * by + bz * bz;
        // Within the box the square is 0, or NaN, which must come out.
        if !V::any(zero.lt(square)) {
            return (inside + square, gradient);
        }
        let distance = square.sqrt();
        let inverse = V::of(1.0) / V::select(zero.lt(square), distance, V::of(1.0));
        let outwards = |b: V, inside: V| {
            let off = zero.lt(b * b);
            V::select(off, b * inverse, inside)
        };
        let [gx, gy, gz] = gradient;
        let gradient = [outwards(bx, gx), outwards(by, gy), outwards(bz, gz)];
        (inside + distance, gradient)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::math::{Purpose, Stream};
    use crate::tool::{GridConfig, Hemisphere, Plate, Shape, Tool};

    fn tool(shape: Shape, spacing_mm: f64) -> Tool {
        let grid = GridConfig {
            spacing_mm: Some(spacing_mm),
            margin_mm: 30.0,
        };
        Tool::from_mesh(shape.mesh().unwrap(), &grid).unwrap()
    }

    /// Points in a box that reaches `beyond` [m] out of the grid.
    fn points(grid: &DistanceGrid, beyond: f64, count: usize) -> Vec<[f64; 3]> {
        let mut stream = Stream::new(3, Purpose::Evaluation, 0);
        let low = grid.origin - Vec3::repeat(beyond);
        let [x, y, z] = grid.dims.map(|n| (n - 1) as f64);
        let size = Vec3::new(x, y, z) * grid.spacing + Vec3::repeat(2.0 * beyond);
        (0..count)
            .map(|_| std::array::from_fn(|a| low[a] + size[a] * stream.uniform()))
            .collect()
    }

    #[test]
    fn plane_is_exact() {
        let grid = tool(Shape::Plate(Plate::default()), 4.0).grid;
        for z in [-0.009_f64, -0.001, 0.0, 0.0123, 0.029] {
            let (phi, grad) = grid.sample([0.0123, -0.0456, z]);
            assert!((phi - z).abs() < 1e-8, "{phi} at {z}");
            assert!((Vec3::from(grad) - Vec3::z()).norm() < 1e-5, "{grad:?}");
        }
    }

    #[test]
    fn box_outside_and_inside() {
        let grid = tool(Shape::Plate(Plate::default()), 4.0).grid;
        // Beside the middle of an edge, above a vertical edge's end, and in the middle.
        let diagonal = (0.02_f64.powi(2) + 0.02_f64.powi(2)).sqrt();
        for (x, exact, tolerance) in [
            ([0.26, 0.0, -0.01], 0.02, 1e-6),
            ([0.26, 0.0, 0.02], diagonal, 1e-4),
            ([0.0, 0.0, -0.0101], -0.0099, 1e-4),
        ] {
            let (phi, _) = grid.sample(x);
            assert!(
                (phi - exact).abs() < tolerance,
                "{phi} for {exact} at {x:?}"
            );
        }
    }

    #[test]
    fn sphere_converges_at_second_order() {
        // A mesh fine enough for its facets (0.005 mm off the sphere) not to matter.
        let shape = Hemisphere {
            radius_mm: 75.0,
            segment_count: 384,
            ring_count: 96,
            plate_mm: [200.0, 200.0],
            ..Hemisphere::default()
        };
        let errors = [8.0, 4.0].map(|spacing_mm| {
            let grid = tool(Shape::Hemisphere(shape.clone()), spacing_mm).grid;
            let mut stream = Stream::new(9, Purpose::Evaluation, 0);
            let (mut worst_phi, mut worst_normal) = (0.0_f64, 0.0_f64);
            for _ in 0..2000 {
                // Within 60 degrees of the pole, the plate is farther away.
                let (cos, turn) = (0.5 + 0.5 * stream.uniform(), TAU * stream.uniform());
                let sin = (1.0 - cos * cos).sqrt();
                let n = Vec3::new(sin * turn.cos(), sin * turn.sin(), cos);
                let phi = 0.01 * (2.0 * stream.uniform() - 1.0);
                let x = (n * (0.075 + phi)).into();
                worst_phi = worst_phi.max((grid.sample(x).0 - phi).abs());
                worst_normal =
                    worst_normal.max((Vec3::from(grid.sample(x).1).normalize() - n).norm());
            }
            (worst_phi, worst_normal)
        });
        let [coarse, fine] = errors;
        // Distance: order 2, and h²/8 · 2/R = 0.06 mm at 4 mm; its gradient: order 1.
        assert!(fine.0 < 0.3 * coarse.0 && fine.0 < 6.5e-5, "{errors:?}");
        assert!(fine.1 < 0.6 * coarse.1 && fine.1 < 0.045, "{errors:?}");
    }

    #[test]
    fn single_precision_agrees() {
        let grid = tool(Shape::default(), 6.0).grid;
        for x in points(&grid, 0.2, 2000) {
            let x = x.map(|c| c as f32);
            let (phi, grad) = grid.sample(x.map(f64::from));
            let (phi_f32, grad_f32) = grid.sample(x);
            assert!(
                (f64::from(phi_f32) - phi).abs() < 2e-7,
                "{phi_f32} for {phi}"
            );
            for (a, b) in grad_f32.iter().zip(grad) {
                assert!(
                    (f64::from(*a) - b).abs() < 1e-3,
                    "{grad_f32:?} for {grad:?}"
                );
            }
        }
    }

    #[test]
    fn gradient_is_that_of_the_value() {
        let grid = tool(Shape::default(), 6.0).grid;
        let step = 1e-7;
        let mut compared = 0;
        for x in points(&grid, 0.2, 2000) {
            // Differences across a cell face or the border of the box mean nothing.
            let is_smooth = (0..3).all(|a| {
                let u = (x[a] - grid.origin[a]) / grid.spacing;
                (u - u.round()).abs() > 1e-3
            });
            if !is_smooth {
                continue;
            }
            compared += 1;
            let (_, grad) = grid.sample(x);
            for a in 0..3 {
                let [mut ahead, mut behind] = [x, x];
                ahead[a] += step;
                behind[a] -= step;
                let slope = (grid.sample(ahead).0 - grid.sample(behind).0) / (2.0 * step);
                assert!(
                    (slope - grad[a]).abs() < 1e-6,
                    "{slope} for {grad:?} at {x:?}"
                );
            }
        }
        assert!(compared > 1900);
    }

    #[test]
    fn far_points_are_bounded_from_above_and_never_nan() {
        let tool = tool(Shape::default(), 8.0);
        for x in points(&tool.grid, 1.0, 500) {
            let (phi, grad) = tool.grid.sample(x);
            let exact = tool.surface.signed_distance(x.into());
            // 8 mm cells: a few millimetres of interpolation error at sharp edges.
            assert!(
                phi > exact - 4e-3 && phi < exact + 0.35,
                "{phi} for {exact}"
            );
            assert!(Vec3::from(grad).norm() < 2.0);
        }
        for huge in [1e3, 1e9, 1e38, f64::MAX, f64::INFINITY] {
            for x in [[huge, 0.0, 0.0], [-huge, huge, -huge], [0.0, 0.0, -huge]] {
                let (phi, grad) = tool.grid.sample(x);
                assert!(phi.is_finite() && phi > 900.0, "{phi} at {x:?}");
                assert!(grad.iter().all(|g| g.is_finite()));
                let (phi, grad) = tool.grid.sample(x.map(|c| c as f32));
                assert!(phi.is_finite() && grad.iter().all(|g| g.is_finite()));
            }
        }
        assert!(tool.grid.sample([f64::NAN, 0.0, 0.0]).0.is_nan());
    }

    #[test]
    fn same_bits_for_any_number_of_threads() {
        let build = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap()
                .install(|| tool(Shape::default(), 10.0).grid)
        };
        let one = build(1);
        for threads in [2, 7] {
            let many = build(threads);
            let bits = |grid: &DistanceGrid| -> Vec<u32> {
                grid.samples.iter().map(|s| s.to_bits()).collect()
            };
            assert!(bits(&one) == bits(&many));
        }
    }

    #[test]
    fn too_fine_a_grid_is_refused() {
        let error = |spacing_mm| {
            let grid = GridConfig {
                spacing_mm: Some(spacing_mm),
                margin_mm: 30.0,
            };
            Tool::from_mesh(Shape::default().mesh().unwrap(), &grid).err()
        };
        assert_eq!(
            error(0.5).unwrap().to_string(),
            "a grid of 1081 x 1001 x 281 nodes at spacing 0.5 mm takes 1160 MiB, expected at \
             most 256: set `tool.grid.spacing_mm` to 1 or more, or check the size of the tool"
        );
        for spacing_mm in [1e-300, 0.0, -1.0, f64::NAN] {
            assert!(matches!(
                error(spacing_mm),
                Some(ToolError::GridTooLarge { .. })
            ));
        }
    }
}
