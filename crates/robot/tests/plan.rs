//! Plans round a dome on a table.

mod dome;

use dome::{cell, path, stroke};
use drape_robot::{Arm, BlockConfig, Cell, Check, NoHome, PathPoint, Plan, Point};
use nalgebra::Vector3;

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

/// Presses all points, hits nothing at finer steps, and is the same every time.
#[test]
fn both_arms_press_a_dome() {
    for robot in Arm::names() {
        let (cell, path) = (cell(robot, |_| {}), path());
        let plan = cell.plan(&path, |_| {}).unwrap();
        assert_eq!(plan.failed, []);
        assert_on_points(&cell, &plan, &path);
        assert_eq!(cell.collisions(&plan), [""; 0]);
        let pressed = plan.contacts().map(|(_, contact)| contact.point);
        assert!(pressed.eq(0..path.len()));
        let again = cell.plan(&path, |_| {}).unwrap();
        assert!(
            plan.contacts()
                .map(|(_, c)| c.joints)
                .eq(again.contacts().map(|(_, c)| c.joints))
        );
        let reached = cell.reached(&path, None);
        assert_eq!(reached.not_at_all, 0, "{reached:?}");
        assert!(reached.at_once < path.len(), "{reached:?}");
    }
}

/// A wall between arm and dome is gone round, or over; one through the dome is not to be had.
#[test]
fn walls_are_gone_round() {
    let wall = |at_mm, size_mm, turns| {
        move |config: &mut drape_robot::CellConfig| {
            config.obstacles.push(BlockConfig {
                name: "wall".into(),
                size_mm,
                at_mm,
                rotation_deg: [0.0; 3],
                turns,
            });
        }
    };
    let path: Vec<PathPoint> = [&stroke(0, 1.5, 6)[3..], &stroke(1, -1.5, 6)[3..]].concat();
    let beside = cell("ur5e", wall([0.0, 0.0, 120.0], [100.0, 4.0, 60.0], false));
    let plan = beside.plan(&path, |_| {}).unwrap();
    assert_eq!(plan.failed, []);
    assert_eq!(beside.collisions(&plan), [""; 0]);
    let through = cell(
        "ur5e",
        wall([0.0, 80.0, 100.0], [400.0, 100.0, 200.0], true),
    );
    let mut plan = through.plan(&path, |_| {}).unwrap();
    assert_eq!(through.collisions(&plan), [""; 0]);
    through.find_remedies(&path, &mut plan);
    let failed: Vec<usize> = plan.failed.iter().map(|point| point.index).collect();
    assert_eq!(failed, [0, 1, 2]);
    for point in &plan.failed {
        assert!(point.detail.contains("wall"), "{point:?}");
        assert!(!point.remedy.is_empty() && !point.tried.is_empty());
    }
}

/// Whatever a path asks, each of its points is either pressed or listed with a reason.
#[test]
fn no_point_is_dropped_without_a_word() {
    // Under the table, far away, on the ground, and one that can be had.
    let odd = |position: [f64; 3], normal: [f64; 3]| PathPoint {
        position: position.into(),
        normal: Vector3::from(normal).normalize(),
        travel: None,
        stroke: 0,
    };
    let mut path = vec![
        odd([0.0, 0.0, -0.5], [0.0, 0.0, -1.0]),
        odd([5.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        odd([0.075, 0.0, 0.001], [1.0, 0.0, 0.0]),
        odd([0.0, 0.0, 0.075], [0.0, 0.0, 1.0]),
    ];
    for (k, point) in path.iter_mut().enumerate() {
        point.stroke = k;
    }
    let cell = cell("crb15000-5", |config| {
        config.obstacles.push(BlockConfig {
            name: "table".into(),
            size_mm: [2000.0, 2000.0, 20.0],
            at_mm: [0.0, 0.0, -11.0],
            rotation_deg: [0.0; 3],
            turns: false,
        });
    });
    let mut plan = cell.plan(&path, |_| {}).unwrap();
    cell.find_remedies(&path, &mut plan);
    let failed: Vec<(usize, Check)> = plan
        .failed
        .iter()
        .map(|point| (point.index, point.check))
        .collect();
    assert_eq!(failed.len(), 3, "{:#?}", plan.failed);
    assert_eq!(failed[1], (1, Check::Reach));
    assert!(
        plan.failed[2].check >= Check::Collision,
        "{:?}",
        plan.failed[2]
    );
    assert!(plan.failed.iter().all(|point| !point.remedy.is_empty()));
    let pressed: Vec<usize> = plan.contacts().map(|(_, contact)| contact.point).collect();
    assert_eq!(pressed, [3]);
}

/// One point, and as many as a whole sheet has.
#[test]
fn paths_of_one_point_and_of_two_thousand() {
    let cell = cell("ur5e", |config| config.limits.deviation_mm = 0.0);
    let one = stroke(0, 0.0, 1);
    let plan = cell.plan(&one, |_| {}).unwrap();
    assert_eq!((plan.strokes.len(), plan.failed.len()), (1, 0));
    let many: Vec<PathPoint> = (0..400)
        .flat_map(|k| stroke(k, 0.1 * k as f64, 5))
        .collect();
    let plan = cell.plan(&many, |_| {}).unwrap();
    assert_eq!(plan.contacts().count() + plan.failed.len(), 2000);
    assert!(plan.failed.len() < 20, "{:?}", plan.failed.first());
    assert!(cell.plan(&[], |_| {}).unwrap().strokes.is_empty());
}

/// A home that is named is held against limits and collisions.
#[test]
fn homes_that_cannot_be_are_refused() {
    // Beyond limits, and straight up through a beam.
    for home in [[700.0; 6], [0.0; 6]] {
        let cell = cell("crb15000-5", |config| {
            config.home_deg = Some(home);
            config.obstacles.push(BlockConfig {
                name: "beam".into(),
                size_mm: [100.0, 400.0, 100.0],
                at_mm: [-550.0, 0.0, 450.0],
                rotation_deg: [0.0; 3],
                turns: false,
            });
        });
        let error = cell.plan(&path(), |_| {}).unwrap_err();
        assert_eq!(error, NoHome::Named, "{home:?}");
    }
}

/// A wall of soft places is pushed by what holds the roller, and nothing else is.
#[test]
fn soft_things_are_pushed_not_hit() {
    let cell = cell("crb15000-5", |_| {});
    let path = stroke(0, 0.0, 1);
    let plan = cell.plan(&path, |_| {}).unwrap();
    assert_eq!(plan.failed, []);
    let above = |height: f64| vec![path[0].position + height * path[0].normal];
    for (height, is_pushed) in [(0.0, false), (0.08, true), (2.0, false)] {
        let soft = above(height);
        let pushed = cell.pushed(&plan, |_| &soft);
        assert_eq!(pushed.len(), usize::from(is_pushed), "{height}: {pushed:?}");
        if let [pushed] = &pushed[..] {
            assert_eq!((pushed.point, &*pushed.part), (0, "roller's holder"));
            // A stem of 12 mm, leaning by some degrees.
            assert!((4.0..12.001).contains(&pushed.depth_mm), "{pushed:?}");
        }
    }
}
