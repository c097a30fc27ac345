use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use drape_cloth::math::Vec3;

/// Shortest way along the surface that has a direction [m]. Robots repeat to some 10 µm: a
/// shorter way says nothing about where the roller should point.
const SHORTEST_TRAVEL: f64 = 1e-6;

/// A vertex to press, in the order of pressing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PressedPoint {
    /// Vertex of the fabric.
    pub vertex: u32,
    /// Where it is pressed on to the tool [m].
    pub position: Vec3,
    /// Outward normal of the tool there, of any length but zero.
    pub normal: Vec3,
}

/// How a point is draped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PressKind {
    /// The roller travels through it in contact.
    Stroke,
    /// Pressed without travel.
    Press,
}

/// One point of a draping path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrapingPoint {
    /// Place in the path, from 0.
    pub index: usize,
    /// Vertex of the fabric.
    pub vertex: u32,
    /// On the tool's surface [m].
    pub position: Vec3,
    /// Outward unit normal of the tool.
    pub normal: Vec3,
    /// Unit tangent towards the next point of the stroke; at its last point, from the one
    /// before. None for a press, and where the way leads straight along the normal.
    pub travel: Option<Vec3>,
    /// Number of the stroke or press the point belongs to, from 0.
    pub stroke: usize,
    /// The robot jumps to this point and comes down on it.
    pub starts_stroke: bool,
    pub kind: PressKind,
}

/// A point of which no path can be made.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("point {index} (vertex {vertex}): {what} {found:?} {fault}")]
pub struct UnusablePoint {
    index: usize,
    vertex: u32,
    what: &'static str,
    found: [f64; 3],
    fault: &'static str,
}

/// What a roller may do within a stroke: the same for costs, files and robots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rolling {
    /// From this distance between two points on the robot jumps [m].
    pub join_distance: f64,
    /// Where its way turns by more, the roller is lifted [rad]. It rolls backwards as well as forwards, so that it never turns
    /// by more than a right angle, and that is no bound.
    pub turn: f64,
}

impl Rolling {
    /// Joins points nearer than a distance [m], wherever the way turns.
    pub fn joining(join_distance: f64) -> Self {
        let turn = FRAC_PI_2;
        Self {
            join_distance,
            turn,
        }
    }

    /// By how much the roller turns about the normal of the tool from one way to the next [rad]; where the tool bends it only tilts.
    fn turn_between(way: &Vec3, next: &Vec3, normal: &Vec3) -> f64 {
        let [way, next] =
            [way, next].map(|way| way - normal * (way.dot(normal) / normal.norm_squared()));
        let angle = way.angle(&next);
        angle.min(PI - angle)
    }
}

/// Groups points into strokes and presses and finds the directions of travel.
///
/// A stroke whose points all coincide, as a single one does, is a press.
pub fn strokes(
    points: &[PressedPoint],
    rolling: Rolling,
) -> Result<Vec<DrapingPoint>, UnusablePoint> {
    let normals = unit_normals(points)?;
    let mut path = Vec::with_capacity(points.len());
    for (stroke, members) in stroke_points(points, rolling).enumerate() {
        let first = path.len();
        let normals = &normals[first..first + members.len()];
        let travels: Vec<_> = (0..members.len())
            .map(|i| travel(members, i, normals[i]))
            .collect();
        let kind = match travels.iter().any(Option::is_some) {
            true => PressKind::Stroke,
            false => PressKind::Press,
        };
        for (i, point) in members.iter().enumerate() {
            path.push(DrapingPoint {
                index: first + i,
                vertex: point.vertex,
                position: point.position,
                normal: normals[i],
                travel: travels[i],
                stroke,
                starts_stroke: i == 0,
                kind,
            });
        }
    }
    Ok(path)
}

/// The points of each stroke or press, as [`strokes`] groups them.
pub fn stroke_points(
    points: &[PressedPoint],
    rolling: Rolling,
) -> impl Iterator<Item = &[PressedPoint]> {
    let mut last: Option<Vec3> = None;
    points.chunk_by(move |a, b| {
        let way = b.position - a.position;
        let turn = last.map_or(0.0, |last| Rolling::turn_between(&last, &way, &a.normal));
        // A right angle of rounded coordinates is none beyond it.
        let rolls = way.norm() < rolling.join_distance && turn <= rolling.turn + 1e-6;
        if !rolls {
            last = None;
        } else if way.norm() > 0.0 {
            last = Some(way);
        }
        rolls
    })
}

/// The normals at unit length, after checking that every point is usable.
fn unit_normals(points: &[PressedPoint]) -> Result<Vec<Vec3>, UnusablePoint> {
    let unit_normal = |(index, point): (usize, &PressedPoint)| {
        let fail = |what, found: Vec3, fault| UnusablePoint {
            index,
            vertex: point.vertex,
            what,
            found: found.into(),
            fault,
        };
        let is_finite = |v: &Vec3| v.iter().all(|x| x.is_finite());
        if !is_finite(&point.position) {
            return Err(fail("position", point.position, "m is not finite"));
        }
        // Scaled first, so that no square under- or overflows.
        let scaled = point.normal / point.normal.amax();
        match is_finite(&scaled) {
            true => Ok(scaled.normalize()),
            false => Err(fail("normal", point.normal, "has no direction")),
        }
    };
    points.iter().enumerate().map(unit_normal).collect()
}

/// Direction of travel at point `i` of a stroke: towards the nearest later point that lies
/// in some direction along the surface, otherwise away from the nearest such earlier one.
fn travel(stroke: &[PressedPoint], i: usize, normal: Vec3) -> Option<Vec3> {
    let here = stroke[i].position;
    let ahead = stroke[i + 1..].iter().map(|p| p.position - here);
    let behind = stroke[..i].iter().rev().map(|p| here - p.position);
    ahead
        .chain(behind)
        .find_map(|way| (way - normal * way.dot(&normal)).try_normalize(SHORTEST_TRAVEL))
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    fn point(vertex: u32, position: [f64; 3], normal: [f64; 3]) -> PressedPoint {
        PressedPoint {
            vertex,
            position: position.into(),
            normal: normal.into(),
        }
    }

    fn path(positions: &[[f64; 3]], join_distance: f64) -> Vec<DrapingPoint> {
        let points: Vec<_> = positions.iter().map(|&p| point(7, p, UP)).collect();
        strokes(&points, Rolling::joining(join_distance)).unwrap()
    }

    fn travels(path: &[DrapingPoint]) -> Vec<Option<[f64; 3]>> {
        path.iter().map(|p| p.travel.map(Into::into)).collect()
    }

    #[test]
    fn no_points_make_no_path() {
        assert_eq!(strokes(&[], Rolling::joining(0.01)), Ok(vec![]));
    }

    #[test]
    fn one_point_is_a_press() {
        let path = strokes(
            &[point(3, [1.0, 2.0, 3.0], [0.0, -4.0, 0.0])],
            Rolling::joining(0.01),
        )
        .unwrap();
        assert_eq!(
            path,
            [DrapingPoint {
                index: 0,
                vertex: 3,
                position: Vec3::new(1.0, 2.0, 3.0),
                normal: Vec3::new(0.0, -1.0, 0.0),
                travel: None,
                stroke: 0,
                starts_stroke: true,
                kind: PressKind::Press,
            }]
        );
    }

    /// Two points along x and one along y, a jump, a press, a jump, two points along −x.
    #[test]
    fn strokes_jumps_and_presses_are_told_apart() {
        let path = path(
            &[
                [0.00, 0.00, 0.0],
                [0.01, 0.00, 0.0],
                [0.01, 0.01, 0.0],
                [0.50, 0.00, 0.0],
                [0.90, 0.00, 0.0],
                [0.89, 0.00, 0.0],
            ],
            0.015,
        );
        let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let back = [-1.0, 0.0, 0.0];
        assert_eq!(
            travels(&path),
            [Some(x), Some(y), Some(y), None, Some(back), Some(back)]
        );
        let column = |f: fn(&DrapingPoint) -> usize| path.iter().map(f).collect::<Vec<_>>();
        assert_eq!(column(|p| p.index), [0, 1, 2, 3, 4, 5]);
        assert_eq!(column(|p| p.stroke), [0, 0, 0, 1, 2, 2]);
        assert_eq!(column(|p| p.starts_stroke.into()), [1, 0, 0, 1, 1, 0]);
        assert_eq!(
            column(|p| (p.kind == PressKind::Press).into()),
            [0, 0, 0, 1, 0, 0]
        );
    }

    #[test]
    fn join_distance_itself_is_a_jump() {
        let positions = [[0.0; 3], [0.25, 0.0, 0.0]];
        assert_eq!(path(&positions, 0.25)[1].stroke, 1);
        assert_eq!(path(&positions, 0.2501)[1].stroke, 0);
    }

    /// East, north-east, south-west (straight back), south: the roller turns by 45 degrees, not at all, and by 45.
    #[test]
    fn strokes_end_where_the_roller_would_turn_too_far() {
        let places = [
            [0.00, 0.00, 0.0],
            [0.01, 0.00, 0.0],
            [0.02, 0.01, 0.0],
            [0.01, 0.00, 0.0],
            [0.01, 0.00, 0.0],
            [0.01, -0.01, 0.0],
            [0.02, -0.01, 0.0],
        ];
        let points = places.map(|place| point(7, place, UP));
        let lengths = |turn_deg: f64| {
            let rolling = Rolling {
                turn: turn_deg.to_radians(),
                ..Rolling::joining(0.1)
            };
            let strokes = stroke_points(&points, rolling);
            strokes.map(<[PressedPoint]>::len).collect::<Vec<_>>()
        };
        assert_eq!(lengths(90.0), [7]);
        assert_eq!(lengths(45.0), [6, 1]);
        // Neither the way back nor a second press at the same place turns anything,
        assert_eq!(lengths(44.0), [2, 3, 2]);
        // and straight over a ridge nothing turns.
        let over = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.01], [0.02, 0.0, 0.0]];
        let over = over.map(|place| point(7, place, UP));
        let rolling = Rolling {
            turn: 0.0,
            ..Rolling::joining(0.1)
        };
        assert_eq!(stroke_points(&over, rolling).count(), 1);
    }

    /// Down a slope of 3 in 4: the way across is (0.04, 0, 0.03), the tangent at the first
    /// point is level, at the second it follows the slope.
    #[test]
    fn travel_is_tangential_to_the_tool() {
        let points = [
            point(0, [0.0; 3], UP),
            point(1, [0.04, 0.0, -0.03], [0.6, 0.0, 0.8]),
        ];
        let path = strokes(&points, Rolling::joining(0.1)).unwrap();
        let expected = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.8, 0.0, -0.6)];
        for (point, expected) in path.iter().zip(expected) {
            let travel = point.travel.unwrap();
            assert!((travel - expected).norm() < 1e-15, "{travel}");
            assert!(travel.dot(&point.normal).abs() < 1e-15);
        }
    }

    #[test]
    fn repeated_points_take_the_direction_of_the_nearest_distinct_one() {
        let (a, b) = ([0.0; 3], [0.01, 0.0, 0.0]);
        let x = Some([1.0, 0.0, 0.0]);
        assert_eq!(travels(&path(&[a, a, b, b], 0.1)), [x; 4]);
        // Closer than a robot can tell is the same point.
        assert_eq!(travels(&path(&[a, [0.0, 1e-7, 0.0], b], 0.1))[0], x);
    }

    #[test]
    fn stroke_without_travel_is_a_press() {
        let path = path(&[[0.2; 3]; 3], 0.1);
        assert_eq!(travels(&path), [None; 3]);
        assert!(
            path.iter()
                .all(|p| p.kind == PressKind::Press && p.stroke == 0)
        );
    }

    #[test]
    fn way_along_the_normal_has_no_travel() {
        let path = path(&[[0.0; 3], [0.0, 0.0, 0.01]], 0.1);
        assert_eq!(travels(&path), [None; 2]);
    }

    #[test]
    fn extreme_normals_keep_their_direction() {
        for length in [1e-300, 1e300] {
            let path = strokes(
                &[point(0, [0.0; 3], [0.0, length, 0.0])],
                Rolling::joining(0.1),
            )
            .unwrap();
            assert_eq!(path[0].normal, Vec3::new(0.0, 1.0, 0.0));
        }
    }

    #[test]
    fn unusable_points_are_named() {
        let sound = point(4, [0.0; 3], UP);
        for normal in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            let error =
                strokes(&[sound, point(9, [0.0; 3], normal)], Rolling::joining(0.1)).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("point 1 (vertex 9): normal {normal:?} has no direction")
            );
        }
        let error =
            strokes(&[point(9, [0.0, f64::NAN, 0.0], UP)], Rolling::joining(0.1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "point 0 (vertex 9): position [0.0, NaN, 0.0] m is not finite"
        );
    }
}
