use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Failure;
use super::args::accuracy;
use super::failure::{OrInvalid, proof_failure};
use super::loaded::{Loaded, Source, observations, policy_paths};
use super::output::{OutFolder, Progress, check_outputs, print};
use super::picture;
use super::proof;
use super::result::{EpisodeStatistics, write_recording};
use super::terminal::Told;
use crate::run::{EpisodeSummary, parallel_episodes};
use drape_cloth::fabric::Drape;
use drape_cloth::file::check_writable;
use drape_cloth::math::Stream;
use drape_cloth::sim::{Accuracy, Observation};
use drape_learn::policy::DeviceKind;
use drape_learn::ppo::{Agent, Sampling};
use drape_proof::presses::again;
use drape_proof::{Case, Listener, Method, Physics, Row, Sensitivity};
use drape_report::Table;
use drape_study::study::region;
use drape_task::env::Draping;
use drape_task::path::PathFigures;
use drape_task::recording::Recording;

/// Roll out a trained policy and compare it with the random one
///
/// Writes before.png, after.png, crushed.png, path.png and rollout.gif of the episode it plays,
/// each in place of that of the last `eval`; those of the run itself change by `--prove` only.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape eval runs/a
  drape eval runs/a --sequence --accuracy accurate --out checked
  drape eval runs/a --checkpoint last --sample --json
  drape eval runs/a --prove --twin
  drape eval runs/a --scene other.toml --prove --out elsewhere")]
pub struct EvalArgs {
    /// Run folder
    run: PathBuf,

    /// Which checkpoint to play: best, last, or a file
    #[arg(long, value_name = "best|last|FILE", default_value = "best")]
    checkpoint: String,

    /// Episodes of the random policy, and of the sampled one with --sample; 0 for nothing to compare with
    #[arg(long, value_name = "K", default_value_t = 32,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(0..=4096))]
    episodes: usize,

    /// Also draw actions from the policy, K episodes, instead of its best action only
    #[arg(long, conflicts_with = "sequence")]
    sample: bool,

    /// Replay the best action sequence of the run; needs no checkpoint
    #[arg(long, conflicts_with = "checkpoint")]
    sequence: bool,

    /// Press what a recording holds again instead, in its own physics, and tell whether it comes to the same:
    /// pictures/recording.drape of the run, or one that `eval` has left
    #[arg(long, value_name = "FILE", conflicts_with_all = ["checkpoint", "sequence", "sample", "accuracy",
          "prove", "state"])]
    recording: Option<PathBuf>,

    /// Play on this scene instead of the run's own, with the same task: the policy of a `unet` plays
    /// on any. With --prove its greedy path and K drawn ones are proved; the run keeps nothing of it
    #[arg(long, value_name = "FILE", requires = "out", conflicts_with_all = ["sequence", "twin"])]
    scene: Option<PathBuf>,

    /// Focus region on the scene's blank [mm]: least x, least y, greatest x, greatest y; the run's
    /// if not given
    #[arg(long, requires = "scene", value_name = "X,Y,X,Y", value_parser = region,
          allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// Step the episodes as finely as this, fast, balanced or accurate, from the initial state of
    /// the run, instead of as in training. A sequence is pressed as a robot would: all of it,
    /// whatever the masks allow then
    #[arg(long, value_parser = accuracy, value_name = "NAME")]
    accuracy: Option<Accuracy>,

    /// Where networks and cloth are computed: flex (the CPU), gpu or gpu:N; as in training
    /// if not given
    #[arg(long, value_name = "DEVICE")]
    device: Option<DeviceKind>,

    /// Also play the best paths of the run, beside K random orders, sweeps and orders outwards from a
    /// place or inwards to one, in worlds that scatter as the configuration says, in the finest of its steps, or at `accurate`
    /// if nothing scatters; keep the best for `export`, and say which quantity by itself hurts it most. Of a checkpoint
    /// also what looking is worth where worlds scatter: its greedy path (`blind`) beside the policy that sees each
    #[arg(long)]
    prove: bool,

    /// Take the best of each to the finite-element twin, which has the last word: in the world of the
    /// scene, and in six others where anything scatters; minutes
    #[arg(long, requires = "prove")]
    twin: bool,

    /// Folder for the pictures, created where missing; pictures/eval in the run folder if not
    /// given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Also write where every vertex of the blank lies after the episode, for `drape compare`
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    run: Told,
    /// `best`, `last`, a file, or `sequence`.
    played: String,
    /// What `--accuracy` asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<Accuracy>,
    /// The greedy episode, or the replayed one.
    episode: EpisodeSummary,
    /// How many deviations of the random policy's score the episode lies above its mean; none if
    /// that does not deviate.
    deviations_above_random: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sampled: Option<EpisodeStatistics>,
    #[serde(skip_serializing_if = "Option::is_none")]
    random: Option<EpisodeStatistics>,
    /// What `--prove` has found.
    #[serde(skip_serializing_if = "Option::is_none")]
    proof: Option<Vec<Row>>,
    /// What each quantity that scatters does to the proved path by itself, what hurts most first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    sensitivity: Vec<Sensitivity>,
    /// Where the pictures are.
    pictures: Told,
    /// On another scene than the run's.
    #[serde(skip)]
    is_elsewhere: bool,
}

/// Runs `drape eval`.
pub fn run(args: EvalArgs) -> Result<(), Failure> {
    let out = args.out.as_deref().map(OutFolder::make).transpose()?;
    let read = args.recording.iter().chain(&args.scene);
    let read = read
        .map(PathBuf::as_path)
        .chain([Path::new(&args.checkpoint)]);
    let recording = out
        .as_ref()
        .map(|folder| folder.path.join("recording.drape"));
    let written = args.state.iter().chain(&recording);
    check_outputs(written.map(PathBuf::as_path), read)?;
    let on = args.scene.as_deref().map(|scene| (scene, args.region));
    let source = match (&args.recording, args.sequence) {
        (Some(_), _) => Source::Other,
        (None, true) => Source::Sequence,
        (None, false) => Source::Checkpoint(&args.checkpoint),
    };
    let mut loaded = Loaded::open(&args.run, source, on, args.device)?;
    let pictures = match out {
        Some(folder) => folder,
        None => OutFolder::make(&loaded.folder.pictures.join("eval"))?,
    };
    if let Some(file) = &args.recording {
        return press_again(file, &loaded, &pictures.path);
    }
    if let Some(accuracy) = args.accuracy {
        loaded.env.set_accuracy(accuracy);
    }
    let (mut best, mut _lock) = (None, None);
    if args.prove && args.scene.is_none() {
        _lock = Some(loaded.folder.lock()?);
        check_writable(&loaded.folder.proof)?;
        best = Some(loaded.best_sequence()?);
    }
    let checkpoint = (!args.sequence).then_some(&*args.checkpoint);
    let (played, agent) = loaded.play(checkpoint)?;
    let Loaded { env, scene, .. } = &loaded;
    if let Some(file) = &args.state {
        let end = scene.tool.in_scene(played.recording.end());
        Drape::new(&scene.lamina, &end).write(file)?;
    }

    let count = args.episodes;
    let random = match count {
        0 => None,
        _ => Some(EpisodeStatistics::random(scene, env, count)?),
    };
    let mut sampled = None;
    if let (Some(agent), true) = (&agent, args.sample && count > 0) {
        let draw =
            |seen: Observation, stream: &mut Stream| agent.act(&[seen], Sampling::Drawn(stream))[0];
        let play = |told: &dyn Fn(f64)| parallel_episodes(scene, env, count, draw, told);
        sampled = Some(EpisodeStatistics::new("sampled episodes", count, play)?);
    }
    let (mut proof, mut sensitivity) = (None, Vec::new());
    if let Some(best) = best {
        // In the run's own steps, whatever the episode was played in.
        let judge = match args.twin {
            true => Physics::Twin,
            false => Physics::Solver,
        };
        let (config, method) = (
            &loaded.config,
            Method {
                random: count,
                judge,
            },
        );
        proof = Some(proof::proved(&loaded.folder, scene, config, best, method)?);
        if let Some(proved) = loaded.folder.read_proof()? {
            let case = proof::case(scene, &loaded.config);
            sensitivity = proof::sensitivity(case, &proved.path.vertices)?;
            if !sensitivity.is_empty() {
                let bars = picture::sensitivity(&sensitivity);
                bars.save_png(&pictures.path.join("sensitivity.png"))?;
            }
        }
    }
    if let (Some(agent), true) = (&agent, args.prove) {
        if args.scene.is_some() {
            proof = Some(proved_elsewhere(agent, &loaded, count)?);
        }
        if !loaded.config.scatter.spreads.is_empty() {
            let rows = looked(agent, &played.recording.vertices(), &loaded)?;
            proof.get_or_insert_default().extend(rows);
        }
    }
    let title = checkpoint.map_or("sequence", |_| "policy");
    write_recording(&played.recording, scene, &pictures.path, title)?;

    let deviations = |random: &EpisodeStatistics| {
        let above = played.summary.score - random.mean_score;
        (random.deviation > 0.0).then(|| above / random.deviation)
    };
    let report = Report {
        run: (&args.run).into(),
        played: checkpoint.unwrap_or("sequence").into(),
        accuracy: args.accuracy,
        deviations_above_random: random.as_ref().and_then(deviations),
        episode: played.summary,
        sampled,
        random,
        proof,
        sensitivity,
        pictures: (&pictures.path).into(),
        is_elsewhere: args.scene.is_some(),
    };
    print(&report, text)
}

/// What is printed of a recording that was pressed again.
#[derive(Serialize)]
struct Again {
    recording: Told,
    by_twin: bool,
    /// At its end [m], [m], [-].
    distance_m: f64,
    surplus_m: f64,
    score: f64,
    #[serde(flatten)]
    path: PathFigures,
    /// It comes to the same, bit for bit.
    same_bits: bool,
    /// Greatest distance between the same vertices in any frame [m].
    apart_m: f64,
    pictures: Told,
}

fn press_again(file: &Path, loaded: &Loaded, pictures: &Path) -> Result<(), Failure> {
    let recorded = Recording::read(file).or_invalid()?;
    let progress = Progress::new("pressing again");
    let told = |share: f64, doing: &str| progress.tell(share, doing);
    let place = Some(file.display().to_string());
    let found = again(&recorded, &loaded.scene, Listener(&told));
    let found = found.map_err(|error| proof_failure(error, place))?;
    drop(progress);
    write_recording(&recorded, &loaded.scene, pictures, "recorded")?;
    let last = recorded.frames.last().expect("it has a start");
    let report = Again {
        recording: file.into(),
        by_twin: recorded.by_twin,
        distance_m: last.distance,
        surplus_m: last.surplus,
        score: last.score,
        path: PathFigures::new(&recorded.presses, recorded.env.rolling()),
        same_bits: found == recorded,
        apart_m: found.apart(&recorded),
        pictures: pictures.into(),
    };
    print(&report, Again::text)
}

impl Again {
    fn text(&self) -> String {
        let solver = match self.by_twin {
            true => "twin",
            false => "fast solver",
        };
        let found = match self.same_bits {
            true => "the same bits".into(),
            false => format!("up to {:.3} mm apart", 1e3 * self.apart_m),
        };
        format!(
            "{}: {}; {:.4} m off the tool, {:.2} mm surplus a yarn, score {:.2} %; pressed again in the \
             {solver}: {found}\npictures in {}",
            self.recording.display(),
            self.path.text(),
            self.distance_m,
            1e3 * self.surplus_m,
            100.0 * self.score,
            self.pictures.display()
        )
    }
}

/// Proves what an agent plays, greedily and drawn so often, on a scene that the run does not know.
fn proved_elsewhere(agent: &Agent, loaded: &Loaded, count: usize) -> Result<Vec<Row>, Failure> {
    let (scene, env) = (&loaded.scene, &loaded.env);
    let paths = policy_paths(agent, scene, env, count, 0)?;
    let case = Case {
        env,
        ..proof::case(scene, &loaded.config)
    };
    let method = Method {
        random: count,
        judge: Physics::Solver,
    };
    let all = |_: &mut Vec<u32>| Ok(());
    Ok(proof::found(case, &paths, method, None, all)?.rows)
}

/// What the greedy path of an agent leaves in the worlds of a proof, and what the agent does that sees each.
fn looked(agent: &Agent, path: &[u32], loaded: &Loaded) -> Result<[Row; 2], Failure> {
    let case = Case {
        env: &loaded.env,
        ..proof::case(&loaded.scene, &loaded.config)
    };
    let greedy = |draping: &Draping| agent.act(&observations(draping), Sampling::Greedy);
    let progress = Progress::new("looking");
    let told = |share: f64, doing: &str| progress.tell(share, doing);
    let rows = drape_proof::looked(case, path, greedy, Listener(&told));
    rows.map_err(|error| proof_failure(error, None))
}

fn text(report: &Report) -> String {
    let Report { episode, .. } = report;
    let accuracy = report.accuracy.map_or(String::new(), |accuracy| {
        format!(", {} steps", accuracy.name())
    });
    let (sampled, random) = (report.sampled.as_ref(), report.random.as_ref());
    let (none, one) = (f64::NAN, [episode.region_final_m, episode.surplus_final_m]);
    // Score, its deviation, the best; distance and surplus.
    let of = |all: &EpisodeStatistics| {
        let scores = [all.mean_score, all.deviation, all.best_score];
        (scores, [all.mean_region_final_m, all.mean_surplus_final_m])
    };
    let mut rows = vec![("episode", 1, ([episode.score, none, episode.score], one))];
    rows.extend(sampled.map(|all| ("sampled", all.episodes.len(), of(all))));
    rows.extend(random.map(|all| ("random", all.episodes.len(), of(all))));
    let title = format!(
        "{}: {}{accuracy}; scores in %",
        report.run.display(),
        report.played
    );
    let table = Table::of("episodes", title, &rows)
        .text("order", |(order, ..)| *order)
        .text("count", |(_, count, _)| *count)
        .number("score", 2, |(.., (scores, _))| 100.0 * scores[0])
        .number("deviation", 2, |(.., (scores, _))| 100.0 * scores[1])
        .number("best", 2, |(.., (scores, _))| 100.0 * scores[2])
        .number("off the tool [m]", 4, |(.., (_, left))| left[0])
        .number("surplus [mm]", 2, |(.., (_, left))| 1e3 * left[1]);
    let locked = episode.locked_share.map_or(String::new(), |share| {
        format!(", {:.1} % of the area locked", 100.0 * share)
    });
    let mut lines = vec![
        table.end().text(),
        format!(
            "the episode began {:.3} m off the tool, with {:.2} mm of surplus",
            episode.region_initial_m,
            1e3 * episode.surplus_initial_m
        ),
        format!("  {}", episode.path.text()),
        format!(
            "  whole sheet: {:.3} m of {:.3} m, {:.2} mm of {:.2} mm; through itself in {} places",
            episode.sheet_final_m,
            episode.sheet_initial_m,
            1e3 * episode.sheet_surplus_final_m,
            1e3 * episode.sheet_surplus_initial_m,
            episode.self_intersections
        ),
        format!(
            "  undraped inner vertices {}; yarn strain p95 {:.2} %, maximum {:.1} %",
            episode.undraped_inner,
            100.0 * episode.strain_p95,
            100.0 * episode.strain_max
        ),
        format!(
            "  shear at most {:.0} degrees{locked}; v_rms {:.1} mm/s; {:.2} s",
            episode.shear_max_deg, episode.v_rms_mm_s, episode.seconds
        ),
    ];
    let diverged: usize = sampled.iter().chain(&random).map(|all| all.diverged).sum();
    if diverged > 0 {
        lines.push(format!(
            "episodes left out because they diverged: {diverged}"
        ));
    }
    if let Some(deviations) = report.deviations_above_random {
        let side = if deviations < 0.0 { "below" } else { "above" };
        lines.push(format!(
            "the episode lies {:.2} deviations {side} the random mean",
            deviations.abs()
        ));
    }
    if let Some(rows) = &report.proof {
        lines.push(proof::text(rows));
    }
    lines.extend(report.sensitivity.iter().map(proof::of_one));
    lines.push(format!("pictures in {}", report.pictures.display()));
    if !report.is_elsewhere {
        lines.push(format!("next: drape robot {}", report.run.display()));
    }
    lines.join("\n")
}
