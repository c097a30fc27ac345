use super::*;
use drape_cloth::fabric::BlankConfig;
use drape_cloth::scene::{Fall, SceneConfig};
use drape_cloth::tool::{Shape, Source};
use drape_proof::orders::sequences;
use drape_task::env::{EnvConfig, Scatter, Spread};
use drape_task::search::Order;
use serde_json::Value;

/// Four random orders on a coarse blank over a wide rib, in worlds whose friction and stencil differ.
fn kept() -> KeptPaths {
    let mut scene = SceneConfig::rib();
    scene.blank = BlankConfig {
        vertices: [13, 13],
        ..scene.blank
    };
    scene.tool.grid.spacing_mm = Some(12.0);
    if let Source::Shape(Shape::Rib(rib)) = &mut scene.tool.source {
        (rib.half_width_mm, rib.plate_mm) = (120.0, [480.0; 2]);
    }
    scene.fall = Fall {
        fall_s: 0.2,
        settle_s: 0.1,
        substep_rate: 1200.0,
        ..scene.fall
    };
    let env = EnvConfig {
        region_mm: Some([-186.0, -186.0, -30.0, -30.0]),
        crop: true,
        stencil_mm: 80.0,
        ..EnvConfig::default()
    };
    let spreads = [
        (Quantity::Friction, Spread::Deviation(0.2)),
        (Quantity::PressOffsetMm, Spread::Deviation(4.0)),
    ];
    let set_up = Arc::new(Scene::new(&scene, |_| ()).unwrap());
    KeptPaths {
        lists: sequences(&set_up, &env, Order::Random, 4, 1).unwrap(),
        scatter: Scatter {
            risk: 0.5,
            substep_rates: vec![1200.0],
            training: false,
            spreads: spreads.into_iter().collect(),
        },
        scene,
        env,
    }
}

fn judged(change: &dyn Fn(&Path, &mut KeptPaths)) -> Result<Report, StudyError> {
    run(
        Judging {
            runs: vec!["a".into(), "b".into()],
            paths: 8,
            twin_worlds: 2,
            finest: false,
            alone: true,
        },
        change,
    )
}

fn run(study: Judging, change: &dyn Fn(&Path, &mut KeptPaths)) -> Result<Report, StudyError> {
    let read = |path: &Path| {
        let mut kept = kept();
        change(path, &mut kept);
        Ok(kept)
    };
    study.run(&Context {
        read_kept: &read,
        ..Context::quiet()
    })
}

/// Every judge has a correlation, the paths are those of both runs with what the twin makes of them, and each quantity is
/// told of in both physics.
#[test]
fn judges_are_held_against_the_twin() {
    let report = judged(&|_, _| ()).unwrap();
    let [judges, paths, alone] = [0, 1, 2].map(|k| report.tables[k].json());
    let rows = |table: &Value| table.as_array().unwrap().clone();
    assert_eq!(rows(&judges).len(), RATES.len() * COUNTS.len());
    for row in rows(&judges) {
        let found = row["mean"].as_f64().unwrap();
        assert!((-1.0..=1.0).contains(&found), "{row}");
    }
    let paths = rows(&paths);
    assert_eq!(paths.len(), 8);
    // Equal paths in equal worlds, whichever run has kept them.
    for k in 0..4 {
        assert_eq!(paths[k]["mean_percent"], paths[k + 4]["mean_percent"]);
    }
    assert_ne!(paths[0]["mean_percent"], paths[1]["mean_percent"]);
    let alone = rows(&alone);
    assert_eq!(alone.len(), 2);
    for row in alone {
        for physics in ["solver_mean_percent", "twin_mean_percent"] {
            assert!(row[physics].as_f64().unwrap() > 50.0, "{row}");
        }
    }
}

/// Steps rank paths the more as the finest do the finer they are.
#[test]
fn coarse_steps_are_held_against_fine_ones() {
    let study = Judging {
        runs: vec!["a".into()],
        paths: 4,
        twin_worlds: 1,
        finest: true,
        alone: false,
    };
    let report = run(study, &|_, _| ()).unwrap();
    let judges = report.tables[0].json();
    let correlation = |row: &Value| row["mean"].as_f64().unwrap();
    let all = judges.as_array().unwrap();
    assert_eq!(all.len(), RATES.len() * COUNTS.len());
    let (coarsest, finest) = (&all[COUNTS.len() - 1], &all[all.len() - 1]);
    assert!(correlation(finest) >= correlation(coarsest), "{judges}");
    assert!(correlation(finest) > 0.5, "{judges}");
}

/// Runs on other tasks, and one whose worlds do not differ, are refused by name.
#[test]
fn what_cannot_be_compared_is_refused() {
    let fault = |change: &dyn Fn(&Path, &mut KeptPaths)| match judged(change) {
        Err(StudyError::Invalid(message)) => message,
        _ => panic!("it was accepted"),
    };
    let other = |path: &Path, kept: &mut KeptPaths| {
        if path == Path::new("b") {
            kept.env.stencil_mm = 60.0;
        }
    };
    assert!(fault(&other).starts_with("b has another task or scatter"));
    let none = |_: &Path, kept: &mut KeptPaths| kept.scatter.spreads.clear();
    assert!(fault(&none).starts_with("`[scatter]` of a lets nothing vary"));
}
