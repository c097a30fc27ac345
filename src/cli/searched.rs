//! A run that a search without training fills.

use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use super::Failure;
use super::failure::OrInvalid;
use super::output::Progress;
use super::proof;
use super::setup::{LIES, set_up_run, set_up_worlds};
use super::signals::stop_on_signal;
use super::terminal::note;
use crate::run::{
    BestPaths, BestSequence, Budget, RunConfig, RunFolder, RunInfo, Weights, search_by_moves,
};
use drape_cloth::scene::Scene;
use drape_proof::Row;
use drape_task::env::{Task, Worlds};
use drape_task::search::{Found, Judge};

/// A new run, its scene set up.
pub(super) struct Searched {
    pub config: RunConfig,
    /// What messages call the configuration.
    pub place: String,
    pub scene: Arc<Scene>,
    pub folder: RunFolder,
    _lock: File,
}

/// What a new run is called, and where it goes.
#[derive(Debug, clap::Args)]
pub(super) struct NewRun {
    /// Name of the run; date and minute (UTC) if not given
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,

    /// Folder that holds the runs
    #[arg(long, value_name = "DIR", default_value = "runs")]
    pub runs: PathBuf,
}

impl Searched {
    /// Sets up the scene of a configuration and makes the run, which keeps what `search` fills it.
    pub fn begin(
        mut config: RunConfig,
        place: String,
        NewRun { name, runs }: &NewRun,
        search: String,
        weights: Option<&Weights>,
    ) -> Result<Self, Failure> {
        let name = name.as_deref();
        RunFolder::check_free(runs, name, Some(&search))?;
        let (scene, (kept, inputs)) = set_up_run(&config, &place)?;
        config.equip(&scene).or_invalid_in(&place)?;
        let info = RunInfo {
            search: Some(search),
            policy: weights.map(Weights::digest),
            ..RunInfo::new(config.seed, SystemTime::now())
        };
        let folder = RunFolder::create(runs, name, &kept, &inputs, &info)?;
        let lock = folder.lock()?;
        note(format_args!("writing {}", folder.path.display()));
        Ok(Self {
            config,
            place,
            scene,
            folder,
            _lock: lock,
        })
    }

    /// Sets up the worlds that searches by moves press in.
    pub fn worlds(&self) -> Result<Arc<Worlds>, Failure> {
        let (scatter, seed) = (&self.config.scatter, self.config.seed);
        let worlds = set_up_worlds(&self.scene, scatter, LIES, seed, &self.place)?;
        Ok(worlds.unwrap_or_else(|| Worlds::nominal(&self.scene).into()))
    }

    /// Searches by moves from the `known` orders and simple ones on, with the presses made; a signal stops it.
    pub fn by_moves(
        &self,
        worlds: &Arc<Worlds>,
        known: Vec<Vec<u32>>,
        budget: Budget,
    ) -> Result<(Found, u64), Failure> {
        let (scene, config) = (&self.scene, &self.config);
        let asked = stop_on_signal()?;
        let rated = config.scatter.rated(&config.env);
        let mut judge = Judge::new(scene, worlds, &rated).or_invalid_in(&self.place)?;
        let place = (scene, &config.env, config.seed);
        let (progress, began) = (Progress::new("searching"), Instant::now());
        let (found, spent) = search_by_moves(&mut judge, place, known, budget, |at| {
            progress.searching(budget.share(began, at.spent), at);
            asked().is_none()
        })?;
        Ok((found, spent))
    }

    /// Writes the best paths into the run; none if there are none.
    pub fn keep(&self, best: &BestPaths) -> Result<Option<BestSequence>, Failure> {
        let task = Task::new(self.scene.clone(), &self.config.env).or_invalid_in(&self.place)?;
        let sequence = best.sequence(&task, self.folder.config_digest()?);
        if let Some(sequence) = &sequence {
            self.folder.write_best_sequence(sequence)?;
        }
        Ok(sequence)
    }

    /// Proves them.
    pub fn prove(&self, best: BestSequence) -> Result<Vec<Row>, Failure> {
        note("proving the best paths");
        let (config, method) = (&self.config, proof::by_solver(&self.config));
        proof::proved(&self.folder, &self.scene, config, best, method)
    }
}
