use super::*;

/// The shape of what is printed; how fast this machine is, no test can know.
#[test]
fn bench_prints_rows_of_one_shape() {
    let folder = folder();
    let report = json(
        folder.path(),
        &["bench", "--quick", "--json", "--repeats", "1"],
    );
    assert_eq!(names(folder.path()), [""; 0]);
    let core = report["core"].as_array().unwrap();
    let keys = |row: &Value| row.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    for row in core {
        assert_eq!(keys(row), keys(&core[0]));
        assert!(["yarn", "gauss_seidel"].contains(&row["solver"].as_str().unwrap()));
        assert!(["f32", "f64"].contains(&row["precision"].as_str().unwrap()));
        assert!(row["lanes"].as_u64().unwrap() > 0 && row["isa"].is_string());
        let timed = [
            "microseconds",
            "microseconds_min",
            "arithmetic_share",
            "bandwidth_share",
        ];
        let played = ["threads", "env_steps_per_second"];
        let is_played = row["threads"].is_u64();
        for (keys, measured) in [(&timed[..], !is_played), (&played, is_played)] {
            for key in keys {
                let value = &row[key];
                assert!(if measured {
                    value.as_f64().unwrap() > 0.0
                } else {
                    value.is_null()
                });
            }
        }
    }
    // Each solver alone in f64 and f32 and in at least one kind of group; then 1 and 2 threads.
    let threads: Vec<_> = core.iter().filter_map(|r| r["threads"].as_u64()).collect();
    assert_eq!(threads, [1, 2]);
    for solver in ["yarn", "gauss_seidel"] {
        let timed = |row: &&Value| row["solver"] == solver && row["threads"].is_null();
        assert!(core.iter().filter(timed).count() >= 3);
    }
    assert!(report["thread_ratio"].as_f64().unwrap() > 0.0);

    let features = report["features"].as_array().unwrap();
    assert_eq!(features[0]["physics"], "default");
    assert_eq!(features[0]["difference"], 0.0);
    for feature in features {
        assert!(feature["microseconds"].as_f64().unwrap() > 0.0);
        assert!(feature["difference"].is_f64());
    }
    assert!(report["unlisted"]["difference"].is_f64());
    assert_eq!(report["sheet"]["vertices"], 4225);
    for limit in report["limits"].as_array().unwrap() {
        assert!(limit["operations_per_second"].as_f64().unwrap() > 1e6);
    }
}
