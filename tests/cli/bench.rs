use super::*;

/// The shape of what is printed; how fast this machine is, no test can know.
#[test]
fn bench_prints_rows_of_one_shape() {
    let folder = folder();
    let args = ["bench", "--quick", "--json", "--repeats", "1"];
    let report = json(folder.path(), &args);
    assert_eq!(names(folder.path()), [""; 0]);
    let rows = |table: &str| report[table].as_array().unwrap().clone();
    for row in rows("core") {
        assert!(["yarn", "gauss_seidel"].contains(&row["solver"].as_str().unwrap()));
        assert!(["f32", "f64"].contains(&row["precision"].as_str().unwrap()));
        assert!(row["lanes"].as_u64().unwrap() > 0 && row["isa"].is_string());
        assert!(row["median_us"].as_f64().unwrap() > 0.0);
        assert!(row["min_us"].as_f64().unwrap() > 0.0);
    }
    // Each solver alone in f64 and f32 and in at least one kind of group.
    for solver in ["yarn", "gauss_seidel"] {
        let own = rows("core");
        assert!(own.iter().filter(|row| row["solver"] == solver).count() >= 3);
    }
    let features = rows("features");
    assert_eq!(features[0]["physics"], "default");
    assert_eq!(features[0]["difference_us"], 0.0);
    for feature in features {
        assert!(feature["median_us"].as_f64().unwrap() > 0.0);
        assert!(feature["difference_us"].is_f64());
    }
    let throughput = rows("throughput");
    let cases = [(1, 1), (8, 1), (1, 2), (8, 2)];
    for (row, (scenes, threads)) in throughput.iter().zip(cases) {
        assert!(row["scenes"] == scenes && row["threads"] == threads);
        assert!(row["environment_steps_per_s"].as_f64().unwrap() > 0.0);
        let is_first = [("over_one_scene", scenes), ("over_one_thread", threads)];
        for (over, _) in is_first.iter().filter(|(_, count)| *count == 1) {
            assert_eq!(row[*over], 1.0);
        }
    }
    assert_eq!(throughput.len(), cases.len());
    let mut learners = Vec::new();
    for row in rows("learner") {
        assert_eq!(
            (&row["network"], &row["batch"]),
            (&"benchmark".into(), &40.into())
        );
        assert!(row["seconds"].as_f64().unwrap() > 0.0);
        let by = row["implementation"].as_str().unwrap().to_owned();
        learners.push((row["side"].clone(), row["threads"].clone(), by));
    }
    let expected = [65, 33].map(|side| {
        [1, 2]
            .map(|threads| ["ours", "flex"].map(|by| (side.into(), threads.into(), by.to_owned())))
    });
    assert_eq!(learners, expected.as_flattened().as_flattened());
}
