use super::contact::{Step, Vertex};
use super::pack::{WIDTH, at};
use super::state::Twin;
use crate::math::{Isa, Kernel, Lanes};
use crate::tool::Tool;

/// A yarn that has grown by this much is no yarn any more [-].
const TORN_STRAIN: f64 = 10.0;

/// The twin cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the twin diverged after {seconds:.6} s at a time step of {time_step:.3e} s: clamps or loads \
     tear the lamina"
)]
pub struct Diverged {
    /// Since the twin was made [s].
    pub seconds: f64,
    /// Last time step [s].
    pub time_step: f64,
}

impl Twin {
    /// Goes on for `seconds`, on `tool` if there is one.
    ///
    /// # Errors
    /// When positions are no numbers any more, or yarns are torn.
    pub fn advance(&mut self, tool: Option<&Tool>, seconds: f64) -> Result<(), Diverged> {
        self.contact.forget();
        let end = self.seconds + seconds;
        loop {
            let left = end - self.seconds;
            if left <= 1e-9 * self.time_step {
                return match self.is_finite() {
                    true => Ok(()),
                    false => Err(self.diverged()),
                };
            }
            self.step(tool, left)?;
        }
    }

    /// One step, of an even share of what is `left` [s].
    pub(super) fn step(&mut self, tool: Option<&Tool>, left: f64) -> Result<(), Diverged> {
        self.vectorize(Task::Forces);
        let torn = self.peak.iter().any(|peak| *peak >= TORN_STRAIN);
        let stiffer = (0..2).any(|k| self.peak[k] > self.bound.limit[k]);
        if self.until_refresh == 0 || stiffer || torn {
            if torn || !self.is_finite() {
                return Err(self.diverged());
            }
            self.refresh_bound();
        }
        self.until_refresh -= 1;
        let drift = left / (left / self.time_step - 1e-9).ceil().max(1.0);
        let kick = 0.5 * (self.last + drift);
        let step = Step {
            kick,
            drift,
            damped: 0.5 * self.config.damping * kick,
        };
        if let Some(tool) = tool {
            self.touch(tool, &step);
        }
        self.hold(&step);
        self.vectorize(Task::Move(step));
        self.last = drift;
        self.seconds += drift;
        Ok(())
    }

    /// Adds the forces of the tool and of pressure on what no clamp holds.
    fn touch(&mut self, tool: &Tool, step: &Step) {
        self.vectorize(Task::FindStale(step.drift));
        for i in 0..self.count {
            if self.contact.is_clear(i) || self.held[i].is_some() {
                continue;
            }
            let (x, v) = (at(&self.x, i), at(&self.v, i));
            if !self.contact.may_act(tool, i, x) {
                continue;
            }
            let (f, mass) = (at(&self.f, i), self.mass[i]);
            let vertex = Vertex { x, v, f, mass };
            let force = self.contact.force(i, &vertex, step, &mut self.ledger);
            for (f, force) in self.f.iter_mut().zip(&force) {
                f[i] += force;
            }
        }
    }

    /// Adds the forces of clamps, which give held vertices their velocity.
    fn hold(&mut self, step: &Step) {
        for (v, held) in self.held.iter().enumerate() {
            let Some(velocity) = held else {
                continue;
            };
            for (k, after) in velocity.iter().enumerate() {
                let before = self.v[k][v];
                let start = step.velocity(before, self.f[k][v] * self.inverse_mass[v]);
                let force = step.force(self.mass[v], after - start);
                self.f[k][v] += force;
                self.ledger.external += force * step.kick * 0.5 * (before + after);
            }
        }
    }

    fn is_finite(&self) -> bool {
        let fields = self.x.iter().chain(&self.v);
        fields.flatten().all(|x| x.is_finite())
    }

    fn diverged(&self) -> Diverged {
        Diverged {
            seconds: self.seconds,
            time_step: self.last,
        }
    }

    /// Runs a task compiled for this machine. Equal bits on all of them.
    fn vectorize(&mut self, task: Task) {
        let isa = self.isa;
        let kernel = Run { twin: self, task };
        match isa {
            Isa::Portable => kernel.run(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => crate::math::F32x8::vectorize(kernel),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => crate::math::F32x16::vectorize(kernel),
        }
    }
}

/// What is done for the whole sheet at once.
#[derive(Clone, Copy)]
enum Task {
    /// Forces at the present positions.
    Forces,
    /// Which planes of the tool are out of date after a step so long [s].
    FindStale(f64),
    /// Velocities and positions after a step.
    Move(Step),
}

struct Run<'a> {
    twin: &'a mut Twin,
    task: Task,
}

impl Kernel for Run<'_> {
    #[inline(always)]
    fn run(self) {
        let twin = self.twin;
        match self.task {
            Task::Forces => {
                for f in &mut twin.f {
                    f.fill(0.0);
                }
                for (f, weight) in twin.f[2].iter_mut().zip(&twin.weight) {
                    *f = -weight;
                }
                // Viscous stress is beta d(stress)/dt with beta = 2 xi / omega.
                let beta = 2.0 * twin.config.viscosity / twin.bound.frequency;
                // The first step has no rate.
                let rate = match twin.last > 0.0 {
                    true => beta / twin.last,
                    false => 0.0,
                };
                let viscosity = (beta > 0.0).then_some(rate);
                let pass = twin.membranes.add_forces(&twin.x, &mut twin.f, viscosity);
                twin.bending.add_forces(&twin.x, &mut twin.f);
                twin.peak = pass.peak;
                twin.ledger.viscosity += pass.dissipated;
            }
            Task::FindStale(drift) => twin.contact.find_stale(&twin.x, &twin.v, drift),
            Task::Move(step) => {
                let mut square = [0.0; WIDTH];
                let is_damped = step.damped > 0.0;
                for axis in 0..3 {
                    let inverse = twin.inverse_mass.chunks_exact(WIDTH);
                    let mass = twin.mass.chunks_exact(WIDTH);
                    let f = twin.f[axis].chunks_exact(WIDTH);
                    let v = twin.v[axis].chunks_exact_mut(WIDTH);
                    let x = twin.x[axis].chunks_exact_mut(WIDTH);
                    for ((((x, v), f), w), m) in x.zip(v).zip(f).zip(inverse).zip(mass) {
                        for l in 0..WIDTH {
                            let before = v[l];
                            v[l] = step.velocity(before, f[l] * w[l]);
                            x[l] += step.drift * v[l];
                            if is_damped {
                                let twice = before + v[l];
                                square[l] += m[l] * twice * twice;
                            }
                        }
                    }
                }
                let sum: f64 = square.into_iter().sum();
                twin.ledger.damping += 0.5 * step.damped * sum;
            }
        }
    }
}
