//! The roller: pressure on cloth, the law of the finite-element twin as well, and its grip.

use super::cloth::Cloth;
use crate::math::{Lanes, Vec3};

/// How near to the tool a vertex lies on it [m]: tangent planes are a few substeps old.
pub(super) const TOUCHING: f64 = 1e-4;

/// A roller that presses on cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roller {
    /// [Pa]
    pub pressure: f64,
    /// Speed at which it comes down [m/s]. Its force falls to nothing where cloth is as fast:
    /// without that, 1 N/mm^2 throws bare vertices at the tool with some 100 m/s.
    pub speed: f64,
}

/// A roller on some vertices of one environment during a control step.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    pub environment: usize,
    /// The vertices, and the force on each of them at rest [N].
    pub forces: Vec<(u32, f64)>,
    /// See [`Roller::speed`].
    pub speed: f64,
}

impl Roller {
    /// What it does to some vertices of areas [m^2] of one environment.
    pub fn press(&self, environment: usize, vertices: &[u32], areas: &[f64]) -> Press {
        let force = |&v: &u32| (v, self.pressure * areas[v as usize]);
        Press {
            environment,
            forces: vertices.iter().map(force).collect(),
            speed: self.speed,
        }
    }
}

/// Pushes one lane of a place towards the tool by `force` [N], at most down to a height of
/// `beneath` [m]; `reach` is how far the roller comes down in a substep [m].
///
/// The force F (1 - v / roller's speed) is implicit in the velocity v, or tens of newtons on
/// milligrams would overshoot: a displacement d becomes (d + g) / (1 + g / reach), g = mobility F.
#[inline(always)]
pub(super) fn push<V: Lanes>(
    [place, lane]: [usize; 2],
    force: f64,
    reach: f64,
    beneath: f64,
    cloth: &mut Cloth<V>,
) {
    let n = Vec3::from(cloth.plane[place].normal.get(lane));
    let x = Vec3::from(cloth.position[place].get(lane));
    let previous = Vec3::from(cloth.previous[place].get(lane));
    let above = n.dot(&x) - cloth.plane[place].offset.get(lane) - beneath;
    let gain = cloth.mobility[place].get(lane) * force;
    let down = n.dot(&(previous - x));
    let pushed = ((down + gain) / (1.0 + gain / reach) - down).min(above);
    if gain > 0.0 && pushed > 0.0 {
        cloth.position[place].set(lane, (x - n * pushed).into());
    }
}

/// Coulomb friction of one lane of a place that lies on the tool under `force` [N], with what
/// the substep has started to do to it: velocity and the yarns' pull. What the static coefficient
/// holds is put back and stays there, whatever the stages that follow want of it; what slides is
/// slowed by the dynamic coefficient.
///
/// Friction by the push out of the tool alone, at the end of a substep, would hold far too much:
/// by then the pressure has been answered by the tool, and the yarns by each other.
#[inline(always)]
pub(super) fn grip<V: Lanes>(
    [place, lane]: [usize; 2],
    force: f64,
    [stick, slide]: [f64; 2],
    cloth: &mut Cloth<V>,
) {
    let n = Vec3::from(cloth.plane[place].normal.get(lane));
    let previous = Vec3::from(cloth.previous[place].get(lane));
    let above = n.dot(&previous) - cloth.plane[place].offset.get(lane);
    let mobility = cloth.mobility[place].get(lane);
    if above > TOUCHING || mobility <= 0.0 {
        return;
    }
    let moved = Vec3::from(cloth.position[place].get(lane)) - previous;
    let off = n.dot(&moved);
    let along = moved - n * off;
    let load = (mobility * force - off).max(0.0);
    let slip = along.norm();
    let left = match slip <= stick * load {
        true => Vec3::zeros(),
        false => along * (1.0 - slide * load / slip).max(0.0),
    };
    cloth.position[place].set(lane, (previous + left - n * above).into());
    if left == Vec3::zeros() {
        cloth.mobility[place].set(lane, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::cloth::Plane;
    use super::*;
    use crate::math::Vec3x;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found - expected).abs() <= tolerance,
            "{found}, expected {expected}"
        );
    }

    /// A vertex over the plane z = 0 that the substep has moved from one height and place to
    /// another, with a mobility of 0.01 m/N.
    fn moved(from: [f64; 3], to: [f64; 3]) -> Cloth<f64> {
        let mut cloth = Cloth::new(1, 0, 1);
        cloth.previous[0] = Vec3x(from);
        cloth.position[0] = Vec3x(to);
        cloth.mobility[0] = 0.01;
        cloth.plane[0] = Plane {
            normal: Vec3x([0.0, 0.0, 1.0]),
            offset: 0.0,
        };
        cloth
    }

    /// Free cloth is as fast as the roller in the limit of great force, F M in that of little; what
    /// falls faster is not held up, and neither tool nor the cloth beneath is passed.
    #[test]
    fn roller_pushes_up_to_its_own_speed_and_down_to_the_tool() {
        let height = |fallen: f64, force: f64, beneath: f64| {
            let mut cloth = moved([0.0, 0.0, 1.0], [0.0, 0.0, 1.0 - fallen]);
            push([0, 0], force, 0.1, beneath, &mut cloth);
            cloth.position[0].0[2]
        };
        close(height(0.0, 1e9, 0.0), 0.9, 1e-6);
        close(height(0.0, 1e-3, 0.0), 1.0 - 1e-5, 1e-8);
        // Half the force at half the roller's speed: d = g (1 - d / reach) for g = reach.
        close(height(0.0, 10.0, 0.0), 0.95, 1e-12);
        close(height(0.2, 1e9, 0.0), 0.8, 1e-12);
        close(height(0.0, 1e9, 0.97), 0.97, 1e-12);
        close(height(0.0, 1e9, 2.0), 1.0, 1e-12);
    }

    /// Coulomb's law under a load of 3 N: it holds up to 0.3 of that, takes 0.2 of it from what
    /// slides, and leaves alone what does not lie on the tool.
    #[test]
    fn roller_grips_what_its_friction_can_hold() {
        let slid = |pull: f64, height: f64| {
            let mut cloth = moved([0.0, 0.0, height], [0.01 * pull, 0.0, height]);
            grip([0, 0], 3.0, [0.3, 0.2], &mut cloth);
            (cloth.position[0].0[0] / 0.01, cloth.mobility[0])
        };
        assert_eq!(slid(0.89, 0.0), (0.0, 0.0));
        let (left, mobility) = slid(0.91, 0.0);
        close(left, 0.91 - 0.6, 1e-12);
        assert_eq!(mobility, 0.01);
        close(slid(0.5, 2.0 * TOUCHING).0, 0.5, 1e-12);
    }
}
