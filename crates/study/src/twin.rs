//! The paper's test case (Section 7.2) in the finite-element twin: fall of the blank, then a
//! list of presses, as it is and accelerated, next to the fast solver.
//!
//! Both start from the same flat blank with the same mass, bending stiffness, damping and
//! clamps, and are pressed at the same vertices. Speeds are not capped in the twin, and its
//! roller stops cloth by pressure where the fast solver's stencil has a place.

mod convergence;

use std::sync::Arc;

use cpu_time::{ProcessTime, ThreadTime};
use serde::Serialize;

use super::compare::{Comparison, Criteria, Surveyed, compare};
use super::points::distance;
use drape_cloth::fabric::{Drape, Lamina};
use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::mesh::compare::SheetError;
use drape_cloth::scene::{Scene, SceneConfig, SceneError, hung};
use drape_cloth::sim::{Bending, BendingStiffness, Compression, SelfCollision};
use drape_cloth::tool::Tool;
use drape_cloth::twin::{Diverged, Energies, Hold, PressConfig, Twin, TwinConfig};
use drape_task::env::{Draping, EnvConfig, EnvError};

pub use convergence::SelfComparison;

/// Inertia over mass of the paper's accelerated variant: 8.15 h become 40.2 min.
pub const ACCELERATION: f64 = 148.0;
/// How fast the twin's roller comes down [m/s]: as the stencil of the fast solver comes down on
/// a wrinkle of 33 mm, and as fast as speeds are capped at there.
pub const SPEED: f64 = 4.0;
/// Cells under the stencil's side, at least: 18 mm on the paper's mesh are three.
const STENCIL_CELLS: f64 = 3.0;

/// A case that cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum TwinStudyError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Env(#[from] EnvError),
    #[error(transparent)]
    Twin(#[from] ValueError),
    #[error("{name}: {source}")]
    Diverged {
        name: &'static str,
        source: Diverged,
    },
    #[error("the fast solver diverged on the way")]
    FastDiverged,
    #[error("{name}: {source}")]
    Sheet {
        name: &'static str,
        source: SheetError,
    },
}

/// Side of the stencil [mm] on a mesh: `side_mm`, but at least three cells, so that as many
/// vertices are under it as on the paper's mesh.
pub fn stencil_mm(lamina: &Lamina, side_mm: f64) -> f64 {
    let cell = 1e3 * lamina.cell_diagonal() / std::f64::consts::SQRT_2;
    side_mm.max(STENCIL_CELLS * cell)
}

/// The twin's configuration for the physics of a scene.
///
/// # Errors
/// Names the first key whose value the twin has nothing for.
pub fn twin_config(scene: &SceneConfig) -> Result<TwinConfig, SceneError> {
    let physics = &scene.physics;
    let refuse = |is_valid, key: &str, found: &str, expected| {
        let checked = ValueError::unless(is_valid, key, found, expected);
        checked.map_err(|error| error.within("physics"))
    };
    let found = format!("{:?}", physics.self_collision).to_lowercase();
    let is_off = physics.self_collision == SelfCollision::Off;
    let expected = "off: the twin's cloth does not touch itself";
    refuse(is_off, "self_collision", &found, expected)?;
    let expected = "true: the twin's fabric resists shear";
    refuse(physics.shear, "shear", "false", expected)?;
    let is_plain = physics.compression == Compression::Material;
    let expected = "material: the twin has no other";
    refuse(is_plain, "compression", "as_tension", expected)?;
    let limit = physics.strain_limit.unwrap_or(f64::INFINITY).to_string();
    let expected = "none: the twin's yarns go on with their slope";
    refuse(
        physics.strain_limit.is_none(),
        "strain_limit",
        &limit,
        expected,
    )?;
    Ok(TwinConfig {
        bending_stiffness: match (physics.bending, physics.bending_stiffness) {
            (Bending::Off, _) => Some([0.0; 2]),
            (_, BendingStiffness::Material) => None,
            (_, BendingStiffness::NewtonMetre(d)) => Some([d; 2]),
        },
        gravity: physics.gravity,
        friction: physics.friction,
        adhesion: physics.adhesion,
        damping: physics.damping,
        ..TwinConfig::default()
    })
}

/// How the twin's roller, which comes down at `speed` [m/s], presses where the environment's
/// stencil does: as long, and with the same distance for draped.
pub fn press_config(env: &EnvConfig, hold: Hold, speed: f64) -> PressConfig {
    PressConfig {
        speed,
        press_s: env.press_s,
        settle_s: env.settle_s,
        drape_threshold_mm: env.drape_threshold_mm,
        hold,
    }
}

/// A twin that has fallen as the scene says. Clamps move evenly during the fall, then stay;
/// settling has the scene's own damping unless the twin has none at all.
pub fn fallen(scene: &Scene, config: &TwinConfig) -> Result<Twin, TwinStudyError> {
    let [fall_s, settle_s] = scene.config.durations();
    let start = hung(&scene.config, &scene.lamina, fall_s)?;
    let mut twin = Twin::new(&scene.lamina, config)?;
    twin.set_positions(&start.position);
    for v in start.fixed.ones() {
        twin.drive(v as u32, start.velocity[v]);
    }
    let name = "the twin's fall";
    let diverged = |source| TwinStudyError::Diverged { name, source };
    let tool = Some(&scene.tool);
    twin.advance(tool, fall_s).map_err(diverged)?;
    for v in start.fixed.ones() {
        twin.fix(v as u32);
    }
    if config.damping > 0.0 {
        twin.set_damping(scene.config.fall.settle_damping);
    }
    twin.advance(tool, settle_s).map_err(diverged)?;
    twin.set_damping(config.damping);
    Ok(twin)
}

/// A scene before its fall, with the durations of the fall, for [`fallen`].
///
/// # Errors
/// If the scene is not valid.
pub fn unfallen(config: &SceneConfig) -> Result<Scene, SceneError> {
    let mut hung = config.clone();
    (hung.fall.fall_s, hung.fall.settle_s) = (0.0, 0.0);
    let mut hung = Scene::new(&hung, |_| ())?;
    hung.config = config.clone();
    Ok(hung)
}

/// A twin at rest at `positions` [m], its clamps where they are there.
pub fn lying(
    scene: &Scene,
    config: &TwinConfig,
    positions: &[[f64; 3]],
) -> Result<Twin, ValueError> {
    let mut twin = Twin::new(&scene.lamina, config)?;
    twin.set_positions(positions);
    for v in scene.initial.fixed.ones() {
        twin.fix(v as u32);
    }
    Ok(twin)
}

/// One model's run of the case.
#[derive(Clone, Debug, Serialize)]
pub struct Ran {
    pub name: &'static str,
    /// CPU time of the fall and of all presses [s].
    pub fall_cpu_s: f64,
    pub press_cpu_s: f64,
    /// Summed distance of the region to the tool before the first press and after the last [m].
    pub region_initial_m: f64,
    pub region_left_m: f64,
    /// Vertices of the region that are held on the tool.
    pub draped: usize,
    /// Largest stable step before the presses [s]; for the fast solver its substep there.
    pub time_step_s: f64,
    /// Root mean square speed before the presses and after them [mm/s].
    pub v_rms_mm_s: [f64; 2],
    /// Balance of the twin after the fall and after the presses, from the start of the fall.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<[Balance; 2]>,
    #[serde(skip)]
    pub initial: Vec<[f64; 3]>,
    #[serde(skip)]
    pub end: Vec<[f64; 3]>,
}

/// Where the energy has gone.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Balance {
    #[serde(flatten)]
    pub energies: Energies,
    /// What the integration has lost [J], and its size over the largest of the amounts.
    pub residual: f64,
    pub residual_share: f64,
}

impl Balance {
    fn new(energies: Energies) -> Self {
        let residual = energies.residual();
        let size = energies.size().max(f64::MIN_POSITIVE);
        Self {
            energies,
            residual,
            residual_share: residual.abs() / size,
        }
    }
}

impl Ran {
    /// CPU time of all [s].
    pub fn cpu_s(&self) -> f64 {
        self.fall_cpu_s + self.press_cpu_s
    }
}

/// The case: a scene, a region with its stencil, and the vertices to press.
pub struct Case<'a> {
    pub scene: &'a Arc<Scene>,
    /// CPU time of the fast solver's fall [s].
    pub fall_cpu_s: f64,
    pub env: &'a EnvConfig,
    pub sequence: &'a [u32],
    pub hold: Hold,
    /// How fast the twin's roller comes down [m/s].
    pub speed: f64,
    /// Inertia over mass of the accelerated twin.
    pub acceleration: f64,
}

/// Sets up the fast solver's scene. Gives its CPU time [s] too, without that of the tool.
pub fn set_up(
    config: &SceneConfig,
    progress: impl FnMut(f64),
) -> Result<(Arc<Scene>, f64), SceneError> {
    twin_config(config)?;
    config.check()?;
    let start = ProcessTime::now();
    Tool::new(&config.tool)?;
    let tool = start.elapsed();
    let start = ProcessTime::now();
    let scene = Scene::new(config, progress)?;
    let cpu = start.elapsed().saturating_sub(tool);
    Ok((Arc::new(scene), cpu.as_secs_f64()))
}

impl Case<'_> {
    /// Fast solver, twin and accelerated twin, in this order; the twins on a thread each.
    /// `progress` is told the share of the twin's presses that are done, 0..=1.
    ///
    /// # Errors
    /// If the scene has what the twin has nothing for, or one of them diverges.
    pub fn run(&self, progress: impl FnMut(f64)) -> Result<[Ran; 3], TwinStudyError> {
        let baseline = twin_config(&self.scene.config)?;
        let accelerated = baseline.accelerated(self.acceleration);
        let fast = self.fast()?;
        let (twin, accelerated) = std::thread::scope(|scope| {
            let other = scope.spawn(|| self.twin("accelerated", &accelerated, 0.0, |_| ()));
            let twin = self.twin("twin", &baseline, 0.0, progress);
            (twin, other.join().expect("the twin does not panic"))
        });
        Ok([fast, twin?, accelerated?])
    }

    fn fast(&self) -> Result<Ran, TwinStudyError> {
        let mut env = Draping::new(self.scene.clone(), self.env, 1)?;
        let initial = env.state(0);
        let start = ProcessTime::now();
        for &vertex in self.sequence {
            if env.press(&[Some(vertex)]) != [true] {
                return Err(TwinStudyError::FastDiverged);
            }
        }
        let press_cpu_s = start.elapsed().as_secs_f64();
        let end = env.state(0);
        let region = &env.region().vertices;
        Ok(Ran {
            name: "fast",
            fall_cpu_s: self.fall_cpu_s,
            press_cpu_s,
            region_initial_m: env.region_distance(&initial),
            region_left_m: env.region_distance(&end),
            draped: env.draped(0).intersection(region).count(),
            time_step_s: 1.0 / self.env.stepping().substep_rate,
            v_rms_mm_s: [&initial, &end].map(|state| 1e3 * state.v_rms()),
            energy: None,
            initial: initial.position,
            end: end.position,
        })
    }

    /// Fall and presses of the twin, between which every free vertex is pushed, normally
    /// distributed with `push` [m].
    fn twin(
        &self,
        name: &'static str,
        config: &TwinConfig,
        push: f64,
        mut progress: impl FnMut(f64),
    ) -> Result<Ran, TwinStudyError> {
        let scene = self.scene;
        let region = self.env.region(&scene.lamina)?.vertices;
        let start = ThreadTime::now();
        let mut twin = fallen(scene, config)?;
        let fall_cpu_s = start.elapsed().as_secs_f64();
        if push > 0.0 {
            let mut pushed = twin.positions();
            let mut stream = Stream::new(1, Purpose::Evaluation, 0);
            for (v, x) in pushed.iter_mut().enumerate() {
                if !scene.initial.fixed.contains(v) {
                    *x = x.map(|x| x + push * stream.normal());
                }
            }
            twin.set_positions(&pushed);
        }
        let initial = twin.positions();
        let before = (Balance::new(twin.energies()), 1e3 * twin.speed());
        let time_step_s = twin.stable_time_step();

        let press = press_config(self.env, self.hold, self.speed);
        let side = 1e-3 * self.env.stencil_mm;
        let start = ThreadTime::now();
        let presses = (self.sequence, side);
        let mut done = 0;
        let watch = |_: &Twin| {
            done += 1;
            progress(done as f64 / self.sequence.len() as f64);
        };
        let replay = twin.replay(&scene.lamina, &scene.tool, &press, presses, watch);
        if let Some(source) = replay.diverged {
            return Err(TwinStudyError::Diverged { name, source });
        }
        let press_cpu_s = start.elapsed().as_secs_f64();
        let end = twin.positions();
        let left = |positions: &[_]| distance(&scene.tool, region.ones(), positions);
        let in_region = replay
            .draped
            .iter()
            .filter(|&&v| region.contains(v as usize));
        Ok(Ran {
            name,
            fall_cpu_s,
            press_cpu_s,
            region_initial_m: left(&initial),
            region_left_m: left(&end),
            draped: in_region.count(),
            time_step_s,
            v_rms_mm_s: [before.1, 1e3 * twin.speed()],
            energy: Some([before.0, Balance::new(twin.energies())]),
            initial,
            end,
        })
    }
}

/// A drape next to the twin's.
pub struct Compared {
    /// `initial` or `draped`.
    pub moment: &'static str,
    /// What is compared with the twin.
    pub name: &'static str,
    pub surface: Surveyed,
    pub reference: Surveyed,
    pub comparison: Comparison,
}

/// Fast against twin and accelerated against twin, before the presses and after them, with a
/// `region` [m on the flat blank].
pub fn compare_all(
    scene: &Scene,
    runs: &[Ran; 3],
    region: Option<[f64; 4]>,
) -> Result<Vec<Compared>, TwinStudyError> {
    let criteria = Criteria {
        tool: Some(&scene.tool.surface),
        region,
        ..Criteria::default()
    };
    let [fast, twin, accelerated] = runs;
    let mut all = Vec::new();
    for moment in ["initial", "draped"] {
        let survey = |ran: &Ran| {
            let position = match moment {
                "initial" => &ran.initial,
                _ => &ran.end,
            };
            let drape = Drape::new(&scene.lamina, position);
            let name = ran.name;
            Surveyed::draped(drape).map_err(|source| TwinStudyError::Sheet { name, source })
        };
        let reference = survey(twin)?;
        for ran in [fast, accelerated] {
            let surface = survey(ran)?;
            all.push(Compared {
                moment,
                name: ran.name,
                comparison: compare(&surface, &reference, &criteria),
                surface,
                reference: reference.clone(),
            });
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests;
