use std::fmt;

use rayon::prelude::*;
use serde::Serialize;

use super::solid::Tool;
use crate::math::Vec3;

/// What counts as near the surface [m]: the range in which cloth touches the tool.
const NEAR: f64 = 2e-3;

/// Difference between the interpolated and the exact distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridError {
    /// Spacing of the grid [mm].
    pub spacing: f64,
    /// At points spread evenly over the grid's box.
    pub everywhere: ErrorSummary,
    /// At points spread evenly over the surface, up to 2 mm above or below it.
    pub within_2_mm: ErrorSummary,
}

/// Absolute errors [mm].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorSummary {
    pub mean: f64,
    pub p95: f64,
    pub max: f64,
}

impl Tool {
    /// Compares the grid with the exact distance at `count` points in the box and as many
    /// near the surface. Always the same points (Halton sequences); `count` must not be 0.
    pub fn grid_error(&self, count: usize) -> GridError {
        let (low, high) = (self.grid.origin, self.grid.end());
        let in_box = |i: usize| {
            let share = Vec3::new(halton(i, 2), halton(i, 3), halton(i, 5));
            low + share.component_mul(&(high - low))
        };

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
        let error =
            |x: Vec3| (self.grid.sample(x.into()).0 - self.surface.signed_distance(x)).abs();
        let everywhere = (1..=count).into_par_iter().map(|i| error(in_box(i)));
        let near = (1..=count).into_par_iter().map(|i| error(near_surface(i)));
        GridError {
            // To the nanometre, so that it reads as it was given.
            spacing: (1e9 * self.grid.spacing).round() / 1e6,
            everywhere: ErrorSummary::new(everywhere.collect()),
            within_2_mm: ErrorSummary::new(near.collect()),
        }
    }
}

impl ErrorSummary {
    /// Of errors [m].
    fn new(mut errors: Vec<f64>) -> Self {
        errors.sort_unstable_by(f64::total_cmp);
        let count = errors.len();
        Self {
            mean: 1e3 * (errors.iter().sum::<f64>() / count as f64),
            p95: 1e3 * errors[(count * 95).div_ceil(100) - 1],
            max: 1e3 * errors[count - 1],
        }
    }
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "everywhere         {}", self.everywhere)?;
        write!(f, "within 2 mm        {}", self.within_2_mm)
    }
}

impl fmt::Display for ErrorSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mean, p95, max } = self;
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
        assert!(
            error.within_2_mm.mean < 2e-2 && error.within_2_mm.p95 < 5e-2,
            "{error}"
        );
        // Both have their maximum at the edges of the plate.
        assert!(
            error.within_2_mm.max < 2.0 && error.everywhere.max < 2.5,
            "{error}"
        );
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
    fn summary_takes_the_95th_of_a_hundred() {
        let errors = (1..=100).rev().map(f64::from).collect();
        let summary = ErrorSummary::new(errors);
        assert_eq!((summary.p95, summary.max), (95e3, 100e3));
        assert_eq!(summary.mean, 50.5e3);
    }

    #[test]
    fn halton_numbers_by_hand() {
        let base_3 = [1, 2, 3, 4].map(|i| halton(i, 3));
        for (found, exact) in base_3.iter().zip([3.0, 6.0, 1.0, 4.0]) {
            assert!((found - exact / 9.0).abs() < 1e-15);
        }
    }
}
