//! Contact with the tool: kinematic, with Coulomb friction, tack and pressure.
//!
//! A vertex that would be inside the tool at the end of the step gets just the force that
//! leaves it on the surface there, as in Abaqus' kinematic contact. So contact has no
//! stiffness to choose, no share in the time step and no depth; a resting vertex rests
//! exactly. Friction takes back the tangential motion of the step, wholly as long as the force
//! that this needs is below the static limit: what sticks does not creep.

use super::energy::Energies;
use super::pack::Field;
use crate::tool::Tool;

/// How far a vertex moves before its tangent plane is looked up anew [m]. On a tool of
/// radius R the plane is then off by its square over 2 R, 1e-7 m for 10 mm; over a sharp edge
/// by as much as itself.
const RENEWAL: f64 = 5e-5;
/// Distance for which the plane of a vertex under pressure gives the direction, far off [m].
const PRESSED_RENEWAL: f64 = 1e-3;
/// Reach of tack [m].
const TACK_RANGE: f64 = 2e-4;
/// The interpolated distance may change by somewhat more than the displacement [-].
const LIPSCHITZ: f64 = 0.9;

/// Slip speed over which friction falls from its static to its dynamic coefficient [m/s], as
/// exp(-v / this) (Abaqus' exponential decay). Far slower than sliding of any interest. With a
/// jump, cloth that lands softly would be set sliding by what is left over of its last step.
const SLIP_SPEED: f64 = 2e-4;

/// The tool's tangent plane near a vertex, while the vertex stays near where it was looked up.
#[derive(Clone, Copy)]
struct Plane {
    /// Where it was looked up [m].
    at: [f64; 3],
    /// Square of the displacement after which it is out of date [m^2]; negative for at once.
    reach: f64,
    normal: [f64; 3],
    /// Plane: normal . x = offset [m].
    offset: f64,
    /// The vertex may touch the tool before the plane is renewed.
    is_near: bool,
}

/// Planes of all vertices.
pub(super) struct Contact {
    planes: Vec<Plane>,
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

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Contact {
    pub fn new(count: usize, friction: Option<[f64; 2]>, tack: Option<Vec<f64>>) -> Self {
        let stale = Plane {
            at: [0.0; 3],
            reach: -1.0,
            normal: [0.0, 0.0, 1.0],
            offset: 0.0,
            is_near: false,
        };
        Self {
            planes: vec![stale; count],
            pressure: vec![0.0; count],
            friction,
            tack,
            press_speed: f64::INFINITY,
        }
    }

    /// Forgets all planes: tool or positions are others.
    pub fn forget(&mut self) {
        for plane in &mut self.planes {
            plane.reach = -1.0;
        }
    }

    /// Adds the forces of contact to `f` [N] for all vertices that are not `fixed`, and their
    /// works to `ledger`.
    pub fn add_forces(
        &mut self,
        tool: &Tool,
        [x, v]: [&Field; 2],
        mass: &[f64],
        fixed: &[bool],
        step: &Step,
        f: &mut Field,
        ledger: &mut Energies,
    ) {
        for i in 0..self.planes.len() {
            let at = [x[0][i], x[1][i], x[2][i]];
            let before = [v[0][i], v[1][i], v[2][i]];
            let plane = &mut self.planes[i];
            let mut square = 0.0;
            for k in 0..3 {
                square += (at[k] + step.drift * before[k] - plane.at[k]).powi(2);
            }
            if square > plane.reach {
                let range = if self.tack.is_some() { TACK_RANGE } else { 0.0 };
                *plane = look_up(tool, at, range, self.pressure[i] > 0.0);
            }
            if !(plane.is_near || self.pressure[i] > 0.0) || fixed[i] {
                continue;
            }
            let force = [f[0][i], f[1][i], f[2][i]];
            let add = self.touch(i, at, before, force, mass[i], step, ledger);
            for k in 0..3 {
                f[k][i] += add[k];
            }
        }
    }

    /// The force of the tool and of pressure on one vertex [N].
    #[expect(clippy::too_many_arguments, reason = "a vertex is that many numbers")]
    fn touch(
        &self,
        i: usize,
        x: [f64; 3],
        before: [f64; 3],
        force: [f64; 3],
        mass: f64,
        step: &Step,
        ledger: &mut Energies,
    ) -> [f64; 3] {
        let Plane {
            normal: n, offset, ..
        } = self.planes[i];
        let start = [0, 1, 2].map(|k| step.velocity(before[k], force[k] / mass));
        let mut after = start;
        let height = dot(n, x) - offset;

        let mut pulled = 0.0;
        if let Some(tack) = &self.tack
            && height < TACK_RANGE
        {
            pulled = -step.kick * tack[i] / (mass * (1.0 + step.damped));
            for k in 0..3 {
                after[k] += n[k] * pulled;
            }
        }

        // The roller: its force falls to nothing where the cloth is as fast as itself. Implicit
        // in the velocity, or 33 N on 30 mg would overshoot.
        let mut pushed = 0.0;
        let toward = n.map(|n| -n);
        if self.pressure[i] > 0.0 {
            let gain = step.kick * self.pressure[i] / (mass * (1.0 + step.damped));
            let speed = dot(after, toward);
            let pressed = (speed + gain) / (1.0 + gain / self.press_speed);
            pushed = (pressed - speed).max(0.0);
            for k in 0..3 {
                after[k] += toward[k] * pushed;
            }
        }

        let depth = -(height + step.drift * dot(n, after));
        let mut hit = 0.0;
        let mut rubbed = [0.0; 3];
        if depth > 0.0 {
            hit = depth / step.drift;
            for k in 0..3 {
                after[k] += n[k] * hit;
            }
            if let Some([stick, slide]) = self.friction {
                let normal = dot(n, after);
                let along = [0, 1, 2].map(|k| after[k] - n[k] * normal);
                let speed = dot(along, along).sqrt();
                let slip = speed - stick * hit;
                let share = if slip <= 0.0 {
                    1.0
                } else {
                    let mu = slide + (stick - slide) * (-slip / SLIP_SPEED).exp();
                    (mu * hit / speed).min(1.0)
                };
                rubbed = along.map(|v| -share * v);
                for k in 0..3 {
                    after[k] += rubbed[k];
                }
            }
        }

        // Impulse times mean velocity: exactly what the step does to the kinetic energy.
        let mean = [0, 1, 2].map(|k| 0.5 * (before[k] + after[k]));
        let impulse = (1.0 + step.damped) * mass;
        let along = dot(n, mean);
        ledger.adhesion += impulse * pulled * along;
        ledger.press += impulse * pushed * dot(toward, mean);
        ledger.contact -= impulse * hit * along;
        ledger.friction -= impulse * dot(rubbed, mean);
        [0, 1, 2].map(|k| step.force(mass, after[k] - start[k]))
    }
}

/// The tangent plane near `x` [m], and how long it may be used.
fn look_up(tool: &Tool, x: [f64; 3], range: f64, is_pressed: bool) -> Plane {
    let (height, normal) = tool.distance(x);
    let is_near = height <= 2.0 * RENEWAL + range;
    let mut reach = if is_near {
        RENEWAL
    } else {
        LIPSCHITZ * (height - RENEWAL - range)
    };
    if is_pressed {
        reach = reach.min(PRESSED_RENEWAL);
    }
    Plane {
        at: x,
        reach: reach * reach,
        normal,
        offset: dot(normal, x) - height,
        is_near,
    }
}
