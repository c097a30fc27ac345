//! Vectors in space, as kernels have them: [component][vertex] of each environment.

use cubecl::prelude::*;

/// A point or direction in space.
#[derive(CubeType, CubeTypeMut, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Vec3g {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

#[cube]
impl Vec3g {
    pub fn new(x: f32, y: f32, z: f32) -> Vec3g {
        Vec3g { x, y, z }
    }

    pub fn zero() -> Vec3g {
        Vec3g::new(0.0f32, 0.0f32, 0.0f32)
    }

    /// Vector `at` among `count` of each component.
    pub fn load(array: &[f32], first: usize, count: usize, at: usize) -> Vec3g {
        Vec3g::new(
            array[first + at],
            array[first + count + at],
            array[first + 2 * count + at],
        )
    }

    pub fn store(self, array: &mut [f32], first: usize, count: usize, at: usize) {
        array[first + at] = self.x;
        array[first + count + at] = self.y;
        array[first + 2 * count + at] = self.z;
    }

    pub fn dot(self, other: Vec3g) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    pub fn scale(self, by: f32) -> Vec3g {
        Vec3g::new(self.x * by, self.y * by, self.z * by)
    }

    pub fn plus(self, other: Vec3g) -> Vec3g {
        Vec3g::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }

    pub fn minus(self, other: Vec3g) -> Vec3g {
        Vec3g::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }

    pub fn cross(self, other: Vec3g) -> Vec3g {
        Vec3g::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }
}
