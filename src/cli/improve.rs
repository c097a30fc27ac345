use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use serde::Serialize;

use super::Failure;
use super::explained::{doubts, explained, factors, line, same_scan};
use super::failure::{Interrupted, OrInvalid};
use super::loaded::{Loaded, Source};
use super::output::{OutFolder, percent, print};
use super::proof;
use super::scanned::ScanArgs;
use super::searched::{NewRun, Searched};
use super::setup::open_run;
use super::signals::stop_on_signal;
use super::terminal::{Told, tell};
use crate::run::{
    BestPaths, Budget, Parameter, RunConfig, RunFolder, ScanFile, Turn, digest, kept_presses,
};
use drape_calibrate::{Estimate, FACTORS, ObservedCloth, posterior, scaled, write_material};
use drape_cloth::file::read_bytes;
use drape_cloth::scene::{Fabric, Scene};
use drape_cloth::sim::{Bending, BendingStiffness, Tension};
use drape_proof::Row;
use drape_proof::presses::resting;
use drape_task::env::Quantity;

/// Learn from scans of what was pressed: a better fabric, and a better path for it
///
/// The proved path of RUN was pressed and the cloth then scanned. What fabric explains the scans is found as `calibrate`
/// finds it, becomes the fabric and the scatter of a new run, the old path is searched on from there and the best is
/// proved. RUN stays as it is. Ctrl-C, SIGTERM and SIGHUP stop it, with the exit code 130, 143 or 129.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape improve runs/a --scan pressed.ply --unit mm --marks marks.toml --name a-2
  drape improve runs/a-2 --scan part-7.ply part-8.ply --unit mm --polish 40000 --json")]
pub struct ImproveArgs {
    /// Run folder whose proved path was pressed
    run: PathBuf,

    /// What was scanned after that: STL, PLY or text files of points, each of one blank
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    scan: Vec<PathBuf>,

    #[command(flatten)]
    placing: ScanArgs,

    /// Environment steps of search from the old path on; the run's `polish` if not given, or its `steps` where that
    /// is 0
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=RunConfig::MAX_STEPS))]
    polish: Option<u64>,

    #[command(flatten)]
    new: NewRun,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Outcome {
    run: Told,
    /// Its number since the first run, 1 for the first.
    turn: usize,
    #[serde(flatten)]
    found: Turn,
    /// The new path in the new worlds, beside other orders.
    proof: Vec<Row>,
}

/// What scans say of the fabric of a run.
struct Explained {
    scans: Vec<ScanFile>,
    /// The path that was pressed.
    path: Vec<u32>,
    scene: Arc<Scene>,
    estimate: Estimate,
}

/// Runs `drape improve`.
pub fn run(args: ImproveArgs) -> Result<(), Failure> {
    if args.placing.unit.is_none() {
        return Err(Failure::invalid(anyhow!(
            "--unit is missing, expected mm, cm, in or m: files of scans do not say it"
        )));
    }
    let (old, mut config) = open_run(&args.run)?;
    if old.read_proof()?.is_none() {
        let run = args.run.display();
        return Err(Failure::invalid(anyhow!(
            "{run} has no proved path, expected proof.json, which `drape eval {run} --sequence --prove` writes"
        )));
    }
    RunFolder::check_free(&args.new.runs, args.new.name.as_deref(), Some("improve"))?;
    let _runs = OutFolder::make(&args.new.runs)?;
    let mut turns = old.read_turns()?;
    let Explained {
        scans,
        path,
        scene,
        estimate,
    } = explain(&args)?;
    config.polish = match (args.polish, config.polish) {
        (Some(steps), _) => steps,
        (None, 0) => config.steps,
        (None, steps) => steps,
    };
    // Until the new run has copied what is in it.
    let inputs = tempfile::tempdir().context("cannot make a temporary folder")?;
    let notes = adopt(&mut config, &scene, &estimate, inputs.path())?;
    let known = match old.best_sequence.exists() {
        true => old
            .read_best_sequence()
            .or_invalid()?
            .all()
            .cloned()
            .collect(),
        false => Vec::new(),
    };
    // What is known before the search stays known if that is interrupted.
    turns.push(Turn {
        from: args.run.display().to_string(),
        scans,
        points: estimate.residuals,
        rms_mm: 1e3 * estimate.rms,
        parameters: factors(&estimate),
        notes,
        score_before: None,
        score_after: None,
        presses_before: path.len(),
        presses_after: 0,
        presses_kept: 0,
    });
    let (folder, before, rows) = improved(&args, config, &path, known, &turns)?;
    let after = folder.read_proof()?.map(|proved| proved.path);
    let pressed = after.as_ref().map_or(&[][..], |after| &after.vertices);
    let found = turns.last_mut().expect("it was just added");
    found.score_before = Some(before).filter(|score| score.is_finite());
    found.score_after = after.as_ref().map(|after| after.score);
    found.presses_after = pressed.len();
    found.presses_kept = kept_presses(&path, pressed);
    let found = found.clone();
    folder.write_turns(&turns)?;
    let outcome = Outcome {
        run: (&folder.path).into(),
        turn: turns.len(),
        found,
        proof: rows,
    };
    print(&outcome, text)
}

/// Presses the path of the run again, puts the scans on to where it ends, and finds the fabric that explains them.
fn explain(args: &ImproveArgs) -> Result<Explained, Failure> {
    let scanned = |file: &PathBuf| {
        Ok(ScanFile {
            file: file.display().to_string(),
            digest: digest(read_bytes(file, MOST_MIB).or_invalid()?),
        })
    };
    // Before the work: one that is missing would waste it.
    let scans = args
        .scan
        .iter()
        .map(scanned)
        .collect::<Result<Vec<ScanFile>, Failure>>()?;
    for (k, scan) in scans.iter().enumerate() {
        if let Some(first) = scans[..k].iter().find(|other| other.digest == scan.digest) {
            return Err(same_scan([&scan.file, &first.file]));
        }
    }
    let loaded = Loaded::open(&args.run, Source::Path, None, None)?;
    let (played, _) = loaded.play_path()?;
    let (scene, path) = (&loaded.scene, played.recording.vertices());
    let pressed = resting(scene, played.recording.end().to_vec());
    let scatter = &loaded.config.scatter;
    let env = scatter.finest(&loaded.config.env);
    let state = |file: &PathBuf| {
        let seen = args.placing.seen(file, &pressed)?;
        let (scene, env) = (scene.clone(), env.clone());
        Ok(ObservedCloth::new(scene, env, path.clone(), &seen.points))
    };
    let states = args.scan.iter().map(state);
    let states = states.collect::<Result<Vec<_>, Failure>>()?;
    let estimate = explained(&states, &args.scan, scatter)?;
    Ok(Explained {
        scans,
        path,
        scene: scene.clone(),
        estimate,
    })
}

/// Largest scan that is read [MiB].
const MOST_MIB: u64 = 2048;

/// Gives a configuration the fabric that was found, in a file of `folder`, and how far it may be off as scatter. What the
/// scans do not tell scatters as it did. Gives what has to be known beside the numbers.
fn adopt(
    config: &mut RunConfig,
    scene: &Scene,
    estimate: &Estimate,
    folder: &Path,
) -> Result<Vec<String>, Failure> {
    let physics = &mut config.scene.physics;
    let (material, mut notes) = scaled(&scene.lamina.material, physics, estimate);
    notes.extend(doubts(estimate));
    if let (BendingStiffness::NewtonMetre(stiffness), true) = (
        &mut physics.bending_stiffness,
        physics.bending != Bending::Off,
    ) {
        let of_bending = FACTORS.iter().zip(&estimate.at);
        let factor = of_bending.filter(|(quantity, _)| **quantity == Quantity::Bending);
        factor.for_each(|(_, at)| *stiffness *= at.exp());
    }
    // The built-in material need not say it, but a file of it has to.
    physics.tension.get_or_insert(Tension::FirstBranch);
    let told = posterior(estimate);
    config.scatter.spreads.extend(told.spreads.clone());
    let file = folder.join("material.toml");
    write_material(&file, &material, &notes, &told)?;
    config.scene.material = Some(Fabric::File(file));
    Ok(notes)
}

/// Makes the new run, to which `turns` have led and whose path is the best that is found from the old one and `known` ones
/// on. Gives the score of the old path in it and the proof of the new one.
fn improved(
    args: &ImproveArgs,
    config: RunConfig,
    path: &[u32],
    known: Vec<Vec<u32>>,
    turns: &[Turn],
) -> Result<(RunFolder, f64, Vec<Row>), Failure> {
    let place = format!("{} with the fabric of the scans", args.run.display());
    let budget = Budget::Presses(config.polish);
    let run = Searched::begin(config, place, &args.new, "improve".into(), None)?;
    run.folder.write_turns(turns)?;
    let mut starts = vec![path.to_vec()];
    starts.extend(known.into_iter().filter(|list| list != path));
    let mut orders = run.by_moves(&run.worlds()?, starts, budget)?.0.orders;
    let keep = |orders| {
        let best = run.keep(&BestPaths::judged(orders))?;
        Ok::<_, Failure>(best.expect("a search gives what it began with at least"))
    };
    if let Some(signal) = stop_on_signal()?() {
        keep(orders)?;
        tell(format_args!(
            "interrupted; prove what is found with: drape eval {} --sequence --prove",
            run.folder.path.display()
        ));
        return Err(Interrupted(signal).into());
    }
    let before = proof::score(proof::case(&run.scene, &run.config), path)?;
    if orders.iter().all(|(list, _)| list != path) {
        // It is a rival, whatever the search thought of it.
        orders.insert(1, (path.to_vec(), before));
    }
    let rows = run.prove(keep(orders)?)?;
    Ok((run.folder, before, rows))
}

fn text(outcome: &Outcome) -> String {
    let (run, found) = (outcome.run.display(), &outcome.found);
    let mut lines = vec![format!(
        "{run}: turn {} from {}, {} points, {:.3} mm off the simulated cloth rms",
        outcome.turn, found.from, found.points, found.rms_mm
    )];
    lines.extend(found.parameters.iter().map(|found: &Parameter| line(found)));
    lines.extend(found.notes.iter().cloned());
    let [before, after] = [found.score_before, found.score_after].map(percent);
    lines.push(format!(
        "score with this fabric: old path {before}, new path {after}"
    ));
    lines.push(format!(
        "presses: {} before, {} now, {} of them as before",
        found.presses_before, found.presses_after, found.presses_kept
    ));
    lines.extend((!outcome.proof.is_empty()).then(|| proof::text(&outcome.proof)));
    lines.push(format!("next: drape robot {run}"));
    lines.join("\n")
}
