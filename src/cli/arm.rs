//! The robot that `drape view` shows.

use std::sync::Arc;

use super::Failure;
use super::failure::OrInvalid;
use super::planned::Planned;
use crate::run::{cell, path_points};
use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_robot::{Cell, CellConfig, Joints, Motion, Place, Pose, ProgramMoment, TurntableConfig};
use drape_task::path::{DrapingPoint, PressedPoint, Rolling, strokes};
use drape_view::{RobotMoment, RobotPlace, ViewedRobot};

/// Pictures a second, and how many are sent at most: of longer programs fewer a second.
const RATE: f64 = 20.0;
const MOST: f64 = 2000.0;

/// How the robot of a cell makes some presses, at `place` if there is one; how it moves if it is to `plan`.
pub(super) fn robot(
    mut config: CellConfig,
    told: &str,
    scene: &Arc<Scene>,
    points: &[PressedPoint],
    rolling: Rolling,
    place: Option<RobotPlace>,
    plan: bool,
) -> Result<ViewedRobot, Failure> {
    if let Some(place) = place {
        // How it leans, no page changes.
        let [x, y, _] = config.base.map_or([0.0; 3], |base| base.rotation_deg);
        config.base = Some(Place {
            at_mm: place.at_mm,
            rotation_deg: [x, y, place.turn_deg],
        });
        let at_mm = config.turntable.and_then(|table| table.at_mm);
        config.turntable = (place.step_deg != 0.0).then_some(TurntableConfig {
            step_deg: place.step_deg,
            at_mm,
        });
        config.check().or_invalid_in(told)?;
    }
    let points = strokes(points, rolling)?;
    match plan {
        true => planned(&points, config, told, scene),
        false => reached(&points, &config, scene),
    }
}

/// What it reaches, with the arm upright.
fn reached(
    points: &[DrapingPoint],
    config: &CellConfig,
    scene: &Arc<Scene>,
) -> Result<ViewedRobot, Failure> {
    let cell = cell(config, scene)?;
    let reachable = cell.reachable(&path_points(points, scene));
    let told = |(point, is_reached): (&DrapingPoint, bool)| {
        (point.vertex, (!is_reached).then(|| "out of reach".into()))
    };
    let upright = RobotMoment {
        at: 0.0,
        pressed: 0,
        poses: poses(&cell, scene, &[0.0; 6], 0),
    };
    Ok(ViewedRobot {
        name: cell.arm.name.clone(),
        place: place(config, &cell),
        points: points.iter().zip(reachable).map(told).collect(),
        program_s: None,
        parts: parts(&cell),
        moments: vec![upright],
    })
}

/// How it moves.
fn planned(
    points: &[DrapingPoint],
    config: CellConfig,
    told: &str,
    scene: &Arc<Scene>,
) -> Result<ViewedRobot, Failure> {
    let mut planned = Planned::of(points, config, told, scene, |_| ())?;
    planned.cell.find_remedies(&planned.path, &mut planned.plan);
    let Planned { cell, plan, .. } = &planned;
    let mut told: Vec<_> = points.iter().map(|point| (point.vertex, None)).collect();
    for failed in &plan.failed {
        told[failed.index].1 = Some(format!("{}; remedy: {}", failed.detail, failed.remedy));
    }
    let program = cell.program(plan, "");
    let corners = program.moments();
    let seconds = program.seconds();
    let count = (seconds * RATE).clamp(1.0, MOST) as usize;
    let even = (0..=count).map(|k| seconds * k as f64 / count as f64);
    // And on every point.
    let presses = corners
        .iter()
        .filter(|corner| corner.motion == Motion::Contact);
    let mut times: Vec<f64> = even.chain(presses.map(|corner| corner.at)).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let mut next = 0;
    let moments = times.into_iter().map(|at| {
        while next + 1 < corners.len() && corners[next].at < at {
            next += 1;
        }
        let (before, to) = (&corners[next.saturating_sub(1)], &corners[next]);
        let pressed = if at < to.at {
            before.pressed
        } else {
            to.pressed
        };
        let station = program.stations.get(to.station);
        let station = station.map_or(0, |station| cell.station(station));
        RobotMoment {
            at,
            pressed: pressed as u32,
            poses: poses(cell, scene, &between(before, to, at), station),
        }
    });
    Ok(ViewedRobot {
        name: cell.arm.name.clone(),
        place: place(&planned.config, cell),
        points: told,
        program_s: Some(seconds),
        parts: parts(cell),
        moments: moments.collect(),
    })
}

/// Joints on the way from one moment to the next.
fn between(from: &ProgramMoment, to: &ProgramMoment, at: f64) -> Joints {
    let share = ((at - from.at) / (to.at - from.at).max(1e-9)).clamp(0.0, 1.0);
    std::array::from_fn(|j| from.joints[j] + share * (to.joints[j] - from.joints[j]))
}

fn place(config: &CellConfig, cell: &Cell) -> RobotPlace {
    let turn_deg = config.base.map_or(0.0, |base| base.rotation_deg[2]);
    RobotPlace {
        at_mm: cell.base.translation.vector.map(|x| 1e3 * x).into(),
        turn_deg,
        step_deg: config.turntable.map_or(0.0, |table| table.step_deg),
    }
}

/// What moves with the arm, and what stands around and does not turn with the tool, or does.
fn parts(cell: &Cell) -> Vec<Vec<[Vec3; 3]>> {
    cell.shapes().into_iter().chain(cell.blocks()).collect()
}

/// Where these are in the frame of the tool, at a station of the cell.
fn poses(cell: &Cell, scene: &Scene, joints: &Joints, station: usize) -> Vec<[f64; 12]> {
    let origin = scene.tool.origin;
    let away = Pose::translation(-origin.x, -origin.y, -origin.z);
    let back = away * cell.turn(station).inverse();
    let arm = cell.frames(joints).map(|pose| back * pose);
    let standing = [back, away];
    let rows = |pose: Pose| {
        let matrix = pose.to_homogeneous();
        std::array::from_fn(|k| matrix[(k / 4, k % 4)])
    };
    arm.into_iter().chain(standing).map(rows).collect()
}
