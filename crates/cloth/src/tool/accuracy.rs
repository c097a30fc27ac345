use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::sharp::NEAR;
use super::solid::Tool;
use crate::math::Vec3;

/// Absolute difference between the interpolated and the exact distance [mm], at points spread evenly
/// over the surface, up to 2 mm above or below it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridError {
    /// Spacing of the grid [mm].
    pub spacing: f64,
    pub mean: f64,
    pub p95: f64,
    pub max: f64,
    /// Where it is greatest.
    pub place: [f64; 3],
}

/// Where the walls of a tool are thinnest, straight through between faces that are parallel to 25
/// degrees [mm]. Edges, where faces meet, are no walls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Thinnest {
    pub thickness: f64,
    pub place: [f64; 3],
}

impl Tool {
    /// Compares the grid with the exact distance at `count` > 0 points near the surface. Always the
    /// same points (Halton sequences).
    pub fn grid_error(&self, count: usize) -> GridError {
        let at = self.on_surface();
        let error = |i: usize| {
            let (on_surface, normal) = at(i);
            let x = on_surface + normal * (NEAR * (2.0 * halton(i, 7) - 1.0));
            let error = (self.distance(x.into()).0 - self.surface.signed_distance(x)).abs();
            (error, x)
        };
        let mut found: Vec<(f64, Vec3)> = (1..=count).into_par_iter().map(error).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let errors: Vec<f64> = found.iter().map(|found| found.0).collect();
        GridError {
            // To the nanometre, so that it reads as it was given.
            spacing: (1e9 * self.grid.spacing).round() / 1e6,
            mean: 1e3 * (errors.iter().sum::<f64>() / count as f64),
            p95: 1e3 * errors[(count * 95).div_ceil(100) - 1],
            max: 1e3 * errors[count - 1],
            place: (found[count - 1].1 * 1e3).into(),
        }
    }

    /// The thinnest wall that is found from `count` points of the surface, if there is any.
    pub fn thinnest(&self, count: usize) -> Option<Thinnest> {
        let at = self.on_surface();
        let thickness = |i: usize| {
            let (x, normal) = at(i);
            Some((self.surface.thickness(x, normal)?, x))
        };
        let found: Vec<_> = (1..=count).into_par_iter().filter_map(thickness).collect();
        let (thickness, x) = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Thinnest {
            thickness: 1e3 * thickness,
            place: (x * 1e3).into(),
        })
    }

    /// The `i`-th of points spread evenly over the surface [m], and its normal (Halton sequences).
    fn on_surface(&self) -> impl Fn(usize) -> (Vec3, Vec3) {
        let mut area_up_to = Vec::with_capacity(self.mesh.triangles.len());
        let mut area = 0.0;
        for t in 0..self.mesh.triangles.len() {
            let [a, b, c] = self.mesh.corners(t);
            area += (b - a).cross(&(c - a)).norm();
            area_up_to.push(area);
        }
        move |i: usize| {
            let chosen = area * halton(i, 2);
            let t = area_up_to.partition_point(|&up_to| up_to <= chosen);
            // Areas too small for f64 add up to nothing.
            let t = t.min(area_up_to.len() - 1);
            let [a, b, c] = self.mesh.corners(t);
            // Evenly over the triangle: the square root makes up for its tip.
            let (r, s) = (halton(i, 3).sqrt(), halton(i, 5));
            let on_surface = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
            let normal = (b - a).cross(&(c - a)).normalize();
            (on_surface, normal)
        }
    }
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mean, p95, max, .. } = self;
        let [x, y, z] = self.place;
        write!(
            f,
            "mean {mean:.4} mm, p95 {p95:.4} mm, max {max:.4} mm at ({x:.1}, {y:.1}, {z:.1}) mm"
        )
    }
}

/// The `i`-th number of the Halton sequence to `base`: evenly spread over (0, 1).
fn halton(mut i: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while i > 0 {
        digit /= base as f64;
        value += digit * (i % base) as f64;
        i /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::shapes::tests::all;
    use crate::tool::tests::blocks;
    use crate::tool::{Atlas, Tools};
    use crate::tool::{GridConfig, Plate, Shape};

    fn rib(spacing_mm: f64) -> Tool {
        let grid = GridConfig {
            spacing_mm: Some(spacing_mm),
            ..GridConfig::default()
        };
        Tool::from_mesh(Shape::default().mesh().unwrap(), &grid).unwrap()
    }

    #[test]
    fn rib_is_accurate_near_its_surface() {
        let tool = rib(4.0);
        let error = tool.grid_error(20_000);
        assert!(error.mean < 2e-2 && error.p95 < 5e-2, "{error}");
        // At the edges of the plate.
        assert!(error.max < 2.0, "{error}");
    }

    #[test]
    fn error_of_the_working_surface_falls_with_the_spacing() {
        // Where cloth lies: the upper face, a cell away from its edges.
        let worst = |spacing_mm| {
            let tool = rib(spacing_mm);
            (1..=20_000)
                .map(|i| {
                    let (x, y) = (0.42 * (halton(i, 2) - 0.5), 0.40 * (halton(i, 3) - 0.5));
                    let (top, _) = *tool.surface.crossings(x, y).last().unwrap();
                    let x = Vec3::new(x, y, top + NEAR * (2.0 * halton(i, 5) - 1.0));
                    (tool.grid.sample(x.into()).0 - tool.surface.signed_distance(x)).abs()
                })
                .reduce(f64::max)
                .unwrap()
        };
        let (coarse, fine) = (worst(6.0), worst(4.0));
        assert!(
            fine < 0.5 * coarse && fine < 1.5e-4,
            "{fine} after {coarse}"
        );
    }

    /// A plate of 3 mm, which a grid of 4 mm does not see.
    fn thin_plate(spacing_mm: Option<f64>) -> Tool {
        let plate = Shape::Plate(Plate {
            plate_mm: [60.0, 50.0],
            base_mm: 3.0,
        });
        let mut mesh = plate.mesh().unwrap();
        for vertex in &mut mesh.vertices {
            // Off the nodes.
            *vertex += Vec3::new(0.0011, 0.0007, 0.0013);
        }
        let grid = GridConfig {
            spacing_mm,
            ..GridConfig::default()
        };
        Tool::from_mesh(mesh, &grid).unwrap()
    }

    #[test]
    fn without_a_spacing_edges_and_thin_walls_are_exact() {
        assert!(thin_plate(Some(4.0)).grid_error(20_000).max > 1.0);
        let tool = thin_plate(None);
        let error = tool.grid_error(20_000);
        assert!(error.max < 1e-4, "{error}");
        let thinnest = tool.thinnest(2000).unwrap();
        assert!((thinnest.thickness - 3.0).abs() < 1e-6, "{thinnest:?}");
        // Below the middle the normal points down, in both precisions.
        let (phi, n) = tool.distance([0.01, 0.01, 0.0013 - 0.002]);
        assert!((phi + 0.001).abs() < 1e-9 && n[2] < -0.999, "{phi} {n:?}");
        let atlas = Atlas::new(&[tool.into()]);
        let tools: Tools<f32> = atlas.in_lanes(1, |_| 0);
        let (phi, n) = tools.distance([0.01f32, 0.01, 0.0013 - 0.001]);
        assert!((phi + 0.001).abs() < 1e-7 && n[2] > 0.999, "{phi} {n:?}");
    }

    /// A fin of 5 mm reads so, stands it on its plate or is it sunk into it; so does a cross of two.
    #[test]
    fn thickness_is_that_of_all_bodies_together() {
        let plate = [[-0.2, -0.2, -0.02], [0.2, 0.2, 0.0]];
        let fin = |foot: f64| [[0.0004, -0.15, foot], [0.0054, 0.15, 0.06]];
        let across = [[-0.1, 0.0, -0.001], [0.1, 0.007, 0.05]];
        for all in [
            &[plate, fin(-0.001)][..],
            &[plate, fin(0.0)],
            &[plate, fin(-0.001), across],
        ] {
            let tool = Tool::from_mesh(blocks(all), &GridConfig::default()).unwrap();
            let thinnest = tool.thinnest(20_000).unwrap();
            assert!((thinnest.thickness - 5.0).abs() < 1e-6, "{thinnest:?}");
            assert!(tool.grid_error(20_000).max < 0.1);
        }
    }

    #[test]
    fn every_shape_keeps_a_tenth_of_a_millimetre() {
        for shape in all() {
            let tool = Tool::from_mesh(shape.mesh().unwrap(), &GridConfig::default()).unwrap();
            let error = tool.grid_error(20_000);
            assert!(error.max < 0.1, "{shape:?}: {error}");
        }
    }

    #[test]
    fn halton_numbers_by_hand() {
        let base_3 = [1, 2, 3, 4].map(|i| halton(i, 3));
        for (found, exact) in base_3.iter().zip([3.0, 6.0, 1.0, 4.0]) {
            assert!((found - exact / 9.0).abs() < 1e-15);
        }
    }
}
