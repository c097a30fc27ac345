use drape_cloth::math::Vec3;
use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector6};
use rayon::prelude::*;

/// A rotation and then a translation [m].
pub type Rigid = Isometry3<f64>;

/// Second extent of marks over their first below which they lie on a line, and no turn about it is known.
const LINE: f64 = 1e-2;
/// Marks are mirrored whose image in a mirror fits so much better,
const MIRRORED: f64 = 0.3;
/// if they do not fit by more than this share of their extent as they are.
const ROUGH: f64 = 0.02;
/// Most steps of [`icp`].
const STEPS: usize = 60;
/// Steps below this end it [m].
const STILL: f64 = 1e-7;
/// Motions that change distances by less than this share of what the best known one does are left alone,
/// as a ball on a ball may turn.
const FREE: f64 = 1e-3;

/// Marks that no rigid motion can be found from.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AlignError {
    #[error("{count} marks, expected at least 3")]
    TooFew { count: usize },
    #[error("all {count} marks lie on a line, expected some beside it")]
    Line { count: usize },
    /// What is left of either [m].
    #[error(
        "its marks are mirrored: they fit to {:.2} mm as they are, to {:.2} mm in a mirror; expected them in \
         the order and the axes of the scene", 1e3 * rms, 1e3 * mirrored_rms
    )]
    Mirrored { rms: f64, mirrored_rms: f64 },
}

/// The rigid motion that brings points as near as possible to others, by the sum of squares, and the root
/// mean square distance that is left [m]. No scale. Kabsch 1976, with the sign of Umeyama 1991.
///
/// # Errors
/// If there are too few pairs, they lie on a line, or only a mirror brings them together.
///
/// # Panics
/// If there are not as many points on both sides.
pub fn kabsch(from: &[Vec3], to: &[Vec3]) -> Result<(Rigid, f64), AlignError> {
    assert_eq!(from.len(), to.len(), "pairs");
    let count = from.len();
    if count < 3 {
        return Err(AlignError::TooFew { count });
    }
    let mean = |points: &[Vec3]| points.iter().sum::<Vec3>() / count as f64;
    let (a, b) = (mean(from), mean(to));
    let pairs = || from.iter().zip(to).map(|(x, y)| (x - a, y - b));
    let moment: Matrix3<f64> = pairs().map(|(x, y)| y * x.transpose()).sum();
    let spread: f64 = pairs()
        .map(|(x, y)| x.norm_squared() + y.norm_squared())
        .sum();
    let svd = moment.svd(true, true);
    let s = svd.singular_values;
    if s[0].is_nan() || s[1] <= LINE * LINE * s[0] || s[0] == 0.0 {
        return Err(AlignError::Line { count });
    }
    let (u, v) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let sign = (u * v).determinant().signum();
    let turn = u * Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, sign)) * v;
    // |Rx - y|^2 = |x|^2 + |y|^2 - 2 yRx, summed.
    let rms = |trace: f64| ((spread - 2.0 * trace).max(0.0) / count as f64).sqrt();
    let (proper, mirrored) = (s[0] + s[1] + sign * s[2], s[0] + s[1] - sign * s[2]);
    let (rms, mirrored_rms) = (rms(proper), rms(mirrored));
    let extent = (0.5 * spread / count as f64).sqrt();
    if mirrored_rms < MIRRORED * rms && rms > ROUGH * extent {
        return Err(AlignError::Mirrored { rms, mirrored_rms });
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Ok((Rigid::from_parts((b - turn * a).into(), turn), rms))
}

/// Moves points on to a surface that a part of them lies on, from `start` on: trimmed ICP, point to plane
/// (Chen and Medioni 1992; Chetverikov et al. 2002). The `share` of the points that is nearest counts.
/// `surface` tells the distance of a place from it [m] and the unit vector along which that grows. Gives
/// the motion and the root mean square distance of these points [m].
///
/// It finds the nearest of what may be many ways to lie, and leaves alone what the surface does not tell.
pub fn icp(
    points: &[Vec3],
    start: Rigid,
    share: f64,
    surface: impl Fn(Vec3) -> (f64, Vec3) + Sync,
) -> (Rigid, f64) {
    let (mut rigid, mut rms) = (start, f64::INFINITY);
    for _ in 0..STEPS {
        let measured = points.par_iter().map(|x| {
            let x = (rigid * nalgebra::Point3::from(*x)).coords;
            let (phi, n) = surface(x);
            (x, phi, n)
        });
        let mut measured: Vec<_> = measured.collect();
        measured.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let count = (share * points.len() as f64).ceil().max(1.0) as usize;
        measured.truncate(count);
        let count = measured.len() as f64;
        rms = (measured.iter().map(|(_, phi, _)| phi * phi).sum::<f64>() / count).sqrt();

        let middle = measured.iter().map(|(x, ..)| x).sum::<Vec3>() / count;
        let squares = measured.iter().map(|(x, ..)| (x - middle).norm_squared());
        // Turns in units of length, so that they compare with shifts.
        let extent = (squares.sum::<f64>() / count).sqrt().max(STILL);
        let (mut normal, mut pull) = (Matrix6::zeros(), Vector6::zeros());
        for (x, phi, n) in &measured {
            let moment = (x - middle).cross(n) / extent;
            let row = Vector6::new(moment.x, moment.y, moment.z, n.x, n.y, n.z);
            normal += row * row.transpose();
            pull -= row * *phi;
        }
        let eigen = normal.symmetric_eigen();
        let least = FREE * eigen.eigenvalues.max();
        let mut step = Vector6::zeros();
        for (k, &value) in eigen.eigenvalues.iter().enumerate() {
            if value > least {
                let along = eigen.eigenvectors.column(k);
                step += along * (along.dot(&pull) / value);
            }
        }
        if !step.iter().all(|x| x.is_finite()) {
            break;
        }
        let turn = UnitQuaternion::from_scaled_axis(Vec3::new(step[0], step[1], step[2]) / extent);
        let shift = Vec3::new(step[3], step[4], step[5]);
        let about = Translation3::from(middle);
        rigid = Translation3::from(shift) * about * turn * about.inverse() * rigid;
        if step.norm() < STILL {
            break;
        }
    }
    (rigid, rms)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> Vec<Vec3> {
        let all = [
            [0.0, 0.0, 0.0],
            [0.3, 0.0, 0.02],
            [0.3, 0.2, -0.01],
            [0.0, 0.2, 0.05],
        ];
        all.map(Vec3::from).to_vec()
    }

    fn motion() -> Rigid {
        Rigid::new(Vec3::new(0.4, -2.0, 0.7), Vec3::new(0.9, -1.4, 0.3))
    }

    #[test]
    fn marks_tell_a_motion_exactly_and_its_residual() {
        let (from, motion) = (corners(), motion());
        let to: Vec<Vec3> = from
            .iter()
            .map(|&x| (motion * nalgebra::Point3::from(x)).coords)
            .collect();
        let (found, rms) = kabsch(&from, &to).unwrap();
        assert!(rms < 1e-8, "{rms}");
        assert!((found.to_matrix() - motion.to_matrix()).amax() < 1e-12);
        // A square whose corners have all gone outwards by 3 mm: no rotation, 3 mm are left.
        let square = [[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]];
        let square = square.map(|[x, y]| Vec3::new(x, y, 0.0));
        let wider = square.map(|x| x + x.normalize() * 3e-3);
        let (found, rms) = kabsch(&square, &wider).unwrap();
        assert!((rms - 3e-3).abs() < 1e-12);
        assert!((found.to_matrix() - nalgebra::Matrix4::identity()).amax() < 1e-12);
    }

    #[test]
    fn marks_that_tell_nothing_are_refused() {
        let from = corners();
        assert_eq!(
            kabsch(&from[..2], &from[..2]),
            Err(AlignError::TooFew { count: 2 })
        );
        let line: Vec<Vec3> = (0..4)
            .map(|k| Vec3::new(0.1, 0.2, 0.3) * f64::from(k))
            .collect();
        assert_eq!(kabsch(&line, &line), Err(AlignError::Line { count: 4 }));
        let same = vec![Vec3::x(); 3];
        assert_eq!(kabsch(&same, &same), Err(AlignError::Line { count: 3 }));
        let deep: Vec<Vec3> = from
            .iter()
            .map(|x| Vec3::new(x.x, x.y, 4.0 * x.z))
            .collect();
        let mirrored: Vec<Vec3> = deep.iter().map(|x| Vec3::new(-x.x, x.y, x.z)).collect();
        let error = kabsch(&mirrored, &deep).unwrap_err();
        assert!(
            matches!(error, AlignError::Mirrored { rms, mirrored_rms } if rms > 0.01 && mirrored_rms < 1e-8)
        );
        assert!(kabsch(&deep, &deep).is_ok());
    }

    /// On three walls of a corner, where all is known, the motion is found though a third of the points do
    /// not lie there; on a plane, what it does not tell is left as it was.
    #[test]
    fn points_find_the_surface_they_lie_on() {
        let wall = |x: Vec3| {
            let k = (0..3)
                .min_by(|&a, &b| x[a].abs().total_cmp(&x[b].abs()))
                .unwrap();
            (x[k], Vec3::ith(k, 1.0))
        };
        let mut points = Vec::new();
        for i in 1..9 {
            for j in 1..9 {
                let (a, b) = (0.02 * f64::from(i), 0.02 * f64::from(j));
                points.extend([[a, b, 0.0], [0.0, a, b], [b, 0.0, a]].map(Vec3::from));
                points.push(Vec3::new(a, b, 0.5 + a));
            }
        }
        let off = Rigid::new(Vec3::new(4e-3, -3e-3, 2e-3), Vec3::new(0.02, -0.01, 0.03));
        let (found, rms) = icp(&points, off, 0.7, wall);
        assert!(rms < 1e-6, "{rms}");
        assert!((found.to_matrix() - nalgebra::Matrix4::identity()).amax() < 1e-5);

        let plane = |x: Vec3| (x.z, Vec3::z());
        let flat: Vec<Vec3> = points.iter().map(|x| Vec3::new(x.x, x.y, 0.0)).collect();
        let (found, rms) = icp(&flat, Rigid::translation(0.1, 0.2, 0.03), 1.0, plane);
        assert!(rms < 1e-9);
        assert!((found.translation.vector - Vec3::new(0.1, 0.2, 0.0)).amax() < 1e-9);
        assert!(found.rotation.angle() < 1e-9);
    }
}
