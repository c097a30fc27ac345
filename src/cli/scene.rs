use std::path::PathBuf;
use std::time::Instant;

use super::Failure;
use super::failure::scene_failure;
use super::output::Progress;
use crate::scene::{Scene, SceneConfig};

/// Let the blank fall on to the tool and show how it lies
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Scene file; the built-in rib with two wrinkles if not given
    config: Option<PathBuf>,

    /// Folder for meshes, pictures and summary; created where missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Also compare the distance grid with the exact distance
    #[arg(long)]
    grid_error: bool,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// Runs `drape scene`.
pub fn run(args: Args) -> Result<(), Failure> {
    let start = Instant::now();
    let (config, place) = match &args.config {
        Some(path) => (SceneConfig::read(path)?, path.display().to_string()),
        None => (SceneConfig::rib(), "built-in scene".into()),
    };
    let scene = set_up(&config, &place, args.json)?;
    let _ = (start, scene);
    Ok(())
}

/// Sets up the scene that was read from `place`, with a progress bar.
pub(super) fn set_up(config: &SceneConfig, place: &str, json: bool) -> Result<Scene, Failure> {
    let progress = Progress::new("draping", json);
    Scene::new(config, |share| progress.set(share)).map_err(|error| scene_failure(error, place))
}
