//! Programs, played back by a reader of their own: where they put the roller, and whether a controller takes them.

mod dome;

use std::collections::HashMap;
use std::process::Command;

use dome::{cell, path};
use drape_robot::{CellConfig, Motion, Pose, Program};
use nalgebra::{Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Numbers of a nested list, in order.
fn numbers(text: &str) -> Vec<f64> {
    let parts = text.split(['[', ']', ',', '(', ')', ' ']);
    parts.filter_map(|part| part.parse().ok()).collect()
}

fn pose(n: &[f64]) -> Pose {
    let turned = UnitQuaternion::from_quaternion(Quaternion::new(n[3], n[4], n[5], n[6]));
    assert!((Quaternion::new(n[3], n[4], n[5], n[6]).norm() - 1.0).abs() < 1e-6);
    let place = 1e-3 * Vector3::new(n[0], n[1], n[2]);
    Pose::from_parts(Translation3::from(place), turned.to_rotation_matrix())
}

/// What a module declares, by name.
#[derive(Default)]
struct Module {
    poses: HashMap<String, Pose>,
    joints: HashMap<String, [f64; 6]>,
    procedures: HashMap<String, Vec<String>>,
}

/// Reads the RAPID that this crate writes, and holds it against rules that controllers have.
fn read(text: &str) -> Module {
    let mut module = Module::default();
    let mut procedure: Option<String> = None;
    assert!(text.is_ascii() && text.starts_with("MODULE ") && text.ends_with("ENDMODULE\n"));
    for line in text.lines() {
        let code = line.split('!').next().unwrap().trim();
        if code.is_empty() || code.starts_with("MODULE") || code == "ENDMODULE" {
            continue;
        }
        let words = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        assert!(words.clone().all(|word| word.len() <= 32), "{line}");
        if let Some(rest) = code.strip_prefix("PROC ") {
            let name = rest.split('(').next().unwrap().to_string();
            module.procedures.insert(name.clone(), Vec::new());
            procedure = Some(name);
        } else if code == "ENDPROC" {
            procedure = None;
        } else if let Some(procedure) = &procedure {
            let code = code.strip_suffix(';').expect("instructions end so");
            module
                .procedures
                .get_mut(procedure)
                .unwrap()
                .push(code.into());
        } else {
            let (declared, value) = code.strip_suffix(';').unwrap().split_once(":=").unwrap();
            let declared: Vec<&str> = declared.split(' ').collect();
            let [_, kind, name] = declared[..] else {
                panic!("{line}")
            };
            let n = numbers(value);
            match kind {
                "jointtarget" => {
                    let known = module
                        .joints
                        .insert(name.into(), n[..6].try_into().unwrap());
                    assert!(known.is_none() && n.len() == 12);
                }
                "robtarget" | "tooldata" | "wobjdata" => {
                    assert!(
                        module.poses.insert(name.into(), pose(&n)).is_none(),
                        "{name} twice"
                    );
                }
                "speeddata" | "num" => {}
                _ => panic!("{line}"),
            }
        }
    }
    module
}

/// Flange poses that the module puts the arm in, in the order of its strokes, and the tool there.
fn play(module: &Module) -> Vec<(Pose, Pose)> {
    let mut places = Vec::new();
    let main = &module.procedures["main"];
    for call in main.iter().filter(|code| code.starts_with("Stroke")) {
        for code in &module.procedures[call] {
            let (instruction, rest) = code.split_once(' ').unwrap();
            let arguments: Vec<&str> = rest.split(',').collect();
            match instruction {
                "MoveAbsJ" => {
                    assert_eq!(arguments.len(), 4, "{code}");
                    assert!(module.joints.contains_key(arguments[0]), "{code}");
                }
                "FCPress1LStart" | "FCPressL" => {
                    assert_eq!(arguments.len(), 5, "{code}");
                    let (tool, object) = arguments[4].split_once("\\WObj:=").unwrap();
                    let (tool, object) = (module.poses[tool], module.poses[object]);
                    let target = module.poses[arguments[0]];
                    places.push((object * target * tool.inverse(), tool));
                }
                "FCPressEnd" => assert_eq!(arguments.len(), 4, "{code}"),
                "WaitTime" | "TurnTable" => {}
                _ => panic!("{code}"),
            }
        }
    }
    places
}

fn assert_alike(a: &Pose, b: &Pose) {
    let way = (a.translation.vector - b.translation.vector).norm();
    let angle = (a.rotation.matrix() - b.rotation.matrix()).norm();
    assert!(way < 1e-5 && angle < 1e-3, "{way} m, {angle} rad");
}

/// A program over the dome.
fn with_program(robot: &str, change: impl FnOnce(&mut CellConfig), test: impl FnOnce(&Program)) {
    let cell = cell(robot, change);
    let plan = cell.plan(&path(), |_| {}).unwrap();
    test(&cell.program(&plan, "dome, first try"));
}

#[test]
fn rapid_puts_the_roller_on_the_points() {
    // Too far away to press the other side without turning the table.
    let far = |cell: &mut CellConfig| cell.base.as_mut().unwrap().at_mm[0] = -850.0;
    with_program("crb15000-5", far, |program| {
        let module = read(&program.rapid().unwrap());
        let places = play(&module);
        let turns = module
            .procedures
            .values()
            .flatten()
            .filter(|code| code.starts_with("TurnTable"));
        assert!(program.stations.len() > 1 && turns.count() >= program.stations.len());
        let contacts = program
            .strokes
            .iter()
            .flat_map(|stroke| stroke.contacts.iter().map(move |contact| (stroke, contact)));
        let mut count = 0;
        for ((stroke, contact), (flange, tool)) in contacts.zip(&places) {
            assert_alike(&program.arm.flange_at(&contact.joints), flange);
            assert_alike(
                &(program.stations[stroke.station].tool * contact.frame),
                &(flange * tool),
            );
            count += 1;
        }
        assert_eq!((count, places.len()), (31, 31));
        // Joints are those of the plan, in degrees.
        for (k, stroke) in program.strokes.iter().enumerate() {
            let above = module.joints[&format!("s{}_above", k + 1)];
            let far = (0..6).map(|j| (above[j] - stroke.approach[j].to_degrees()).abs());
            assert!(far.fold(0.0, f64::max) < 1e-4);
        }
    });
}

#[test]
fn urscript_puts_the_roller_on_the_points() {
    with_program(
        "ur5e",
        |_| {},
        |program| {
            let text = program.urscript().unwrap();
            let lines = text
                .lines()
                .filter(|line| line.trim().starts_with("movel(p["));
            let contacts = program
                .strokes
                .iter()
                .flat_map(|stroke| stroke.contacts.iter().map(move |contact| (stroke, contact)));
            let mut count = 0;
            for ((stroke, contact), line) in contacts.zip(lines) {
                let n = numbers(line.split("p[").nth(1).unwrap());
                let turned = Rotation3::new(Vector3::new(n[3], n[4], n[5]));
                let at = Pose::from_parts(Translation3::new(n[0], n[1], n[2]), turned);
                let tcp = program.roller.contact(stroke.tilt);
                assert_alike(
                    &(at * tcp.inverse()),
                    &program.arm.flange_at(&contact.joints),
                );
                count += 1;
            }
            assert_eq!(count, 31);
            // At each point the force acts in its frame.
            let frame = |word| {
                move |line: &str| {
                    line.trim()
                        .strip_prefix(word)?
                        .split(']')
                        .next()
                        .map(str::to_owned)
                }
            };
            let [at, pressed]: [Vec<String>; 2] = ["movel(p", "force_mode(p"]
                .map(|word| text.lines().filter_map(frame(word)).collect());
            assert_eq!(at, pressed);
            let opened = text
                .lines()
                .filter(|line| line.trim().starts_with("def "))
                .count();
            assert_eq!(
                opened,
                text.lines().filter(|line| line.trim() == "end").count()
            );
        },
    );
}

/// Times rise, no joint is faster than it can, and all formats tell the same time.
#[test]
fn trajectories_keep_to_the_joints_speeds() {
    with_program(
        "ur5e",
        |_| {},
        |program| {
            let moments = program.moments();
            assert_eq!(
                moments
                    .iter()
                    .filter(|moment| moment.motion == Motion::Contact)
                    .count(),
                31 + 1
            );
            for pair in moments.windows(2) {
                let dt = pair[1].at - pair[0].at;
                assert!(dt > 0.0);
                for (j, joint) in program.arm.joints.iter().enumerate() {
                    let way = (pair[1].joints[j] - pair[0].joints[j]).abs();
                    assert!(way <= joint.speed * dt * (1.0 + 1e-9));
                }
            }
            let text = program.trajectory().unwrap();
            assert_eq!(text.matches("positions").count(), moments.len());
            let last = text.lines().last().unwrap();
            let time = numbers(&last.replace(['{', '}', ':'], " "));
            assert!((time[0] + 1e-9 * time[1] - program.seconds()).abs() < 1e-6);
            let json: serde_json::Value =
                serde_json::from_str(&program.points_json().unwrap()).unwrap();
            assert_eq!(json["points"].as_array().unwrap().len(), 31);
            assert_eq!(json["seconds"], program.seconds());
            let csv = program.points_csv().unwrap();
            assert!(
                csv.lines()
                    .skip(1)
                    .all(|line| line.split(',').count() == 20)
            );
        },
    );
}

#[test]
fn programs_that_cannot_be_are_errors() {
    with_program(
        "ur5e",
        |_| {},
        |program| {
            let mut empty = program.clone();
            empty.strokes.clear();
            let mut lost = program.clone();
            lost.strokes[0].approach[2] = f64::NAN;
            for write in [
                Program::rapid,
                Program::urscript,
                Program::trajectory,
                Program::points_csv,
            ] {
                let error = write(&empty).unwrap_err().to_string();
                assert!(error.contains("no stroke"), "{error}");
                let error = write(&lost).unwrap_err().to_string();
                assert!(error.contains("not finite"), "{error}");
            }
        },
    );
}

/// An independent checker, for those who have it: `pip install rapidchecker`.
#[test]
#[ignore = "needs rapidchecker"]
fn rapidchecker_passes_modules() {
    with_program(
        "crb15000-5",
        |_| {},
        |program| {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("drape.mod");
            std::fs::write(&file, program.rapid().unwrap()).unwrap();
            let run = Command::new("python3")
                .args(["-m", "rapidchecker"])
                .arg(&file)
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&run.stdout).into_owned()
                + &String::from_utf8_lossy(&run.stderr);
            assert!(run.status.success(), "{said}");
        },
    );
}
