use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::thread;
use std::time::{Duration, Instant};

use drape_cloth::sim::Accuracy;
use drape_task::env::Draping;
use drape_task::path::stroke_points;
use drape_task::recording::{RecordedFrame, Recording};

use super::command::{Change, Command};
use super::export::still_page;
use super::fall::fallen;
use super::host::{Host, Rival, Spec};
use super::moment::{Moment, Numbers, Shared, Status};
use super::past::Past;
use super::robot::Asking;
use super::shade::Shade;
use super::stage::Stage;

/// Time between two pulls [s].
const FRAME: f64 = 1.0 / 60.0;
/// Moments a second.
const RATE: f64 = 30.0;
/// Words that are kept for pages.
const NOTICES: usize = 8;
/// Presses that may wait.
const MOST_WAITING: usize = 4096;
/// Time between two looks at a robot that is being asked.
const ROBOT: Duration = Duration::from_millis(30);
/// Time between two looks at what trainings have written.
const CURVES: Duration = Duration::from_secs(2);

/// The cloth, what has been done to it, and what is to be done.
pub struct Session<H: Host> {
    host: H,
    shared: Arc<Shared>,
    commands: Receiver<Command>,
    spec: Spec,
    stage: Arc<Stage>,
    /// How many stages there have been, those that could not be set up included.
    stages: u64,
    /// Where the blank was while it fell [m].
    fall: Vec<Vec<[f32; 3]>>,
    draping: Draping,
    past: Past,
    /// Number of the moment that is shown, those of the fall first.
    at: usize,
    waiting: VecDeque<u32>,
    pull: Option<(u32, [f64; 3])>,
    /// What is shown beside the presses, step by step.
    beside: Vec<RecordedFrame>,
    status: Status,
    said: u64,
    rivals: Option<Receiver<Vec<Rival>>>,
    /// The task has changed since they were asked.
    asks_again: bool,
    robot: Asking,
    looked: Instant,
}

impl<H: Host> Session<H> {
    /// Lets the blank of a task fall, and shows it.
    ///
    /// # Errors
    /// Those of the host, and what it says of a value that is out of range.
    pub fn new(
        mut host: H,
        spec: Spec,
        shared: Arc<Shared>,
        commands: Receiver<Command>,
    ) -> Result<Self, H::Error> {
        let offers = host.offers();
        let mut status = Status {
            rate: RATE,
            accuracy: spec.env.accuracy.name(),
            tools: offers.tools.iter().map(|(name, _)| name.clone()).collect(),
            materials: offers
                .materials
                .iter()
                .map(|(name, _)| name.clone())
                .collect(),
            ..Status::default()
        };
        let (stage, fall, draping) = fallen(&mut host, &spec, &shared, &mut status, 1)?;
        let mut session = Self {
            at: fall.len(),
            past: Past::new(&draping, &host.path(&draping)?),
            beside: host.beside(&draping),
            rivals: None,
            asks_again: false,
            robot: Asking::default(),
            looked: Instant::now(),
            host,
            shared,
            commands,
            spec,
            stage,
            stages: 1,
            fall,
            draping,
            waiting: VecDeque::new(),
            pull: None,
            status,
            said: 0,
        };
        session.ask_rivals();
        if session.host.has_robot() {
            session.robot.wish(None, true);
            session.ask_robot();
        }
        session.publish();
        Ok(session)
    }

    /// Obeys commands until nobody can give one any more.
    pub fn run(mut self) {
        let mut last = Instant::now();
        loop {
            let wait = match self.is_busy() {
                true => self.due(last).saturating_duration_since(Instant::now()),
                false if self.robot.is_asked() => ROBOT,
                false => CURVES,
            };
            match self.commands.recv_timeout(wait) {
                Ok(command) => {
                    self.obey(command);
                    // What has come since belongs to the same moment.
                    while let Ok(command) = self.commands.try_recv() {
                        self.obey(command);
                    }
                    self.publish();
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if self.is_busy() && Instant::now() >= self.due(last) {
                last = Instant::now();
                self.advance();
                self.publish();
            }
            self.look();
        }
    }

    /// A page that goes through all presses without a server.
    ///
    /// # Errors
    /// If there is a robot and it cannot be planned.
    pub fn export(mut self) -> Result<String, String> {
        self.robot.wait()?;
        self.fall.clear();
        let moments = (0..self.count()).filter_map(|at| {
            self.go(at);
            self.publish();
            Some(self.shared.newest()?.message(Shade::Distance).bytes())
        });
        let moments: Vec<_> = moments.collect();
        let robot = self.robot.shown().map(|robot| robot.message());
        Ok(still_page(
            &self.stage.message(),
            robot.as_deref(),
            &moments,
        ))
    }

    /// When what goes on by itself goes on, if it last did so then.
    fn due(&self, last: Instant) -> Instant {
        let pace = match self.pull {
            Some(_) => FRAME,
            None => 1.0 / self.status.rate,
        };
        last + Duration::from_secs_f64(pace)
    }

    /// Something goes on by itself.
    fn is_busy(&self) -> bool {
        let status = &self.status;
        let goes_on = !self.waiting.is_empty() || status.playing || status.following;
        self.pull.is_some() || goes_on && !status.paused
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Press { vertices } => {
                let count = self.stage.scene.lamina.vertex_count();
                let is_new = vertices.iter().all(|&v| (v as usize) < count);
                if !is_new || self.waiting.len() + vertices.len() > MOST_WAITING {
                    return self.say("these presses are too many, or beyond the blank".into());
                }
                self.status.playing = false;
                self.waiting.extend(vertices);
            }
            Command::Undo {} if self.at > self.fall.len() => self.go(self.at - 1),
            Command::Undo {} => {}
            Command::Redo {} => self.go(self.at + 1),
            Command::Reset {} => self.go(self.fall.len()),
            Command::Seek { to } => self.go(to),
            Command::Play { on } => {
                if on && self.at + 1 >= self.count() {
                    self.go(0);
                }
                self.status.playing = on;
            }
            Command::Follow { on } => self.status.following = on && self.status.has_policy,
            Command::Pause { on } => self.status.paused = on,
            Command::Step {} => {
                self.status.paused = true;
                match self.waiting.is_empty() && !self.status.following {
                    true => self.go(self.at + 1),
                    false => self.advance(),
                }
            }
            Command::Speed { rate } => self.status.rate = rate.clamp(0.1, 1000.0),
            Command::Accuracy { name } => self.refine(name),
            Command::Pull { vertex, to } => self.grab(vertex, to),
            Command::Release {} => self.let_go(),
            Command::Task { change } => self.change(change),
            Command::Path {} => self.take_path(),
            Command::Beside {} => match self.beside.is_empty() {
                true => self.beside = self.recorded().map_or(Vec::new(), |made| made.frames),
                false => self.beside.clear(),
            },
            Command::Robot { place, plan } => {
                self.robot.wish(place, plan);
            }
            Command::SavePresses {} => self.save_presses(),
            Command::SaveTask {} => {
                let saved = self.host.save_task(&self.spec);
                let told = saved.map(|name| format!("saved {name}: drape train {name}"));
                self.say(told.unwrap_or_else(|error| error.to_string()));
            }
        }
    }

    /// All that has been gone through and can be gone through again.
    fn count(&self) -> usize {
        self.fall.len() + self.past.len()
    }

    /// Shows another moment.
    fn go(&mut self, to: usize) {
        self.stop();
        self.at = to.min(self.count() - 1);
        let step = self.at.saturating_sub(self.fall.len());
        let reached = self.past.enter(step, &mut self.draping);
        if reached < step {
            self.at = self.fall.len() + reached;
            self.say(format!("the cloth diverges after {reached} of these"));
        }
    }

    fn stop(&mut self) {
        self.waiting.clear();
        self.let_go();
        (self.status.playing, self.status.following) = (false, false);
    }

    /// Does what is next.
    fn advance(&mut self) {
        if let Some((vertex, to)) = self.pull {
            if !self.past.pull(vertex, to, &mut self.draping) {
                self.let_go();
            }
            return;
        }
        if let Some(vertex) = self.waiting.pop_front() {
            return self.press(vertex);
        }
        if self.status.following {
            let advice = self.host.advise(&self.draping).unwrap_or_default();
            let best = (0..advice.len()).max_by(|&a, &b| advice[a].total_cmp(&advice[b]));
            let vertex = best.and_then(|action| self.draping.vertex(action as u32));
            match vertex.filter(|_| !self.draping.is_over(0)) {
                Some(vertex) => self.press(vertex),
                None => self.status.following = false,
            }
        } else if self.status.playing {
            let to = self.at + 1;
            self.go(to);
            self.status.playing = to + 1 < self.count();
        }
    }

    /// Takes the cloth to be pressed or pulled from the moment that is shown.
    fn take_hold(&mut self) {
        let from = self.at.saturating_sub(self.fall.len());
        self.past.forget_after(from);
        self.at = self.fall.len() + from;
    }

    fn press(&mut self, vertex: u32) {
        self.take_hold();
        match self.past.press(vertex, &mut self.draping) {
            true => self.at += 1,
            false => {
                self.stop();
                self.say(format!(
                    "the cloth diverges when vertex {vertex} is pressed here"
                ));
            }
        }
    }

    fn grab(&mut self, vertex: u32, to: [f64; 3]) {
        let is_new = (vertex as usize) < self.stage.scene.lamina.vertex_count();
        let is_place = to.iter().all(|x| x.abs() < 10.0);
        if !is_new || !is_place {
            return self.say("that cannot be pulled".into());
        }
        if self.pull.is_none() {
            self.stop();
            self.take_hold();
            if self.draping.state(0).fixed.contains(vertex as usize) {
                return self.say("a vertex that is draped or clamped cannot be pulled".into());
            }
            self.past.begin_pull(vertex);
            self.at += 1;
        }
        self.pull = Some((self.pull.map_or(vertex, |(held, _)| held), to));
    }

    fn let_go(&mut self) {
        if self.pull.take().is_some() && !self.past.end_pull(&mut self.draping) {
            self.at -= 1;
            self.say("the cloth diverges when it is pulled so".into());
        }
    }

    /// Presses as finely as this, what has been pressed so far too: it comes to another end.
    fn refine(&mut self, name: Accuracy) {
        self.stop();
        let mut spec = self.spec.clone();
        spec.env.set_accuracy(name);
        let scene = self.draping.scene().clone();
        match Draping::new(scene, &spec.env, 1) {
            Ok(draping) => {
                let last = self.past.len() - 1;
                let presses: Vec<u32> = self.past.vertices(last).collect();
                if self.past.is_pulled(last) {
                    self.say("what was pulled by hand is left out".into());
                }
                let pressed = self
                    .at
                    .checked_sub(self.fall.len())
                    .map(|step| self.past.vertices(step).count());
                (self.spec, self.draping) = (spec, draping);
                self.robot.forget();
                self.past = Past::new(&self.draping, &presses);
                self.status.accuracy = name.name();
                self.go(pressed.map_or(self.at, |count| self.fall.len() + count));
                self.ask_rivals();
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    fn change(&mut self, change: Change) {
        self.stop();
        let mut spec = self.spec.clone();
        let offers = self.host.offers();
        if let Some(name) = change.tool {
            match offers.tools.iter().find(|(known, _)| *known == name) {
                Some((_, tool)) => spec.scene.tool = tool.clone(),
                None => return self.say(format!("there is no tool {name}")),
            }
        }
        if let Some(name) = change.material {
            match offers.materials.iter().find(|(known, _)| *known == name) {
                Some((_, material)) => spec.scene.material = Some(material.clone()),
                None => return self.say(format!("there is no material {name}")),
            }
        }
        spec.env.region_mm = change.region_mm;
        if let Some(placement) = change.placement {
            spec.scene.placement = placement;
        }
        if let Some(clamps) = change.clamps {
            spec.scene.clamps = clamps;
        }
        self.stages += 1;
        let number = self.stages;
        self.status.rivals.clear();
        // An equal scene lies as this one does: nothing falls.
        let lies = (spec.scene == self.spec.scene).then(|| self.draping.scene().clone());
        let set_up = match lies {
            Some(scene) => Draping::new(scene.clone(), &spec.env, 1)
                .map(|draping| {
                    let stage = Stage::new(number, &scene, &spec, &scene.initial.position);
                    (stage, std::mem::take(&mut self.fall), draping)
                })
                .map_err(|error| error.to_string()),
            None => {
                let (shared, status) = (&self.shared, &mut self.status);
                let fallen = fallen(&mut self.host, &spec, shared, status, number);
                fallen.map_err(|error| error.to_string())
            }
        };
        match set_up {
            Ok((stage, fall, draping)) => {
                // Its numbers are of the task before.
                self.beside.clear();
                self.robot.forget();
                self.past = Past::new(&draping, &[]);
                self.at = fall.len();
                (self.spec, self.stage, self.fall, self.draping) = (spec, stage, fall, draping);
                self.ask_rivals();
            }
            Err(error) => {
                self.say(error);
                self.ask_rivals();
            }
        }
    }

    /// Takes what the run has found so far instead of what was pressed.
    fn take_path(&mut self) {
        match self.host.path(&self.draping) {
            Ok(path) if path.is_empty() => self.say("no path has been found yet".into()),
            Ok(path) => {
                self.go(self.fall.len());
                self.past = Past::new(&self.draping, &path);
                self.ask_rivals();
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// The presses up to what is shown; none, with a word on why, if no task has what was done.
    fn recorded(&mut self) -> Option<Recording> {
        let to = self.at.saturating_sub(self.fall.len());
        let vertices: Vec<u32> = self.past.vertices(to).collect();
        let fault = match self.past.is_pulled(to) {
            true => Some("no task pulls at cloth, undo that first"),
            false => vertices.is_empty().then_some("nothing has been pressed"),
        };
        if let Some(fault) = fault {
            self.say(fault.into());
            return None;
        }
        let mut made = Recording::new(self.draping.task(0));
        self.draping.replay(&[&vertices], |draping, _, _| {
            made.see(draping.task(0), &draping.episode(0));
        });
        self.past.enter(to, &mut self.draping);
        Some(made)
    }

    fn save_presses(&mut self) {
        if let Some(made) = self.recorded() {
            let saved = self
                .host
                .save_presses(&self.spec, &self.stage.scene.lamina, &made);
            let told = saved.map(|names| format!("saved {}", names.join(", ")));
            self.say(told.unwrap_or_else(|error| error.to_string()));
        }
    }

    /// Asks what others come to, one after the other: of tasks that are changed meanwhile only the last is of use.
    fn ask_rivals(&mut self) {
        self.status.rivals.clear();
        self.asks_again = self.rivals.is_some();
        if !self.asks_again {
            let asked = self.host.rivals(&self.draping);
            let (sender, receiver) = std::sync::mpsc::channel();
            let begun = thread::Builder::new().spawn(move || sender.send(asked()));
            self.rivals = begun.ok().map(|_| receiver);
        }
    }

    /// Asks a robot for all presses that can be gone through, unless it is still being asked or the cloth is held. Whether
    /// there is something new to show.
    fn ask_robot(&mut self) -> bool {
        if self.pull.is_some() {
            return false;
        }
        let Some((place, plan)) = self.robot.next() else {
            return false;
        };
        if self.past.is_pulled(self.past.len() - 1) {
            self.say("no robot pulls at cloth, undo that first".into());
            return true;
        }
        let at = self.at.saturating_sub(self.fall.len());
        let reached = self.past.enter(self.past.len() - 1, &mut self.draping);
        let points = self.draping.points(0);
        self.past.enter(at.min(reached), &mut self.draping);
        self.at = self.at.min(self.fall.len() + reached);
        let job = self.host.robot(&self.draping, &points, place, plan);
        self.robot.begin(job);
        true
    }

    /// Looks at what others have found meanwhile.
    fn look(&mut self) {
        let mut is_new = false;
        if let Some(found) = self.robot.look() {
            found.unwrap_or_else(|error| self.say(error));
            is_new = true;
        }
        is_new |= self.ask_robot();
        let found = self.rivals.as_ref().map(Receiver::try_recv);
        if let Some(Ok(_) | Err(TryRecvError::Disconnected)) = found {
            self.rivals = None;
            match (found, self.asks_again) {
                (_, true) => self.ask_rivals(),
                (Some(Ok(found)), _) => (self.status.rivals, is_new) = (found, true),
                _ => {}
            }
        }
        if self.looked.elapsed() > CURVES {
            self.looked = Instant::now();
            let curves = self.host.curves();
            is_new |= curves != self.status.curves;
            self.status.curves = curves;
        }
        if is_new {
            self.publish();
        }
    }

    fn say(&mut self, words: String) {
        self.said += 1;
        self.status.notices.push((self.said, words));
        if self.status.notices.len() > NOTICES {
            self.status.notices.remove(0);
        }
    }

    fn publish(&mut self) {
        let state = self.draping.state(0);
        let falls = self.at < self.fall.len();
        let position = match falls {
            true => self.fall[self.at]
                .iter()
                .map(|x| x.map(f64::from))
                .collect(),
            false => state.position.clone(),
        };
        let task = self.draping.task(0);
        let marks = match falls {
            true => self.stage.marks.clone(),
            false => {
                let pulled = self.past.pulled();
                self.stage.marked(&self.draping, &state, pulled)
            }
        };
        let points = self.draping.points(0);
        let strokes = stroke_points(&points, task.config.rolling());
        let strokes = strokes.map(|stroke| stroke.iter().map(|point| point.vertex).collect());
        let idle = !falls && self.waiting.is_empty() && self.pull.is_none();
        let advice = self.host.advise(&self.draping);
        self.status.has_policy = advice.is_some();
        let mut by_vertex = Vec::new();
        if let Some(advice) = advice.filter(|_| idle) {
            by_vertex = vec![0.0; position.len()];
            for (action, p) in advice.into_iter().enumerate() {
                if let Some(v) = self.draping.vertex(action as u32) {
                    by_vertex[v as usize] = p;
                }
            }
        }
        let step = self.at.saturating_sub(self.fall.len());
        let beside = self.beside.get(step).or(self.beside.last());
        let status = Status {
            phase: "ready",
            share: 1.0,
            at: self.at,
            count: self.count(),
            fall: self.fall.len(),
            waiting: self.waiting.len(),
            pulled: self.past.is_pulled(step),
            over: !falls && self.draping.is_over(0),
            plans: self.robot.is_asked(),
            robot: self.robot.shown().map_or(0, |robot| robot.number),
            numbers: match falls {
                true => Numbers::default(),
                false => Numbers::of(task, &state, &self.draping),
            },
            beside: beside.map(|of| [of.distance, 1e3 * of.surplus, of.score]),
            strokes: if falls { Vec::new() } else { strokes.collect() },
            ..self.status.clone()
        };
        self.shared.publish(Moment {
            number: 0,
            stage: Some(self.stage.clone()),
            robot: self.robot.shown(),
            position,
            beside: beside.map(|frame| frame.position.clone()),
            marks,
            advice: by_vertex,
            status,
        });
    }
}
