//! Dihedral bending: the angle between neighbouring triangles.

use super::bend::bending_stiffness;
use super::edges::in_colors;
use super::physics::{Bending, PhysicsConfig};
use super::scales::Scales;
use crate::fabric::{Family, Hinge, Lamina};
use crate::math::{Lanes, Vec3x, polynomial};

/// A hinge between two triangles. C = dihedral angle [rad].
#[derive(Clone, Copy, Debug)]
pub(super) struct BendHinge {
    pub vertices: [u32; 4],
    /// [rad^2/J]
    pub compliance: f64,
}

/// Dihedral bending: everywhere if it is asked for, else along and beside membranes, where
/// there is no yarn to bend.
pub(super) fn hinges(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Vec<BendHinge>> {
    let hinges: Vec<Hinge> = match physics.bending {
        Bending::Off => Vec::new(),
        Bending::Yarns => lamina.membrane_hinges(),
        Bending::Dihedral => lamina.hinges(),
    };
    let of = |family| bending_stiffness(lamina, physics, family);
    let mean = 0.5 * (of(Family::Warp) + of(Family::Weft));
    let with_compliance = hinges.iter().map(|hinge| BendHinge {
        vertices: hinge.vertices,
        compliance: 1.0 / (mean * hinge.weight),
    });
    let stiff = with_compliance.filter(|hinge| hinge.compliance.is_finite());
    in_colors(lamina, &stiff.collect::<Vec<_>>(), |hinge| hinge.vertices)
}

/// Arc tangent of t >= 0 [rad], error below 2e-6 (least-squares polynomial in t^2 over
/// 0..1, reflected beyond).
#[inline(always)]
fn arc_tangent<V: Lanes>(t: V) -> V {
    let one = V::of(1.0);
    let large = one.lt(t);
    let u = V::select(large, one / t.max(V::of(1e-20)), t);
    let factors = [
        0.999_977_26,
        -0.332_623_47,
        0.193_543_46,
        -0.116_432_87,
        0.052_653_32,
        -0.011_721_2,
    ];
    let angle = u * polynomial(&factors, u * u);
    V::select(large, V::of(std::f64::consts::FRAC_PI_2) - angle, angle)
}

/// Projects dihedral bending, one colour.
///
/// C = angle between the normals of the two triangles [rad], 0 at rest (paper, Figure 2b).
/// The angle comes from its half's tangent, which stays exact near the flat state where
/// arccos does not. Gradients as in Bridson et al. 2003 (discrete hinge).
#[inline(always)]
pub(super) fn project_hinges<V: Lanes>(
    hinges: &[BendHinge],
    x: &mut [Vec3x<V>],
    w: &[V],
    scales: Option<&Scales<V>>,
) {
    let tiny = V::of(1e-20);
    for hinge in hinges {
        let i = hinge.vertices.map(|v| v as usize);
        let [p0, p1, p2, p3] = i.map(|i| x[i]);
        let e = p1 - p0;
        // Normals of twice the area: of (p0, p1, p2), and of (p1, p0, p3).
        let n1 = e.cross(p2 - p0);
        let n2 = (p3 - p0).cross(e);
        let s1 = n1.dot(n1).max(tiny);
        let s2 = n2.dot(n2).max(tiny);
        let es = e.dot(e).max(tiny);
        let length = es.sqrt();
        let cosine = n1.dot(n2);
        let sine = n1.cross(n2).dot(e) / length;
        let norm = (s1 * s2).sqrt();
        // tan(angle / 2) = |sine| / (norm + cosine)
        let absolute = sine.max(-sine);
        let half = arc_tangent(absolute / (norm + cosine).max(tiny));
        let angle = V::select(sine.lt(V::zero()), -(half + half), half + half);

        let g2 = n1.scale(-(length / s1));
        let g3 = n2.scale(-(length / s2));
        let t2 = (p2 - p0).dot(e) / es;
        let t3 = (p3 - p0).dot(e) / es;
        let one = V::of(1.0);
        let g0 = g2.scale(t2 - one) + g3.scale(t3 - one);
        let g1 = (g2.scale(t2) + g3.scale(t3)).scale(V::of(-1.0));
        let g = [g0, g1, g2, g3];

        let mut sum = V::of(hinge.compliance);
        if let Some(scales) = scales {
            sum = sum * scales.hinge;
        }
        for k in 0..4 {
            sum = sum + w[i[k]] * g[k].dot(g[k]);
        }
        let lambda = -(angle / sum);
        for k in 0..4 {
            x[i[k]] = x[i[k]] + g[k].scale(lambda * w[i[k]]);
        }
    }
}

#[cfg(test)]
mod tests;
