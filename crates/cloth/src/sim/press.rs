//! The roller: pressure on cloth, the law of the finite-element twin as well, and its grip.

use super::cloth::Cloth;
use crate::math::{Lanes, Vec3};

/// How near to the tool a vertex lies on it [m]: tangent planes are a few substeps old.
const TOUCHING: f64 = 1e-4;

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
