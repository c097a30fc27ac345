use std::f64::consts::TAU;
use std::sync::Arc;

use super::config::{Clamp, FRAME, Over, Placement, SceneConfig, SceneError};
use crate::fabric::Lamina;
use crate::sim::{
    Backend, Cpu, Model, Own, Parameters, PhysicsConfig, Precision, Snapshot, Tolerance, World,
};
use crate::tool::{SMOOTH, Tool};

/// Depth in the tool that a blank may start at, in spacings of the tool's grid: what that errs by
/// at an edge. Deeper, contact would throw it out.
const IN_TOOL: f64 = 0.5;

/// Nearer to the tool than this a blank touches it [m].
const TOUCHING: f64 = 1e-5;

/// A scene that is set up: the lamina lies on the tool as the fall has left it.
#[derive(Clone)]
pub struct Scene {
    pub config: SceneConfig,
    pub tool: Arc<Tool>,
    pub lamina: Arc<Lamina>,
    /// The physics of the scene, ready to be stepped.
    pub model: Arc<Model>,
    /// The settled state.
    pub initial: Arc<Snapshot>,
    /// How well that is known where it was fitted to a scan: mean distance between both [m]. 0 where it fell.
    pub fit_error: f64,
}

impl Scene {
    /// Sets up a scene: builds the tool, cuts the blank and lets it fall. About two seconds
    /// on one core for the standard blank. `progress` is told the simulated share 0..1.
    ///
    /// The fall is computed in f64 with many substeps, since every episode starts from its
    /// result. Equal configurations give equal bits.
    ///
    /// # Errors
    /// What cannot be set up, or starts from a scan, which is not known here.
    pub fn new(config: &SceneConfig, mut progress: impl FnMut(f64)) -> Result<Self, SceneError> {
        Self::watched(config, |_, share, _| progress(share))
    }

    /// For who wants to see it fall: `watch` is told the scene, which has no initial state yet, the
    /// simulated share and where the blank is then.
    pub fn watched(
        config: &SceneConfig,
        mut watch: impl FnMut(&Self, f64, &dyn Fn() -> Snapshot),
    ) -> Result<Self, SceneError> {
        config.check()?;
        config.placement.check_falls()?;
        let lamina = Lamina::new(&config.blank, config.read_material()?)?;
        config.physics.check_for(&lamina)?;
        let tool = Tool::new(&config.tool)?;

        let [falling, _] = config.fall.frames();
        let model = model_over(config, &lamina, &tool);
        let start = hung(config, &lamina, &tool, &model, falling as f64 * FRAME)?;
        let model = Arc::new(model);
        let tool = Arc::new(tool);
        let lamina = Arc::new(lamina);
        let mut scene = Self {
            config: config.clone(),
            tool,
            lamina,
            model,
            initial: Arc::default(),
            fit_error: 0.0,
        };
        watch(&scene, 0.0, &|| start.clone());
        let mut told = |share, cloth: &Cpu| watch(&scene, share, &|| cloth.snapshot(0));
        let state = scene.fall(vec![start.clone()], &mut told)?.remove(0);
        scene.initial = Arc::new(state);
        Ok(scene)
    }

    /// Where blanks come to rest that start off their place or have other laws, as [`Scene::new`] lets
    /// each fall, all at once: the same scene from other initial states. A blank that was fitted to a scan starts off
    /// where that lies, and settles only. `progress` is told the simulated share 0..1.
    ///
    /// # Errors
    /// Where a fall diverges.
    pub fn fallen(
        &self,
        blanks: &[(Misplacement, Parameters)],
        mut progress: impl FnMut(f64),
    ) -> Result<Vec<Self>, SceneError> {
        let start = |(off, parameters): &(Misplacement, Parameters)| {
            let (mut start, _) = self.begun(off)?;
            start.own.parameters = parameters.clone();
            Ok(start)
        };
        let starts: Result<Vec<_>, SceneError> = blanks.iter().map(start).collect();
        let states = self
            .fall(starts?, &mut |share, _| progress(share))?
            .into_iter();
        let scene = |mut state: Snapshot| {
            state.own = Own::default();
            Self {
                initial: state.into(),
                ..self.clone()
            }
        };
        Ok(states.map(scene).collect())
    }

    /// The flat blank before the fall; clamps already have the velocity of their displacement, which
    /// takes `fall_s` seconds.
    pub fn hung(&self, fall_s: f64) -> Result<Snapshot, SceneError> {
        hung(&self.config, &self.lamina, &self.tool, &self.model, fall_s)
    }

    /// A blank before it falls from `off` its place, and for how long that takes [s] before it settles; one that was fitted
    /// to a scan lies on the tool already.
    pub fn begun(&self, off: &Misplacement) -> Result<(Snapshot, f64), SceneError> {
        let [fall_s, _] = self.config.fall.durations();
        let (mut start, fall_s) = match self.config.placement.scan {
            Some(_) => (Snapshot::clone(&self.initial), 0.0),
            None => (self.hung(fall_s)?, fall_s),
        };
        off.apply(&mut start.position, self);
        Ok((start, fall_s))
    }

    /// Lets blanks fall and settle, side by side.
    fn fall(
        &self,
        starts: Vec<Snapshot>,
        progress: &mut dyn FnMut(f64, &Cpu),
    ) -> Result<Vec<Snapshot>, SceneError> {
        let fall = &self.config.fall;
        let control = fall.stepping().control(FRAME);
        let [mut falling, settling] = fall.frames();
        if self.config.placement.scan.is_some() {
            falling = 0;
        }
        let mut quiet = self.config.physics.clone();
        quiet.damping = fall.settle_damping;
        let quiet = Arc::new(Model::new(&self.lamina, &quiet).over_that_of(&self.model));
        let (mut states, mut done) = (starts, 0);
        for (model, frames) in [(&self.model, falling), (&quiet, settling)] {
            let world = World::new(model.clone(), self.tool.clone());
            let mut cloth = Cpu::new(&world, states.len(), Precision::F64);
            let numbered = states.iter().enumerate();
            numbered.for_each(|(k, state)| cloth.load(k, state));
            for _ in 0..frames {
                cloth.step(&control, &[]);
                done += 1;
                if cloth.finite().contains(&false) {
                    let time_s = f64::from(done) * FRAME;
                    return Err(SceneError::Diverged { time_s });
                }
                progress(f64::from(done) / (falling + settling) as f64, &cloth);
            }
            for (k, state) in states.iter_mut().enumerate() {
                *state = cloth.snapshot(k);
                // Clamps stop.
                for vertex in state.fixed.ones() {
                    state.velocity[vertex] = [0.0; 3];
                }
            }
        }
        Ok(states)
    }

    /// This initial state under other physics: what differs then is the episode alone.
    /// `physics` must have been checked.
    pub fn with_physics(&self, physics: PhysicsConfig) -> Self {
        let mut scene = self.clone();
        let model = Model::new(&scene.lamina, &physics);
        scene.model = model.over_that_of(&self.model).into();
        scene.config.physics = physics;
        scene
    }

    /// How deep the sheet may lie in the tool: what cells of this size cannot but reach through curves,
    /// or less where the tool is finer than they are.
    pub fn tolerance(&self) -> Tolerance {
        let smooth = Tolerance {
            depth: SMOOTH * self.lamina.cell_diagonal(),
            cell: f64::INFINITY,
        };
        self.model.tolerance().unwrap_or(smooth)
    }

    /// Distance to the tool of the vertex nearest to it, as the fall has left it [m].
    pub fn clearance(&self) -> f64 {
        let distances = self.initial.position.iter();
        let distances = distances.map(|&x| self.tool.distance(x).0);
        distances.fold(f64::INFINITY, f64::min)
    }

    /// The clamp that holds the blank farthest off the tool after the fall, by its number, and how
    /// far that is [m]; none if there are no clamps.
    pub fn farthest_clamp(&self) -> Option<(usize, f64)> {
        let held = self.config.clamps.iter().map(|clamp| {
            let vertex = nearest(clamp, &self.lamina).0;
            self.tool.distance(self.initial.position[vertex]).0
        });
        held.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// How far off its place a blank begins its fall, as one that is laid by hand does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Misplacement {
    /// Along x and y, and upwards [m].
    pub shift: [f64; 3],
    /// About the vertical through its middle [rad].
    pub turn: f64,
    /// Of the wave that it has, two over its length: height [m], direction and phase [rad].
    pub wave: [f64; 3],
}

impl Misplacement {
    /// Puts the vertices of a blank off their place, and up until they clear the tool [m].
    pub fn apply(&self, position: &mut [[f64; 3]], scene: &Scene) {
        let extremes = |k: usize| {
            let values = position.iter().map(|x| x[k]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
        };
        let [[x0, x1], [y0, y1]] = [0, 1].map(extremes);
        let (middle, length) = ([0.5 * (x0 + x1), 0.5 * (y0 + y1)], (x1 - x0).max(y1 - y0));
        let (sin, cos) = self.turn.sin_cos();
        let [height, direction, phase] = self.wave;
        for at in &mut *position {
            let [x, y] = [at[0] - middle[0], at[1] - middle[1]];
            let along = (x * direction.cos() + y * direction.sin()) / length;
            at[0] = middle[0] + self.shift[0] + cos * x - sin * y;
            at[1] = middle[1] + self.shift[1] + sin * x + cos * y;
            at[2] += self.shift[2] + height * (2.0 * TAU * along + phase).sin();
        }
        let felt = scene.model.felt(position);
        let up = lift(&scene.tool, &felt).unwrap_or(0.0).max(0.0);
        position.iter_mut().for_each(|at| at[2] += up);
    }
}

/// The vertex nearest to a clamp, and its distance from there on the flat blank, squared [m²].
fn nearest(clamp: &Clamp, lamina: &Lamina) -> (usize, f64) {
    let at = clamp.at_mm.map(|c| c * 1e-3);
    let square = |[u, w]: &[f64; 2]| (u - at[0]).powi(2) + (w - at[1]).powi(2);
    let squares = lamina.rest.iter().map(square).enumerate();
    let nearest = squares.min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.expect("a blank has vertices")
}

/// The physics of a scene: what its tool is like under the blank and where clamps take it tells whether contact
/// looks between the vertices.
fn model_over(config: &SceneConfig, lamina: &Lamina, tool: &Tool) -> Model {
    let (mut placement, _) = seated(config, tool);
    placement.tilt_deg = 0.0;
    let mut under = placed(&placement, lamina);
    for clamp in &config.clamps {
        let ([x, y, z], by) = (under[nearest(clamp, lamina).0], clamp.move_mm);
        under.push([x + 1e-3 * by[0], y + 1e-3 * by[1], z]);
    }
    Model::new(lamina, &config.physics).over(lamina, tool, &under)
}

/// See [`Scene::hung`]. Fails if the blank is not over the tool or inside it, or if a clamp is
/// further from the blank than a cell is long.
fn hung(
    config: &SceneConfig,
    lamina: &Lamina,
    tool: &Tool,
    model: &Model,
    fall_s: f64,
) -> Result<Snapshot, SceneError> {
    let Placement {
        centre_mm,
        height_mm,
        ..
    } = config.placement;
    let (mut placement, middle_mm) = seated(config, tool);
    let mut position = placed(&placement, lamina);
    let Some(lift) = lift(tool, &model.felt(&position)) else {
        let from_mm = [0, 1].map(|k| placement.centre_mm[k] - centre_mm[k]);
        let middle_mm = [0, 1].map(|k| middle_mm[k] - from_mm[k]);
        return Err(SceneError::Beside {
            centre_mm,
            middle_mm,
        });
    };
    let mut touching_mm = height_mm + 1e3 * lift;
    if placement.over == Over::Tool {
        placement.height_mm += touching_mm;
        position = placed(&placement, lamina);
        touching_mm = 0.0;
    }
    let depths = model.felt(&position).into_iter();
    let depths = depths.map(|x| -tool.distance(x).0);
    let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
    if deepest > IN_TOOL * tool.grid.spacing() {
        return Err(SceneError::InTool {
            height_mm,
            // To the next tenth.
            min_mm: (10.0 * touching_mm).ceil() / 10.0,
            depth_mm: 1e3 * deepest,
        });
    }
    let mut snapshot = Snapshot::at_rest(position);
    for (index, clamp) in config.clamps.iter().enumerate() {
        let (nearest, square) = nearest(clamp, lamina);
        // NaN is no place either.
        let is_near = square <= lamina.cell_diagonal().powi(2);
        if config.blank.outline.is_some() && !is_near {
            return Err(clamp.off_the_blank(index));
        }
        for vertex in lamina.within(nearest as u32, clamp.radius_mm * 1e-3) {
            snapshot.fixed.insert(vertex as usize);
            if fall_s > 0.0 {
                snapshot.velocity[vertex as usize] = clamp.move_mm.map(|m| m * 1e-3 / fall_s);
            }
        }
    }
    Ok(snapshot)
}

/// Where the blank is placed in the frame of the tool, and the middle of that in x and y [mm].
fn seated(config: &SceneConfig, tool: &Tool) -> (Placement, [f64; 2]) {
    let mut placement = config.placement.clone();
    let (low, high) = tool.mesh.bounds();
    let middle_mm = [0, 1].map(|k| 500.0 * (low[k] + high[k]));
    let from_mm = match placement.over {
        Over::Origin => {
            placement.height_mm -= 1e3 * tool.origin.z;
            [0, 1].map(|k| -1e3 * tool.origin[k])
        }
        Over::Tool => middle_mm,
    };
    placement.centre_mm = [0, 1].map(|k| from_mm[k] + placement.centre_mm[k]);
    (placement, middle_mm)
}

/// How far points at `x` have to be lifted, let down where negative, to just touch the tool from
/// above [m]; none if they are not over its box. They come down by what is free about all of them.
fn lift(tool: &Tool, x: &[[f64; 3]]) -> Option<f64> {
    let (low, high) = tool.mesh.bounds();
    let max = |k: usize| x.iter().map(|x| x[k]).fold(f64::NEG_INFINITY, f64::max);
    let min = |k: usize| x.iter().map(|x| x[k]).fold(f64::INFINITY, f64::min);
    if (0..2).any(|k| max(k) < low[k] || min(k) > high[k]) {
        return None;
    }
    let (highest, top) = (max(2), high.z + TOUCHING - min(2));
    let mut lift = top;
    while highest + lift > low.z {
        let free = x.iter().map(|&[x, y, z]| tool.distance([x, y, z + lift]).0);
        let free = free.fold(f64::INFINITY, f64::min);
        if free < TOUCHING {
            return Some(lift);
        }
        lift -= free;
    }
    // The tool slips between them.
    Some(top)
}

/// Where the vertices of the flat blank are over the origin [m].
fn placed(placement: &Placement, lamina: &Lamina) -> Vec<[f64; 3]> {
    let (tilt_sin, tilt_cos) = placement.tilt_deg.to_radians().sin_cos();
    let (sin, cos) = placement.tilt_axis_deg.to_radians().sin_cos();
    let [cx, cy] = placement.centre_mm.map(|c| c * 1e-3);
    // Along the axis of the tilt and across it.
    let turned = |[u, v]: &[f64; 2]| {
        let (x, y) = (cx + u, cy + v);
        [cos * x + sin * y, cos * y - sin * x]
    };
    let across = lamina.rest.iter().map(|at| turned(at)[1]);
    // With a negative tilt the edge farthest across is the low one.
    let hinge = match tilt_sin < 0.0 {
        true => across.fold(f64::NEG_INFINITY, f64::max),
        false => across.fold(f64::INFINITY, f64::min),
    };
    let place = |at: &[f64; 2]| {
        let [along, across] = turned(at);
        let rising = across - hinge;
        let across = hinge + rising * tilt_cos;
        let z = 1e-3 * placement.height_mm + rising * tilt_sin;
        [cos * along - sin * across, cos * across + sin * along, z]
    };
    lamina.rest.iter().map(place).collect()
}
