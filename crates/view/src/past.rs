use drape_cloth::sim::Snapshot;
use drape_task::env::{Draping, EpisodeState};

/// States may take so much [bytes]; beyond, every second is made again when it is asked for.
const MOST: usize = 256 << 20;
/// Time that cloth is given to come to rest after a pull, in presses.
const REST: usize = 20;
/// Longest pull, in presses: then it is let go, as by a page that has left meanwhile.
const LONGEST_PULL: usize = 3600;
/// Speed of a vertex that is pulled [m/s].
const PULL_SPEED: f64 = 1.0;

/// What has been done to the cloth, in order, so that any state of it comes back bit for bit.
pub struct Past {
    /// The first of them is the start.
    steps: Vec<Step>,
}

struct Step {
    act: Act,
    /// After it; none where it has to be made again.
    state: Option<EpisodeState>,
}

/// Something that was done.
#[derive(Clone, Debug, PartialEq)]
enum Act {
    /// The blank has fallen.
    Start,
    /// This vertex was pressed.
    Press(u32),
    /// This vertex was pulled from place to place [m], and let go.
    Pull(u32, Vec<[f64; 3]>),
}

impl Past {
    /// At the start of an episode, with presses that can be gone through.
    pub fn new(draping: &Draping, presses: &[u32]) -> Self {
        let start = Step {
            act: Act::Start,
            state: Some(draping.episode(0)),
        };
        let press = |&vertex| Step {
            act: Act::Press(vertex),
            state: None,
        };
        let steps = std::iter::once(start).chain(presses.iter().map(press));
        Self {
            steps: steps.collect(),
        }
    }

    /// With the start.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// The vertices that are pressed until a step.
    pub fn vertices(&self, until: usize) -> impl Iterator<Item = u32> {
        let vertex = |step: &Step| match step.act {
            Act::Press(vertex) => Some(vertex),
            _ => None,
        };
        self.steps[..=until].iter().filter_map(vertex)
    }

    /// Whether anything was pulled until a step.
    pub fn is_pulled(&self, until: usize) -> bool {
        let is_pull = |step: &Step| matches!(step.act, Act::Pull(..));
        self.steps[..=until.min(self.len() - 1)].iter().any(is_pull)
    }

    /// The vertex that is being pulled.
    pub fn pulled(&self) -> Option<u32> {
        match self.steps.last() {
            Some(Step {
                act: Act::Pull(vertex, _),
                state: None,
            }) => Some(*vertex),
            _ => None,
        }
    }

    /// Puts the cloth to where it was after a step: from the nearest state before it that is known. Gives the step: one
    /// before it if the cloth diverges on the way, and then what comes later is forgotten.
    pub fn enter(&mut self, to: usize, draping: &mut Draping) -> usize {
        let known = |&k: &usize| self.steps[k].state.is_some();
        let from = (0..=to).rev().find(known).expect("the start is known");
        draping.go_on(0, self.steps[from].state.as_ref().expect("it is known"));
        for k in from + 1..=to {
            match &self.steps[k].act {
                Act::Start => unreachable!("there is one start"),
                Act::Press(vertex) => drop(draping.press(&[Some(*vertex)])),
                Act::Pull(vertex, path) => {
                    path.iter().for_each(|&to| drag(*vertex, to, draping));
                    (0..REST).for_each(|_| drop(draping.press(&[None])));
                }
            }
            if !draping.state(0).is_finite() {
                self.forget_after(k - 1);
                return self.enter(k - 1, draping);
            }
            self.steps[k].state = Some(draping.episode(0));
            self.thin_out(k);
        }
        to
    }

    /// Forgets what was done after a step.
    pub fn forget_after(&mut self, step: usize) {
        self.steps.truncate(step + 1);
    }

    /// Presses a vertex; false, and nothing has been done, if the cloth diverges.
    pub fn press(&mut self, vertex: u32, draping: &mut Draping) -> bool {
        let finite = draping.press(&[Some(vertex)])[0];
        self.keep(Act::Press(vertex), finite, draping)
    }

    /// Begins to pull a vertex.
    pub fn begin_pull(&mut self, vertex: u32) {
        self.steps.push(Step {
            act: Act::Pull(vertex, Vec::new()),
            state: None,
        });
    }

    /// Pulls it on, for the time of a press; false if that is the last time.
    pub fn pull(&mut self, vertex: u32, to: [f64; 3], draping: &mut Draping) -> bool {
        drag(vertex, to, draping);
        match self.steps.last_mut().map(|step| &mut step.act) {
            Some(Act::Pull(_, path)) => {
                path.push(to);
                path.len() < LONGEST_PULL
            }
            _ => false,
        }
    }

    /// Lets it go; false, and nothing has been done, if the cloth has diverged.
    pub fn end_pull(&mut self, draping: &mut Draping) -> bool {
        let Some(Step { act, .. }) = self.steps.pop() else {
            return true;
        };
        (0..REST).for_each(|_| drop(draping.press(&[None])));
        let finite = draping.state(0).is_finite();
        self.keep(act, finite, draping)
    }

    fn keep(&mut self, act: Act, finite: bool, draping: &mut Draping) -> bool {
        if !finite {
            self.enter(self.len() - 1, draping);
            return false;
        }
        let state = Some(draping.episode(0));
        self.steps.push(Step { act, state });
        self.thin_out(self.len() - 1);
        true
    }

    /// Keeps within memory, and the state of step `but`.
    fn thin_out(&mut self, but: usize) {
        let size = |state: &EpisodeState| {
            let Snapshot {
                position,
                force_density,
                ..
            } = state.cloth();
            48 * position.len() + 8 * force_density.len() + 32 * state.presses().len()
        };
        let known = |step: &&Step| step.state.is_some();
        let count = self.steps.iter().filter(known).count();
        if count < 4 || count * self.steps[but].state.as_ref().map_or(0, size) <= MOST {
            return;
        }
        let mut number = 0;
        for (k, step) in self.steps.iter_mut().enumerate() {
            number += usize::from(step.state.is_some());
            if number % 2 == 0 && k != but {
                step.state = None;
            }
        }
    }
}

/// Moves a vertex towards a place for the time of a press, and the cloth with it: a fixed vertex has the
/// velocity that it is given.
fn drag(vertex: u32, to: [f64; 3], draping: &mut Draping) {
    let v = vertex as usize;
    let dt = draping.config().press_s + draping.config().settle_s;
    let episode = draping.episode(0);
    let mut cloth = episode.cloth().clone();
    let at = cloth.position[v];
    let velocity = [0, 1, 2].map(|k| (to[k] - at[k]) / dt);
    let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
    let slower = (PULL_SPEED / speed.max(1e-9)).min(1.0);
    cloth.velocity[v] = velocity.map(|v| slower * v);
    cloth.fixed.insert(v);
    let presses = episode.presses().to_vec();
    draping.go_on(0, &EpisodeState::new(presses.clone(), cloth));
    draping.press(&[None]);
    let mut cloth = draping.state(0);
    cloth.velocity[v] = [0.0; 3];
    cloth.fixed.set(v, false);
    draping.go_on(0, &EpisodeState::new(presses, cloth));
}
