//! An upper bound of the highest frequency, which bounds the time step.
//!
//! An element of stiffness k whose strain changes by g_i . u_i with its corners' motion u_i
//! stores k (sum of g_i . u_i)^2 / 2. By Cauchy's inequality, for any weights w > 0,
//!
//! (sum_i |g_i| y_i)^2 <= (sum_j |g_j| w_j) (sum_i |g_i| y_i^2 / w_i),  y_i = n . u_i,
//!
//! so that the sheet's stiffness is less than a block-diagonal matrix with the 3 x 3 blocks
//! H_i = sum over elements of k |g_i| / w_i (sum_j |g_j| w_j) n n^T, and the squared frequency
//! less than the greatest eigenvalue of H_i / m_i of all vertices. With w = 1/sqrt(m) this is
//! exact inside an even sheet of orthogonal yarns, where a bound by rows (Gershgorin) would
//! add up warp and weft, which pull at right angles.

use super::bending::Bending;
use super::membrane::{Membranes, Mode};
use super::pack::Field;

/// Margin of the softer modes for what their linear stiffness leaves out: shear and hinges
/// change direction with the cloth [-].
const TURNING: f64 = 2.0;

/// What the bound holds for.
pub(super) struct Bound {
    /// Highest angular frequency [rad/s].
    pub frequency: f64,
    /// Strain of warp and weft up to which it holds [-].
    pub limit: [f64; 2],
}

/// Bounds the frequencies at `x` [m] while yarns are strained by less than the limits that
/// contain `peak`. `mass` is inertia [kg].
pub(super) fn bound(
    membranes: &Membranes,
    bending: &Bending,
    x: &Field,
    mass: &[f64],
    peak: [f64; 2],
) -> Bound {
    let laws = &membranes.laws;
    let (mut slope, mut limit) = ([0.0; 2], [0.0; 2]);
    for family in 0..2 {
        let law = &laws.yarns[family];
        let (tension, end) = law.positive.stiffest(peak[family]);
        let (compression, _) = law.negative.stiffest(f64::INFINITY);
        slope[family] = tension.max(compression);
        limit[family] = end;
    }
    let [positive, negative] = [&laws.shear.positive, &laws.shear.negative];
    let [shear, other] = [positive, negative].map(|ramps| ramps.stiffest(f64::INFINITY).0);
    let shear = shear.max(other);
    let root: Vec<f64> = mass.iter().map(|m| m.sqrt()).collect();
    // xx, yy, zz, xy, xz, yz.
    let mut along = vec![[0.0; 6]; mass.len()];
    let mut any = vec![0.0; mass.len()];
    membranes.modes(x, |mode, vertices, slopes, volume| {
        for (v, share) in shares(&root, &vertices, &slopes, volume) {
            match mode {
                Mode::Yarn { family, direction } => {
                    let [nx, ny, nz] = direction;
                    let k = share * slope[family];
                    let products = [nx * nx, ny * ny, nz * nz, nx * ny, nx * nz, ny * nz];
                    for (sum, product) in along[v].iter_mut().zip(products) {
                        *sum += k * product;
                    }
                }
                Mode::Shear => any[v] += TURNING * shear * share,
            }
        }
    });
    bending.modes(|vertices, slopes, stiffness| {
        for (v, share) in shares(&root, vertices, slopes, TURNING * stiffness) {
            any[v] += share;
        }
    });
    let mut square = 0.0f64;
    for v in 0..mass.len() {
        // The trace first: it is more, and cheap.
        let trace = along[v][0] + along[v][1] + along[v][2];
        if (trace + any[v]) / mass[v] > square {
            square = square.max((greatest(&along[v]) + any[v]) / mass[v]);
        }
    }
    Bound {
        frequency: square.sqrt(),
        limit,
    }
}

/// What an element of stiffness `k` adds to each of its vertices, |g_i| / w_i (sum_j |g_j| w_j) k.
fn shares<'a>(
    root: &'a [f64],
    vertices: &'a [u32],
    slopes: &'a [f64],
    k: f64,
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let each = move || vertices.iter().map(|&v| v as usize).zip(slopes);
    let reach: f64 = each().map(|(v, g)| g / root[v]).sum();
    each().map(move |(v, g)| (v, k * g * reach * root[v]))
}

/// Greatest eigenvalue of a symmetric 3 x 3 matrix (Smith 1961).
fn greatest([xx, yy, zz, xy, xz, yz]: &[f64; 6]) -> f64 {
    let mean = (xx + yy + zz) / 3.0;
    let [a, b, c] = [xx - mean, yy - mean, zz - mean];
    let off = xy * xy + xz * xz + yz * yz;
    let p = ((a * a + b * b + c * c + 2.0 * off) / 6.0).sqrt();
    if p <= 0.0 {
        return mean;
    }
    let det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let r = (0.5 * det / p.powi(3)).clamp(-1.0, 1.0);
    mean + 2.0 * p * (r.acos() / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greatest_eigenvalue_of_known_matrices() {
        for (matrix, expected) in [
            ([3.0, 1.0, 2.0, 0.0, 0.0, 0.0], 3.0),
            ([5.0, 5.0, 5.0, 0.0, 0.0, 0.0], 5.0),
            ([2.0, 2.0, 0.0, 1.0, 0.0, 0.0], 3.0),
            ([1.0, 4.0, 9.0, 2.0, 3.0, 6.0], 14.0),
        ] {
            let found = greatest(&matrix);
            assert!(
                (found - expected).abs() < 1e-12,
                "{found} is not {expected}"
            );
        }
    }
}
