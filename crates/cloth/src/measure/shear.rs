//! Shear: how far the yarns have turned against each other.

use fixedbitset::FixedBitSet;

use crate::fabric::{Drape, Lamina};

/// Shear of a part of the blank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheared {
    /// Greatest angle, of either sign [rad].
    pub max: f64,
    /// Share of the area at rest that is sheared by more than a limit [-].
    pub share_beyond: f64,
}

/// Shear angle of every triangle at `positions` [rad], two of them a cell: by how much the angle
/// between the yarns has closed.
pub fn shear(lamina: &Lamina, positions: &[[f64; 3]]) -> Vec<f64> {
    let drape = Drape::new(lamina, positions);
    let triangles = 0..drape.triangles.len();
    triangles.map(|t| drape.tangents(t).shear()).collect()
}

/// Shear of the triangles with all corners in `region`, against a `limit` [rad]; 0 where there
/// are none.
pub fn sheared(
    lamina: &Lamina,
    positions: &[[f64; 3]],
    region: &FixedBitSet,
    limit: f64,
) -> Sheared {
    let drape = Drape::new(lamina, positions);
    let (mut max, mut area, mut beyond) = (0.0, 0.0, 0.0);
    for (t, corners) in drape.triangles.iter().enumerate() {
        if corners.iter().any(|&v| !region.contains(v as usize)) {
            continue;
        }
        let angle = drape.tangents(t).shear().abs();
        // What is no number stays none.
        if angle > max || angle.is_nan() {
            max = angle;
        }
        let part = drape.rest_area(t);
        area += part;
        if angle > limit {
            beyond += part;
        }
    }
    let share_beyond = if area > 0.0 { beyond / area } else { 0.0 };
    Sheared { max, share_beyond }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};

    /// Along its yarns, at 45 degrees to them with halves of cells at the border, and at an angle
    /// with cut cells there.
    fn laminas() -> [Lamina; 3] {
        [(0.0, None), (45.0, Some(8.0)), (20.0, Some(6.0))].map(|(yarn_angle_deg, cell_mm)| {
            let config = BlankConfig {
                size_mm: [100.0, 80.0],
                vertices: [11, 9],
                cell_mm,
                yarn_angle_deg,
                ..BlankConfig::default()
            };
            Lamina::new(&config, Material::interglas_92125()).unwrap()
        })
    }

    /// The flat blank with its weft leaning over by `angle(along the weft)` [rad].
    fn leaning(lamina: &Lamina, angle: impl Fn(f64) -> f64) -> Vec<[f64; 3]> {
        let [cos, sin] = lamina.warp;
        let lean = |[x, y]: &[f64; 2]| {
            let (a, b) = (x * cos + y * sin, y * cos - x * sin);
            [a + angle(b).sin() * b, angle(b).cos() * b, 0.02]
        };
        lamina.rest.iter().map(lean).collect()
    }

    #[test]
    fn sheared_sheet_has_its_angle_on_every_mesh() {
        for lamina in laminas() {
            let mut all = FixedBitSet::with_capacity(lamina.vertex_count());
            all.insert_range(..);
            for angle in [30f64, -30.0, 55.0].map(f64::to_radians) {
                let at = leaning(&lamina, |_| angle);
                let found = shear(&lamina, &at);
                assert_eq!(found.len(), lamina.triangles.len());
                assert!(found.iter().all(|found| (found - angle).abs() < 1e-12));
                for (limit, share) in [(0.9, 1.0), (1.1, 0.0)] {
                    let found = sheared(&lamina, &at, &all, limit * angle.abs());
                    assert!((found.max - angle.abs()).abs() < 1e-12);
                    assert_eq!(found.share_beyond, share);
                }
            }
        }
    }

    /// Half of a sheet is sheared: the share is its area, and a region has its own.
    #[test]
    fn shares_are_of_the_area_in_the_region() {
        let [lamina, ..] = laminas();
        let at = leaning(&lamina, |b| if b > 0.0 { 0.5 } else { 0.0 });
        let upper = |v: usize| lamina.rest[v][1] > -1e-9;
        let region = |is_in: &dyn Fn(usize) -> bool| -> FixedBitSet {
            (0..lamina.vertex_count()).filter(|&v| is_in(v)).collect()
        };
        let of = |region: &FixedBitSet| sheared(&lamina, &at, region, 0.3);
        let all = of(&region(&|_| true));
        assert!((all.max - 0.5).abs() < 1e-12 && (all.share_beyond - 0.5).abs() < 1e-12);
        assert!((of(&region(&upper)).share_beyond - 1.0).abs() < 1e-12);
        let lower = of(&region(&|v| lamina.rest[v][1] < 1e-9));
        assert!(lower.max < 1e-12 && lower.share_beyond == 0.0);
        let none = of(&FixedBitSet::new());
        assert_eq!((none.max, none.share_beyond), (0.0, 0.0));
        let lost = vec![[f64::NAN; 3]; lamina.vertex_count()];
        assert!(
            sheared(&lamina, &lost, &region(&|_| true), 0.3)
                .max
                .is_nan()
        );
    }
}
