//! Plans round a dome on a table.

use drape_robot::{Arm, Cell, CellConfig, PathPoint, Place, Plan, Point, Pose, Surface};
use nalgebra::Vector3;

const RADIUS: f64 = 0.075;

/// A closed half ball of 75 mm on the ground, and a path over it: strokes down from near the top, and a press.
fn dome() -> Surface {
    let (rows, columns) = (12, 24);
    let mut corners = vec![Vector3::new(0.0, 0.0, RADIUS)];
    for row in 1..=rows {
        for column in 0..columns {
            corners.push(on_dome(
                0.5 * std::f64::consts::PI * row as f64 / rows as f64,
                std::f64::consts::TAU * column as f64 / columns as f64,
            ));
        }
    }
    corners.push(Vector3::zeros());
    let at = |row: usize, column: usize| (1 + (row - 1) * columns + column % columns) as u32;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        for row in 1..rows {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            triangles.extend([[a, c, d], [a, d, b]]);
        }
        triangles.push([at(rows, column), corners.len() as u32 - 1, at(rows, column + 1)]);
    }
    Surface { corners, triangles }
}

fn on_dome(polar: f64, azimuth: f64) -> Vector3<f64> {
    let (sin, cos) = polar.sin_cos();
    RADIUS * Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

fn stroke(number: usize, azimuth: f64, count: usize) -> Vec<PathPoint> {
    let place = |k: usize| on_dome(0.15 + 0.16 * k as f64, azimuth);
    let point = |k: usize| {
        let (here, next) = (place(k), place(k + 1));
        let normal = here.normalize();
        let way = next - here;
        PathPoint {
            position: here,
            normal,
            travel: (count > 1).then(|| (way - normal * way.dot(&normal)).normalize()),
            stroke: number,
        }
    };
    (0..count).map(point).collect()
}

fn path() -> Vec<PathPoint> {
    let strokes = (0..6).map(|k| stroke(k, f64::from(k as u32), if k == 5 { 1 } else { 6 }));
    strokes.flatten().collect()
}

fn cell(robot: &str, change: impl FnOnce(&mut CellConfig)) -> Cell {
    let mut config = CellConfig {
        robot: Some(robot.into()),
        base: Some(Place {
            at_mm: [-550.0, 0.0, -100.0],
            rotation_deg: [0.0; 3],
        }),
        ..CellConfig::default()
    };
    change(&mut config);
    config.check().unwrap();
    Cell::new(Arm::shipped(robot).unwrap(), &config, &dome(), &Pose::identity())
}

/// Every contact of a plan puts the roller on its point: line of contact, axis and direction.
fn assert_on_points(cell: &Cell, plan: &Plan, path: &[PathPoint]) {
    let program = cell.program(plan, "dome");
    for stroke in &plan.strokes {
        let tool = plan.stations[stroke.station].tool;
        for contact in &stroke.contacts {
            let at = cell.arm.flange_at(&contact.joints) * program.roller.contact(stroke.tilt);
            let point = &path[contact.point];
            let there = tool * Point::from(point.position);
            assert!((at.translation.vector - there.coords).norm() < 1e-9);
            let down = at.rotation * Vector3::z();
            assert!((down + tool.rotation * point.normal).norm() < 1e-9);
            if let Some(travel) = point.travel {
                let along = (at.rotation * Vector3::x()).dot(&(tool.rotation * travel));
                assert!((along.abs() - 1.0).abs() < 1e-9, "{along}");
            }
        }
    }
}

#[test]
fn both_arms_press_a_dome() {
    for robot in Arm::names() {
        let (cell, path) = (cell(robot, |_| {}), path());
        let start = std::time::Instant::now();
        let plan = cell.plan(&path, |_| {}).unwrap();
        println!("{robot}: {:.1} s, {} strokes, lifted {}, failed {:#?}", start.elapsed().as_secs_f64(), plan.strokes.len(), plan.lifted, plan.failed);
        assert_on_points(&cell, &plan, &path);
        let start = std::time::Instant::now();
        println!("{:?} {:?} once {}, {:.1} s, {:.1} s", cell.collisions(&plan), cell.reached(&path), cell.collisions_at_once(&path), start.elapsed().as_secs_f64(), cell.program(&plan, "x").seconds());
        assert_eq!(plan.failed, []);
        assert_eq!(cell.collisions(&plan), [""; 0]);
        let pressed = plan.contacts().map(|(_, contact)| contact.point);
        assert!(pressed.eq(0..path.len()));
    }
}
