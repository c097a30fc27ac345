//! Contact with the tool: kinematic, with Coulomb friction, tack and pressure.
//!
//! A vertex that would be inside the tool at the end of the step gets just the force that
//! leaves it on the surface there, as in Abaqus' kinematic contact: no stiffness to choose, no
//! share in the time step, no depth. Friction takes back the tangential motion of the step, wholly
//! as long as the force that this needs is below the static limit: what sticks does not creep.

use super::energy::Energies;
use super::pack::{Field, WIDTH, zeros};
use crate::math::Vec3;
use crate::tool::Tool;

/// How far a vertex moves before its tangent plane is refreshed [m]. On a tool of
/// radius R the plane is then off by its square over 2 R, 1e-7 m for 10 mm; over a sharp edge
/// by as much as itself.
const REFRESH: f64 = 5e-5;
/// Distance for which the plane of a vertex under pressure gives the direction, far off [m].
const PRESSED_REFRESH: f64 = 1e-3;
/// Reach of tack [m].
const TACK_RANGE: f64 = 2e-4;
/// The interpolated distance may change by somewhat more than the displacement [-].
const LIPSCHITZ: f64 = 0.9;

/// Slip speed over which friction falls from its static to its dynamic coefficient [m/s], as
/// exp(-v / this) (Abaqus' exponential decay). A jump would set softly landing cloth sliding.
const SLIP_SPEED: f64 = 2e-4;

/// The tool's tangent plane near a vertex, normal . x = offset [m].
#[derive(Clone, Copy)]
struct Plane {
    normal: Vec3,
    offset: f64,
}

/// Planes of all vertices.
pub(super) struct Contact {
    planes: Vec<Plane>,
    /// Where each was taken [m].
    at: Field,
    /// Square of the displacement after which it is out of date [m^2]: negative for at once, infinite in padding.
    reach: Vec<f64>,
    /// Which are, as [`Contact::find_stale`] says.
    is_stale: Vec<bool>,
    /// Whether the vertex may touch the tool before the plane is refreshed.
    is_near: Vec<bool>,
    /// Whether a vertex is pressed on to the tool, and with which force [N].
    pub pressure: Vec<f64>,
    /// Static and dynamic coefficient.
    friction: Option<[f64; 2]>,
    /// Largest pull of the tool on each vertex [N].
    tack: Option<Vec<f64>>,
    /// Speed of the roller [m/s], which pressure does not outrun.
    pub press_speed: f64,
}

/// What all vertices share in a step.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// From one velocity to the next [s].
    pub kick: f64,
    /// From one position to the next [s].
    pub drift: f64,
    /// Half the damping of the step, damping times kick over 2 [-].
    pub damped: f64,
}

/// A vertex before the step: place [m], velocity [m/s], force of all but contact [N], mass [kg].
pub(super) struct Vertex {
    pub x: Vec3,
    pub v: Vec3,
    pub f: Vec3,
    pub mass: f64,
}

impl Step {
    /// Velocity after the step under the force over mass `a` [m/s^2].
    #[inline(always)]
    pub fn velocity(&self, v: f64, a: f64) -> f64 {
        ((1.0 - self.damped) * v + self.kick * a) / (1.0 + self.damped)
    }

    /// The force on `mass` [N] that changes the velocity after the step by `dv`.
    #[inline(always)]
    pub fn force(&self, mass: f64, dv: f64) -> f64 {
        (1.0 + self.damped) * mass * dv / self.kick
    }
}

impl Contact {
    pub fn new(count: usize, friction: Option<[f64; 2]>, tack: Option<Vec<f64>>) -> Self {
        let plane = Plane {
            normal: Vec3::z(),
            offset: 0.0,
        };
        let mut contact = Self {
            planes: vec![plane; count],
            at: zeros(count),
            reach: vec![f64::INFINITY; count.next_multiple_of(WIDTH)],
            is_stale: vec![false; count.next_multiple_of(WIDTH)],
            is_near: vec![false; count],
            pressure: vec![0.0; count],
            friction,
            tack,
            press_speed: f64::INFINITY,
        };
        contact.forget();
        contact
    }

    /// Forgets all planes: tool or positions are others.
    pub fn forget(&mut self) {
        self.reach[..self.planes.len()].fill(-1.0);
    }

    /// Finds the planes that are out of date where the vertices go, from `x` [m] by `v` [m/s] for `drift` [s].
    #[inline(always)]
    pub fn find_stale(&mut self, x: &Field, v: &Field, drift: f64) {
        for first in (0..self.reach.len()).step_by(WIDTH) {
            let block = first..first + WIDTH;
            let mut square = [0.0; WIDTH];
            for axis in 0..3 {
                let (x, v) = (&x[axis][block.clone()], &v[axis][block.clone()]);
                let at = &self.at[axis][block.clone()];
                for l in 0..WIDTH {
                    let off = x[l] + v[l] * drift - at[l];
                    square[l] += off * off;
                }
            }
            let (reach, is_stale) = (&self.reach[block.clone()], &mut self.is_stale[block]);
            for l in 0..WIDTH {
                is_stale[l] = square[l] > reach[l];
            }
        }
    }

    /// Whether vertex `i` is far from the tool, and its plane still tells.
    pub fn is_clear(&self, i: usize) -> bool {
        !self.is_stale[i] && !self.is_near[i] && self.pressure[i] <= 0.0
    }

    /// Whether the tool or pressure may act on vertex `i` at `x` [m]; refreshes its plane.
    pub fn may_act(&mut self, tool: &Tool, i: usize, x: Vec3) -> bool {
        let is_pressed = self.pressure[i] > 0.0;
        if self.is_stale[i] {
            self.refresh(tool, i, x, is_pressed);
        }
        self.is_near[i] || is_pressed
    }

    /// The force of the tool and of pressure on vertex `i` [N]; adds its works to `ledger`.
    pub fn force(&self, i: usize, vertex: &Vertex, step: &Step, ledger: &mut Energies) -> Vec3 {
        let Vertex { x, v, f, mass } = vertex;
        let (n, offset) = (self.planes[i].normal, self.planes[i].offset);
        let start = v.zip_map(f, |v, f| step.velocity(v, f / mass));
        let mut after = start;
        let height = n.dot(x) - offset;

        let mut pulled = 0.0;
        if let Some(tack) = &self.tack
            && height < TACK_RANGE
        {
            pulled = -step.kick * tack[i] / (mass * (1.0 + step.damped));
            after += n * pulled;
        }

        // The roller: its force falls to nothing where the cloth is as fast as itself. Implicit
        // in the velocity, or 33 N on 30 mg would overshoot.
        let mut pushed = 0.0;
        if self.pressure[i] > 0.0 {
            let gain = step.kick * self.pressure[i] / (mass * (1.0 + step.damped));
            let speed = -n.dot(&after);
            let pressed = (speed + gain) / (1.0 + gain / self.press_speed);
            pushed = (pressed - speed).max(0.0);
            after -= n * pushed;
        }

        let depth = -(height + step.drift * n.dot(&after));
        let mut hit = 0.0;
        let mut rubbed = Vec3::zeros();
        if depth > 0.0 {
            hit = depth / step.drift;
            after += n * hit;
            if let Some([stick, slide]) = self.friction {
                let along = after - n * n.dot(&after);
                let speed = along.norm();
                let slip = speed - stick * hit;
                let share = if slip <= 0.0 {
                    1.0
                } else {
                    let mu = slide + (stick - slide) * (-slip / SLIP_SPEED).exp();
                    (mu * hit / speed).min(1.0)
                };
                rubbed = along * -share;
                after += rubbed;
            }
        }

        // Impulse times mean velocity: exactly what the step does to the kinetic energy.
        let mean = (v + after) * 0.5;
        let impulse = (1.0 + step.damped) * mass;
        let along = n.dot(&mean);
        ledger.adhesion += impulse * pulled * along;
        ledger.press -= impulse * pushed * along;
        ledger.contact -= impulse * hit * along;
        ledger.friction -= impulse * rubbed.dot(&mean);
        (after - start).map(|dv| step.force(*mass, dv))
    }

    /// Takes the tangent plane near `x` [m].
    fn refresh(&mut self, tool: &Tool, i: usize, x: Vec3, is_pressed: bool) {
        let range = if self.tack.is_some() { TACK_RANGE } else { 0.0 };
        let (height, normal) = tool.distance(x.into());
        let normal = Vec3::from(normal);
        let is_near = height <= 2.0 * REFRESH + range;
        let mut reach = match is_near {
            true => REFRESH,
            false => LIPSCHITZ * (height - REFRESH - range),
        };
        if is_pressed {
            reach = reach.min(PRESSED_REFRESH);
        }
        for (at, x) in self.at.iter_mut().zip(&x) {
            at[i] = *x;
        }
        self.reach[i] = reach * reach;
        self.is_near[i] = is_near;
        self.planes[i] = Plane {
            normal,
            offset: normal.dot(&x) - height,
        };
    }
}
