//! Bending: along yarns by second differences, beside membranes by the angle of hinges.

use super::pack::{Block, Field, Lane, WIDTH, at, pack};
use crate::fabric::{Family, Lamina};
use crate::math::Vec3;

/// Below this squared height over squared edge a triangle has no normal [-].
const FLAT: f64 = 1e-12;

/// Three neighbours on a yarn: energy D b |x0 - 2 x1 + x2|^2 / (2 l^3).
struct Triples {
    block: Block,
    /// D b / l^3 [N/m]; 0 in unused lanes.
    stiffness: Lane,
}

/// Two triangles over an edge: energy stiffness angle^2 / 2.
struct Hinge {
    vertices: [u32; 4],
    /// [J]
    stiffness: f64,
    /// Slopes of the angle with each vertex on the flat blank [1/m].
    slopes: [f64; 4],
}

/// All that resists bending.
pub(super) struct Bending {
    triples: Vec<Triples>,
    hinges: Vec<Hinge>,
}

impl Bending {
    /// Of a sheet with the bending stiffness per width of warp and weft, `stiffness` [N m], or that
    /// of its material if none, times `factors`.
    pub fn new(lamina: &Lamina, stiffness: Option<[f64; 2]>, factors: [f64; 2]) -> Self {
        let of_material = |family| lamina.material.bending_stiffness(family);
        let families = [Family::Warp, Family::Weft];
        let stiffness = stiffness.unwrap_or_else(|| families.map(of_material));
        let [warp, weft] = [0, 1].map(|k| stiffness[k] * factors[k]);
        let mut vertices = Vec::new();
        let mut of_triple = Vec::new();
        for yarn in &lamina.yarns {
            let d = [warp, weft][yarn.family as usize];
            for v in yarn.vertices.windows(3) {
                vertices.push([v[0], v[1], v[2]]);
                of_triple.push(d * yarn.width / yarn.rest_length.powi(3));
            }
        }
        let triples = pack(&vertices).into_iter().map(|block| {
            let mut stiffness = [0.0; WIDTH];
            for (to, &element) in stiffness.iter_mut().zip(&block.elements) {
                *to = of_triple[element];
            }
            Triples { block, stiffness }
        });
        // A hinge bends across its edge, under whatever angle to the yarns: their mean.
        let hinges = lamina.membrane_hinges().into_iter().map(|hinge| {
            let flat = hinge.vertices.map(|v| {
                let [x, y] = lamina.rest[v as usize];
                Vec3::new(x, y, 0.0)
            });
            let slopes = angle(&flat).map_or([0.0; 4], |(_, slopes)| slopes.map(|s| s.norm()));
            Hinge {
                vertices: hinge.vertices,
                stiffness: 0.5 * (warp + weft) * hinge.weight,
                slopes,
            }
        });
        Self {
            triples: triples.collect(),
            hinges: hinges.collect(),
        }
    }

    /// Adds the forces at `x` [m] to `f` [N].
    #[inline(always)]
    pub fn add_forces(&self, x: &Field, f: &mut Field) {
        for triples in &self.triples {
            for axis in 0..3 {
                // One by one: in a closure they would not be compiled for the vectors of this machine.
                let a = triples.block.load(&x[axis], 0);
                let b = triples.block.load(&x[axis], 1);
                let c = triples.block.load(&x[axis], 2);
                let mut pull = [0.0; WIDTH];
                let mut back = [0.0; WIDTH];
                for l in 0..WIDTH {
                    let second = a[l] - 2.0 * b[l] + c[l];
                    pull[l] = -triples.stiffness[l] * second;
                    back[l] = -2.0 * pull[l];
                }
                triples.block.add(&mut f[axis], 0, &pull);
                triples.block.add(&mut f[axis], 1, &back);
                triples.block.add(&mut f[axis], 2, &pull);
            }
        }
        if !self.hinges.is_empty() {
            self.add_hinges(x, f);
        }
    }

    /// Kept out of the vectorised code: there are few.
    #[inline(never)]
    fn add_hinges(&self, x: &Field, f: &mut Field) {
        for hinge in &self.hinges {
            if let Some((angle, slopes)) = angle(&hinge.corners(x)) {
                for (v, slope) in hinge.vertices.iter().zip(slopes) {
                    for (f, slope) in f.iter_mut().zip(slope.iter()) {
                        f[*v as usize] -= hinge.stiffness * angle * slope;
                    }
                }
            }
        }
    }

    /// Energy at `x` [J].
    pub fn energy(&self, x: &Field) -> f64 {
        let mut sum = 0.0;
        for triples in &self.triples {
            for x in x {
                let [a, b, c] = [0, 1, 2].map(|corner| triples.block.load(x, corner));
                for l in 0..WIDTH {
                    sum += 0.5 * triples.stiffness[l] * (a[l] - 2.0 * b[l] + c[l]).powi(2);
                }
            }
        }
        for hinge in &self.hinges {
            if let Some((angle, _)) = angle(&hinge.corners(x)) {
                sum += 0.5 * hinge.stiffness * angle * angle;
            }
        }
        sum
    }

    /// Tells the vertices of every element, how its strain changes with each of them, and its
    /// stiffness. For the bound on frequencies.
    pub fn modes(&self, mut tell: impl FnMut(&[u32], &[f64], f64)) {
        for triples in &self.triples {
            for l in 0..triples.block.elements.len() {
                let vertices = triples.block.vertices.map(|corner| corner[l]);
                tell(&vertices, &[1.0, 2.0, 1.0], triples.stiffness[l]);
            }
        }
        for hinge in &self.hinges {
            tell(&hinge.vertices, &hinge.slopes, hinge.stiffness);
        }
    }
}

impl Hinge {
    fn corners(&self, x: &Field) -> [Vec3; 4] {
        self.vertices.map(|v| at(x, v as usize))
    }
}

/// Angle between the triangles (a, b, c) and (b, a, d) [rad], 0 when flat, and its slope with
/// each corner [1/m]; none where one of them is degenerate. Bridson et al. 2003.
fn angle([a, b, c, d]: &[Vec3; 4]) -> Option<(f64, [Vec3; 4])> {
    let edge = b - a;
    let n1 = edge.cross(&(c - a));
    let n2 = (d - a).cross(&edge);
    let (length, square1, square2) = (edge.norm(), n1.norm_squared(), n2.norm_squared());
    let min = FLAT * length.powi(4);
    if !(square1 > min && square2 > min) {
        return None;
    }
    let angle = (n1.cross(&n2).dot(&edge) / length).atan2(n1.dot(&n2));
    // The opposite corners move along their normals, over their heights.
    let of_c = n1 * (-length / square1);
    let of_d = n2 * (-length / square2);
    let at = |p: &Vec3| (p - a).dot(&edge) / (length * length);
    let (s, t) = (at(c), at(d));
    let of_a = -(of_c * (1.0 - s) + of_d * (1.0 - t));
    let of_b = -(of_c * s + of_d * t);
    Some((angle, [of_a, of_b, of_c, of_d]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};
    use crate::math::{Purpose, Stream};
    use crate::twin::pack::zeros;

    fn crumpled(lamina: &Lamina, size: f64) -> Field {
        let mut stream = Stream::new(9, Purpose::Evaluation, 0);
        let mut x = zeros(lamina.vertex_count());
        for (v, rest) in lamina.rest.iter().enumerate() {
            for (axis, x) in x.iter_mut().enumerate() {
                x[v] = rest.get(axis).unwrap_or(&0.0) + size * (stream.uniform() - 0.5);
            }
        }
        x
    }

    #[test]
    fn forces_are_the_slope_of_the_energy() {
        for angle in [0.0, 30.0] {
            let blank = BlankConfig {
                size_mm: [40.0, 30.0],
                vertices: [9, 7],
                yarn_angle_deg: angle,
                ..BlankConfig::default()
            };
            let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
            let bending = Bending::new(&lamina, None, [1.0; 2]);
            assert_eq!(bending.hinges.is_empty(), angle == 0.0);
            let x = crumpled(&lamina, 4e-3);
            let mut f = zeros(lamina.vertex_count());
            bending.add_forces(&x, &mut f);
            let size = f.iter().flatten().fold(0.0f64, |most, f| most.max(f.abs()));
            for v in 0..lamina.vertex_count() {
                for axis in 0..3 {
                    let h = 1e-8;
                    let at = |step: f64| {
                        let mut x = x.clone();
                        x[axis][v] += step;
                        bending.energy(&x)
                    };
                    let slope = (at(h) - at(-h)) / (2.0 * h);
                    let off = (slope + f[axis][v]).abs();
                    assert!(off < 1e-5 * size, "{} is not {slope}", -f[axis][v]);
                }
            }
        }
    }

    /// A sheet bent to a cylinder has the plate's energy D kappa^2 A / 2 along either family.
    #[test]
    fn cylinder_has_the_energy_of_the_plate() {
        let blank = BlankConfig {
            size_mm: [100.0, 100.0],
            vertices: [49, 49],
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
        let bending = Bending::new(&lamina, None, [1.0; 2]);
        for (axis, family) in [(0, Family::Warp), (1, Family::Weft)] {
            let radius: f64 = 0.1;
            let mut x = zeros(lamina.vertex_count());
            for (v, rest) in lamina.rest.iter().enumerate() {
                let angle = rest[axis] / radius;
                x[axis][v] = radius * angle.sin();
                x[1 - axis][v] = rest[1 - axis];
                x[2][v] = radius * angle.cos();
            }
            let d = lamina.material.bending_stiffness(family);
            // Vertices on the border carry no curvature.
            let plate = 0.5 * d / radius.powi(2) * lamina.area() * 47.0 / 48.0;
            let found = bending.energy(&x);
            assert!((found / plate - 1.0).abs() < 1e-3, "{found} is not {plate}");
        }
    }
}
