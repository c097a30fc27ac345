//! What no shop can hold: where a blank is laid, what fabric it is, how a robot presses. A path is worth
//! what it is worth in worlds that differ by that (for learning: Rajeswaran et al., "EPOpt", 2017).

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Misplacement, Scene, SceneError};
use drape_cloth::sim::{Accuracy, Parameters, Stepping};

use super::config::EnvConfig;

/// What varies from world to world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Where the blank is laid: along x and along y, its height [mm], and its turn [degrees];
    ShiftMm,
    HeightMm,
    TurnDeg,
    /// the height of the waves that it has before its fall [mm].
    WavinessMm,
    /// Factors on the fabric's laws, of warp and weft alike, and on its areal mass.
    Friction,
    Bending,
    Shear,
    Tension,
    Compression,
    ArealMass,
    /// Factors on the roller's pressure and on the side of the stencil.
    Pressure,
    Stencil,
    /// Where all presses of a world land, along either side of the stencil [mm] and about it [degrees],
    OffsetMm,
    TiltDeg,
    /// how far single ones scatter about that, normally,
    PressOffsetMm,
    PressTiltDeg,
    /// and the share of them that do not reach the cloth.
    PressMisses,
}

/// How a quantity varies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a standard deviation, or the two ends of a range"
)]
pub enum Spread {
    /// By the standard deviation of a normal distribution that is cut off at twice that; of a factor's
    /// logarithm.
    Deviation(f64),
    /// Uniformly between two ends.
    Range([f64; 2]),
}

/// What varies from world to world, and how paths are judged by that. What is not listed is as scene and
/// task say, and costs nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scatter {
    /// Judges by the mean over worlds (0), by that of their worst quarter (1), or in between.
    #[serde(default)]
    pub risk: f64,
    /// Substeps [1/s] by which paths are judged. If none are given, those of [`Scatter::suit`] where anything varies, and
    /// `accurate` where nothing does. A search takes each for an equal share of its time, in turns; proofs take the last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub substep_rates: Vec<f64>,
    /// Whether every episode of a training is in a world of its own, too.
    #[serde(default)]
    pub training: bool,
    #[serde(flatten)]
    pub spreads: BTreeMap<Quantity, Spread>,
}

/// Rates [1/s] that suit cells of this side [m], and how many times as fine they become at most.
const RATES: [f64; 2] = [1200.0, 2400.0];
const REFERENCE_CELL: f64 = 8e-3;
const MOST_FINER: f64 = 400.0;

impl Quantity {
    /// Least and greatest value.
    fn range(self) -> [f64; 2] {
        match self {
            _ if self.is_factor() => [1e-2, 1e2],
            Self::PressMisses => [0.0, 1.0],
            Self::TurnDeg | Self::TiltDeg | Self::PressTiltDeg => [-20.0, 20.0],
            _ => [-50.0, 50.0],
        }
    }

    fn is_factor(self) -> bool {
        Self::Friction <= self && self <= Self::Stencil
    }

    /// Whether blanks come to rest differently.
    fn changes_start(self) -> bool {
        self <= Self::ArealMass
    }

    /// As in files.
    pub fn name(self) -> String {
        let value = toml::Value::try_from(self).expect("it is a name");
        value.as_str().expect("it is a name").into()
    }
}

impl Scatter {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), ValueError> {
        for (&quantity, spread) in &self.spreads {
            let [least, greatest] = quantity.range();
            let most = if quantity.is_factor() {
                1.0
            } else {
                0.5 * greatest
            };
            let is_single = quantity >= Quantity::PressOffsetMm;
            let (found, is_valid) = match spread {
                Spread::Deviation(value) => (value.to_string(), (0.0..=most).contains(value)),
                Spread::Range([low, high]) => (
                    format!("[{low}, {high}]"),
                    least <= *low && low <= high && *high <= greatest && !is_single,
                ),
            };
            let kind = match quantity {
                Quantity::PressMisses => "share",
                _ => "standard deviation",
            };
            let mut expected = format!("a {kind} from 0 to {most}");
            if !is_single {
                expected += &format!(", or two ends of a range from {least} to {greatest}");
            }
            ValueError::unless(is_valid, &quantity.name(), found, expected)?;
        }
        let (key, count) = ("substep_rates", self.substep_rates.len());
        ValueError::unless(count <= 16, key, count, "at most 16 rates")?;
        for &rate in &self.substep_rates {
            let checked = with_rate(rate).check();
            checked.map_err(|error| ValueError::new(key, rate, error.expected))?;
        }
        let (found, expected) = (
            format!("{:?}", self.substep_rates),
            "each rate above the one before",
        );
        ValueError::unless(
            self.substep_rates.is_sorted_by(|a, b| a < b),
            key,
            found,
            expected,
        )?;
        ValueError::unless_within("risk", self.risk, [0.0, 1.0])
    }

    /// Judged alike, with only one quantity varying.
    pub fn only(&self, quantity: Quantity) -> Self {
        let mut one = self.clone();
        one.spreads.retain(|&other, _| other == quantity);
        one
    }

    /// What scores over worlds come to: between their mean and that of their worst quarter, by the risk.
    pub fn judge(&self, scores: &[f64]) -> f64 {
        let [mean, worst] = mean_and_worst_quarter(scores);
        (1.0 - self.risk) * mean + self.risk * worst
    }

    /// Where worlds differ and no rates are given, judges by 1200 and 2400 substeps a second, on cells of less than 8 mm by
    /// (8 mm / `cell`)² times as many: if the last were coarser, paths would rank otherwise than in fine steps
    /// (docs/SCATTER.md). Never in coarser steps than episodes have. `cell` is the shorter side of a cell [m].
    pub fn suit(&mut self, cell: f64, env: &EnvConfig) {
        if self.substep_rates.is_empty() && !self.spreads.is_empty() {
            let finer = (REFERENCE_CELL / cell).powi(2).clamp(1.0, MOST_FINER);
            let own = env.stepping().substep_rate;
            self.substep_rates = RATES.map(|rate| own.max(rate * finer.round())).to_vec();
            self.substep_rates.dedup();
        }
    }

    /// The task in steps of each rate by which paths are judged.
    pub fn rated(&self, env: &EnvConfig) -> Vec<EnvConfig> {
        let with = |stepping| {
            let mut env = env.clone();
            env.set_stepping(stepping);
            env
        };
        let (own, fine) = (env.stepping(), Accuracy::Accurate.stepping());
        match self.substep_rates.is_empty() {
            true => vec![with(Stepping {
                substep_rate: own.substep_rate.max(fine.substep_rate),
                contact_rate: own.contact_rate.max(fine.contact_rate),
            })],
            false => self
                .substep_rates
                .iter()
                .map(|&rate| with(with_rate(rate)))
                .collect(),
        }
    }

    /// The task in the last of these steps.
    pub fn finest(&self, env: &EnvConfig) -> EnvConfig {
        self.rated(env).pop().expect("one at least")
    }

    /// This scatter where a blank was fitted to a scan, `fit_error` [m] off it: it lies as far off its place and is as wavy,
    /// unless something is said of how it lies.
    fn about(&self, fit_error: f64) -> Self {
        let mut about = self.clone();
        let says = |&quantity: &Quantity| quantity <= Quantity::WavinessMm;
        if fit_error > 0.0 && !self.spreads.is_empty() && !self.spreads.keys().any(says) {
            let spread = Spread::Deviation(1e3 * fit_error);
            let added =
                [Quantity::ShiftMm, Quantity::WavinessMm].map(|quantity| (quantity, spread));
            about.spreads.extend(added);
        }
        about
    }

    /// One draw: a factor or a number, 1 or 0 where nothing varies.
    fn draw(&self, quantity: Quantity, stream: &mut Stream) -> f64 {
        let of = |value: f64| {
            if quantity.is_factor() {
                value.exp()
            } else {
                value
            }
        };
        match self.spreads.get(&quantity) {
            None => of(0.0),
            Some(Spread::Range([low, high])) => low + (high - low) * stream.uniform(),
            Some(Spread::Deviation(deviation)) => loop {
                let normal = stream.normal();
                if normal.abs() <= 2.0 {
                    break of(deviation * normal);
                }
            },
        }
    }

    /// Standard deviation from press to press, or the share of presses.
    fn deviation(&self, quantity: Quantity) -> f64 {
        match self.spreads.get(&quantity) {
            Some(Spread::Deviation(deviation)) => *deviation,
            _ => 0.0,
        }
    }

    /// A blank off its place, and what fabric it is.
    fn blank(&self, mut stream: Stream) -> (Misplacement, Parameters) {
        let shift = [Quantity::ShiftMm, Quantity::ShiftMm, Quantity::HeightMm];
        let off = Misplacement {
            shift: shift.map(|quantity| 1e-3 * self.draw(quantity, &mut stream)),
            turn: self.draw(Quantity::TurnDeg, &mut stream).to_radians(),
            wave: [
                1e-3 * self.draw(Quantity::WavinessMm, &mut stream),
                TAU * stream.uniform(),
                TAU * stream.uniform(),
            ],
        };
        let mut both = |quantity| [self.draw(quantity, &mut stream); 2];
        let fabric = Parameters {
            friction: both(Quantity::Friction),
            bending: both(Quantity::Bending),
            shear: both(Quantity::Shear),
            tension: both(Quantity::Tension),
            compression: both(Quantity::Compression),
            areal_mass: both(Quantity::ArealMass)[0],
            ..Parameters::default()
        };
        (off, fabric)
    }

    /// How a world is pressed.
    fn presses(&self, mut stream: Stream) -> Parameters {
        let mut draw = |quantity| self.draw(quantity, &mut stream);
        Parameters {
            pressure: draw(Quantity::Pressure),
            stencil: draw(Quantity::Stencil),
            offset_mm: [Quantity::OffsetMm; 2].map(&mut draw),
            tilt_deg: [Quantity::TiltDeg; 2].map(&mut draw),
            offset_deviation_mm: self.deviation(Quantity::PressOffsetMm),
            tilt_deviation_deg: self.deviation(Quantity::PressTiltDeg),
            misses: self.deviation(Quantity::PressMisses),
            seed: stream.bits() >> 1,
            ..Parameters::default()
        }
    }
}

/// The mean of some scores, and that of their worst quarter (the conditional value at risk, Rockafellar and
/// Uryasev 2000); no numbers if there are none.
pub fn mean_and_worst_quarter(scores: &[f64]) -> [f64; 2] {
    let mut sorted = scores.to_vec();
    sorted.sort_by(f64::total_cmp);
    let worst = &sorted[..sorted.len().div_ceil(4)];
    [&sorted, worst].map(|all| all.iter().sum::<f64>() / all.len() as f64)
}

/// Steps at a rate, with a fifth as many refreshes of contact.
fn with_rate(substep_rate: f64) -> Stepping {
    Stepping::every(substep_rate, 5)
}

/// Worlds to draw from: as many lies of the blank as have been simulated, each in its fabric, and any number
/// of ways to press them.
pub struct Worlds {
    pub scatter: Scatter,
    /// One at least.
    lies: Vec<Lie>,
    seed: u64,
}

/// How a blank lies.
struct Lie {
    scene: Arc<Scene>,
    off: Misplacement,
    fabric: Parameters,
}

/// One of many worlds.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatteredWorld {
    /// Number of its lie.
    pub lie: usize,
    /// How it differs, on top of what the task says.
    pub parameters: Parameters,
}

impl Worlds {
    /// Worlds round `scene`, the blanks of which fall now, `count` if they differ. Everything is drawn
    /// under `seed`. `progress` is told the simulated share 0..1.
    ///
    /// # Errors
    /// If a fall diverges.
    pub fn new(
        scene: &Arc<Scene>,
        scatter: &Scatter,
        count: usize,
        seed: u64,
        progress: impl FnMut(f64),
    ) -> Result<Self, SceneError> {
        let stream = |k| Stream::new(seed, Purpose::Worlds, k);
        let scatter = &scatter.about(scene.fit_error);
        let differ = scatter
            .spreads
            .keys()
            .any(|quantity| quantity.changes_start());
        let blanks: Vec<(Misplacement, Parameters)> = match differ {
            false => vec![Default::default()],
            true => (0..count as u32)
                .map(|k| scatter.blank(stream(k)))
                .collect(),
        };
        let scenes: Vec<Arc<Scene>> = match differ {
            false => vec![scene.clone()],
            true => scene
                .fallen(&blanks, progress)?
                .into_iter()
                .map(Arc::new)
                .collect(),
        };
        let lies = scenes.into_iter().zip(blanks);
        let lies = lies.map(|(scene, (off, fabric))| Lie { scene, off, fabric });
        Ok(Self {
            scatter: scatter.clone(),
            lies: lies.collect(),
            seed,
        })
    }

    /// The one world that is as the scene says.
    pub fn nominal(scene: &Arc<Scene>) -> Self {
        let none = Scatter::default();
        Self::new(scene, &none, 1, 0, |_| ()).expect("nothing falls")
    }

    /// Whether anything tells them apart.
    pub fn differ(&self) -> bool {
        !self.scatter.spreads.is_empty()
    }

    /// The scene of each lie.
    pub fn scenes(&self) -> impl Iterator<Item = &Arc<Scene>> {
        self.lies.iter().map(|lie| &lie.scene)
    }

    /// How far off its place the blank of a lie began its fall.
    pub fn misplacement(&self, lie: usize) -> Misplacement {
        self.lies[lie].off
    }

    /// The world of a number, always the same. Lies take turns, and begin one later each time.
    pub fn world(&self, number: u64) -> ScatteredWorld {
        let count = self.lies.len() as u64;
        let lie = ((number + number / count) % count) as usize;
        debug_assert!(
            number < 1 << 31,
            "numbers and lies have streams of their own"
        );
        let index = (number as u32) | 1 << 31;
        let presses = self
            .scatter
            .presses(Stream::new(self.seed, Purpose::Worlds, index));
        ScatteredWorld {
            lie,
            parameters: self.lies[lie].fabric.and(&presses),
        }
    }
}

#[cfg(test)]
mod tests;
