use drape_cloth::math::Vec3;

/// Part of the picture, on each side, that stays free around the bounds.
const MARGIN: f64 = 0.04;

/// An orthographic camera which shows all of a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Unit vectors in the world: to the right of the picture, up in it, and from the scene
    /// towards the eye.
    axes: [Vec3; 3],
    /// Middle of what is shown, in the world [m].
    center: Vec3,
    /// Width and height of what is shown [m].
    extent: [f64; 2],
}

impl Camera {
    /// Looks along `direction` at the box from `low` to `high` [m]; `up`, in another
    /// direction, is upright in the picture. Directions need no unit length.
    pub fn new(direction: Vec3, up: Vec3, low: Vec3, high: Vec3) -> Self {
        let back = -direction.normalize();
        let right = up.cross(&back).normalize();
        let axes = [right, back.cross(&right), back];
        let size = high - low;
        let extent = |axis: Vec3| axis.abs().dot(&size.abs());
        Self {
            axes,
            center: (low + high) / 2.0,
            extent: [extent(axes[0]), extent(axes[1])],
        }
    }

    /// From above: x to the right, y up in the picture.
    pub fn top(bounds: (Vec3, Vec3)) -> Self {
        Self::new(-Vec3::z(), Vec3::y(), bounds.0, bounds.1)
    }

    /// From the front, left and above, by 35 degrees each way: y leads away from the eye.
    pub fn isometric(bounds: (Vec3, Vec3)) -> Self {
        Self::new(Vec3::new(0.574, 0.819, -0.7), Vec3::z(), bounds.0, bounds.1)
    }

    /// The map into a picture of `width` by `height` samples.
    pub(super) fn view(&self, width: usize, height: usize) -> Projection {
        let size = [width as f64, height as f64];
        let fit = |i: usize| size[i] / self.extent[i];
        let scale = (1.0 - 2.0 * MARGIN) * fit(0).min(fit(1));
        // A box without extent is shown at any scale.
        let scale = if scale.is_finite() { scale } else { 1.0 };
        Projection {
            camera: self.clone(),
            scale,
            middle: [size[0] / 2.0, size[1] / 2.0],
        }
    }
}

/// A camera in front of a grid of samples.
#[derive(Clone)]
pub(super) struct Projection {
    camera: Camera,
    /// Samples per metre.
    scale: f64,
    /// Middle of the grid [samples].
    middle: [f64; 2],
}

impl Projection {
    /// Samples from the left, samples from the top, and depth away from the eye [m].
    pub(super) fn project(&self, point: &Vec3) -> [f32; 3] {
        let [right, up, back] = self.rotate(&(point - self.camera.center));
        [
            (self.middle[0] + self.scale * right) as f32,
            (self.middle[1] - self.scale * up) as f32,
            -back as f32,
        ]
    }

    /// Components of `v` to the right, up and towards the eye.
    pub(super) fn rotate(&self, v: &Vec3) -> [f64; 3] {
        self.camera.axes.map(|axis| axis.dot(v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOW: Vec3 = Vec3::new(-0.2, 0.1, 0.0);
    const HIGH: Vec3 = Vec3::new(0.2, 0.3, 0.1);

    #[test]
    fn box_fills_the_picture_up_to_the_margin_and_stays_in_the_middle() {
        let corners = (0..8).map(|i| {
            let pick = |axis: usize| [LOW, HIGH][i >> axis & 1][axis];
            Vec3::new(pick(0), pick(1), pick(2))
        });
        let corners: Vec<Vec3> = corners.collect();
        for camera in [Camera::top((LOW, HIGH)), Camera::isometric((LOW, HIGH))] {
            let view = camera.view(640, 480);
            let seen: Vec<_> = corners.iter().map(|c| view.project(c)).collect();
            let range = |i: usize| {
                let values = seen.iter().map(|p| p[i]);
                let ends = values.fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(v), h.max(v)));
                (ends.0 + ends.1, ends.1 - ends.0)
            };
            let ((x_sum, width), (y_sum, height)) = (range(0), range(1));
            assert!((x_sum - 640.0).abs() < 1e-2 && (y_sum - 480.0).abs() < 1e-2);
            let filled = (width / 640.0).max(height / 480.0);
            assert!((filled - 0.92).abs() < 1e-4, "fills {filled}");
        }
    }

    #[test]
    fn top_view_has_x_to_the_right_y_up_and_z_nearer() {
        let view = Camera::top((LOW, HIGH)).view(100, 100);
        let origin = view.project(&Vec3::zeros());
        let [x, y, z] = [Vec3::x(), Vec3::y(), Vec3::z()].map(|v| view.project(&v));
        assert!(x[0] > origin[0] && (x[1] - origin[1]).abs() < 1e-3);
        assert!(y[1] < origin[1] && (y[0] - origin[0]).abs() < 1e-3);
        assert!(z[2] < origin[2]);
    }
}
