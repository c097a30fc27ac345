//! The case: fall and presses of the fast solver, of the twin, and of the twin with scaled mass.

use std::sync::Arc;
use std::thread::Builder;

use cpu_time::{ProcessTime, ThreadTime};

use crate::points::{apart_mm, coarser, same_points, summed_m};
use crate::study::StudyError;
use drape_cloth::scene::{Misplacement, Scene};
use drape_cloth::sim::{Presses, Snapshot};
use drape_cloth::twin::{Energies, Hold, Twin, TwinConfig};
use drape_proof::presses::{Positions, pushed};
use drape_proof::twin::{fallen, press_config, twin_config, twin_of, unfallen};
use drape_task::env::{Draping, EnvConfig, Region};

/// Inertia over mass of the paper's accelerated variant: 8.15 h become 40.2 min.
const ACCELERATION: f64 = 148.0;

/// A scene, a region with its stencil, and the vertices to press.
pub struct PaperCase {
    pub scene: Arc<Scene>,
    /// CPU time of the fast solver's fall [s].
    pub fall_cpu_s: f64,
    pub env: EnvConfig,
    pub region: Region,
    pub sequence: Vec<u32>,
}

/// One model's run of the case.
#[derive(Clone, Debug)]
pub struct Ran {
    pub name: &'static str,
    /// CPU time of the fall and of all presses [s].
    pub fall_cpu_s: f64,
    pub press_cpu_s: f64,
    /// Vertices that are held on the tool.
    pub draped: Vec<u32>,
    /// Largest stable step before the presses [s]; for the fast solver its substep there.
    pub time_step_s: f64,
    /// Root mean square speed before the presses and after them [m/s].
    pub v_rms: [f64; 2],
    /// Of the twin, after the fall and after the presses, from the start of the fall.
    pub energy: Option<[Energies; 2]>,
    /// Positions before the presses and after them [m].
    pub ends: [Positions; 2],
}

impl Ran {
    /// CPU time of all [s].
    pub fn cpu_s(&self) -> f64 {
        self.fall_cpu_s + self.press_cpu_s
    }
}

fn draped(state: &Snapshot) -> Vec<u32> {
    state.pressed.draped.ones().map(|v| v as u32).collect()
}

impl PaperCase {
    /// Summed distance of the region to the tool [m].
    pub fn distance_m(&self, positions: &Positions) -> f64 {
        let tool = &self.scene.tool;
        tool.summed_distance(self.region.vertices.ones(), positions)
    }

    /// Fast solver, twin and accelerated twin, in this order; the twins on a thread each.
    /// `progress` is told the share of the twin's presses that are done, 0..=1. Fails if one of
    /// them diverges.
    pub fn run(&self, progress: impl FnMut(f64)) -> Result<[Ran; 3], StudyError> {
        let baseline = twin_of(&self.scene)?;
        let accelerated = baseline.accelerated(ACCELERATION);
        let fast = self.fast()?;
        std::thread::scope(|scope| {
            let other = || self.twin("accelerated", &accelerated, false, |_| ());
            let other = Builder::new().spawn_scoped(scope, other)?;
            let twin = self.twin("twin", &baseline, false, progress);
            let accelerated = other.join().expect("the twin does not panic");
            Ok([fast, twin?, accelerated?])
        })
    }

    fn fast(&self) -> Result<Ran, StudyError> {
        let mut env = Draping::new(self.scene.clone(), &self.env, 1)?;
        let initial = env.state(0);
        let start = ProcessTime::now();
        let ended = env.replay(&[&self.sequence], |_, _, _| ());
        let press_cpu_s = start.elapsed().as_secs_f64();
        ended[0].map_err(|_| StudyError::FastDiverged)?;
        let end = env.state(0);
        Ok(Ran {
            name: "fast",
            fall_cpu_s: self.fall_cpu_s,
            press_cpu_s,
            draped: draped(&end),
            time_step_s: 1.0 / self.env.stepping().substep_rate,
            v_rms: [&initial, &end].map(Snapshot::v_rms),
            energy: None,
            ends: [initial.position, end.position],
        })
    }

    /// Fall and presses of the twin, the latter from a [`pushed`] start or not.
    fn twin(
        &self,
        name: &'static str,
        config: &TwinConfig,
        is_pushed: bool,
        mut progress: impl FnMut(f64),
    ) -> Result<Ran, StudyError> {
        let scene = &self.scene;
        let start = ThreadTime::now();
        let mut twin = fallen(scene, config, &Misplacement::default())?;
        let fall_cpu_s = start.elapsed().as_secs_f64();
        if is_pushed {
            twin.set_positions(&pushed(scene, twin.positions(), 0));
        }
        let initial = twin.positions();
        let (energy, speed) = (twin.energies(), twin.speed());
        let time_step_s = twin.stable_time_step();

        let start = ThreadTime::now();
        let press = press_config(&self.env, Hold::Pressure);
        let (list, side) = (&self.sequence, 1e-3 * self.env.stencil_mm);
        let told = |_: &Twin, presses: &Presses| {
            progress(presses.len() as f64 / self.sequence.len() as f64);
        };
        let ended = twin.replay(&scene.lamina, &scene.tool, &press, list, side, told);
        ended.map_err(|error| StudyError::Named(name, error.into()))?;
        Ok(Ran {
            name,
            fall_cpu_s,
            press_cpu_s: start.elapsed().as_secs_f64(),
            draped: draped(&twin.snapshot()),
            time_step_s,
            v_rms: [speed, twin.speed()],
            energy: Some([energy, twin.energies()]),
            ends: [initial, twin.positions()],
        })
    }

    /// Holds variants against `twin`, this case's baseline, each on a thread: half the time step
    /// throughout; presses from a start pushed by a micrometre; and, for a plain rectangle with
    /// even numbers of cells, the fall with cells twice as wide. Fails if one diverges.
    pub fn converge(&self, twin: &Ran) -> Result<Vec<SelfComparison>, StudyError> {
        let config = twin_of(&self.scene)?;
        let mut finer = config.clone();
        finer.safety *= 0.5;
        std::thread::scope(|scope| {
            let half = || self.twin("half step", &finer, false, |_| ());
            let half = Builder::new().spawn_scoped(scope, half)?;
            let pushed = || self.twin("pushed start", &config, true, |_| ());
            let pushed = Builder::new().spawn_scoped(scope, pushed)?;
            let coarse = self.coarser_fall(twin);
            let (tool, mut found) = (&self.scene.tool, Vec::new());
            for ran in [half, pushed] {
                let ran = ran.join().expect("the twin does not panic")?;
                let all: Vec<[usize; 2]> = (0..ran.ends[0].len()).map(|v| [v, v]).collect();
                found.push(SelfComparison {
                    name: ran.name,
                    vertices: all.len(),
                    time_step_s: ran.time_step_s,
                    initial_mm: apart_mm(&ran.ends[0], &twin.ends[0], &all),
                    initial_m: summed_m(tool, [&ran.ends[0], &twin.ends[0]], &all),
                    draped_mm: apart_mm(&ran.ends[1], &twin.ends[1], &all),
                    left_m: [&ran, twin].map(|ran| self.distance_m(&ran.ends[1])),
                });
            }
            found.extend(coarse?);
            Ok(found)
        })
    }

    fn coarser_fall(&self, twin: &Ran) -> Result<Option<SelfComparison>, StudyError> {
        let Some(vertices) = coarser(&self.scene.config) else {
            return Ok(None);
        };
        let mut config = self.scene.config.clone();
        config.blank.vertices = vertices;
        let coarse = unfallen(&config)?;
        // By vertices alone as well where such cells are coarser than the tool: that is what it shows.
        let settled = fallen(&coarse, &twin_config(&config)?, &Misplacement::default())?;
        let x = settled.positions();
        let pairs = same_points(&coarse.lamina.rest, &self.scene.lamina.rest);
        Ok(Some(SelfComparison {
            name: "twice the cell",
            vertices: x.len(),
            time_step_s: settled.stable_time_step(),
            initial_mm: apart_mm(&x, &twin.ends[0], &pairs),
            initial_m: summed_m(&self.scene.tool, [&x, &twin.ends[0]], &pairs),
            draped_mm: [f64::NAN; 2],
            left_m: [f64::NAN; 2],
        }))
    }
}

/// How far a variant of the twin ends from the twin, between the same material points.
pub struct SelfComparison {
    pub name: &'static str,
    /// Of the variant's mesh.
    pub vertices: usize,
    /// Its largest stable step before the presses, times its safety [s].
    pub time_step_s: f64,
    /// Mean and greatest distance after the fall [mm].
    pub initial_mm: [f64; 2],
    /// Summed distance of these points to the tool then: the variant's, the twin's [m].
    pub initial_m: [f64; 2],
    /// Mean and greatest distance after the presses [mm], and the summed one of the region then;
    /// NaN on another mesh, where the same presses act on other patches.
    pub draped_mm: [f64; 2],
    pub left_m: [f64; 2],
}
