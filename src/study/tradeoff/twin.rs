use cpu_time::ProcessTime;
use serde::Serialize;

use super::settings::{CONVERGED, coarser};
use super::{TradeoffError, deviation, summed};
use crate::reference::{self, Diverged, Twin, TwinConfig, TwinError};
use crate::scene::{Scene, SceneConfig, SceneError};
use crate::sim::{Bending, BendingStiffness, Solver};

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

/// The twin could not fall.
#[derive(Debug, thiserror::Error)]
pub enum TwinnedError {
    #[error(transparent)]
    Study(#[from] TradeoffError),
    #[error(transparent)]
    Twin(#[from] TwinError),
    #[error(transparent)]
    Diverged(#[from] Diverged),
}

/// Lets the twin and the fast solver fall alike, on a mesh of twice the cell: the same mass,
/// bending stiffness, damping and clamps. A 33 x 33 twin takes 15 s and more.
pub fn against_twin(config: &SceneConfig) -> Result<Twinned, TwinnedError> {
    let mut config = config.clone();
    config.blank.vertices = coarser(&config).unwrap_or(config.blank.vertices);
    let mut hung = config.clone();
    (hung.fall.fall_s, hung.fall.settle_s) = (0.0, 0.0);
    let hung = Scene::new(&hung, |_| ()).map_err(TradeoffError::from)?;

    let start = ProcessTime::now();
    let damped = |damping| TwinConfig {
        bending_stiffness: match config.physics.bending_stiffness {
            _ if config.physics.bending == Bending::Off => {
                reference::BendingStiffness::NewtonMetre(0.0)
            }
            BendingStiffness::Material => reference::BendingStiffness::Material,
            BendingStiffness::NewtonMetre(d) => reference::BendingStiffness::NewtonMetre(d),
        },
        gravity: config.physics.gravity,
        friction: config.physics.friction,
        adhesion: config.physics.adhesion,
        damping,
        ..TwinConfig::default()
    };
    let fall = &config.fall;
    let mut falling = Twin::new(&hung.lamina, &damped(config.physics.damping))?;
    falling.set_positions(&hung.initial.position);
    for vertex in hung.initial.fixed.ones() {
        let at = hung.lamina.rest[vertex];
        let square =
            |place: [f64; 2]| (at[0] - 1e-3 * place[0]).powi(2) + (at[1] - 1e-3 * place[1]).powi(2);
        let by = |a: &&_, b: &&_| {
            let [a, b]: [&crate::scene::Clamp; 2] = [a, b];
            square(a.at_mm).total_cmp(&square(b.at_mm))
        };
        if let Some(clamp) = config.clamps.iter().min_by(by) {
            let velocity = clamp.move_mm.map(|way| 1e-3 * way / fall.fall_s.max(1e-9));
            falling.drive(vertex as u32, velocity);
        }
    }
    falling.advance(Some(&hung.tool), fall.fall_s)?;
    let mut settling = Twin::new(&hung.lamina, &damped(fall.settle_damping))?;
    settling.set_positions(&falling.positions());
    settling.set_velocities(&falling.velocities());
    for vertex in hung.initial.fixed.ones() {
        settling.fix(vertex as u32);
    }
    settling.advance(Some(&hung.tool), fall.settle_s)?;
    let seconds = start.elapsed().as_secs_f64();

    let twin = settling.positions();
    let all: Vec<[usize; 2]> = (0..twin.len()).map(|v| [v, v]).collect();
    let mut falls = Vec::new();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for rate in [300.0, 600.0, 1200.0, 6000.0, CONVERGED.0] {
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
                    [fallen.mean_mm, fallen.max_mm] = deviation(x, &twin, &all);
                    fallen.distance_m = summed(&hung.tool, x, &all, 0);
                }
                Err(SceneError::Diverged { .. }) => {}
                Err(error) => return Err(TradeoffError::from(error).into()),
            }
            falls.push(fallen);
        }
    }
    Ok(Twinned {
        vertices: twin.len(),
        distance_m: summed(&hung.tool, &twin, &all, 0),
        seconds,
        falls,
    })
}
