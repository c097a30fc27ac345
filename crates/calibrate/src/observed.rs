use std::sync::Arc;

use drape_cloth::file::ValueError;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::compare::{Sheet, SheetError};
use drape_cloth::scene::{Misplacement, Scene, SceneError};
use drape_cloth::sim::Parameters;
use drape_task::env::{Draping, EnvConfig, Member, Quantity, ReplayDiverged};

use crate::estimate::{Estimate, Query, estimate};

/// What scans may tell, in the order of [`Factors`].
pub const FACTORS: [Quantity; 4] = [
    Quantity::Friction,
    Quantity::Bending,
    Quantity::Shear,
    Quantity::Tension,
];

/// One number for each of [`FACTORS`].
pub type Factors = [f64; 4];

/// Push of a blank that tells how chaotic its fall is [m].
const PUSH: f64 = 1e-6;

/// Most points of a scan that are used: neighbours tell the same.
const MOST_POINTS: usize = 3000;

/// Neighbourhoods along the longest side of a scan.
const BLOCKS: f64 = 3.0;

/// A state of cloth that was seen.
pub struct ObservedCloth {
    /// What fell, as its configuration says.
    pub scene: Arc<Scene>,
    /// How it was pressed, and where; nowhere if it only fell.
    pub env: EnvConfig,
    pub presses: Vec<u32>,
    /// Points on the cloth, in the frame of the scene [m].
    points: Vec<Vec3>,
}

/// A world that cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Value(#[from] ValueError),
    #[error(transparent)]
    Presses(#[from] ReplayDiverged),
    #[error("the simulated cloth has no upper side")]
    Sheet(#[from] SheetError),
}

impl ObservedCloth {
    /// A scan of the cloth of a scene after presses, as they are made in `env`. Of many points every so manieth is used.
    pub fn new(scene: Arc<Scene>, env: EnvConfig, presses: Vec<u32>, points: &[Vec3]) -> Self {
        let every = points.len().div_ceil(MOST_POINTS).max(1);
        Self {
            points: points.iter().copied().step_by(every).collect(),
            scene,
            env,
            presses,
        }
    }

    /// Numbers of neighbourhoods, from `first` on.
    fn blocks(&self, first: usize) -> Vec<usize> {
        let ends = |start: f64, of: fn(f64, f64) -> f64| {
            let fold = |ends: Vec3, x: &Vec3| ends.zip_map(x, of);
            self.points.iter().fold(Vec3::repeat(start), fold)
        };
        let low = ends(f64::INFINITY, f64::min);
        let side = (ends(f64::NEG_INFINITY, f64::max) - low).max() / BLOCKS;
        let place = |x: &Vec3| (x - low).map(|d| (d / side.max(f64::MIN_POSITIVE)) as u32);
        let places = || self.points.iter().map(|x| <[u32; 3]>::from(place(x)));
        let mut known: Vec<[u32; 3]> = places().collect();
        known.sort_unstable();
        known.dedup();
        let number = |place| known.binary_search(&place).expect("it is among them");
        places().map(|place| first + number(place)).collect()
    }

    /// Distances of the points from the simulated cloth along its normal in each of many worlds [m]; NaN
    /// where a point lies farther beside the cloth than a cell is long.
    fn residuals(
        &self,
        queries: &[Query],
        progress: impl FnMut(f64),
    ) -> Result<Vec<Vec<f64>>, SimulationError> {
        let blanks: Vec<(Misplacement, Parameters)> = queries.iter().map(blank).collect();
        let scenes = match self.scene.config.placement.scan {
            // Whatever its laws, the blank lay where it was scanned.
            Some(_) => blanks.iter().map(|(off, _)| self.begun(off)).collect(),
            None => self.scene.fallen(&blanks, progress)?,
        };
        let states = match self.presses.is_empty() {
            true => (scenes.iter().map(|scene| scene.initial.position.clone())).collect(),
            false => self.pressed(scenes, &blanks)?,
        };
        let cell = self.scene.lamina.cell_diagonal();
        let of_state = |at: &Vec<[f64; 3]>| {
            let mesh = self.scene.lamina.mesh(&self.scene.tool.in_scene(at));
            let sheet = Sheet::new(&mesh)?;
            let residual = |&x: &Vec3| {
                let foot = sheet.foot(x);
                let aside = (foot.distance.powi(2) - foot.deviation.powi(2))
                    .max(0.0)
                    .sqrt();
                match foot.is_beyond && aside > cell {
                    true => f64::NAN,
                    false => foot.deviation,
                }
            };
            Ok(self.points.iter().map(residual).collect())
        };
        states.iter().map(of_state).collect()
    }

    /// The scene with its blank shifted from where it starts.
    fn begun(&self, off: &Misplacement) -> Scene {
        let mut state = (*self.scene.initial).clone();
        for (v, x) in state.position.iter_mut().enumerate() {
            if !state.fixed.contains(v) {
                *x = (Vec3::from(*x) + Vec3::from(off.shift)).into();
            }
        }
        Scene {
            initial: state.into(),
            ..(*self.scene).clone()
        }
    }

    /// Where each of the blanks is after the presses.
    fn pressed(
        &self,
        scenes: Vec<Scene>,
        blanks: &[(Misplacement, Parameters)],
    ) -> Result<Vec<Vec<[f64; 3]>>, SimulationError> {
        let member = |(scene, (_, fabric)): (Scene, &(Misplacement, Parameters))| Member {
            scene: Arc::new(scene),
            config: EnvConfig {
                parameters: self.env.parameters.and(fabric),
                ..self.env.clone()
            },
            count: 1,
            worlds: None,
        };
        let members = scenes.into_iter().zip(blanks).map(member).collect();
        let mut draping = Draping::on(members, &Default::default())?;
        let lists = vec![&self.presses[..]; blanks.len()];
        let mut states = vec![Vec::new(); blanks.len()];
        let ended = draping.replay(&lists, |draping, index, presses| {
            if presses == self.presses.len() {
                states[index] = draping.state(index).position;
            }
        });
        ended.into_iter().collect::<Result<Vec<()>, _>>()?;
        Ok(states)
    }
}

/// The blank of a query, and its fabric.
fn blank(query: &Query) -> (Misplacement, Parameters) {
    let [friction, bending, shear, tension] = [0, 1, 2, 3].map(|k| [query.at[k].exp(); 2]);
    let push = query.push.map_or(Vec3::zeros(), |number| {
        let (sin, cos) = (number as f64).sin_cos();
        PUSH * Vec3::new(cos, sin, 0.0)
    });
    let off = Misplacement {
        shift: push.into(),
        ..Misplacement::default()
    };
    let fabric = Parameters {
        friction,
        bending,
        shear,
        tension,
        ..Parameters::default()
    };
    (off, fabric)
}

/// How much wider deviations are than residuals say: cloth is not the solver, and how both differ does not show in them.
/// Held against states of the finite-element twin (docs/CALIBRATE.md).
const BETWEEN_MODELS: f64 = 2.0;

/// The logarithms of [`FACTORS`] that explain all states best, with deviations twice as wide as residuals say, but no wider
/// than before. `prior` has the standard deviations of their
/// logarithms. `progress` is told the number of the evaluation and the simulated share of it.
///
/// Gives also the share of the points of each state that are within a cell's diagonal of the simulated cloth.
///
/// # Errors
/// If a world diverges on the way.
pub fn explain(
    states: &[ObservedCloth],
    prior: Factors,
    mut progress: impl FnMut(usize, f64),
) -> Result<(Estimate, Vec<f64>), SimulationError> {
    let (mut blocks, mut near) = (Vec::new(), Vec::new());
    for state in states {
        let first = blocks.iter().max().map_or(0, |last| last + 1);
        blocks.extend(state.blocks(first));
    }
    let mut number = 0;
    let simulate = |queries: &[Query]| {
        number += 1;
        near.clear();
        let mut all: Vec<Vec<f64>> = vec![Vec::new(); queries.len()];
        for (k, state) in states.iter().enumerate() {
            let share = |share: f64| (k as f64 + share) / states.len() as f64;
            let found = state.residuals(queries, |at| progress(number, share(at)))?;
            let most = state.scene.lamina.cell_diagonal();
            let counted = found[0].iter().filter(|off| off.abs() <= most).count();
            near.push(counted as f64 / found[0].len() as f64);
            all.iter_mut()
                .zip(found)
                .for_each(|(all, of)| all.extend(of));
        }
        Ok::<_, SimulationError>(all)
    };
    let mut found = estimate(&prior, &blocks, simulate)?;
    for (deviation, prior) in found.deviation.iter_mut().zip(prior) {
        *deviation = (BETWEEN_MODELS * *deviation).min(prior);
    }
    Ok((found, near))
}
