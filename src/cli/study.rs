mod episodes;
mod stability;
mod tradeoff;
mod transfer;
mod twin;
mod verify;

use std::path::Path;
use std::time::SystemTime;

use anyhow::anyhow;
use clap::Subcommand;

use super::Failure;
use super::failure::OrInvalid;
use super::output::OutFolder;
use crate::run::dated_folder;
use drape_cloth::scene::{SceneConfig, SceneError};
use drape_study::twin::TwinStudyError;
use drape_task::env::EnvError;

/// Measure the simulator itself
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, Subcommand)]
enum Study {
    Episodes(episodes::Args),
    Stability(stability::Args),
    Tradeoff(tradeoff::Args),
    Verify(verify::Args),
    Transfer(transfer::Args),
    Twin(twin::Args),
}

/// The focus region of the quickstart [mm].
const REGION: [f64; 4] = [-186.0, -186.0, -60.0, -60.0];
/// Vertices along the longer side of the blank, where nothing else is asked for.
const MESH: usize = 33;

/// Runs `drape study`.
pub fn run(args: Args) -> Result<(), Failure> {
    match args.study {
        Study::Episodes(args) => episodes::run(args),
        Study::Stability(args) => stability::run(args),
        Study::Tradeoff(args) => tradeoff::run(args),
        Study::Verify(args) => verify::run(args),
        Study::Transfer(args) => transfer::run(args),
        Study::Twin(args) => twin::run(args),
    }
}

/// Four numbers between commas.
fn region(text: &str) -> Result<[f64; 4], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .filter_map(|n| n.trim().parse().ok())
        .collect();
    let all = numbers.len() == text.split(',').count() && numbers.iter().all(|n| n.is_finite());
    match <[f64; 4]>::try_from(numbers) {
        Ok(region) if all => Ok(region),
        _ => Err("expected four numbers between commas, as -186,-186,-60,-60".into()),
    }
}

/// The scene of a file, or the built-in one, and what to call it.
fn scene_config(path: Option<&Path>) -> Result<(SceneConfig, String), Failure> {
    Ok(match path {
        Some(path) => (
            SceneConfig::read(path).or_invalid()?,
            path.display().to_string(),
        ),
        None => (SceneConfig::rib(), "the built-in scene".into()),
    })
}

/// Gives the blank `mesh` vertices along its longer side. Blanks with a cell or an outline of
/// their own keep their mesh, unless another is asked for, which they cannot have.
fn set_mesh(config: &mut SceneConfig, mesh: Option<usize>) -> Result<(), Failure> {
    let blank = &mut config.blank;
    if blank.outline.is_some() || blank.cell_mm.is_some() {
        return match mesh {
            None => Ok(()),
            Some(_) => Err(Failure::invalid(anyhow!(
                "`--mesh` is for rectangular blanks without `blank.cell_mm`"
            ))),
        };
    }
    let cells = (mesh.unwrap_or(MESH) - 1) as f64;
    let longer = blank.size_mm[0].max(blank.size_mm[1]);
    // Sides that are no lengths are refused when the blank is cut.
    blank.vertices = blank
        .size_mm
        .map(|side| 1 + ((cells * side / longer).round() as usize).max(1));
    Ok(())
}

/// The folder to write to, made before the work.
fn folder(out: Option<&Path>, prefix: &str) -> Result<OutFolder, Failure> {
    match out {
        Some(folder) => OutFolder::make(folder),
        None => {
            let runs = Path::new("runs");
            let made = if runs.exists() { 1 } else { 2 };
            let path = dated_folder(runs, prefix, SystemTime::now())?;
            Ok(OutFolder { path, made })
        }
    }
}

/// What is wrong with a study's environment, whose region is an option.
fn as_option(error: &EnvError) -> String {
    error.to_string().replace("`env.region_mm`", "`--region`")
}

/// Sorts what can go wrong with a study that has a twin.
fn twin_failure(error: TwinStudyError, place: &str) -> Failure {
    let is_input = match &error {
        TwinStudyError::Scene(error) => !matches!(error, SceneError::Diverged { .. }),
        TwinStudyError::Env(_) | TwinStudyError::Twin(_) => true,
        TwinStudyError::Diverged { .. }
        | TwinStudyError::FastDiverged
        | TwinStudyError::Sheet { .. } => false,
    };
    let error = match error {
        TwinStudyError::Env(error) => anyhow!(as_option(&error)),
        error => anyhow::Error::new(error),
    };
    let error = error.context(place.to_string());
    if is_input {
        Failure::invalid(error)
    } else {
        error.into()
    }
}
