use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, anyhow, bail};
use serde::{Deserialize, Serialize};

use super::best::{BestPaths, BestSequence, Scored};
use super::checkpoint::Checkpoint;
use super::config::RunConfig;
use super::demonstrations::{Demonstrations, beginners_order};
use super::events::{create_events, reopen_logs, scalar_record};
use super::folder::{RunFolder, write_json};
use super::log::Log;
use super::metrics::{kept_lines, metrics_line};
use super::search::{Budget, search_by_moves};
use super::weights::Weights;
use drape_cloth::file::read_json;
use drape_cloth::scene::Scene;
use drape_learn::ppo::{
    EpisodeRecord, Iteration, NETWORK, Sampling, Sections, Trainer, decode, encode, read_section,
};
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, End, EnvConfig, Member, Reward, Tasks, Worlds};
use drape_task::search::{Judge, Searching};

/// Checkpoint section of what the run itself remembers.
const RUN: &str = "run";
/// Checkpoint section of the path that was proved before the run went on, where it was polished.
const POLISHED: &str = "polished";

/// Those that a policy learns on, in the order of [`RunConfig::members`]: the run's own first.
/// Each with the worlds round it, if they scatter.
pub type Scenes = Vec<(Arc<Scene>, Option<Arc<Worlds>>)>;

/// A training that writes into its run folder.
pub struct Training {
    /// The configuration of the run.
    pub config: RunConfig,
    /// Of what stands in the file, also where it lacks keys that are newer.
    config_digest: String,
    /// The folder that the run writes into.
    pub folder: RunFolder,
    trainer: Trainer<Draping>,
    /// One environment for the greedy episodes.
    evaluation: Draping,
    /// So many tasks, the first, are on the run's own scene.
    own_tasks: usize,
    /// Worlds round each scene.
    worlds: Vec<Arc<Worlds>>,
    memory: Memory,
    /// What an earlier polish has come to, which the memory knows nothing of.
    polished: Option<Vec<u32>>,
    cluster: Cluster,
    /// Metrics and events; only the first process of a cluster writes.
    logs: Option<[Log; 2]>,
    _lock: Option<File>,
}

/// What a run remembers beside its learner.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Memory {
    /// Score of the best greedy episode so far.
    best_greedy: Option<f64>,
    /// The best episode of each iteration, the greedy ones and those shown, best first, each path once.
    best: BestPaths,
    /// Scores of the last episodes of the training, oldest first.
    recent: Vec<f64>,
    /// What comes before the first rollout is done.
    is_prepared: bool,
    /// Lines of the metrics.
    lines: u64,
}

/// Episodes that the mean score of a report is taken over.
const RECENT: usize = 50;

/// What one iteration has brought.
#[derive(Clone, Debug)]
pub struct TrainingReport {
    pub iteration: Iteration,
    /// Mean score of the last 50 episodes; none before the first ends.
    pub mean_score: Option<f64>,
    /// Score of the greedy episode, if one was played.
    pub greedy_score: Option<f64>,
    /// Best score of any episode so far.
    pub best_score: Option<f64>,
}

/// What is done before the first rollout, and how well it goes.
#[derive(Clone, Copy, Debug)]
pub enum Preparation {
    /// With the best score so far.
    Searching { best: Option<f64> },
    /// With the cross-entropy of what is imitated [nat].
    Imitating { loss: f32 },
}

impl Training {
    /// A new training in a new run folder, from the weights of another or from scratch. All processes of the cluster
    /// make it and call the same functions of it; the first writes.
    pub fn new(
        config: RunConfig,
        scenes: Scenes,
        folder: RunFolder,
        cluster: &Cluster,
        weights: Option<&Weights>,
    ) -> Result<Self> {
        let mut new = Self::set_up(config, scenes, folder, cluster, Reward::default())?;
        if let Some(weights) = weights {
            let loaded = new.trainer.load_network(weights.network());
            loaded.map_err(|fault| anyhow!(fault))?;
        }
        new.begin()
    }

    /// One with neither logs nor a checkpoint yet.
    fn set_up(
        config: RunConfig,
        scenes: Scenes,
        folder: RunFolder,
        cluster: &Cluster,
        reward: Reward,
    ) -> Result<Self> {
        let lock = cluster.is_first().then(|| folder.lock()).transpose()?;
        let all = scenes.iter().map(|(scene, worlds)| {
            let nominal = || Worlds::nominal(scene).into();
            worlds.clone().unwrap_or_else(nominal)
        });
        let all: Vec<Arc<Worlds>> = all.collect();
        let evaluation = member(&scenes[0].0, &config.env, 1);
        let members = config.members()?;
        let own_tasks = members[0].environments;
        let members = scenes.iter().zip(members);
        let members = members.map(|((scene, worlds), own)| Member {
            worlds: worlds.clone().filter(|_| config.scatter.training),
            ..member(scene, &own.env, own.environments)
        });
        let tasks = Draping::on(members.collect(), cluster)?;
        let tasks = tasks.forgetting_ends().with_reward(reward);
        let (ppo, policy) = (config.ppo.clone(), &config.policy);
        let trainer = Trainer::new(ppo, policy, tasks, config.seed, config.device)?;
        Ok(Self {
            config_digest: folder.config_digest()?,
            trainer: trainer.among(cluster)?,
            evaluation: Draping::on(vec![evaluation], cluster)?,
            own_tasks,
            worlds: all,
            config,
            folder,
            memory: Memory::default(),
            polished: None,
            cluster: cluster.clone(),
            logs: None,
            _lock: lock,
        })
    }

    fn begin(mut self) -> Result<Self> {
        if self.cluster.is_first() {
            let events = create_events(&self.folder.events, wall_time());
            self.logs = Some([Log::create(&self.folder.metrics)?, events?]);
        }
        // Whatever happens from now on, the run can be gone on with.
        self.checkpoint()?;
        Ok(self)
    }

    /// The training in `folder` as its last checkpoint left it. Metrics that were written
    /// after that checkpoint are cut off: their steps are taken again. A run that was killed before
    /// its first checkpoint begins anew.
    pub fn resume(
        config: RunConfig,
        scenes: Scenes,
        folder: RunFolder,
        cluster: &Cluster,
    ) -> Result<Self> {
        let mut training = Self::set_up(config, scenes, folder, cluster, Reward::default())?;
        let folder = &training.folder;
        let path = folder.last_checkpoint.clone();
        // The first checkpoint comes before the first line.
        let has_begun = path.exists() || fs::metadata(&folder.metrics).is_ok_and(|m| m.len() > 0);
        // All have looked before the first writes.
        if !cluster.any(has_begun) {
            if cluster.is_first() {
                for log in [&folder.metrics, &folder.events] {
                    let _ = fs::remove_file(log);
                }
            }
            return training.begin();
        }
        let name = || path.display().to_string();
        let Checkpoint { sections, .. } = Checkpoint::of_run(&path, folder)?;
        training.trainer.load(&sections).with_context(name)?;
        training.memory = read_section(&sections, RUN, decode).with_context(name)?;
        if sections.contains_key(POLISHED) {
            training.polished = read_section(&sections, POLISHED, decode).with_context(name)?;
        }
        if cluster.is_first() {
            let (folder, lines) = (&training.folder, training.memory.lines);
            training.logs = Some(reopen_logs(folder, lines, wall_time())?);
        }
        Ok(training)
    }

    /// Environment steps that the run in `folder` had taken at its last checkpoint; none where what comes before them is
    /// still to be done.
    pub fn taken(folder: &RunFolder) -> Result<Option<u64>> {
        let path = &folder.last_checkpoint;
        if !path.exists() {
            return Ok(None);
        }
        let name = || path.display().to_string();
        let Checkpoint { sections, .. } = Checkpoint::of_run(path, folder)?;
        let memory: Memory = read_section(&sections, RUN, decode).with_context(name)?;
        let last = kept_lines(&folder.metrics, memory.lines)?.pop();
        let before = memory.is_prepared.then_some(0);
        Ok(last.map(|(line, _)| line.step).or(before))
    }

    /// Makes `text` the configuration of the run that it is gone on with. Where it was polished its best sequences are
    /// those of its checkpoint again, and what it has proved is one that the next polish begins from.
    pub fn reconfigure(&mut self, text: &str) -> Result<()> {
        let polish = RunConfig::read(&self.folder.config)?.polish;
        // All have read before the first writes.
        if self.cluster.any(polish > 0) {
            let proved = self.folder.read_proof().unwrap_or(None);
            let path = proved.map(|proved| proved.path);
            let path = path.filter(|path| path.check_config(&self.config_digest).is_ok());
            self.polished = path.map(|path| path.vertices).or(self.polished.take());
        }
        if self.cluster.is_first() {
            self.folder.write_config(text)?;
        }
        self.write_best()?;
        self.checkpoint()
    }

    /// What is to be proved: the best sequences, and what has been proved before the run went on.
    pub fn best_sequence(&self) -> Result<BestSequence> {
        let mut best = self.folder.read_best_sequence()?;
        let is_new = |path: &&Vec<u32>| best.all().all(|other| other != *path);
        if let Some(path) = self.polished.as_ref().filter(is_new) {
            let (vertices, score) = (path.clone(), best.score);
            best.others.insert(0, Scored { vertices, score });
        }
        Ok(best)
    }

    /// The scene of the run.
    pub fn scene(&self) -> &Arc<Scene> {
        self.evaluation.scene()
    }

    /// Environment steps taken so far.
    pub fn env_steps(&self) -> u64 {
        self.trainer.env_steps()
    }

    /// All steps of the configuration are taken.
    pub fn is_complete(&self) -> bool {
        self.env_steps() >= self.config.steps
    }

    /// Mean score of the last 50 episodes; none before the first ends.
    pub fn mean_score(&self) -> Option<f64> {
        let recent = &self.memory.recent;
        let mean = recent.iter().sum::<f64>() / recent.len() as f64;
        (!recent.is_empty()).then_some(mean)
    }

    /// Best score of any episode so far.
    pub fn best_score(&self) -> Option<f64> {
        self.memory.best.score()
    }

    /// What comes before the first rollout, once: searches for as many steps as the configuration says, lets
    /// the learner see the best that was found, and in the environments that are left orders that anybody could
    /// think of, and imitate them. `go_on` is told what is done and the share of it; when it says no, nothing
    /// has changed.
    pub fn prepare(
        &mut self,
        mut go_on: impl FnMut(Preparation, f64) -> bool + Send,
    ) -> Result<()> {
        let Some(imitation) = &self.config.ppo.imitation else {
            return Ok(());
        };
        if self.memory.is_prepared || self.env_steps() > 0 {
            return Ok(());
        }
        let before = (imitation.pretraining > 0).then(|| self.trainer.save());
        let searching = |best, share| go_on(Preparation::Searching { best }, share);
        let Some(mut found) = self.search(searching)? else {
            return Ok(());
        };
        found[0].insert(Demonstrations::of(&self.folder)?);
        let mut presses = vec![0; self.trainer.tasks().count()];
        let shown = self.trainer.show(|tasks, task| {
            let scene = usize::from(tasks.observations().views[task]);
            let own: Vec<usize> = tasks.environments(scene).collect();
            let number = own.iter().take_while(|&&other| other != task).count();
            let next = found[scene].next(number, &mut presses[task], tasks, task);
            next.unwrap_or_else(|| beginners_order(tasks, &own, number))
        });
        let mut is_whole = true;
        self.trainer.pretrain(|share, loss| {
            is_whole = go_on(Preparation::Imitating { loss }, share);
            is_whole
        })?;
        if let (false, Some(before)) = (is_whole, before) {
            return Ok(self.trainer.load(&before)?);
        }
        let count = self.own_tasks;
        for episode in shown.iter().filter(|e| e.task < count) {
            self.remember(episode.score, &episode.actions)?;
        }
        self.memory.is_prepared = true;
        self.checkpoint()
    }

    /// The best orders of a search on each scene, best first; none when `go_on`, told what the best is worth and the share of
    /// the presses, has said no.
    fn search(
        &self,
        mut go_on: impl FnMut(Option<f64>, f64) -> bool + Send,
    ) -> Result<Option<Vec<Demonstrations>>> {
        let (tasks, all) = (self.trainer.tasks(), self.config.search);
        let file = self.folder.path.join("searched.json");
        // What an interrupted search has found, by scene.
        let known: Vec<Demonstrations> = match file.exists() {
            true => read_json(&file, "orders of a search")?,
            false => Vec::new(),
        };
        // All have looked before the first writes.
        self.cluster.any(false);
        let (mut found, mut before) = (known, 0);
        for (number, (task, worlds)) in tasks.tasks().iter().zip(&self.worlds).enumerate() {
            let count = tasks.environments(number).count();
            let presses = all * count as u64 / tasks.count() as u64;
            if let Some(known) = found.get(number) {
                let checked = known.check(&task.scene.lamina);
                checked.with_context(|| format!("{}: scene {number}", file.display()))?;
                before += presses;
                continue;
            }
            if presses == 0 {
                found.push(Demonstrations::default());
                continue;
            }
            let rated = match worlds.differ() {
                true => self.config.scatter.rated(&task.config),
                false => vec![task.config.clone()],
            };
            let mut judge = Judge::new(&task.scene, worlds, &rated)?;
            let (budget, mut is_whole) = (Budget::Presses(presses), true);
            let place = (&task.scene, &task.config, self.config.seed);
            let searched = search_by_moves(&mut judge, place, Vec::new(), budget, |at| {
                let done = before + at.spent.min(presses);
                is_whole = go_on(at.best, done as f64 / all as f64);
                is_whole
            });
            let (orders, _) = searched.with_context(|| format!("scene {number}"))?;
            if !is_whole {
                return Ok(None);
            }
            before += presses;
            let orders = orders.orders.into_iter().take(count);
            found.push(orders.map(|(order, _)| order).collect());
            if self.cluster.is_first() {
                write_json(&file, &found)?;
            }
        }
        Ok(Some(found))
    }

    /// One iteration of the learner, with its metrics written. Checkpoints are up to the
    /// caller, except that of a policy which plays better than every one before.
    pub fn advance(&mut self) -> Result<TrainingReport> {
        let iteration = self.trainer.iterate()?;
        let count = self.own_tasks;
        let own = iteration.episodes.iter().filter(|e| e.task < count);
        self.memory
            .recent
            .extend(own.clone().filter_map(|e| e.score));
        let score = |episode: &&EpisodeRecord| episode.score.unwrap_or(f64::NEG_INFINITY);
        if let Some(best) = own.max_by(|a, b| score(a).total_cmp(&score(b))) {
            self.remember(best.score, &best.actions)?;
        }
        let surplus = self.memory.recent.len().saturating_sub(RECENT);
        self.memory.recent.drain(..surplus);

        let due = iteration.number % self.config.evaluation_interval == 0 || self.is_complete();
        let greedy_score = if due { self.evaluate()? } else { None };
        let report = TrainingReport {
            mean_score: self.mean_score(),
            greedy_score,
            best_score: self.best_score(),
            iteration,
        };
        self.log(&report)?;
        Ok(report)
    }

    /// Searches for as many steps as the configuration says from the best sequences on, and from what
    /// [`search_by_moves`] begins with beside them, in scattered worlds: what is best in one may not hold in another.
    /// What is found comes before them, with what it comes to there. `go_on` is told where the search is. No
    /// checkpoint is to follow: a run that is resumed polishes again, to the same end.
    pub fn polish(&mut self, go_on: impl FnMut(Searching) -> bool + Send) -> Result<()> {
        let config = &self.config;
        let known = self.polished.iter().chain(self.memory.best.lists());
        let known: Vec<Vec<u32>> = known.cloned().collect();
        let scene = self.evaluation.scene();
        let rated = config.scatter.rated(&config.env);
        let mut judge = Judge::new(scene, &self.worlds[0], &rated)?;
        let budget = Budget::Presses(config.polish);
        let place = (scene, &config.env, config.seed);
        let (found, _) = search_by_moves(&mut judge, place, known, budget, go_on)?;
        let best = BestPaths::judged(found.orders);
        self.memory.best = best.before(&self.memory.best);
        self.write_best()
    }

    /// Writes everything needed to go on exactly from here.
    pub fn checkpoint(&mut self) -> Result<()> {
        for log in self.logs.iter().flatten() {
            log.sync()?;
        }
        let mut sections = self.trainer.save();
        sections.insert(RUN.into(), encode(&self.memory));
        if self.polished.is_some() {
            sections.insert(POLISHED.into(), encode(&self.polished));
        }
        self.save(sections, &self.folder.last_checkpoint)
    }

    fn save(&self, sections: Sections, path: &Path) -> Result<()> {
        let mut digest = crc32fast::Hasher::new();
        sections.values().for_each(|section| digest.update(section));
        let digests = self.cluster.gather(digest.finalize());
        if let Some(other) = digests.iter().position(|found| *found != digests[0]) {
            bail!(
                "process {other} has come to another state than process 0, expected the same: start all with \
                 the same build, arguments and kind of processor"
            );
        }
        if !self.cluster.is_first() {
            return Ok(());
        }
        let config_digest = self.config_digest.clone();
        let checkpoint = Checkpoint {
            config_digest,
            sections,
        };
        Ok(checkpoint.save(path)?)
    }

    /// Plays one greedy episode. A policy better than every one before is kept. As in training
    /// an episode that diverged has no score.
    fn evaluate(&mut self) -> Result<Option<f64>> {
        let agent = self.trainer.agent();
        let greedy = |draping: &Draping| agent.act(&[draping.observation(0)], Sampling::Greedy);
        let episode = self.evaluation.play(greedy).swap_remove(0).episode;
        self.remember(episode.score, &episode.actions)?;
        if episode.score > self.memory.best_greedy {
            self.memory.best_greedy = episode.score;
            let sections = Sections::from([(NETWORK.into(), agent.save())]);
            self.save(sections, &self.folder.best_checkpoint)?;
        }
        Ok(episode.score)
    }

    /// Keeps the sequence of an episode if it is among the best so far.
    fn remember(&mut self, score: Option<f64>, actions: &[u32]) -> Result<()> {
        let best = &mut self.memory.best;
        match best.remember(score, actions, self.evaluation.task(0)) {
            true => self.write_best(),
            false => Ok(()),
        }
    }

    fn write_best(&self) -> Result<()> {
        if !self.cluster.is_first() {
            return Ok(());
        }
        let (task, digest) = (self.evaluation.task(0), self.config_digest.clone());
        let sequence = self.memory.best.sequence(task, digest);
        sequence.map_or(Ok(()), |best| self.folder.write_best_sequence(&best))
    }

    fn log(&mut self, report: &TrainingReport) -> Result<()> {
        let TrainingReport { iteration, .. } = report;
        let metrics = &iteration.metrics;
        let seconds = &iteration.seconds;
        let lengths = iteration.episodes.iter().map(|e| e.actions.len() as f64);
        let count = |chosen: fn(End) -> bool| {
            let ends = iteration.episodes.iter().map(|episode| episode.end);
            ends.filter(|&end| chosen(end)).count() as f64
        };
        let wall_time = wall_time();
        let mut values = vec![
            ("iteration", iteration.number as f64),
            ("wall_time", wall_time),
            ("episodes", iteration.episodes.len() as f64),
            ("truncated", count(End::is_truncation)),
            ("diverged", count(|end| end == End::Diverged)),
            ("learning_rate", self.config.ppo.learning_rate),
            ("policy_loss", metrics.policy_loss.into()),
            ("value_loss", metrics.value_loss.into()),
            ("entropy", metrics.entropy.into()),
            ("imitation_loss", metrics.imitation_loss.into()),
            ("approx_kl", metrics.approx_kl.into()),
            ("clip_fraction", metrics.clip_fraction.into()),
            ("gradient_norm", metrics.gradient_norm.into()),
            ("explained_variance", metrics.explained_variance.into()),
            ("seconds_simulation", seconds.simulation),
            ("seconds_inference", seconds.inference),
            ("seconds_update", seconds.update),
        ];
        if !iteration.episodes.is_empty() {
            let mean = lengths.sum::<f64>() / iteration.episodes.len() as f64;
            values.push(("episode_length", mean));
        }
        let optional = [
            ("mean_score", report.mean_score),
            ("greedy_score", report.greedy_score),
            ("best_score", report.best_score),
        ];
        values.extend(optional.iter().filter_map(|&(name, v)| Some((name, v?))));
        self.memory.lines += 1;
        let Some([metrics, events]) = &mut self.logs else {
            return Ok(());
        };
        let line = metrics_line(iteration.env_steps, &values);
        metrics.append(line.as_bytes())?;
        let record = scalar_record(wall_time, iteration.env_steps, &values);
        events.append(&record)
    }
}

/// `count` environments on a scene.
fn member(scene: &Arc<Scene>, config: &EnvConfig, count: usize) -> Member {
    Member {
        scene: scene.clone(),
        config: config.clone(),
        count,
        worlds: None,
    }
}

/// Seconds since 1970; 0 for clocks set before that.
fn wall_time() -> f64 {
    let elapsed = SystemTime::now().duration_since(UNIX_EPOCH);
    elapsed.unwrap_or_default().as_secs_f64()
}

#[cfg(test)]
mod tests;
