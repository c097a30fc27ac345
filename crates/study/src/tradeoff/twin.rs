use cpu_time::ProcessTime;
use serde::Serialize;

use crate::points::{apart_mm, coarser, distance};
use crate::twin::{TwinStudyError, fallen, twin_config, unfallen};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::Solver;

/// Falls of the fast solver against that of the finite-element twin.
#[derive(Clone, Debug, Serialize)]
pub struct Twinned {
    /// Of the mesh that both have.
    pub vertices: usize,
    /// Summed distance to the tool that the twin's fall leaves [m].
    pub distance_m: f64,
    /// CPU time of its fall [s].
    pub seconds: f64,
    pub falls: Vec<TwinnedFall>,
}

/// A fall of the fast solver; NaN where it diverged.
#[derive(Clone, Debug, Serialize)]
pub struct TwinnedFall {
    pub solver: Solver,
    pub substep_rate: f64,
    /// CPU time [s].
    pub seconds: f64,
    /// Distance from the twin between the same material points.
    pub mean_mm: f64,
    pub max_mm: f64,
    pub distance_m: f64,
}

/// Lets the twin and the fast solver fall alike, on a mesh of twice the cell: the same mass,
/// bending stiffness, damping and clamps; on the scene's own mesh where that cannot be halved. A 33 x 33 twin takes 15 s and more.
///
/// # Errors
/// If the twin has nothing for what the scene asks, or diverges.
pub fn against_twin(config: &SceneConfig) -> Result<Twinned, TwinStudyError> {
    let mut config = config.clone();
    config.blank.vertices = coarser(&config).unwrap_or(config.blank.vertices);
    let damped = twin_config(&config)?;
    let hung = unfallen(&config)?;

    let start = ProcessTime::now();
    let twin = fallen(&hung, &damped)?.positions();
    let seconds = start.elapsed().as_secs_f64();
    let all: Vec<[usize; 2]> = (0..twin.len()).map(|v| [v, v]).collect();
    let mut falls = Vec::new();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for rate in [300.0, 600.0, 1200.0, 6000.0, 12_000.0] {
            let mut fast = config.clone();
            fast.physics.solver = solver;
            fast.fall.substep_rate = rate;
            let start = ProcessTime::now();
            let mut fallen = TwinnedFall {
                solver,
                substep_rate: rate,
                seconds: f64::NAN,
                mean_mm: f64::NAN,
                max_mm: f64::NAN,
                distance_m: f64::NAN,
            };
            match Scene::new(&fast, |_| ()) {
                Ok(scene) => {
                    fallen.seconds = start.elapsed().as_secs_f64();
                    let x = &scene.initial.position;
                    [fallen.mean_mm, fallen.max_mm] = apart_mm(x, &twin, &all);
                    fallen.distance_m = distance(&hung.tool, 0..x.len(), x);
                }
                Err(SceneError::Diverged { .. }) => {}
                Err(error) => return Err(error.into()),
            }
            falls.push(fallen);
        }
    }
    Ok(Twinned {
        vertices: twin.len(),
        distance_m: distance(&hung.tool, 0..twin.len(), &twin),
        seconds,
        falls,
    })
}
