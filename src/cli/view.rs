use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use anyhow::{Context, Error, anyhow};
use serde_json::{Value, json};

use super::Failure;
use super::args::accuracy;
use super::arm::robot;
use super::failure::OrInvalid;
use super::loaded::load_agent;
use super::output::check_outputs;
use super::planned::cell_config;
use super::setup::{missed, odd_fit, oddities, open_run, read_config, read_scene_or_run, warn};
use super::terminal::{is_json, show, tell};
use super::tool::shape;
use crate::run::{
    BestSequence, Demonstrations, RunConfig, RunFolder, curve, digest, play, random_episodes,
    read_metrics,
};
use drape_cloth::fabric::{Drape, Lamina};
use drape_cloth::file::{ValueError, check_name, write_atomic};
use drape_cloth::math::Vec3;
use drape_cloth::scene::{Fabric, Scene};
use drape_cloth::sim::{Accuracy, Snapshot};
use drape_cloth::tool::{GridConfig, MeshSource, Pose, Shape, Source, ToolConfig};
use drape_learn::ppo::{Agent, Sampling};
use drape_robot::CellConfig;
use drape_task::env::{Draping, EpisodeState, ImageShape, Tasks};
use drape_task::path::PressedPoint;
use drape_task::recording::{RecordedFrame, Recording};
use drape_view::{Host, Offers, Rival, RobotJob, RobotPlace, Server, Session, Shared, Spec, Watch};

/// Random episodes that presses by hand are shown beside, and vertices of the largest blank on which they are played.
const RANDOM: usize = 8;
const MOST_VERTICES: usize = 5000;
/// Points of a curve.
const MOST_POINTS: usize = 300;
/// Commands that may wait for the session.
const COMMANDS: usize = 1024;

/// Show cloth in a browser, to be turned, pressed and pulled
///
/// Serves one page on this machine until Ctrl-C, and prints its address, with --json also its token. All pages with the address see the same cloth.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape view --open
  drape view configs/scenes/rib.toml
  drape view runs/a --watch runs/b --watch runs/c
  drape view runs/a/pictures/eval/recording.drape --beside twin.drape
  drape view runs/a --export page.html
  drape view runs/a --cell cell.toml
  ssh -L 9000:127.0.0.1:8000 host drape view --port 8000 --no-open")]
pub struct ViewArgs {
    /// Scene or task file, run folder, or a recording, a sequence of presses or a state, in the folder of a run or beside
    /// its task; the built-in quickstart if not given
    what: Option<PathBuf>,

    /// Show a recording or a state of the same blank beside it, by whatever physics
    #[arg(long, value_name = "FILE")]
    beside: Option<PathBuf>,

    /// Which checkpoint of the run to ask: best, which is the default, last, or a file
    #[arg(long, value_name = "best|last|FILE")]
    checkpoint: Option<String>,

    /// Show the curves of this run too, while it trains; may be given again
    #[arg(long, value_name = "RUN")]
    watch: Vec<PathBuf>,

    /// Offer this STL or PLY file as a tool, in millimetres; may be given again
    #[arg(long, value_name = "FILE")]
    tool: Vec<PathBuf>,

    /// Offer this material file; may be given again
    #[arg(long, value_name = "FILE")]
    material: Vec<PathBuf>,

    /// Show the robot of this cell, as docs/ROBOT.md has it; the run's own, or what `drape robot` has left in it, if not
    /// given
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,

    /// How finely presses are stepped, fast, balanced or accurate, instead of the configuration's rates
    #[arg(long, value_parser = accuracy, value_name = "NAME")]
    accuracy: Option<Accuracy>,

    /// Folder that the page saves presses and tasks to; must exist
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,

    /// Write a page that replays the presses without a server, instead of serving one
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "open", "allow_host"])]
    export: Option<PathBuf>,

    /// Port to listen on; a free one if not given
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,

    /// Another name by which pages may call this host, as behind a proxy; may be given again
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,

    /// Open the page in the browser
    #[arg(long, overrides_with = "no_open")]
    open: bool,

    /// Do not open it, which is the default
    #[arg(long)]
    no_open: bool,
}

/// Runs `drape view`.
pub fn run(mut args: ViewArgs) -> Result<(), Failure> {
    let (mut what, mut pressed) = (args.what.take(), None);
    if let Some(file) = what.take_if(|path| {
        path.extension()
            .is_some_and(|end| end == "drape" || end == "json")
    }) {
        what = Some(task_of(&file)?);
        match Drape::read(&file) {
            Ok(_) if args.beside.is_some() => {
                let fault = anyhow!("{}: a state stands beside itself", file.display());
                return Err(Failure::invalid(fault));
            }
            Ok(_) => args.beside = Some(file),
            Err(_) => pressed = Some(file),
        }
    }
    let (folder, (mut config, place)) = match what.as_deref() {
        Some(path) if path.is_dir() => {
            let (folder, config) = open_run(path)?;
            let place = folder.config.display().to_string();
            (Some(folder), (config, place))
        }
        Some(path) => (None, (read_scene_or_run(path)?, path.display().to_string())),
        None => (None, read_config(None)?),
    };
    if let Some(accuracy) = args.accuracy {
        config.env.set_accuracy(accuracy);
    }
    let spec = Spec {
        scene: config.scene.clone(),
        env: config.env.clone(),
    };
    let watched = args.watch.iter().map(|path| RunFolder::open(path));
    let watched: Vec<RunFolder> = watched.collect::<Result<_, _>>().or_invalid()?;
    if !args.out.is_dir() {
        let fault = anyhow!("--out {}: there is no such folder", args.out.display());
        return Err(Failure::invalid(fault));
    }
    if let (None, Some(name)) = (&folder, &args.checkpoint) {
        let fault = anyhow!("--checkpoint {name}: {place} is no run");
        return Err(Failure::invalid(fault));
    }
    // What cannot be read shows before the fall.
    let material = spec.scene.read_material().or_invalid_in(&place)?;
    let lamina = Lamina::new(&spec.scene.blank, material).or_invalid_in(&place)?;
    let read = Demonstrations::read(pressed.as_slice(), &lamina).or_invalid()?;
    let beside = args
        .beside
        .as_deref()
        .map(|file| Beside::read(file, &lamina));
    let cell = cell_config(args.cell.as_deref(), folder.as_ref(), &config)?;
    let host = Desk {
        has_robot: args.cell.is_some() || config.cell.is_some() || cell.0.base.is_some(),
        cell,
        agent: None,
        runs: folder.iter().cloned().chain(watched).collect(),
        run: folder.map(|folder| (folder, args.checkpoint.clone())),
        offers: offers(&args),
        pressed: read.lists().first().cloned(),
        beside: beside.transpose()?,
        out: args.out.clone(),
        first: spec.clone(),
        path_score: None,
        config,
        place,
    };

    let (sender, commands) = sync_channel(COMMANDS);
    let shared = Arc::new(Shared::default());
    if let Some(file) = &args.export {
        let files = spec.scene.files();
        let given = what
            .iter()
            .chain(&pressed)
            .chain(&args.beside)
            .chain(&args.cell);
        let read = given.chain(&args.tool).chain(&args.material).chain(&files);
        check_outputs([&**file], read.map(PathBuf::as_path))?;
        let page = Session::new(host, spec, shared, commands)?.export();
        let page = page.map_err(|error| anyhow!(error))?;
        write_atomic(file, |file| file.write_all(page.as_bytes()))?;
        return Ok(show(&match is_json() {
            true => json!({ "file": file }).to_string(),
            false => format!("written to {}", file.display()),
        })?);
    }
    let server = Server::open(args.port, &args.allow_host, shared.clone(), sender);
    let server = server.with_context(|| format!("cannot listen on port {}", args.port))?;
    let (address, token) = (
        format!("http://{}/", server.address()?),
        server.token().to_owned(),
    );
    let page = format!("{address}#{token}");
    server.start();
    show(&match is_json() {
        true => json!({ "address": address, "token": token }).to_string(),
        false => format!("{page}\nCtrl-C ends it"),
    })?;
    if args.open {
        open(&page);
    }
    Session::new(host, spec, shared, commands)?.run();
    Ok(())
}

/// Where the task of presses or of a state is: the run whose folder they are in, or the file beside them that has their
/// name.
fn task_of(made: &Path) -> Result<PathBuf, Failure> {
    let made = std::path::absolute(made)?;
    let mut folders = made.ancestors().skip(1).take(3);
    let run = folders.find(|folder| folder.join("run.json").exists());
    let beside = made.with_extension("toml");
    run.map(PathBuf::from)
        .or(beside.exists().then_some(beside.clone()))
        .ok_or_else(|| {
            Failure::invalid(anyhow!(
                "{}: its task is unknown, expected the folder of a run around it or {} beside it",
                made.display(),
                beside.display()
            ))
        })
}

/// Built-in shapes and the files that were given.
fn offers(args: &ViewArgs) -> Offers {
    let name = |path: &Path| path.display().to_string();
    let tool = |source| ToolConfig {
        source,
        pose: Pose::default(),
        grid: GridConfig::default(),
    };
    let by_default = |name| shape(name, &[]).expect("a shape has defaults");
    let shapes = Shape::KINDS.map(|name| (name.into(), tool(Source::Shape(by_default(name)))));
    let mesh = |path: &PathBuf| MeshSource {
        path: path.clone(),
        scale: 1e-3,
    };
    let files = args
        .tool
        .iter()
        .map(|path| (name(path), tool(Source::Mesh(mesh(path)))));
    let materials = args
        .material
        .iter()
        .map(|path| (name(path), Fabric::File(path.clone())));
    Offers {
        tools: shapes.into_iter().chain(files).collect(),
        materials: materials.collect(),
    }
}

/// Lets the desktop open a page. Where there is none, the address was printed.
fn open(page: &str) {
    let mut command = match std::env::consts::OS {
        "macos" => Command::new("open"),
        "windows" => Command::new("explorer"),
        _ => Command::new("xdg-open"),
    };
    command
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    if let Err(error) = command.spawn() {
        tell(format_args!("warning: cannot open the browser: {error}"));
    }
}

/// What stands beside the presses.
enum Beside {
    Frames(Vec<RecordedFrame>),
    /// Places in the frame of the scene [m].
    State(Vec<[f64; 3]>),
}

impl Beside {
    /// A recording, or a state where the file ends in `.json`, of this blank.
    fn read(file: &Path, lamina: &Lamina) -> Result<Self, Failure> {
        let (rest, read) = match file.extension().is_some_and(|end| end == "json") {
            false => {
                let made = Recording::read(file).or_invalid()?;
                (made.rest, Self::Frames(made.frames))
            }
            true => {
                let state = Drape::read(file).or_invalid()?;
                (state.rest, Self::State(state.position))
            }
        };
        // States are read to the last bit but one.
        let near = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
        match lamina.rest.len() == rest.len() && lamina.rest.iter().zip(&rest).all(near) {
            true => Ok(read),
            false => Err(Failure::invalid(anyhow!(
                "{}: is of another blank than that of the task",
                file.display()
            ))),
        }
    }
}

/// What the session asks for beside cloth.
struct Desk {
    config: RunConfig,
    place: String,
    /// With the checkpoint that was asked for.
    run: Option<(RunFolder, Option<String>)>,
    /// The policy of the run, for tasks that look like its own.
    agent: Option<Agent>,
    /// The task that was asked for.
    first: Spec,
    /// Of the path that can be gone through, where a run has found it.
    path_score: Option<f64>,
    /// The vertices that are gone through, if they are not those of a run, and what stands beside them.
    pressed: Option<Vec<u32>>,
    beside: Option<Beside>,
    runs: Vec<RunFolder>,
    offers: Offers,
    out: PathBuf,
    /// The robot's cell, and where it is from.
    cell: (CellConfig, String),
    has_robot: bool,
}

impl Desk {
    /// A name in the folder for what is saved that nothing has, with these ends.
    fn free_name(&self, start: &str, ends: &[&str]) -> String {
        let mut names = (1..).map(|number| format!("{start}-{number}"));
        let file = |name: &String, end| self.out.join(format!("{name}.{end}"));
        let is_free = |name: &String| {
            ends.iter()
                .all(|end| file(name, end).symlink_metadata().is_err())
        };
        names.find(is_free).expect("names do not run out")
    }

    /// Whether a policy of the run knows this task.
    fn looks_alike(&self, draping: &Draping) -> bool {
        draping.config().region_mm == self.first.env.region_mm
            && draping.scene().config == self.first.scene
    }

    /// Writes a task. Gives the text of it.
    fn write_task(&self, spec: &Spec, file: &Path) -> Result<String, Error> {
        let text = self.config.with_task(&spec.scene, &spec.env)?.to_toml();
        write_atomic(file, |file| file.write_all(text.as_bytes()))?;
        Ok(text)
    }
}

impl Host for Desk {
    type Error = Failure;

    fn refuse(&self, error: ValueError) -> Failure {
        Error::new(error).context(self.place.clone()).into()
    }

    fn set_up(&mut self, spec: &Spec, watch: Watch) -> Result<(Arc<Scene>, Vec<String>), Failure> {
        let watch =
            |scene: &Scene, share: f64, cloth: &dyn Fn() -> Snapshot| watch(scene, share, cloth);
        let scene = drape_scan::set_up(&spec.scene, watch);
        let (scene, fit) = scene.with_context(|| self.place.clone())?;
        let odd = oddities(&scene).into_iter();
        let odd = odd.chain(fit.iter().flat_map(|fit| odd_fit(fit, &scene)));
        let oddities: Vec<String> = missed(&scene).into_iter().chain(odd).collect();
        warn(oddities.iter().cloned(), &self.place);
        Ok((Arc::new(scene), oddities))
    }

    fn advise(&self, draping: &Draping) -> Option<Vec<f32>> {
        let agent = self.agent.as_ref().filter(|_| self.looks_alike(draping))?;
        // Where all is touched, nothing is allowed.
        match draping.is_over(0) {
            true => Some(Vec::new()),
            false => Some(agent.probabilities(draping.observation(0))),
        }
    }

    fn rivals(&self, draping: &Draping) -> Box<dyn FnOnce() -> Vec<Rival> + Send> {
        let (scene, env) = (draping.scene().clone(), draping.config().clone());
        let is_first = env == self.first.env && scene.config == self.first.scene;
        let path = self.path_score.filter(|_| is_first);
        let agent = self.agent.clone().filter(|_| is_first);
        let is_small = scene.lamina.vertex_count() <= MOST_VERTICES;
        let is_played = is_small && draping.task(0).can_win();
        Box::new(move || {
            let by_policy = agent.and_then(|agent| {
                let choose =
                    |seen: &Draping| agent.act(&[seen.observation(0)], Sampling::Greedy)[0];
                let mut draping = Draping::new(scene.clone(), &env, 1).ok()?;
                Some(play(&mut draping, choose, |_| ()).ok()?.summary.score)
            });
            let played = is_played.then(|| random_episodes(&scene, &env, RANDOM, |_| ()));
            let scores = played
                .into_iter()
                .flatten()
                .flatten()
                .map(|episode| episode.score);
            let scores: Vec<f64> = scores.filter(|score| score.is_finite()).collect();
            let mean = scores.iter().sum::<f64>() / scores.len() as f64;
            let rivals = [
                ("the run's path, as it was judged", path),
                ("the policy", by_policy),
                ("random orders", Some(mean).filter(|mean| mean.is_finite())),
                ("the best of them", scores.into_iter().reduce(f64::max)),
            ];
            let known = |(name, score): (&str, Option<f64>)| {
                Some(Rival {
                    name: name.into(),
                    score: score?,
                })
            };
            rivals.into_iter().filter_map(known).collect()
        })
    }

    fn save_presses(
        &mut self,
        spec: &Spec,
        lamina: &Lamina,
        made: &Recording,
    ) -> Result<Vec<String>, Failure> {
        let name = self.free_name("presses", &["drape", "json", "toml"]);
        let file = |end: &str| self.out.join(format!("{name}.{end}"));
        let text = self.write_task(spec, &file("toml"))?;
        made.write(&file("drape"))?;
        let sequence = BestSequence {
            vertices: made.vertices(),
            score: made.frames.last().map_or(0.0, |frame| frame.score),
            grid: ImageShape {
                rows: lamina.rows,
                columns: lamina.columns,
            },
            config_digest: digest(text),
            others: Vec::new(),
        };
        let json = serde_json::to_string_pretty(&sequence)?;
        write_atomic(&file("json"), |file| writeln!(file, "{json}"))?;
        Ok(["drape", "json", "toml"]
            .map(|end| file(end).display().to_string())
            .into())
    }

    fn save_task(&mut self, spec: &Spec) -> Result<String, Failure> {
        let file = self.out.join(self.free_name("task", &["toml"]) + ".toml");
        check_name(&file)?;
        self.write_task(spec, &file)?;
        Ok(file.display().to_string())
    }

    fn curves(&self) -> Value {
        let of = |run: &RunFolder| {
            // Not yet, or just being written.
            let metrics = read_metrics(&run.metrics).ok()?;
            let curve = |of| {
                let all = curve(&metrics, of);
                let every = all.len().div_ceil(MOST_POINTS).max(1);
                let from_end = all.into_iter().rev().step_by(every);
                from_end.rev().collect::<Vec<_>>()
            };
            Some(json!({
                "name": run.path.file_name().unwrap_or_default().to_string_lossy(),
                "best": curve("best_score"),
                "mean": curve("mean_score"),
            }))
        };
        self.runs.iter().filter_map(of).collect::<Vec<_>>().into()
    }

    fn path(&mut self, draping: &Draping) -> Result<Vec<u32>, Failure> {
        // A training may have written one since.
        if let Some((folder, checkpoint)) = self.run.as_ref().filter(|_| self.looks_alike(draping))
            && (checkpoint.is_some()
                || folder.check_trained().is_ok() && folder.best_checkpoint.exists())
        {
            let name = checkpoint.as_deref().unwrap_or("best");
            self.agent = Some(load_agent(folder, &self.config, name, draping)?);
        }
        if let Some(pressed) = &self.pressed {
            return Ok(pressed.clone());
        }
        let Some((folder, _)) = &self.run else {
            return Ok(Vec::new());
        };
        let lamina = &draping.scene().lamina;
        let best = match folder.read_proof()? {
            Some(proved) => proved.path,
            None if folder.best_sequence.exists() => folder.read_best_sequence()?,
            None => return Ok(Vec::new()),
        };
        let is_alike = [best.grid.rows, best.grid.columns] == [lamina.rows, lamina.columns];
        let checked = best
            .check_config(&folder.config_digest()?)
            .and(is_alike.then_some(()).ok_or("is of another blank".into()));
        let place = folder.best_sequence.display();
        checked.map_err(|fault| Failure::invalid(anyhow!("{place}: {fault}")))?;
        self.path_score = Some(best.score);
        Ok(best.vertices)
    }

    fn beside(&self, draping: &Draping) -> Vec<RecordedFrame> {
        match &self.beside {
            None => Vec::new(),
            Some(Beside::Frames(frames)) => frames.clone(),
            Some(Beside::State(position)) => {
                let (mut cloth, origin) = (draping.state(0), draping.scene().tool.origin);
                let place = |&x: &[f64; 3]| (Vec3::from(x) - origin).into();
                cloth.position = position.iter().map(place).collect();
                let mut made = Recording::new(draping.task(0));
                made.see(draping.task(0), &EpisodeState::new(Vec::new(), cloth));
                made.frames
            }
        }
    }

    fn has_robot(&self) -> bool {
        self.has_robot
    }

    fn robot(
        &self,
        draping: &Draping,
        points: &[PressedPoint],
        place: Option<RobotPlace>,
        plan: bool,
    ) -> RobotJob {
        let ((cell, told), scene) = (self.cell.clone(), draping.scene().clone());
        let (points, rolling) = (points.to_vec(), draping.config().rolling());
        Box::new(move || {
            let found = robot(cell, &told, &scene, &points, rolling, place, plan);
            found.map_err(|error| error.to_string())
        })
    }

    fn offers(&self) -> &Offers {
        &self.offers
    }
}
