//! What is the same for all environments on a scene: where they press, what they show, and how well
//! that is done.

use std::ops::Range;
use std::sync::Arc;

use fixedbitset::FixedBitSet;

use super::config::{EnvConfig, Region};
use super::objective::Goal;
use super::reward::score;
use super::task::ImageShape;
use super::terrain::Terrain;
use crate::path::{PathFigures, PressedPoint, Robot};
use drape_cloth::file::ValueError;
use drape_cloth::math::Vec3;
use drape_cloth::measure::{Measures, surplus};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Snapshot, Stencil, View};

/// A scene and what is to be done on it.
#[derive(Clone)]
pub struct Task {
    pub scene: Arc<Scene>,
    pub config: EnvConfig,
    /// The focus region.
    pub region: Region,
    /// Vertices of it that can be pressed: all, or those that the robot reaches where they lie before the first press.
    pub pressable: FixedBitSet,
    /// The objective at the start [m], see [`Task::can_win`].
    pub initial: f64,
    /// What it shows that never changes.
    pub terrain: Arc<Terrain>,
    pub(super) stencil: Stencil,
    pub(super) view: Arc<View>,
    goal: Goal,
    /// Rows and columns of the lamina that the image shows.
    image: [Range<usize>; 2],
}

impl Task {
    /// Whether there is anything to bring down, a micrometre at least: scores divide by it.
    pub fn can_win(&self) -> bool {
        self.initial >= 1e-6
    }

    /// A task.
    ///
    /// # Errors
    /// If a value is out of range, or the region is not on the blank.
    pub fn new(scene: Arc<Scene>, config: &EnvConfig) -> Result<Self, ValueError> {
        let region = config.region(&scene.lamina)?;
        let image = match config.crop {
            true => [region.rows.clone(), region.columns.clone()],
            false => [0..scene.lamina.rows, 0..scene.lamina.columns],
        };
        let stepping = config.stepping();
        let stencil = Stencil {
            side: 1e-3 * config.stencil_mm,
            threshold: config.drape_threshold(),
            max_strain: config.drape_strain,
            roller: config.roller(),
            press: stepping.press(config.press_s),
            settle: (config.settle_s > 0.0).then(|| stepping.control(config.settle_s)),
        };
        let shape = shape(&image);
        let allowed = pressable(&scene, &region, &config.robot);
        let seen = (0..shape.pixel_count() as u32).filter_map(|pixel| {
            let vertex = vertex(&scene, &image, pixel)?;
            (allowed.contains(vertex as usize)).then_some((pixel, vertex))
        });
        let view = View::new(
            shape.pixel_count(),
            seen,
            scene.lamina.vertex_count(),
            config.mask,
        );
        let (objective, at) = (config.objective, &scene.initial.position);
        let goal = Goal::new(objective, scene.clone(), region.vertices.clone(), at);
        ValueError::unless(
            region.vertices.is_clear() || !allowed.is_clear(),
            "cell",
            "a robot that reaches no vertex of the region",
            "one that reaches some",
        )?;
        Ok(Self {
            terrain: Terrain::new(&scene, &view).into(),
            pressable: allowed,
            initial: goal.left(at),
            config: config.clone(),
            view: view.into(),
            scene,
            region,
            stencil,
            goal,
            image,
        })
    }

    /// The task from another lie of the blank, which is seen over this terrain.
    pub(super) fn lying(&self, scene: &Arc<Scene>) -> Self {
        let (objective, at) = (self.config.objective, &scene.initial.position);
        let goal = Goal::new(objective, scene.clone(), self.region.vertices.clone(), at);
        Self {
            scene: scene.clone(),
            config: self.config.clone(),
            region: self.region.clone(),
            initial: goal.left(at),
            terrain: self.terrain.clone(),
            pressable: self.pressable.clone(),
            stencil: self.stencil.clone(),
            view: self.view.clone(),
            goal,
            image: self.image.clone(),
        }
    }

    /// Size of the image.
    pub fn shape(&self) -> ImageShape {
        shape(&self.image)
    }

    /// The vertex of the blank that an action presses; none where the blank has been cut away.
    pub fn vertex(&self, action: u32) -> Option<u32> {
        vertex(&self.scene, &self.image, action)
    }

    /// The action that presses a vertex; none outside the image.
    pub fn action(&self, vertex: u32) -> Option<u32> {
        let ([row, column], [rows, columns]) = (self.scene.lamina.place(vertex), &self.image);
        let is_seen = rows.contains(&row) && columns.contains(&column);
        is_seen.then(|| ((row - rows.start) * columns.len() + column - columns.start) as u32)
    }

    /// Vertices of the region, ascending.
    pub fn region_vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.region.vertices.ones().map(|v| v as u32)
    }

    /// Vertices that can be pressed, ascending.
    pub fn pressable_vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.pressable.ones().map(|v| v as u32)
    }

    /// About how many presses an episode takes: one for each five vertices.
    pub fn expected_presses(&self) -> usize {
        self.view.vertices.len().div_ceil(5)
    }

    /// Summed distance to the tool of the region [m].
    pub fn distance(&self, state: &Snapshot) -> f64 {
        let (region, position) = (&self.region.vertices, &state.position);
        self.scene.tool.summed_distance(region.ones(), position)
    }

    /// Surplus of the region, see [`surplus`] [m].
    pub fn surplus(&self, state: &Snapshot) -> f64 {
        let Scene { lamina, tool, .. } = &*self.scene;
        surplus(lamina, tool, &state.position, &self.region.vertices)
    }

    /// Where on the tool, in the frame of the scene, presses have landed whose vertices were at these
    /// places [m] over it.
    pub fn points(&self, presses: &[(u32, [f64; 3])]) -> Vec<PressedPoint> {
        let point = |&(vertex, at): &(u32, [f64; 3])| landing(&self.scene, vertex, at);
        presses.iter().map(point).collect()
    }

    /// What a path asks of a robot.
    pub fn figures(&self, points: &[PressedPoint]) -> PathFigures {
        PathFigures::new(points, self.config.rolling())
    }

    /// How well presses that have ended in `state` were done: see [`score`].
    pub fn score(&self, state: &Snapshot) -> f64 {
        score(self.initial, self.goal.left(&state.position))
    }

    /// What the path through `points` costs, see [`Costs`](super::Costs).
    pub fn cost(&self, points: &[PressedPoint], state: &Snapshot) -> f64 {
        let costs = &self.config.costs;
        let undraped = match costs.undraped > 0.0 {
            true => self.undraped_inner(state),
            false => 0,
        };
        let touched = &state.pressed.touched;
        let untouched = self.pressable.difference(touched).count();
        costs.of(&self.figures(points), undraped, untouched)
            + costs.infeasible * self.infeasible(points) as f64
    }

    /// Points of a path that the robot cannot press; none where there is no robot.
    pub fn infeasible(&self, points: &[PressedPoint]) -> usize {
        let robot = self.config.robot.0.as_ref();
        robot.map_or(0, |robot| robot.infeasible(points, self.config.rolling()))
    }

    /// What is measured of a state.
    pub(super) fn measures(&self, state: &Snapshot) -> Measures {
        self.goal.measures(&state.position)
    }

    /// Inner vertices of the region farther than `env.drape_threshold_mm` from the tool.
    pub fn undraped_inner(&self, state: &Snapshot) -> usize {
        let threshold = self.config.drape_threshold();
        self.region
            .undraped_inner(&self.scene, threshold, &state.position)
    }

    /// What is left of the objective [m].
    pub(super) fn left(&self, measures: &Measures) -> f64 {
        self.goal.left_of(measures)
    }

    /// Whether these can be measures of a fabric: no yarn is stretched and no vertex sunk into the tool
    /// beyond belief, by the bounds of the configuration.
    pub(super) fn is_believable(&self, measures: &Measures) -> bool {
        measures.strain <= self.config.max_tension
            && measures.depth <= 1e-3 * self.config.max_depth_mm
    }
}

/// Where a vertex at `at` [m], over the tool, lands if it is pressed, in the scene.
fn landing(scene: &Scene, vertex: u32, at: [f64; 3]) -> PressedPoint {
    let surface = scene.tool.surface.project(Vec3::from(at));
    PressedPoint {
        vertex,
        position: surface.position + scene.tool.origin,
        normal: surface.normal,
    }
}

/// Vertices of a region whose place on the tool a robot reaches.
fn pressable(scene: &Scene, region: &Region, robot: &Robot) -> FixedBitSet {
    let mut all = region.vertices.clone();
    if let Some(robot) = &robot.0 {
        for v in region.vertices.ones() {
            let point = landing(scene, v as u32, scene.initial.position[v]);
            all.set(v, robot.allows(&point));
        }
    }
    all
}

fn shape(image: &[Range<usize>; 2]) -> ImageShape {
    let [rows, columns] = image.each_ref().map(Range::len);
    ImageShape { rows, columns }
}

fn vertex(scene: &Scene, [rows, columns]: &[Range<usize>; 2], pixel: u32) -> Option<u32> {
    let pixel = pixel as usize;
    let [down, right] = [pixel / columns.len(), pixel % columns.len()];
    (scene.lamina).vertex_at(rows.start + down, columns.start + right)
}
