use std::sync::Arc;

use super::config::{FRAME, SceneConfig, SceneError};
use crate::fabric::Lamina;
use crate::sim::{Backend, Cpu, Model, PhysicsConfig, Precision, Snapshot, World};
use crate::tool::Tool;

/// Depth in the tool that a blank may start at, in spacings of the tool's grid: what that errs by
/// at an edge. Deeper, contact would throw it out.
const IN_TOOL: f64 = 0.5;

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
}

impl Scene {
    /// Sets up a scene: builds the tool, cuts the blank and lets it fall. About two seconds
    /// on one core for the standard blank. `progress` is told the simulated share 0..1.
    ///
    /// The fall is computed in f64 with many substeps, since every episode starts from its
    /// result. Equal configurations give equal bits.
    pub fn new(config: &SceneConfig, mut progress: impl FnMut(f64)) -> Result<Self, SceneError> {
        config.check()?;
        let lamina = Lamina::new(&config.blank, config.read_material()?)?;
        config.physics.check_for(&lamina)?;
        let tool = Tool::new(&config.tool)?;

        let fall = &config.fall;
        let control = fall.stepping().control(FRAME);
        let [falling, settling] = fall.frames();

        let start = hung(config, &lamina, falling as f64 * FRAME)?;
        let depths = start.position.iter().map(|&x| -tool.distance(x).0);
        let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
        if deepest > IN_TOOL * tool.grid.spacing() {
            return Err(SceneError::InTool {
                height_mm: config.placement.height_mm,
                depth_mm: 1e3 * deepest,
            });
        }
        let tool = Arc::new(tool);
        let model = Arc::new(Model::new(&lamina, &config.physics));
        let mut quiet = config.physics.clone();
        quiet.damping = fall.settle_damping;
        let quiet = Arc::new(Model::new(&lamina, &quiet));
        let mut state = start;
        let mut done = 0;
        for (model, frames) in [(&model, falling), (&quiet, settling)] {
            let world = World::new(model.clone(), tool.clone());
            let mut cloth = Cpu::new(&world, 1, Precision::F64);
            cloth.load(0, &state);
            for _ in 0..frames {
                cloth.step(&control, &[]);
                done += 1;
                if !cloth.finite()[0] {
                    let time_s = f64::from(done) * FRAME;
                    return Err(SceneError::Diverged { time_s });
                }
                progress(f64::from(done) / (falling + settling) as f64);
            }
            state = cloth.snapshot(0);
            // Clamps stop.
            for vertex in state.fixed.ones() {
                state.velocity[vertex] = [0.0; 3];
            }
        }
        let initial = Arc::new(state);
        Ok(Self {
            config: config.clone(),
            tool,
            lamina: Arc::new(lamina),
            model,
            initial,
        })
    }

    /// The same initial state under other physics: what differs then is the episode alone.
    /// `physics` must have been checked.
    pub fn with_physics(&self, physics: PhysicsConfig) -> Self {
        let mut scene = self.clone();
        scene.model = Model::new(&scene.lamina, &physics).into();
        scene.config.physics = physics;
        scene
    }

    /// Distance to the tool of the vertex nearest to it, as the fall has left it [m].
    pub fn clearance(&self) -> f64 {
        let distances = self.initial.position.iter();
        let distances = distances.map(|&x| self.tool.distance(x).0);
        distances.fold(f64::INFINITY, f64::min)
    }
}

/// The flat blank before the fall; clamps already have the velocity of their displacement, which
/// takes `fall_s` seconds. Fails if one is further from the blank than a cell is long.
pub fn hung(config: &SceneConfig, lamina: &Lamina, fall_s: f64) -> Result<Snapshot, SceneError> {
    let placement = &config.placement;
    let (tilt_sin, tilt_cos) = placement.tilt_deg.to_radians().sin_cos();
    let [cx, cy] = placement.centre_mm.map(|c| c * 1e-3);
    let heights = lamina.rest.iter().map(|[_, v]| cy + v);
    // With a negative tilt the edge at the highest y is the low one.
    let hinge = match tilt_sin < 0.0 {
        true => heights.fold(f64::NEG_INFINITY, f64::max),
        false => heights.fold(f64::INFINITY, f64::min),
    };
    let place = |[u, v]: &[f64; 2]| {
        let along = cy + v - hinge;
        let z = 1e-3 * placement.height_mm + along * tilt_sin;
        [cx + u, hinge + along * tilt_cos, z]
    };

    let mut snapshot = Snapshot::at_rest(lamina.rest.iter().map(place).collect());
    for (index, clamp) in config.clamps.iter().enumerate() {
        let at = clamp.at_mm.map(|c| c * 1e-3);
        let square = |v: usize| {
            let [u, w] = lamina.rest[v];
            (u - at[0]).powi(2) + (w - at[1]).powi(2)
        };
        let nearest = (0..lamina.vertex_count())
            .min_by(|&a, &b| square(a).total_cmp(&square(b)))
            .expect("a blank has vertices");
        // NaN is no place either.
        let is_near = square(nearest) <= lamina.cell_diagonal().powi(2);
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
