//! A dome on a table and a path over it.

use drape_robot::{Arm, Cell, CellConfig, ObstacleSurface, PathPoint, Place, Pose};
use nalgebra::Vector3;

const RADIUS: f64 = 0.075;

/// A closed half ball of 75 mm on the ground, and a path over it: strokes down from near the top, and a press.
pub fn dome() -> ObstacleSurface {
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
        triangles.push([
            at(rows, column),
            corners.len() as u32 - 1,
            at(rows, column + 1),
        ]);
    }
    ObstacleSurface { corners, triangles }
}

fn on_dome(polar: f64, azimuth: f64) -> Vector3<f64> {
    let (sin, cos) = polar.sin_cos();
    RADIUS * Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

pub fn stroke(number: usize, azimuth: f64, count: usize) -> Vec<PathPoint> {
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

pub fn path() -> Vec<PathPoint> {
    let strokes = (0..6).map(|k| stroke(k, f64::from(k as u32), if k == 5 { 1 } else { 6 }));
    strokes.flatten().collect()
}

pub fn cell(robot: &str, change: impl FnOnce(&mut CellConfig)) -> Cell {
    let mut config = CellConfig {
        robot: Some(robot.into()),
        base: Some(Place {
            at_mm: [-550.0, 0.0, -100.0],
            rotation_deg: [0.0; 3],
        }),
        ..CellConfig::unnamed()
    };
    change(&mut config);
    config.check().unwrap();
    Cell::new(
        Arm::shipped(robot).unwrap(),
        &config,
        &dome(),
        &Pose::identity(),
    )
}
