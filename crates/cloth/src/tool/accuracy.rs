use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::solid::Tool;

/// What counts as near the surface [m]: the range in which cloth touches the tool.
const NEAR: f64 = 2e-3;

/// Absolute difference between the interpolated and the exact distance [mm], at points spread evenly
/// over the surface, up to 2 mm above or below it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridError {
    /// Spacing of the grid [mm].
    pub spacing: f64,
    pub mean: f64,
    pub p95: f64,
    pub max: f64,
}

impl Tool {
    /// Compares the grid with the exact distance at `count` > 0 points near the surface. Always the
    /// same points (Halton sequences).
    pub fn grid_error(&self, count: usize) -> GridError {
        let mut area_up_to = Vec::with_capacity(self.mesh.triangles.len());
        let mut area = 0.0;
        for t in 0..self.mesh.triangles.len() {
            let [a, b, c] = self.mesh.corners(t);
            area += (b - a).cross(&(c - a)).norm();
            area_up_to.push(area);
        }
        let near_surface = |i: usize| {
            let chosen = area * halton(i, 2);
            let t = area_up_to.partition_point(|&up_to| up_to <= chosen);
            // Areas too small for f64 add up to nothing.
            let t = t.min(area_up_to.len() - 1);
            let [a, b, c] = self.mesh.corners(t);
            // Evenly over the triangle: the square root makes up for its tip.
            let (r, s) = (halton(i, 3).sqrt(), halton(i, 5));
            let on_surface = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
            let normal = (b - a).cross(&(c - a)).normalize();
            on_surface + normal * (NEAR * (2.0 * halton(i, 7) - 1.0))
        };
        let error = |i: usize| {
            let x = near_surface(i);
            (self.grid.sample(x.into()).0 - self.surface.signed_distance(x)).abs()
        };
        let mut errors: Vec<f64> = (1..=count).into_par_iter().map(error).collect();
        errors.sort_unstable_by(f64::total_cmp);
        GridError {
            // To the nanometre, so that it reads as it was given.
            spacing: (1e9 * self.grid.spacing).round() / 1e6,
            mean: 1e3 * (errors.iter().sum::<f64>() / count as f64),
            p95: 1e3 * errors[(count * 95).div_ceil(100) - 1],
            max: 1e3 * errors[count - 1],
        }
    }
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mean, p95, max, .. } = self;
        write!(f, "mean {mean:.4} mm, p95 {p95:.4} mm, max {max:.4} mm")
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
    use crate::math::Vec3;
    use crate::tool::{GridConfig, Shape};

    fn rib(spacing_mm: f64) -> Tool {
        let grid = GridConfig {
            spacing_mm,
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

    #[test]
    fn halton_numbers_by_hand() {
        let base_3 = [1, 2, 3, 4].map(|i| halton(i, 3));
        for (found, exact) in base_3.iter().zip([3.0, 6.0, 1.0, 4.0]) {
            assert!((found - exact / 9.0).abs() < 1e-15);
        }
    }
}
