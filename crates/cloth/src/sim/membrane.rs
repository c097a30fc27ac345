//! Membrane triangles: the material law where no yarn runs along an edge.
//!
//! The deformation gradient F of a triangle takes the yarns' directions at rest to F a and
//! F b. Three constraints: C1 = |F a| - 1, C2 = |F b| - 1 [-], the strains of warp and weft,
//! and C3 = F a . F b / (|F a| |F b|), the sine of the shear angle gamma. Their energies are
//! E t A C1^2 / 2, E t A C2^2 / 2 and G t A gamma^2 / 2 with the area A and the thickness t, each
//! modulus by the sign of its C: the law of yarns and diagonals, integrated over the triangle.
//!
//! Linear triangles have constant strain. Where yarns run obliquely to the mesh they cannot
//! follow inextensible yarns in bending lines, and lock: a strip is then at least twice as stiff.

use super::bend::along_yarn;
use super::curve::{Lagged, of_sign, within};
use super::edges::in_colors;
use super::law::{EdgeLaw, branch};
use super::line::{Direction, MAX_WARM};
use super::locking::Locking;
use super::physics::PhysicsConfig;
use super::scales::Scales;
use super::shear::share_of_sine;
use crate::fabric::{Family, Lamina};
use crate::math::{Lanes, Vec3x};

/// Below this squared stretch a direction is lost, and nothing acts along it.
const MIN_SQUARE: f64 = 1e-12;

/// Sweeps over the elements a substep.
pub(super) const SWEEPS: usize = 4;

/// Share of what a sweep adds to a force that lasts.
///
/// A mode of which a substep takes away the share k of its strain c, while its force l lasts, follows
/// c'' = l - k (c + c') and l' = -gain k c from substep to substep, which is stable for gain < k
/// (Routh and Hurwitz). Where rows of cut cells lie beside yarns, k is small after one sweep: with a gain of 1
/// 20 of 28 blanks with rectangular holes or inner corners never rested. A smaller gain takes longer to hold what a
/// press pulls, so more sweeps raise k first; presses then strain as much as with one sweep and a gain of 1.
const GAIN: f64 = 0.4;
/// That of a scene without shear, where more of them shake.
const GAIN_WITHOUT_SHEAR: f64 = 0.1;

/// A triangle, with compliances [1/J] of its dimensionless constraints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    pub vertices: [u32; 3],
    /// Slopes along warp and weft of the shares of the second and the third corner [1/m];
    /// that of the first is minus their sum.
    pub gradient: [[f64; 2]; 2],
    /// Of C1 and C2; none where yarns stand for them.
    pub yarns: Option<[EdgeLaw; 2]>,
    /// The forces of C1 and C2 that last, as those of yarns do; none under Gauss-Seidel.
    pub lasting: Option<Lasting>,
    /// Of C3 near rest; none if the scene has no shear.
    pub shear: Option<EdgeLaw>,
}

/// Force densities, force over stretch [J], that last from substep to substep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lasting {
    /// Number of that of the warp; that of the weft follows.
    first: u32,
    /// The greatest compression that lasts, <= 0, by the rule of the yarns beside it.
    min_warm: [f64; 2],
    /// [`GAIN`] or [`GAIN_WITHOUT_SHEAR`].
    gain: f64,
}

impl Lasting {
    /// Place of the force density of a family, and what of it the next substep starts with.
    #[inline(always)]
    fn warm<V: Lanes>(
        &self,
        family: usize,
        density: &[V],
        scales: Option<&Scales<V>>,
    ) -> (usize, V) {
        let place = self.first as usize + family;
        let mut min_warm = V::of(self.min_warm[family]);
        if let Some(scales) = scales {
            min_warm = min_warm * scales.bending[family];
        }
        (place, density[place].max(min_warm))
    }
}

impl Element {
    /// Those of both corners along warp and weft.
    #[inline(always)]
    fn slopes<V: Lanes>(&self) -> [[V; 2]; 2] {
        let [g1, g2] = self.gradient;
        [[g1[0], g2[0]].map(V::of), [g1[1], g2[1]].map(V::of)]
    }
}

/// The elements of a lamina, in colours; force densities that last are counted from `first`.
pub(super) fn elements(
    lamina: &Lamina,
    physics: &PhysicsConfig,
    first: Option<usize>,
) -> Vec<Vec<Element>> {
    let thickness = lamina.material.thickness();
    let mut next = first.map(|first| first as u32);
    let min_warm = |area: f64| {
        [Family::Warp, Family::Weft].map(|family| {
            let length = lamina.cell()[family as usize];
            let bending = along_yarn(lamina, physics, family, [area / length, length]);
            -MAX_WARM * bending * length * length
        })
    };
    let all: Vec<Element> = lamina
        .membranes
        .iter()
        .filter(|membrane| physics.shear || !membrane.has_yarns)
        .map(|membrane| {
            let law = |moduli: [f64; 2]| {
                EdgeLaw::of_stiffness(moduli.map(|modulus| modulus * thickness * membrane.area))
            };
            let yarn = |family| {
                let of = lamina.material.yarn(family);
                law([of.tension.modulus(), of.compression.modulus()])
            };
            let shear = &lamina.material.shear;
            Element {
                vertices: membrane.vertices,
                gradient: [membrane.gradient[1], membrane.gradient[2]],
                yarns: (!membrane.has_yarns).then(|| [Family::Warp, Family::Weft].map(yarn)),
                lasting: next.filter(|_| !membrane.has_yarns).map(|first| {
                    next = Some(first + 2);
                    let min_warm = min_warm(membrane.area);
                    Lasting {
                        first,
                        min_warm,
                        gain: if physics.shear {
                            GAIN
                        } else {
                            GAIN_WITHOUT_SHEAR
                        },
                    }
                }),
                shear: (physics.shear)
                    .then(|| law([shear.positive.modulus(), shear.negative.modulus()])),
            }
        })
        .collect();
    in_colors(lamina, &all, |element| element.vertices)
}

/// The elements without C3, and without C1 and C2, where lines are solved: like the shear of whole cells
/// it comes before the yarns.
pub(super) fn split(classes: &[Vec<Element>]) -> [Vec<Vec<Element>>; 2] {
    let parts = |is_part: fn(&Element) -> bool, cut: fn(&mut Element)| {
        let mut parts = classes.to_vec();
        for class in &mut parts {
            class.retain(is_part);
            class.iter_mut().for_each(cut);
        }
        parts.retain(|class| !class.is_empty());
        parts
    };
    let along = parts(
        |element| element.yarns.is_some(),
        |element| element.shear = None,
    );
    let without_yarns = |element: &mut Element| (element.yarns, element.lasting) = (None, None);
    [
        along,
        parts(|element| element.shear.is_some(), without_yarns),
    ]
}

/// Moves the corners along `gradient` of C (that of the first corner is minus the sum of the
/// others', so that no force is left over) by the XPBD step with lambda = 0 before it.
#[inline(always)]
fn apply<V: Lanes>(
    c: V,
    [g1, g2]: [Vec3x<V>; 2],
    alpha: V,
    x: &mut [Vec3x<V>; 3],
    w: &[V; 3],
) -> V {
    let g0 = g1 + g2;
    let sum = w[0] * g0.dot(g0) + w[1] * g1.dot(g1) + w[2] * g2.dot(g2) + alpha;
    let lambda = c / sum.max(V::of(1e-28));
    x[0] = x[0] + g0.scale(lambda * w[0]);
    x[1] = x[1] - g1.scale(lambda * w[1]);
    x[2] = x[2] - g2.scale(lambda * w[2]);
    lambda
}

/// Adds what the forces of the last substep, as the elements of one colour lie at `x`, pull at
/// their corners [N], and the stress there, the sum of |force density| times slope^2 [N/m].
#[inline(always)]
pub(super) fn warm_start_elements<V: Lanes>(
    elements: &[Element],
    x: &[Vec3x<V>],
    density: &[V],
    pull: &mut [Vec3x<V>],
    stress: &mut [V],
    scales: Option<&Scales<V>>,
) {
    for element in elements {
        let Some(lasting) = element.lasting else {
            continue;
        };
        let v = element.vertices.map(|v| v as usize);
        let corners = v.map(|v| x[v]);
        for (k, slope) in element.slopes::<V>().into_iter().enumerate() {
            let (_, warm) = lasting.warm(k, density, scales);
            let f = image(&corners, slope);
            let shares = [-(slope[0] + slope[1]), slope[0], slope[1]];
            for (v, share) in v.into_iter().zip(shares) {
                pull[v] = pull[v] - f.scale(warm * share);
                stress[v] = stress[v] + warm.max(-warm) * share * share;
            }
        }
    }
}

/// A column of F.
#[inline(always)]
fn image<V: Lanes>(x: &[Vec3x<V>; 3], [s, t]: [V; 2]) -> Vec3x<V> {
    (x[1] - x[0]).scale(s) + (x[2] - x[0]).scale(t)
}

/// Direction and length of a column of F; none is zero.
#[inline(always)]
fn column<V: Lanes>(x: &[Vec3x<V>; 3], slope: [V; 2]) -> (Vec3x<V>, V) {
    let f = image(x, slope);
    let length = f.dot(f).max(V::of(MIN_SQUARE)).sqrt();
    (f.scale(V::of(1.0) / length), length)
}

/// C3 and its derivatives by the second and the third corner.
#[inline(always)]
fn sine<V: Lanes>(x: &[Vec3x<V>; 3], slopes: [[V; 2]; 2]) -> (V, [Vec3x<V>; 2]) {
    let [(a, a_length), (b, b_length)] = slopes.map(|slope| column(x, slope));
    let c = a.dot(b);
    // Derivatives of C3 by F a and F b.
    let by_a = (b - a.scale(c)).scale(V::of(1.0) / a_length);
    let by_b = (a - b.scale(c)).scale(V::of(1.0) / b_length);
    let [warp, weft] = slopes;
    (c, [0, 1].map(|k| by_a.scale(warp[k]) + by_b.scale(weft[k])))
}

/// Projects the elements of one colour: C1, C2, then C3, each from where the one before has
/// left the corners. Macklin et al. 2016 (XPBD), eqs. 17-18.
#[inline(always)]
pub(super) fn project_elements<V: Lanes>(
    elements: &[Element],
    position: &mut [Vec3x<V>],
    mobility: &[V],
    density: &mut [V],
    scales: Option<&Scales<V>>,
) {
    for element in elements {
        let v = element.vertices.map(|v| v as usize);
        let mut x = v.map(|v| position[v]);
        let w = v.map(|v| mobility[v]);
        let slopes = element.slopes();
        for (k, law) in element.yarns.iter().flatten().enumerate() {
            let slope = slopes[k];
            let (n, length) = column(&x, slope);
            let c = length - V::of(1.0);
            let gradient = slope.map(|s| n.scale(s));
            let law = law.in_lanes(Scales::on_compliance(scales, k));
            let Some(lasting) = element.lasting else {
                apply(c, gradient, branch(law, c), &mut x, &w);
                continue;
            };
            let (place, warm) = lasting.warm(k, density, scales);
            let alpha = branch(law, density[place]);
            let force = apply(c - alpha * (warm * length), gradient, alpha, &mut x, &w);
            density[place] = warm + V::of(lasting.gain) * force / length;
        }
        if let Some(law) = &element.shear {
            let (c, gradient) = sine(&x, slopes);
            let factors = Scales::on_compliance(scales, Direction::Diagonal as usize);
            let law = law.in_lanes(factors);
            let alpha = branch(law, c) * share_of_sine(c);
            apply(c, gradient, alpha, &mut x, &w);
        }
        for k in 0..3 {
            position[v[k]] = x[k];
        }
    }
}

/// Projects the shear of the elements of one colour by a curve.
#[inline(always)]
pub(super) fn shear_elements_by_curve<V: Lanes>(
    elements: &[Element],
    lagged: &Lagged<V>,
    position: &mut [Vec3x<V>],
    mobility: &[V],
    scales: Option<&Scales<V>>,
) {
    for element in elements {
        let Some(law) = &element.shear else { continue };
        let v = element.vertices.map(|v| v as usize);
        let (mut x, w) = (v.map(|v| position[v]), v.map(|v| mobility[v]));
        let slopes = element.slopes();
        let (before, _) = sine(&v.map(|v| lagged.previous[v]), slopes);
        let before = within(before);
        let [force, slope] = lagged.curve.of_sine(before);
        let (now, gradient) = sine(&x, slopes);
        let factors = Scales::on_compliance(scales, Direction::Diagonal as usize);
        let alpha = of_sign(law.in_lanes(factors), before) / slope;
        apply(now - before + force / slope, gradient, alpha, &mut x, &w);
        for k in 0..3 {
            position[v[k]] = x[k];
        }
    }
}

/// Projects what locking adds to the shear of the elements of one colour.
#[inline(always)]
pub(super) fn project_locking<V: Lanes>(
    elements: &[Element],
    locking: &Locking,
    position: &mut [Vec3x<V>],
    mobility: &[V],
    scales: Option<&Scales<V>>,
) {
    for element in elements {
        let Some(law) = &element.shear else { continue };
        let v = element.vertices.map(|v| v as usize);
        let mut x = v.map(|v| position[v]);
        let slopes = element.slopes();
        let [a, b] = slopes.map(|slope| image(&x, slope));
        let is_locked = locking.holds([a.dot(b), a.dot(a), b.dot(b)]);
        if !V::any(is_locked) {
            continue;
        }
        let (sine, gradient) = sine(&x, slopes);
        let [c, share] = locking.of_sine(sine);
        let c = V::select(is_locked, c, V::zero());
        let factors = Scales::on_compliance(scales, Direction::Diagonal as usize);
        let law = law.in_lanes(factors);
        let (alpha, w) = (branch(law, c) * share, v.map(|v| mobility[v]));
        apply(c, gradient, alpha, &mut x, &w);
        for k in 0..3 {
            position[v[k]] = x[k];
        }
    }
}

#[cfg(test)]
mod tests;
