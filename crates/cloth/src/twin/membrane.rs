//! Triangles of constant strain with the law of a woven fabric.
//!
//! The deformation gradient F takes the yarns' directions at rest to F a and F b. Strains are
//! e1 = |F a| - 1 and e2 = |F b| - 1, shear is the change of the angle between the yarns,
//! gamma = asin(F a . F b / (|F a| |F b|)). The energy per volume at rest is the sum of the
//! integrals of the three curves, as in Abaqus' *FABRIC.

use super::law::Laws;
use super::pack::{Block, Field, Lane, WIDTH, pack};
use crate::fabric::{Lamina, Membrane};
use crate::math::{ASIN_P, ASIN_Q};

/// Below this stretch a yarn has no direction [-].
const MIN_STRETCH: f64 = 1e-6;
/// Below this cosine of the shear angle its slope is cut: the yarns lie on each other.
const MIN_COSINE: f64 = 1e-6;

/// A block of triangles.
struct Triangles {
    block: Block,
    /// Slopes along warp and weft of the shares of the second and the third corner [1/m];
    /// that of the first is minus their sum.
    gradient: [[Lane; 2]; 2],
    /// Volume at rest [m^3]; 0 in unused lanes.
    volume: Lane,
    memory: [Memory; 2],
}

/// What damping remembers of a family of yarns: strain and stress of the last step [-, Pa],
/// and the viscous stress then [Pa].
#[derive(Default)]
struct Memory {
    strain: Lane,
    stress: Lane,
    viscous: Lane,
}

/// All triangles of a sheet.
pub(super) struct Membranes {
    triangles: Vec<Triangles>,
    pub laws: Laws,
    /// The memory is that of the last step.
    remembers: bool,
}

/// What a pass over all triangles finds.
pub(super) struct Pass {
    /// Largest strain of the warp and of the weft [-].
    pub peak: [f64; 2],
    /// Work done against viscous stress since the last pass [J].
    pub dissipated: f64,
}

impl Membranes {
    pub fn new(lamina: &Lamina, laws: Laws) -> Self {
        let thickness = lamina.material.thickness();
        let triangles = pack(&lamina.triangles).into_iter().map(|block| {
            let mut gradient = [[[0.0; WIDTH]; 2]; 2];
            let mut volume = [0.0; WIDTH];
            for (l, &element) in block.elements.iter().enumerate() {
                let corners = lamina.triangles[element];
                let rest = corners.map(|v| lamina.rest[v as usize]);
                let flat = Membrane::new(corners, rest, lamina.warp);
                volume[l] = flat.area * thickness;
                for (to, slope) in gradient.iter_mut().zip(&flat.gradient[1..]) {
                    [to[0][l], to[1][l]] = *slope;
                }
            }
            Triangles {
                block,
                gradient,
                volume,
                memory: Default::default(),
            }
        });
        Self {
            triangles: triangles.collect(),
            laws,
            remembers: false,
        }
    }

    /// Lets damping begin anew: what was before is no motion.
    pub fn forget(&mut self) {
        self.remembers = false;
    }

    /// Adds the elastic forces at `x` [m] to `f` [N].
    pub fn add_elastic_forces(&self, x: &Field, f: &mut Field) {
        for some in &self.triangles {
            let columns = some.columns(x);
            let stress = self.laws.along_yarns(&columns.strain);
            some.add(&columns, &stress, &self.laws, f);
        }
    }

    /// Adds the forces at `x` [m] to `f` [N]. With `viscosity` [-] the stress of yarns is
    /// greater by that times its change since the last pass.
    #[inline(always)]
    pub fn add_forces(&mut self, x: &Field, f: &mut Field, viscosity: Option<f64>) -> Pass {
        let mut peak = [[0.0; WIDTH]; 2];
        let mut dissipated = [0.0; WIDTH];
        for some in &mut self.triangles {
            let columns = some.columns(x);
            let mut stress = self.laws.along_yarns(&columns.strain);
            for family in 0..2 {
                for l in 0..WIDTH {
                    let (strain, peak) = (columns.strain[family][l], &mut peak[family][l]);
                    *peak = if strain > *peak { strain } else { *peak };
                }
            }
            if let Some(viscosity) = viscosity {
                let rate = if self.remembers { viscosity } else { 0.0 };
                let of_family = some.memory.iter_mut().zip(&columns.strain);
                for ((memory, strain), stress) in of_family.zip(&mut stress) {
                    for l in 0..WIDTH {
                        let viscous = rate * (stress[l] - memory.stress[l]);
                        let growth = strain[l] - memory.strain[l];
                        let mean = 0.5 * (viscous + memory.viscous[l]);
                        // The first pass has nothing behind it.
                        let work = some.volume[l] * mean * growth;
                        dissipated[l] += if self.remembers { work } else { 0.0 };
                        memory.stress[l] = stress[l];
                        memory.strain[l] = strain[l];
                        memory.viscous[l] = viscous;
                        stress[l] += viscous;
                    }
                }
            }
            some.add(&columns, &stress, &self.laws, f);
        }
        self.remembers = true;
        Pass {
            peak: peak.map(|lanes| lanes.into_iter().fold(0.0, f64::max)),
            dissipated: dissipated.into_iter().sum(),
        }
    }

    /// Energy of the yarns' stretch and of shear at `x` [J].
    pub fn energy(&self, x: &Field) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for some in &self.triangles {
            let columns = some.columns(x);
            let shear = asin(&columns.sine);
            for l in 0..some.block.elements.len() {
                for (law, strain) in self.laws.yarns.iter().zip(&columns.strain) {
                    sum[0] += some.volume[l] * law.energy(strain[l]);
                }
                sum[1] += some.volume[l] * self.laws.shear.energy(shear[l]);
            }
        }
        sum
    }

    /// Tells, element by element and for each mode of its deformation, the corners, how far the strain
    /// changes with each of them [1/m], the unit direction in which it does if there is one,
    /// and the volume [m^3]. For the bound on frequencies.
    pub fn modes(&self, x: &Field, mut tell: impl FnMut(Mode, [u32; 3], [f64; 3], f64)) {
        for some in &self.triangles {
            let columns = some.columns(x);
            for l in 0..some.block.elements.len() {
                let vertices = some.block.vertices.map(|corner| corner[l]);
                let [g1, g2] = [0, 1].map(|k| [0, 1].map(|family| some.gradient[k][family][l]));
                let corners = [[-g1[0] - g2[0], -g1[1] - g2[1]], g1, g2];
                for family in 0..2 {
                    let direction = [0, 1, 2].map(|axis| columns.direction[family][axis][l]);
                    let mode = Mode::Yarn { family, direction };
                    let slopes = corners.map(|g| g[family].abs());
                    tell(mode, vertices, slopes, some.volume[l]);
                }
                let inverse = [0, 1].map(|family| columns.inverse[family][l]);
                let slopes = corners.map(|g| g[0].abs() * inverse[0] + g[1].abs() * inverse[1]);
                tell(Mode::Shear, vertices, slopes, some.volume[l]);
            }
        }
    }
}

/// How a triangle deforms.
pub(super) enum Mode {
    Yarn { family: usize, direction: [f64; 3] },
    Shear,
}

/// Both columns of F in every lane.
struct Columns {
    /// Unit vectors along warp and weft.
    direction: [[Lane; 3]; 2],
    /// One over the stretch [-].
    inverse: [Lane; 2],
    /// Stretch minus one [-].
    strain: [Lane; 2],
    /// Sine of the shear angle [-].
    sine: Lane,
}

impl Triangles {
    #[inline(always)]
    fn columns(&self, x: &Field) -> Columns {
        let mut sides = [[[0.0; WIDTH]; 3]; 2];
        for axis in 0..3 {
            let first = self.block.load(&x[axis], 0);
            for (corner, side) in sides.iter_mut().enumerate() {
                let other = self.block.load(&x[axis], corner + 1);
                for l in 0..WIDTH {
                    side[axis][l] = other[l] - first[l];
                }
            }
        }
        let mut columns = Columns {
            direction: [[[0.0; WIDTH]; 3]; 2],
            inverse: [[0.0; WIDTH]; 2],
            strain: [[0.0; WIDTH]; 2],
            sine: [0.0; WIDTH],
        };
        let [u, v] = &sides;
        for family in 0..2 {
            let (g1, g2) = (&self.gradient[0][family], &self.gradient[1][family]);
            let [dx, dy, dz] = &mut columns.direction[family];
            for l in 0..WIDTH {
                let x = u[0][l] * g1[l] + v[0][l] * g2[l];
                let y = u[1][l] * g1[l] + v[1][l] * g2[l];
                let z = u[2][l] * g1[l] + v[2][l] * g2[l];
                let stretch = (x * x + y * y + z * z).sqrt();
                // A choice of this form is a vector instruction; `max` with its NaNs is none.
                let above = stretch > MIN_STRETCH;
                let inverse = 1.0 / if above { stretch } else { MIN_STRETCH };
                dx[l] = x * inverse;
                dy[l] = y * inverse;
                dz[l] = z * inverse;
                columns.inverse[family][l] = inverse;
                columns.strain[family][l] = stretch - 1.0;
            }
        }
        let [a, b] = &columns.direction;
        for l in 0..WIDTH {
            let sine = a[0][l] * b[0][l] + a[1][l] * b[1][l] + a[2][l] * b[2][l];
            let low = if sine > -1.0 { sine } else { -1.0 };
            columns.sine[l] = if low < 1.0 { low } else { 1.0 };
        }
        columns
    }

    /// Adds the forces of the `stress` along the yarns [Pa] and of shear.
    #[inline(always)]
    fn add(&self, columns: &Columns, stress: &[Lane; 2], laws: &Laws, f: &mut Field) {
        let tau = laws.shear.stress(&asin(&columns.sine));
        // Nominal stress along a direction, and along the other that shear brings in.
        let mut own = [[0.0; WIDTH]; 2];
        let mut other = [[0.0; WIDTH]; 2];
        for l in 0..WIDTH {
            let sine = columns.sine[l];
            let cosine = (1.0 - sine * sine).sqrt();
            let above = cosine > MIN_COSINE;
            let turn = tau[l] / if above { cosine } else { MIN_COSINE } * self.volume[l];
            for family in 0..2 {
                let across = turn * columns.inverse[family][l];
                own[family][l] = stress[family][l] * self.volume[l] - sine * across;
                other[family][l] = across;
            }
        }
        for (axis, f) in f.iter_mut().enumerate() {
            let (a, b) = (&columns.direction[0][axis], &columns.direction[1][axis]);
            let mut first = [0.0; WIDTH];
            let mut rest = [[0.0; WIDTH]; 2];
            for l in 0..WIDTH {
                let along = own[0][l] * a[l] + other[0][l] * b[l];
                let across = own[1][l] * b[l] + other[1][l] * a[l];
                let p = along * self.gradient[0][0][l] + across * self.gradient[0][1][l];
                let q = along * self.gradient[1][0][l] + across * self.gradient[1][1][l];
                first[l] = p + q;
                rest[0][l] = -p;
                rest[1][l] = -q;
            }
            self.block.add(f, 0, &first);
            self.block.add(f, 1, &rest[0]);
            self.block.add(f, 2, &rest[1]);
        }
    }
}

/// Arc sine as the lanes of the fast solver have it.
#[inline(always)]
fn asin(x: &Lane) -> Lane {
    const P: [f64; 6] = ASIN_P;
    const Q: [f64; 4] = ASIN_Q;
    let mut angle = [0.0; WIDTH];
    for l in 0..WIDTH {
        let size = x[l].abs();
        let is_small = size < 0.5;
        let (square, rest) = (size * size, 0.5 * (1.0 - size));
        let t = if is_small { square } else { rest };
        let root = t.sqrt();
        let p = t * (P[0] + t * (P[1] + t * (P[2] + t * (P[3] + t * (P[4] + t * P[5])))));
        let q = 1.0 + t * (Q[0] + t * (Q[1] + t * (Q[2] + t * Q[3])));
        let base = if is_small { size } else { root };
        let arc = base + base * (p / q);
        let large = std::f64::consts::FRAC_PI_2 - 2.0 * arc;
        angle[l] = if is_small { arc } else { large }.copysign(x[l]);
    }
    angle
}

#[cfg(test)]
mod tests;
