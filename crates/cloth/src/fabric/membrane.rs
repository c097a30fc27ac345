use crate::math::Vec3;

/// A triangle that is no part of a whole cell.
///
/// The deformation gradient F takes the yarns' directions at rest, warp a and weft b, to
/// F a = sum of x_i `gradient[i][0]` and F b = sum of x_i `gradient[i][1]` over its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Membrane {
    pub vertices: [u32; 3],
    /// Slope of each corner's share, which is 1 there and 0 at the others, along warp and
    /// weft [1/m].
    pub gradient: [[f64; 2]; 3],
    /// Area at rest [m^2].
    pub area: f64,
    /// It is half of a cell: yarns along two of its sides stand for its width as well, and carry
    /// its strain along both families.
    pub has_yarns: bool,
}

impl Membrane {
    /// The triangle with corners `rest` [m], counter-clockwise, and the unit vector `warp`.
    pub(crate) fn new(vertices: [u32; 3], rest: [[f64; 2]; 3], warp: [f64; 2]) -> Self {
        let side = |i: usize, j: usize| [rest[j][0] - rest[i][0], rest[j][1] - rest[i][1]];
        let (u, v) = (side(0, 1), side(0, 2));
        let twice = u[0] * v[1] - u[1] * v[0];
        let gradient = [0, 1, 2].map(|i| {
            // The side opposite, turned to the left and over twice the area.
            let [x, y] = side((i + 1) % 3, (i + 2) % 3);
            let slope = [-y / twice, x / twice];
            [
                slope[0] * warp[0] + slope[1] * warp[1],
                slope[1] * warp[0] - slope[0] * warp[1],
            ]
        });
        Self {
            vertices,
            gradient,
            area: 0.5 * twice,
            has_yarns: false,
        }
    }

    /// A membrane that is half of a cell with yarns along two of its sides.
    pub(crate) fn of_yarns(vertices: [u32; 3], rest: [[f64; 2]; 3], warp: [f64; 2]) -> Self {
        Self {
            has_yarns: true,
            ..Self::new(vertices, rest, warp)
        }
    }

    /// F a and F b at `position` [-]; their lengths are the stretch.
    pub fn columns(&self, position: &[[f64; 3]]) -> [Vec3; 2] {
        [0, 1].map(|family| {
            let corners = self.vertices.iter().zip(&self.gradient);
            corners
                .map(|(&v, slope)| Vec3::from(position[v as usize]) * slope[family])
                .sum()
        })
    }
}
