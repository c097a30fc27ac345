//! The robot of a run: its cell, and which presses it can make.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_4;
use std::path::Path;
use std::sync::{Arc, RwLock};

use anyhow::{Context, Result, anyhow, ensure};

use drape_cloth::file::read_text;
use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_robot::{Arm, Cell, CellConfig, ObstacleSurface, PathPoint, contact};
use drape_task::path::{DrapingPoint, Feasibility, Frame, PressedPoint, Rolling, stroke_points};

/// The cell that `config` describes, round the tool of a scene.
///
/// # Errors
/// If there is no such robot, its file is none, or its base stands in something.
pub fn cell(config: &CellConfig, scene: &Scene) -> Result<Cell> {
    let arm = match (&config.robot_file, &config.robot) {
        (Some(file), _) => {
            let file = Path::new(file);
            let text = read_text(file)?;
            match file.extension().is_some_and(|end| end == "toml") {
                true => Arm::from_toml(&text, file)?,
                false => Arm::from_urdf(&text, file)?,
            }
        }
        (None, name) => {
            let name = name.as_deref().unwrap_or(CellConfig::ROBOT);
            let known: Vec<_> = Arm::names().collect();
            let expected = known.join(", ");
            Arm::shipped(name)
                .ok_or_else(|| anyhow!("`robot` is {name:?}, expected one of {expected}"))?
        }
    };
    let mesh = scene.tool.mesh_in_scene();
    let surface = ObstacleSurface {
        corners: mesh.vertices,
        triangles: mesh.triangles,
    };
    let cell = Cell::new(arm, config, &surface, &scene.config.tool.pose.isometry());
    if let (Some(_), Some(name)) = (config.base, cell.base_in()) {
        return Err(anyhow!(
            "`base.at_mm` puts the robot's base into the {name}, expected a free place"
        ));
    }
    Ok(cell)
}

/// The points of a path as robots take them.
pub fn path_points(points: &[DrapingPoint], scene: &Scene) -> Vec<PathPoint> {
    let frame = Frame::tool(&scene.config.tool.pose);
    let of = |point: &DrapingPoint| PathPoint {
        position: frame.point(&point.position),
        normal: frame.direction(&point.normal),
        travel: point.travel.map(|travel| frame.direction(&travel)),
        stroke: point.stroke,
    };
    points.iter().map(of).collect()
}

/// What a robot can press, looked up in a grid over the tool whose places are filled in as they are asked for.
pub struct ReachMap {
    cell: Cell,
    scene: Arc<Scene>,
    /// By place and direction of travel: angles of the table and tilts, one bit each.
    found: RwLock<HashMap<([i32; 3], usize), u64>>,
}

/// Between two places of the grid [m].
const SPACING: f64 = 0.015;
/// Directions of travel that are told apart; those beyond the half are the roller flipped.
const DIRECTIONS: usize = 8;

impl ReachMap {
    /// For the robot that `config` describes.
    pub fn new(config: &CellConfig, scene: &Arc<Scene>) -> Result<Self> {
        let cell = cell(config, scene).context("cell")?;
        ensure!(
            config.base.is_some(),
            "`cell.base` is missing, expected the robot's place: `drape robot` proposes one"
        );
        // What is proved is planned, which takes a place to wait in: better said before the training.
        cell.find_home().context("cell")?;
        Ok(Self {
            cell,
            scene: scene.clone(),
            found: RwLock::default(),
        })
    }

    /// At the place of the grid that a point is nearest to.
    fn ways(&self, point: &PressedPoint, direction: usize) -> u64 {
        let place: [i32; 3] = std::array::from_fn(|k| (point.position[k] / SPACING).round() as i32);
        let key = (place, direction);
        if let Some(&ways) = self.found.read().expect("no panic").get(&key) {
            return ways;
        }
        // Whichever point asks first.
        let middle = Vec3::from(place.map(|k| f64::from(k) * SPACING));
        let surface = self
            .scene
            .tool
            .surface
            .project(middle - self.scene.tool.origin);
        let on_tool = self.scene.config.tool.pose.isometry().inverse();
        let position =
            on_tool * drape_robot::Point::from(surface.position + self.scene.tool.origin);
        let normal = on_tool * surface.normal;
        let (sin, cos) = (direction as f64 * FRAC_PI_4).sin_cos();
        let travel = on_tool * Vec3::new(cos, sin, 0.0);
        let ways = self
            .cell
            .reach(&contact(&position.coords, &normal, &travel));
        self.found.write().expect("no panic").insert(key, ways);
        ways
    }

    fn any(&self, point: &PressedPoint) -> bool {
        (0..DIRECTIONS).any(|direction| self.ways(point, direction) != 0)
    }
}

impl Feasibility for ReachMap {
    fn allows(&self, point: &PressedPoint) -> bool {
        self.any(point)
    }

    /// A point that no pose reaches counts, and each that a stroke has to be lifted at.
    fn infeasible(&self, path: &[PressedPoint], rolling: Rolling) -> usize {
        let mut count = 0;
        for stroke in stroke_points(path, rolling) {
            if let [single] = stroke {
                count += usize::from(!self.any(single));
                continue;
            }
            // Ways that have held since the stroke began, or was last lifted, with the roller either way round.
            let (mut held, mut last) = ([u64::MAX; 2], 0);
            for (k, point) in stroke.iter().enumerate() {
                let to = stroke.get(k + 1).unwrap_or(point);
                let from = if k + 1 < stroke.len() {
                    point
                } else {
                    &stroke[k - 1]
                };
                let way = to.position - from.position;
                let turns = (way.y.atan2(way.x) / FRAC_PI_4).round() as i32;
                let mut direction = turns.rem_euclid(DIRECTIONS as i32) as usize;
                // A roller that turns back rolls backwards.
                let apart = direction
                    .abs_diff(last)
                    .min(DIRECTIONS - direction.abs_diff(last));
                if k > 0 && apart > DIRECTIONS / 4 {
                    direction = (direction + DIRECTIONS / 2) % DIRECTIONS;
                }
                last = direction;
                let flipped = (direction + DIRECTIONS / 2) % DIRECTIONS;
                let here = [direction, flipped].map(|direction| self.ways(point, direction));
                let both = [held[0] & here[0], held[1] & here[1]];
                if both == [0; 2] {
                    count += 1;
                    // At a lift the roller may be turned; where no way holds nothing else will.
                    held = if here == [0; 2] { [u64::MAX; 2] } else { here };
                } else {
                    held = both;
                }
            }
        }
        count
    }
}
