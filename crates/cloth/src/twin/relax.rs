use super::state::Twin;
use super::step::Diverged;
use crate::tool::Tool;

/// Min and max steps between two estimates of how the twin moves.
const WINDOW: [usize; 2] = [200, 20_000];
/// Share of a radian of the slowest motion between two estimates.
const SHARE: f64 = 0.1;
/// Estimates in a row that have to find the twin at rest.
const QUIET: usize = 3;

impl Twin {
    /// Goes on under the damping that brings the present motion to rest soonest, until vertices
    /// have about `tolerance` [m] left to go (root mean square), for `seconds` at most. Gives
    /// whether they have come to rest.
    ///
    /// Adaptive dynamic relaxation (Underwood 1983): the slowest frequency omega is estimated
    /// from the motion itself by Rayleigh's quotient, and damping is critical for it, 2 omega.
    /// Motion that only creeps is damped too much; the rate at which it fades tells by how much.
    /// How the twin gets there is no motion of cloth; where it comes to rest is. With friction
    /// that can depend on the path there.
    ///
    /// # Errors
    /// As for [`Twin::advance`].
    pub fn relax(
        &mut self,
        tool: Option<&Tool>,
        tolerance: f64,
        seconds: f64,
    ) -> Result<bool, Diverged> {
        let damping = self.config.damping;
        let result = self.relax_damped(tool, tolerance, seconds);
        self.config.damping = damping;
        result
    }

    fn relax_damped(
        &mut self,
        tool: Option<&Tool>,
        tolerance: f64,
        seconds: f64,
    ) -> Result<bool, Diverged> {
        let start = self.seconds;
        self.contact.forget();
        let mut window = WINDOW[0];
        let mut quiet = 0;
        let (mut x, mut f) = (self.x.clone(), self.elastic_field());
        let mut last: Option<(f64, f64)> = None;
        while start + seconds - self.seconds > 1e-9 * self.time_step && quiet < QUIET {
            let began = self.seconds;
            for _ in 0..window {
                // An even share of what is left is a whole step as long as that is long.
                let left = start + seconds - self.seconds;
                if left <= 1e-9 * self.time_step {
                    break;
                }
                self.step(tool, left)?;
            }
            let time = self.seconds - began;
            let now = self.elastic_field();
            let (mut work, mut inertia, mut mass) = (0.0, 0.0, 0.0);
            for v in 0..self.count {
                mass += self.mass[v];
                for k in 0..3 {
                    let u = self.x[k][v] - x[k][v];
                    work -= u * (now[k][v] - f[k][v]);
                    inertia += self.mass[v] * u * u;
                }
            }
            let speed = (inertia / mass).sqrt() / time;
            // A sheet that falls freely has none, and a sheet that does not move 0 / 0.
            let omega = (work / inertia).max(0.0).sqrt();
            let mut omega = if omega.is_finite() { omega } else { 0.0 };
            let damping = self.config.damping;
            let fading = last.map_or(0.0, |(speed_then, time_then)| {
                (speed_then / speed).ln() / (0.5 * (time_then + time))
            });
            if fading > 0.0 && fading < 0.5 * damping {
                omega = omega.min((fading * (damping - fading)).sqrt());
            }
            self.config.damping = 2.0 * omega;
            let distance_left = if speed > 0.0 {
                speed / fading.min(omega).max(1.0 / seconds)
            } else {
                0.0
            };
            last = Some((speed, time));
            quiet = if distance_left < tolerance {
                quiet + 1
            } else {
                0
            };
            let steps = SHARE / omega.max(f64::MIN_POSITIVE) / self.time_step;
            window = (steps as usize).clamp(WINDOW[0], WINDOW[1]);
            x.clone_from(&self.x);
            f = now;
        }
        Ok(quiet >= QUIET)
    }
}
