//! The tasks that `drape train` learns on, for Python. Arrays cross the border as bytes; the spaces
//! and customs of Gymnasium stand on its other side (`drape/__init__.py`).

use std::mem::forget;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use drape::cli::{Failure, read_config, set_up_tasks};
use drape::run::digest;
use drape_cloth::file::ValueError;
use drape_cloth::sim::{ALLOWED, DRAPED, Observation, TOUCHED};
use drape_task::env::{Draping, End, StepOutcome, Tasks};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Channels of an observation: draped, distance, touched, allowed.
const CHANNELS: usize = 4;

/// N draping tasks, stepped together; each is reset in the step that ends its episode.
#[pyclass(module = "drape._drape")]
struct Environments {
    draping: Draping,
    /// 1 / distance that is seen as 1 [1/m].
    distance_factor: f32,
    reward_factor: f32,
    /// What they are made from, and a digest of what came of it.
    config: Option<PathBuf>,
    scale_rewards: bool,
    origin: String,
}

/// As [`Environments`] are made with them.
type Arguments = (Option<PathBuf>, Option<usize>, bool);
/// What they have been made from, and where their episodes are.
type State<'py> = (String, Bound<'py, PyBytes>);

/// A finished episode.
#[pyclass(frozen, get_all, module = "drape._drape")]
struct Episode {
    /// Environment that it was played in.
    index: usize,
    truncated: bool,
    diverged: bool,
    /// The share of the objective that was removed; none if the simulation diverged.
    score: Option<f64>,
    /// Sum of the rewards, scaled as they are.
    total_reward: f32,
    /// Vertices of the blank in the order they were pressed.
    vertices: Vec<u32>,
    /// The observation after the last press, before the reset.
    last: Py<PyBytes>,
}

fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// What the user can mend is a `ValueError`.
fn failed(failure: Failure) -> PyErr {
    match failure.is_input {
        true => PyValueError::new_err(failure.to_string()),
        false => PyRuntimeError::new_err(failure.to_string()),
    }
}

/// Computes on threads of this process, without the interpreter's lock. Rayon's own are lost in a fork, in which whoever
/// waits for them waits for ever.
fn on_threads<T: Send>(py: Python<'_>, compute: impl FnOnce() -> T + Send) -> PyResult<T> {
    // Locked under the interpreter's lock only, so that no other thread holds it in a fork.
    static THREADS: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let pool = {
        let mut threads = THREADS.lock().expect("nobody panics with it");
        let own = std::process::id();
        match &*threads {
            Some((process, pool)) if *process == own => pool.clone(),
            _ => {
                let started = ThreadPoolBuilder::new().build();
                let cannot =
                    |error| PyRuntimeError::new_err(format!("cannot start threads: {error}"));
                let pool = Arc::new(started.map_err(cannot)?);
                // Of the process that this was forked from there is nothing that could be ended.
                forget(threads.replace((own, pool.clone())));
                pool
            }
        }
    };
    Ok(py.detach(|| pool.install(compute)))
}

fn set_up(
    path: Option<PathBuf>,
    count: Option<usize>,
    scale_rewards: bool,
) -> Result<Environments, Failure> {
    // Others may be made from it where another folder is the current one.
    let path = path.map(|path| std::path::absolute(&path).unwrap_or(path));
    let (mut config, place) = read_config(path.as_deref())?;
    config.environments = count.unwrap_or(config.environments);
    let (found, expected) = (config.environments, "a number from 1 to 4096");
    ValueError::unless((1..=4096).contains(&found), "num_envs", found, expected)
        .map_err(Failure::invalid)?;
    // Nothing is searched for here.
    config.search = 0;
    let draping = set_up_tasks(&config, config.environments, &place)?;
    // By what its files hold, wherever they are.
    config.keep_inputs()?;
    let at = draping.scene().initial.position.as_flattened().iter();
    let mut origin = config.to_toml().into_bytes();
    origin.extend(at.flat_map(|x| x.to_le_bytes()));
    Ok(Environments {
        config: path,
        scale_rewards,
        origin: digest(origin),
        distance_factor: 1000.0 / config.policy.distance_scale_mm,
        reward_factor: match scale_rewards {
            true => 1.0 / draping.reward_scale(0),
            false => 1.0,
        },
        draping,
    })
}

impl Environments {
    /// Writes an observation as `[CHANNELS, rows, columns]`, single precision in native order.
    fn write(&self, seen: Observation, out: &mut [u8]) {
        let plane = out.len() / CHANNELS;
        let mut set = |channel: usize, pixel: usize, value: f32| {
            let start = channel * plane + size_of::<f32>() * pixel;
            out[start..][..size_of::<f32>()].copy_from_slice(&value.to_ne_bytes());
        };
        for (pixel, (distance, mark)) in seen.distance.iter().zip(seen.marks).enumerate() {
            for (channel, bit) in [(0, DRAPED), (2, TOUCHED), (3, ALLOWED)] {
                set(channel, pixel, f32::from(mark & bit != 0));
            }
            set(1, pixel, distance * self.distance_factor);
        }
    }

    /// Looks at all environments, so that nothing is computed where their observations are read.
    fn observe(&self, py: Python<'_>) -> PyResult<()> {
        on_threads(py, || {
            self.draping.observations();
        })
    }

    /// Bytes of an observation.
    fn size(&self) -> usize {
        CHANNELS * self.draping.shape().pixel_count() * size_of::<f32>()
    }
}

#[pymethods]
impl Environments {
    #[new]
    #[pyo3(signature = (config, num_envs, scale_rewards))]
    fn new(
        py: Python<'_>,
        config: Option<PathBuf>,
        num_envs: Option<usize>,
        scale_rewards: bool,
    ) -> PyResult<Self> {
        on_threads(py, || set_up(config, num_envs, scale_rewards))?.map_err(failed)
    }

    /// How pickles and deep copies are made: from the same configuration, and put to the same state.
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Arguments, State<'py>)> {
        let (py, of) = (slf.py(), slf.borrow());
        let of = &*of;
        let saved = on_threads(py, || of.draping.save())?;
        let state = (of.origin.clone(), PyBytes::new(py, &saved));
        let arguments = (of.config.clone(), Some(of.num_envs()), of.scale_rewards);
        Ok((slf.get_type().into_any(), arguments, state))
    }

    fn __setstate__(&mut self, py: Python<'_>, state: State<'_>) -> PyResult<()> {
        let (origin, saved) = state;
        if origin != self.origin {
            let place = self.config.as_ref().map(|path| path.display().to_string());
            let place = place.unwrap_or("built-in quickstart".into());
            let fault = "the environments were made from another configuration or scene";
            return Err(value_error(format!("{place}: {fault}")));
        }
        let saved = saved.as_bytes();
        on_threads(py, || self.draping.load(saved))?.map_err(value_error)
    }

    #[getter]
    fn num_envs(&self) -> usize {
        self.draping.count()
    }

    /// Channels, rows, columns.
    #[getter]
    fn shape(&self) -> [usize; 3] {
        let shape = self.draping.shape();
        [CHANNELS, shape.rows, shape.columns]
    }

    /// Return of a perfect episode [m]: what rewards are divided by.
    #[getter]
    fn reward_scale(&self) -> f32 {
        self.draping.reward_scale(0)
    }

    /// The vertex of the blank that an action presses; none where the blank has been cut away.
    fn vertex(&self, action: u32) -> PyResult<Option<u32>> {
        let pixels = self.draping.shape().pixel_count();
        let expected = format!("a number below {pixels}");
        ValueError::unless((action as usize) < pixels, "action", action, expected)
            .map_err(value_error)?;
        Ok(self.draping.vertex(action))
    }

    /// All observations, `[num_envs, channels, rows, columns]` in single precision.
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let size = self.size();
        self.observe(py)?;
        PyBytes::new_with(py, self.draping.count() * size, |out| {
            for (index, out) in out.chunks_exact_mut(size).enumerate() {
                self.write(self.draping.observation(index), out);
            }
            Ok(())
        })
    }

    /// The allowed actions, `[num_envs, rows * columns]`, one byte each.
    fn masks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let pixels = self.draping.shape().pixel_count();
        self.observe(py)?;
        PyBytes::new_with(py, self.draping.count() * pixels, |out| {
            for (index, out) in out.chunks_exact_mut(pixels).enumerate() {
                let marks = self.draping.observation(index).marks.iter();
                let allowed = marks.map(|mark| u8::from(mark & ALLOWED != 0));
                out.iter_mut()
                    .zip(allowed)
                    .for_each(|(out, allowed)| *out = allowed);
            }
            Ok(())
        })
    }

    /// Puts one environment back to its start.
    fn reset(&mut self, py: Python<'_>, index: usize) -> PyResult<()> {
        let expected = format!("a number below {}", self.draping.count());
        ValueError::unless(index < self.draping.count(), "index", index, expected)
            .map_err(value_error)?;
        on_threads(py, || self.draping.reset(index))
    }

    /// Takes one action in every environment: gives the rewards, and the episodes that have ended.
    /// Nothing has happened where an action is refused.
    fn step(&mut self, py: Python<'_>, actions: Vec<i128>) -> PyResult<(Vec<f32>, Vec<Episode>)> {
        let (count, found) = (self.draping.count(), actions.len());
        ValueError::unless(found == count, "actions", found, format!("{count} of them"))
            .map_err(value_error)?;
        self.observe(py)?;
        let mut allowed = Vec::with_capacity(count);
        for (index, action) in actions.into_iter().enumerate() {
            let seen = self.draping.observation(index);
            let valid = u32::try_from(action).ok().filter(|&a| seen.allows(a));
            let key = format!("actions[{index}]");
            ValueError::unless(valid.is_some(), &key, action, "one that the mask allows")
                .map_err(value_error)?;
            allowed.push(action as u32);
        }
        let outcomes = on_threads(py, || self.draping.step(&allowed))?;
        let (mut rewards, mut episodes) = (Vec::with_capacity(count), Vec::new());
        for (index, StepOutcome { reward, episode }) in outcomes.into_iter().enumerate() {
            rewards.push(reward * self.reward_factor);
            let Some(episode) = episode else { continue };
            let last = PyBytes::new_with(py, self.size(), |out| {
                self.write(self.draping.last().row(index), out);
                Ok(())
            })?;
            let vertices = episode
                .actions
                .iter()
                .filter_map(|&a| self.draping.vertex(a));
            episodes.push(Episode {
                index,
                truncated: episode.end == End::Truncated,
                diverged: episode.end == End::Diverged,
                score: episode.score,
                total_reward: episode.total_reward * self.reward_factor,
                vertices: vertices.collect(),
                last: last.unbind(),
            });
        }
        Ok((rewards, episodes))
    }
}

#[pymodule]
fn _drape(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Environments>()?;
    module.add_class::<Episode>()
}
