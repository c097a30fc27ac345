//! What all studies share.

use std::path::{Path, PathBuf};

use crate::trainings::{Trainings, Treatment};
use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::scene::{SceneConfig, SceneError};
use drape_proof::{Listener, ProofError};
use drape_report::{Image, Table};
use drape_task::env::{EnvConfig, Scatter};

/// A study: its options are its fields. It prints and writes nothing.
pub trait Study {
    /// As on the command line.
    const NAME: &'static str;

    /// Names of the tables that a report of it can have.
    const TABLES: &'static [&'static str];

    /// Measures.
    ///
    /// # Errors
    /// If the options ask for what cannot be, or a simulation diverges that all depends on.
    fn run(&self, context: &Context) -> Result<Report, StudyError>;

    /// The folder of an earlier study that this one goes on with.
    fn resumed(&self) -> Option<&Path> {
        None
    }

    /// The scene, where the study has one; errors name it.
    fn scene(&self) -> Option<&SceneOptions> {
        None
    }
}

/// How much of a study is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// What takes little time.
    Quick,
    Full,
}

impl Effort {
    /// Whichever of two values it takes.
    pub(crate) fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

impl From<bool> for Effort {
    /// As `--quick` asks for, if it is given.
    fn from(quick: bool) -> Self {
        if quick { Self::Quick } else { Self::Full }
    }
}

/// What a study is given by whoever runs it.
pub struct Context<'a> {
    /// Is told the share that is done, 0 to 1, and what is being done.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
    /// Reads scene and task of a run folder, which this crate knows nothing of.
    pub read_task: Reader<'a, (SceneConfig, EnvConfig)>,
    /// Reads its best path, too.
    pub read_run: Reader<'a, TrainedPath>,
    /// Reads all paths that it has kept.
    pub read_kept: Reader<'a, KeptPaths>,
    /// Trains in the folder of the study, and reads what the runs have left.
    pub train: &'a dyn Fn(&Trainings) -> Result<Vec<Treatment>, StudyError>,
}

/// Reads something of a folder.
pub type Reader<'a, T> = &'a dyn Fn(&Path) -> Result<T, StudyError>;

/// An error of another crate.
pub type Failed = Box<dyn std::error::Error + Send + Sync>;

/// The best path of a run and what it was found for.
pub struct TrainedPath {
    pub scene: SceneConfig,
    pub env: EnvConfig,
    pub vertices: Vec<u32>,
}

/// All paths that a run has kept, best first, what they were found for, and how its worlds scatter.
pub struct KeptPaths {
    pub scene: SceneConfig,
    pub env: EnvConfig,
    pub scatter: Scatter,
    pub lists: Vec<Vec<u32>>,
}

impl Context<'_> {
    /// One that tells nobody and knows no runs.
    pub fn quiet() -> Context<'static> {
        Context {
            progress: &|_, _| (),
            read_task: &|_| Err(StudyError::Invalid("there are no runs".into())),
            read_run: &|_| Err(StudyError::Invalid("there are no runs".into())),
            read_kept: &|_| Err(StudyError::Invalid("there are no runs".into())),
            train: &|_| Err(StudyError::Invalid("there are no runs".into())),
        }
    }

    /// See [`Listener`].
    pub fn listener(&self) -> Listener<'_> {
        Listener(self.progress)
    }

    /// See [`Listener::each`].
    pub fn each<C: Sync, R: Send>(&self, cases: &[C], run: impl Fn(&C) -> R + Sync) -> Vec<R> {
        self.listener().each(cases, run)
    }
}

/// Writes a file of a report to the path it is given.
pub type WriteFile = Box<dyn Fn(&Path) -> Result<(), Failed>>;

/// What a study has found.
#[derive(Default)]
pub struct Report {
    pub tables: Vec<Table>,
    /// Lines for a reader, below the tables.
    pub notes: Vec<String>,
    /// What is no table, for JSON.
    pub facts: serde_json::Map<String, serde_json::Value>,
    /// Pictures and whatever else is for a folder, by name.
    pub files: Vec<(String, WriteFile)>,
}

impl Report {
    pub(crate) fn new(tables: impl Into<Vec<Table>>) -> Self {
        Self {
            tables: tables.into(),
            ..Self::default()
        }
    }

    pub(crate) fn fact(&mut self, key: &str, value: impl serde::Serialize) {
        let value = serde_json::to_value(value).expect("facts are plain data");
        self.facts.insert(key.into(), value);
    }

    pub(crate) fn file<E: Into<Failed>>(
        &mut self,
        name: impl Into<String>,
        write: impl Fn(&Path) -> Result<(), E> + 'static,
    ) {
        let write = move |path: &Path| write(path).map_err(Into::into);
        self.files.push((name.into(), Box::new(write)));
    }

    pub(crate) fn image(&mut self, name: impl Into<String>, image: Image) {
        self.file(name, move |path| image.save_png(path));
    }
}

/// A study that cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// Options that ask for what cannot be.
    #[error("{0}")]
    Invalid(String),
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A value of the scene or task that cannot be; its key or option is named.
    #[error("{0}")]
    Value(String),
    /// A run folder or a file that cannot be read.
    #[error(transparent)]
    Read(Failed),
    /// A file that the program itself has written and that is damaged.
    #[error(transparent)]
    Damaged(Failed),
    #[error("the fast solver diverged on the way")]
    FastDiverged,
    /// What a simulation of this name has come to, or what its sheet is refused for.
    #[error("{0}")]
    Named(&'static str, #[source] Failed),
    #[error(transparent)]
    Proof(#[from] ProofError),
    #[error("cannot start threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}

impl StudyError {
    /// Whether the user can mend it.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Invalid(_) | Self::Value(_) | Self::Read(_) => true,
            Self::Scene(error) => !matches!(error, SceneError::Diverged { .. }),
            Self::Proof(error) => error.is_input(),
            _ => false,
        }
    }
}

impl From<ValueError> for StudyError {
    /// The region of a study's environment is an option.
    fn from(error: ValueError) -> Self {
        Self::Value(error.to_string().replace("`env.region_mm`", "`--region`"))
    }
}

/// The front left corner of the rib with its wrinkle, the focus region of the paper's case [mm].
pub const CORNER: [f64; 4] = [-186.0, -186.0, -60.0, -60.0];

/// Options of studies of a scene.
#[derive(Clone, Debug, clap::Args)]
pub struct SceneOptions {
    /// Scene file, or run folder, of which scene and focus region are used; the built-in rib with
    /// two wrinkles if not given
    pub config: Option<PathBuf>,

    /// Vertices along the blank's longer side
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(3..=257))]
    pub mesh: Option<u16>,

    /// Focus region on the flat blank [mm]: least x, least y, greatest x, greatest y
    #[arg(long, value_name = "X,Y,X,Y", value_parser = region, allow_hyphen_values = true)]
    pub region: Option<[f64; 4]>,
}

/// A region on the flat blank from the command line: four numbers between commas, the lesser ones
/// first, in the unit that is written.
pub fn region(text: &str) -> Result<[f64; 4], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    let expected = "expected four numbers between commas, least x, least y, greatest x, greatest \
                    y, as -186,-186,-60,-60";
    match numbers.ok().and_then(|n| <[f64; 4]>::try_from(n).ok()) {
        Some(n) if n.iter().all(|x| x.is_finite()) && n[0] < n[2] && n[1] < n[3] => Ok(n),
        _ => Err(expected.into()),
    }
}

impl SceneOptions {
    /// What messages call the scene.
    pub fn place(&self) -> String {
        let path = self.config.as_ref();
        path.map_or("the built-in scene".into(), |p| p.display().to_string())
    }

    /// The scene of the file, that of the run with its focus region, or the built-in one.
    pub(crate) fn read(
        &self,
        context: &Context,
    ) -> Result<(SceneConfig, Option<[f64; 4]>), StudyError> {
        let Some(path) = &self.config else {
            return Ok((SceneConfig::rib(), None));
        };
        if path.is_dir() {
            let (scene, env) = (context.read_task)(path)?;
            return Ok((scene, env.region_mm));
        }
        let scene = SceneConfig::read(path).map_err(|error| StudyError::Read(error.into()))?;
        Ok((scene, None))
    }

    /// Gives the blank as many vertices along its longer side as are asked for, or else `mesh` if
    /// any. Blanks with a cell or an outline of their own keep their mesh: none can be asked for.
    pub(crate) fn set_mesh(
        &self,
        config: &mut SceneConfig,
        mesh: Option<u16>,
    ) -> Result<(), StudyError> {
        let blank = &mut config.blank;
        if blank.outline.is_some() || blank.cell_mm.is_some() {
            let message = "`--mesh` is for rectangular blanks without `blank.cell_mm`";
            let refused = self.mesh.map(|_| StudyError::Invalid(message.into()));
            return refused.map_or(Ok(()), Err);
        }
        if let Some(vertices) = self.mesh.or(mesh) {
            let longer = blank.size_mm[0].max(blank.size_mm[1]);
            // Sides that are no lengths are refused when the blank is cut.
            let cells = |side: f64| (f64::from(vertices - 1) * side / longer).round() as usize;
            blank.vertices = blank.size_mm.map(|side| 1 + cells(side).max(1));
        }
        Ok(())
    }
}

/// The task on a region [mm], which is all that the agent sees. Cloth does not rest after the paper's press: the hardest case
/// for a solver, and the least of simulation for a step.
pub(crate) fn restless(region_mm: Option<[f64; 4]>) -> EnvConfig {
    EnvConfig {
        region_mm,
        crop: true,
        ..EnvConfig::default()
    }
}

/// The blank of a scene, flat.
pub(crate) fn lamina(scene: &SceneConfig) -> Result<Lamina, SceneError> {
    Ok(Lamina::new(&scene.blank, scene.read_material()?)?)
}

/// Side of the stencil [mm] on a mesh: `side_mm`, but at least three cells, so that as many
/// vertices are under it as on the paper's mesh of 65 x 65.
pub(crate) fn stencil_mm(lamina: &Lamina, side_mm: f64) -> f64 {
    let cell = 1e3 * lamina.cell_diagonal() / std::f64::consts::SQRT_2;
    side_mm.max(3.0 * cell)
}

/// Chooses `cases` whose name is among `names`, in their own order; all if there are no names.
/// Fails if there is none of a name.
pub fn only<C>(
    mut cases: Vec<C>,
    names: &[String],
    name: impl Fn(&C) -> &'static str,
) -> Result<Vec<C>, StudyError> {
    if let Some(unknown) = names.iter().find(|n| !cases.iter().any(|c| name(c) == **n)) {
        let mut known: Vec<&str> = cases.iter().map(&name).collect();
        known.dedup();
        return Err(StudyError::Invalid(format!(
            "there is no `{unknown}`, expected one of {}",
            known.join(", ")
        )));
    }
    cases.retain(|case| names.is_empty() || names.iter().any(|n| n == name(case)));
    Ok(cases)
}
