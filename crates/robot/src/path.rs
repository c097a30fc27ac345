use nalgebra::{Matrix3, Rotation3, Vector3};

use super::place::Pose;

/// A point that the roller presses, in the tool's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// [m]
    pub position: Vector3<f64>,
    /// Out of the tool, of unit length.
    pub normal: Vector3<f64>,
    /// Unit tangent along the stroke; none for a press without travel.
    pub travel: Option<Vector3<f64>>,
    /// Points of the same number, one behind the other, are rolled over without lifting.
    pub stroke: usize,
}

/// Contact frames of the points of one stroke: z into the surface, x along the travel, forwards or backwards so that the
/// roller turns on the spot by no more than a right angle. Where no point travels x is any tangent.
pub(crate) fn contacts(points: &[PathPoint]) -> Vec<Pose> {
    let mut last: Option<Vector3<f64>> = None;
    let mut frames = Vec::with_capacity(points.len());
    for point in points {
        let z = -point.normal;
        let x = match (point.travel.or(last), last) {
            (Some(travel), Some(last)) if travel.dot(&last) < 0.0 => -travel,
            (Some(travel), _) => travel,
            (None, _) => Vector3::x(),
        };
        last = Some(tangent(&x, &z));
        frames.push(contact(&point.position, &point.normal, &x));
    }
    frames
}

/// The frame of a contact whose roller travels along `x`, or as nearly as the surface lets it.
pub fn contact(position: &Vector3<f64>, normal: &Vector3<f64>, x: &Vector3<f64>) -> Pose {
    let z = -normal;
    let x = tangent(x, &z);
    let turned = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Pose::from_parts((*position).into(), turned)
}

/// The unit vector across `z` that is nearest to `x`.
fn tangent(x: &Vector3<f64>, z: &Vector3<f64>) -> Vector3<f64> {
    let across = |x: &Vector3<f64>| (x - z * x.dot(z)).try_normalize(1e-6);
    let instead = Vector3::ith(z.iamin(), 1.0);
    across(x)
        .or_else(|| across(&instead))
        .expect("an axis lies across")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(position: [f64; 3], travel: Option<[f64; 3]>) -> PathPoint {
        PathPoint {
            position: position.into(),
            normal: Vector3::z(),
            travel: travel.map(Into::into),
            stroke: 0,
        }
    }

    /// There and back again: the roller rolls backwards instead of turning.
    #[test]
    fn a_stroke_that_returns_turns_nothing() {
        let points = [
            point([0.0; 3], Some([1.0, 0.0, 0.0])),
            point([0.1, 0.0, 0.0], Some([-1.0, 0.0, 0.0])),
            point([0.0; 3], Some([0.0, 1.0, 0.0])),
        ];
        let frames = contacts(&points);
        let x = |k: usize| frames[k].rotation * Vector3::x();
        assert!((x(0) - Vector3::x()).norm() < 1e-15);
        assert!((x(1) - Vector3::x()).norm() < 1e-15);
        assert!((x(2) - Vector3::y()).norm() < 1e-15);
        for frame in frames {
            assert!((frame.rotation * Vector3::z() + Vector3::z()).norm() < 1e-15);
            assert!((frame.rotation.matrix().determinant() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_press_has_a_frame_whatever_its_normal() {
        for normal in [Vector3::x(), -Vector3::x(), Vector3::new(0.6, 0.0, 0.8)] {
            let press = PathPoint {
                normal,
                ..point([0.0; 3], None)
            };
            let turned = contacts(&[press])[0].rotation;
            assert!((turned * Vector3::z() + normal).norm() < 1e-12);
            let unit = turned.matrix().transpose() * turned.matrix();
            assert!((unit - Matrix3::identity()).norm() < 1e-12);
        }
    }
}
