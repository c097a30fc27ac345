//! Files of runs and drapes that are damaged, hostile or unlucky are refused in a line, or used whole;
//! scenes, meshes and materials are in `crates/cloth/tests/readers`.

#[path = "../crates/cloth/tests/readers/damage.rs"]
mod damage;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::SystemTime;

use damage::{dialects, folder, survives};
use drape::run::{
    Checkpoint, Rules, RunConfig, RunFolder, RunInfo, Training, curve, digest, read_metrics, replay,
};
use drape_cloth::fabric::Drape;
use drape_cloth::mesh::read_mesh;
use drape_cloth::scene::Scene;
use drape_cloth::tool::Pose;
use drape_proof::Listener;
use drape_proof::presses::again;
use drape_proof::{Criteria, Surveyed, compare};
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, Tasks};
use drape_task::path::{Frame, PressedPoint, Rolling, read_json, strokes, write_json};
use drape_task::recording::Recording;

/// Memory is counted for the whole process: one at a time.
fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(|error| error.into_inner())
}

/// An error and its causes, as the command line puts them.
fn line(error: impl Into<anyhow::Error>) -> String {
    format!("{:#}", error.into())
}

const TINY: &str = "steps = 8\nenvironments = 2\nenv.region_mm = [-10, -10, 186, 186]\n\
    [ppo]\nrollout_steps = 2\nminibatch_size = 4\nepochs = 1\n\
    [policy.network.compact]\nchannels = 4\nblocks = 1\nvalue_hidden = 4\n\
    [scene]\nfall = { fall_s = 0.2, settle_s = 0.1, substep_rate = 600 }\n\
    [scene.blank]\nvertices = [5, 5]\n\
    [scene.tool]\nsource.shape.kind = \"rib\"\ngrid.spacing_mm = 40\n";

#[test]
fn run_configurations() {
    let _alone = alone();
    let shipped = ["paper.toml", "quickstart.toml", "tasks/double-dome.toml"];
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut corpus: Vec<Vec<u8>> = shipped
        .iter()
        .map(|name| fs::read(configs.join(name)).unwrap())
        .collect();
    // Findings: a table as a list of its values, samples that no memory holds, and a number of the
    // grid's that was looked at only when the tool was made.
    let values = "preset = \"paper\"\nppo.imitation = [4, 128, 0.3]\n";
    let samples = "ppo.imitation.samples = 9223372036854775807\n";
    let margin = format!("{TINY}grid.margin_mm = nan\n");
    corpus.extend([TINY, values, samples, &margin].map(Into::into));
    corpus.extend(dialects(TINY));
    survives("run.toml", &corpus, 3000, |path| {
        let config = RunConfig::read(path).map_err(line)?;
        config.policy.validate(17, 17).map_err(line)?;
        let blank = &config.scene.blank;
        if blank.vertices.iter().all(|&n| n <= 65) && blank.is_plain() {
            config.check_before_fall().map_err(line)?;
            // What is left is no NaN.
            let (text, again) = (config.to_toml(), path.with_extension("again.toml"));
            fs::write(&again, &text).unwrap();
            assert!(
                RunConfig::read(&again).is_ok_and(|again| again == config),
                "{text}"
            );
        }
        Ok(())
    });
}

/// A run of [`TINY`], named `name`, that has taken a step.
fn begun(name: &str) -> (RunConfig, Arc<Scene>, RunFolder) {
    let root = folder();
    let _ = fs::remove_dir_all(root.join(name));
    let file = root.join("tiny.toml");
    fs::write(&file, TINY).unwrap();
    let config = RunConfig::read(&file).unwrap();
    let info = RunInfo::new(1, SystemTime::now());
    let run = RunFolder::create(&root, Some(name), &config.to_toml(), &[], &info).unwrap();
    let scene = Arc::new(Scene::new(&config.scene, |_| ()).unwrap());
    let mut training = Training::new(
        config.clone(),
        vec![(scene.clone(), None)],
        run.clone(),
        &Cluster::default(),
        None,
    )
    .unwrap();
    training.prepare(|_, _| true).unwrap();
    training.advance().unwrap();
    training.checkpoint().unwrap();
    (config, scene, run)
}

#[test]
fn checkpoints() {
    let _alone = alone();
    let (config, scene, run) = begun("of-checkpoints");
    let whole = fs::read(&run.last_checkpoint).unwrap();
    let foreign = b"\x89drape\r\n\x05\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff".to_vec();
    survives("whole.drape", &[whole.clone(), foreign], 1000, |path| {
        Checkpoint::of_run(path, &run).map(drop).map_err(line)
    });
    // And behind a checksum that fits.
    let metrics = fs::read(&run.metrics).unwrap();
    let content = whole[20..whole.len() - 4].to_vec();
    // A finding: a number that does not end.
    let endless = vec![0xff; 20];
    survives("content.drape", &[content, endless], 150, |path| {
        let content = fs::read(path).unwrap();
        let length = (content.len() as u64).to_le_bytes();
        let mut bytes = [&whole[..12], &length, &content].concat();
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        fs::write(&run.last_checkpoint, bytes).unwrap();
        fs::write(&run.metrics, &metrics).unwrap();
        let resumed = Training::resume(
            config.clone(),
            vec![(scene.clone(), None)],
            run.clone(),
            &Cluster::default(),
        );
        resumed
            .and_then(|mut training| training.advance())
            .map(drop)
            .map_err(line)
    });
}

#[test]
fn recordings() {
    let _alone = alone();
    let (config, scene, run) = begun("of-recordings");
    let mut draping = Draping::new(scene.clone(), &config.env, 1).unwrap();
    let first = draping.observation(0).allowed().next().unwrap();
    let vertices = [draping.vertex(first).unwrap()];
    let played = replay(&mut draping, &vertices, Rules::Robot, |_| ()).unwrap();
    let file = run.path.join("whole.drape");
    played.recording.write(&file).unwrap();
    let whole = fs::read(&file).unwrap();
    survives(
        "recording.drape",
        std::slice::from_ref(&whole),
        1000,
        |path| Recording::read(path).map(drop).map_err(line),
    );
    // And behind a checksum that fits: what is read can be pressed again, or not at all.
    let content = whole[20..whole.len() - 4].to_vec();
    survives("content.drape", &[content], 400, |path| {
        let content = fs::read(path).unwrap();
        let length = (content.len() as u64).to_le_bytes();
        let mut bytes = [&whole[..12], &length, &content].concat();
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        fs::write(&file, bytes).unwrap();
        let read = Recording::read(&file).map_err(line)?;
        let length = read.presses.len() + read.frames.len();
        let pressed = again(&read, &scene, Listener::QUIET).map_err(line)?;
        assert_eq!(pressed.presses.len() + pressed.frames.len(), length);
        Ok(())
    });
}

#[test]
fn metrics() {
    let _alone = alone();
    let (config, scene, run) = begun("of-metrics");
    let whole = fs::read(&run.metrics).unwrap();
    let extreme = "{\"step\":4,\"wall_time\":1e300,\"score\":-1e39}\n".repeat(2);
    survives("metrics.jsonl", &[whole, extreme.into()], 300, |path| {
        let lines = read_metrics(path).map_err(line)?;
        assert!(curve(&lines, "score").len() <= lines.len());
        fs::copy(path, &run.metrics).unwrap();
        let resumed = Training::resume(
            config.clone(),
            vec![(scene.clone(), None)],
            run.clone(),
            &Cluster::default(),
        );
        resumed.map(drop).map_err(line)
    });
}

#[test]
fn sequences_and_proofs() {
    let _alone = alone();
    let (config, _, run) = begun("of-sequences");
    let digest = digest(config.to_toml());
    // Finding: a grid of its own that lets any vertex through.
    let sequence = format!(
        "{{\"vertices\":[3,4,5],\"score\":0.5,\"grid\":{{\"rows\":900,\"columns\":900}},\
         \"config_digest\":\"{digest}\",\"others\":[{{\"vertices\":[5000],\"score\":1e300}}]}}\n"
    );
    let proof = format!("{{\"physics\":\"accurate\",\"path\":{sequence},\"proof\":[]}}\n");
    let check = |vertices: &[u32], count: usize| {
        assert!(!vertices.is_empty() && vertices.iter().all(|&v| (v as usize) < count));
    };
    survives("best_sequence.json", &[sequence.into()], 2000, |path| {
        fs::copy(path, &run.best_sequence).unwrap();
        let best = run.read_best_sequence().map_err(line)?;
        check(&best.vertices, best.grid.pixel_count());
        best.check_config(&run.config_digest().map_err(line)?)
    });
    survives("proof.json", &[proof.into()], 1000, |path| {
        fs::copy(path, &run.proof).unwrap();
        let proved = run.read_proof().map_err(line)?.expect("a file is there");
        check(&proved.path.vertices, proved.path.grid.pixel_count());
        Ok(())
    });
}

/// Compares with itself what lies at `path`.
fn compared(surveyed: Surveyed) {
    let found = compare(&surveyed, &surveyed, &Criteria::default());
    serde_json::to_string(&found).unwrap();
}

#[test]
fn states_and_scans() {
    let _alone = alone();
    let state = "{\"format\":\"drape state 1, metres\",\"warp\":[1,0],\
        \"rest\":[[0,0],[0.1,0],[0,0.1],[0.1,0.1]],\
        \"position\":[[0,0,0.1],[0.1,0,0.1],[0,0.1,0.1],[0.1,0.1,0.2]],\
        \"triangles\":[[0,1,3],[0,3,2]]}\n";
    let long = state.replace("[0.1,0]", "[0.1,0,7]");
    let mut corpus: Vec<Vec<u8>> = vec![state.into(), long.into()];
    corpus.extend(dialects(state));
    survives("state.json", &corpus, 1500, |path| {
        let drape = Drape::read(path).map_err(line)?;
        compared(Surveyed::draped(drape).map_err(line)?);
        Ok(())
    });
    let sheet = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\nvertex 0 10 0\n\
        endloop\nendfacet\nendsolid\n";
    // A square with a hole, its inner corners first.
    let head = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
        property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n";
    let ring = "10 10 0\n20 10 0\n20 20 0\n10 20 0\n0 0 0\n30 0 0\n30 30 0\n0 30 0\n\
        4 4 5 1 0\n4 5 6 2 1\n4 6 7 3 2\n4 7 4 0 3\n";
    let corpus: [Vec<u8>; 2] = [sheet.into(), format!("{head}{ring}").into()];
    survives("scan.stl", &corpus, 1000, |path| {
        let mesh = read_mesh(path, 1e-3).map_err(line)?.mesh;
        compared(Surveyed::scan(mesh).map_err(line)?);
        Ok(())
    });
}

#[test]
fn draping_paths() {
    let _alone = alone();
    let point = |vertex, x| PressedPoint {
        vertex,
        position: [x, 0.0, 0.25].into(),
        normal: [0.0, 0.0, 1.0].into(),
    };
    let file: PathBuf = folder().join("points.json");
    let points = strokes(
        &[point(5, 0.0), point(6, 0.5), point(9, 8.0)],
        Rolling::joining(1.0),
    )
    .unwrap();
    write_json(&file, &points, &Frame::tool(&Pose::default())).unwrap();
    survives("path.json", &[fs::read(&file).unwrap()], 1500, |path| {
        read_json(path).map(drop).map_err(line)
    });
}
