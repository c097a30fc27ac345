//! What docs/VIEW.md tells of speed and memory:
//! `cargo test --release --test view figures -- --ignored --nocapture`, with `DRAPE_VIEW_MINUTES=60` for an hour of clicks.

use std::fs;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::browser::{Browser, page};
use super::viewer::Viewer;

/// The quickstart's scene with so many vertices a side.
fn task(side: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let quickstart = include_str!("../../configs/quickstart.toml");
    let text = quickstart.replace(
        "vertices = [33, 33]",
        &format!("vertices = [{side}, {side}]"),
    );
    fs::write(folder.path().join("quickstart.toml"), text).unwrap();
    folder
}

/// Bytes that the page's scripts hold.
fn heap(browser: &mut Browser) -> f64 {
    browser.call("HeapProfiler.collectGarbage", &json!({}));
    browser.call("Runtime.getHeapUsage", &json!({}))["usedSize"]
        .as_f64()
        .unwrap()
}

/// Presses a vertex and waits until that is drawn [ms].
const CLICK: &str = "new Promise((done) => {
    const start = performance.now(), count = moment.numbers.presses;
    const look = () => {
        if (moment.numbers.presses === count || isDirty) return requestAnimationFrame(look);
        drawing.gl.finish(); done(performance.now() - start);
    };
    link.send('press', { vertices: [VERTEX] }); look();
})";

/// Draws for ten seconds as fast as moments come, and gives the frames.
const FRAMES: &str = "new Promise((done) => {
    link.send('speed', { rate: 60 }); link.send('seek', { to: 0 }); link.send('play', { on: true });
    const start = told.frames, again = setInterval(() => { if (!moment.playing) link.send('play', { on: true }); }, 50);
    setTimeout(() => { clearInterval(again); link.send('play', { on: false }); done((told.frames - start) / 10); }, 10000);
})";

/// Moments a second that a page gets which draws nothing.
fn alone(viewer: &Viewer) -> f64 {
    let mut page = viewer.page();
    page.ready();
    for order in [
        json!({ "do": "speed", "rate": 1000.0 }),
        json!({ "do": "seek", "to": 0 }),
        json!({ "do": "play", "on": true }),
    ] {
        page.say(&order);
    }
    page.until(|moment| moment["playing"] == true);
    let (start, mut count) = (Instant::now(), 0);
    while page.next()["playing"] == true {
        count += 1;
    }
    f64::from(count) / start.elapsed().as_secs_f64()
}

#[test]
#[ignore = "measures, needs chromium"]
fn figures() {
    println!(
        "| Blank | Frames a second | Without a browser | Click to picture: median, longest of 20 [ms] | Bytes a frame | Memory: server, scripts [MiB] |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for side in [33, 65, 129] {
        let viewer = Viewer::of(task(side), &["quickstart.toml"]);
        let alone = alone(&viewer);
        let mut browser = page(&viewer, &[]);
        let frames = browser.eval(FRAMES).as_f64().unwrap();
        browser.eval("link.send('reset')");
        browser.until("moment.numbers.presses === 0 && moment.at === moment.fall && !isDirty");
        let mut times: Vec<f64> = (0..20)
            .map(|k| {
                // In the region, a diagonal off its edge.
                let v = (side / 2 - 2 - k % 10 * side / 33) * side + side / 4 + k / 10;
                browser
                    .eval(&CLICK.replace("VERTEX", &v.to_string()))
                    .as_f64()
                    .unwrap()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let bytes = browser.eval("told.bytes");
        println!(
            "| {side} x {side} | {frames:.1} | {alone:.0} | {:.0}, {:.0} | {bytes} | {:.0}, {:.1} |",
            times[10],
            times[19],
            viewer.memory() as f64 / f64::from(1 << 20),
            heap(&mut browser) / f64::from(1 << 20)
        );
    }
}

/// Presses, undoes, goes back and forth and turns, over and over. `DRAPE_VIEW_MINUTES` says how long, 2 if not given.
#[test]
#[ignore = "measures, needs chromium"]
fn memory_stays() {
    let minutes =
        std::env::var("DRAPE_VIEW_MINUTES").map_or(2, |text| text.parse::<u64>().unwrap());
    let viewer = Viewer::of(task(33), &["quickstart.toml"]);
    let mut browser = page(&viewer, &[]);
    let (start, mut told) = (Instant::now(), 0);
    let mut seen: Vec<(f64, f64)> = Vec::new();
    while start.elapsed() < Duration::from_secs(60 * minutes) {
        for k in 0..10 {
            browser.eval(&CLICK.replace("VERTEX", &(33 * (4 + k) + 10).to_string()));
            browser.eval("turn(7, 0)");
        }
        browser.eval("link.send('undo'), link.send('seek', { to: moment.fall >> 1 })");
        browser.until("moment.at < moment.fall && !isDirty");
        browser.eval("link.send('reset')");
        browser.until("moment.at === moment.fall && !isDirty");
        if start.elapsed().as_secs() / 30 >= told {
            told += 1;
            let mib = f64::from(1 << 20);
            seen.push((viewer.memory() as f64 / mib, heap(&mut browser) / mib));
            let (server, scripts) = seen[seen.len() - 1];
            let heard: Value = browser.eval("told.heard");
            println!(
                "{:5} s, {heard} frames: server {server:.1} MiB, scripts {scripts:.1} MiB",
                start.elapsed().as_secs()
            );
        }
    }
    // From when all had been used once.
    let (first, last) = (seen[seen.len().min(4) - 1], seen[seen.len() - 1]);
    assert!(
        last.0 < first.0 + 16.0 && last.1 < first.1 + 8.0,
        "{seen:?}"
    );
}

/// Ten ways to drape the corner of the paper's scene, as scripted clicks: strokes across a direction, from the inner corner
/// outwards. They are saved to `DRAPE_VIEW_OUT`, if it is given, for `drape train --demonstrate`.
#[test]
#[ignore = "measures"]
fn the_papers_corner_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let out =
        std::env::var("DRAPE_VIEW_OUT").unwrap_or_else(|_| folder.path().display().to_string());
    let corner = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/tasks/rib-corner.toml");
    let viewer = Viewer::of(folder, &[corner, "--out", &out]);
    let mut page = viewer.page();
    page.until(|moment| moment["phase"] == "ready");
    // 33 x 33 vertices, a stencil of three by three, and a region of 11 x 11 in the corner.
    let (side, step) = (33, 2);
    for way in 0..10 {
        let turn = f64::to_radians(9.0 * f64::from(way) + 4.5);
        let lines = |at: [i32; 2]| {
            let [x, y] = at.map(|k| f64::from(10 - k));
            let [along, across] = [
                turn.cos() * x + turn.sin() * y,
                turn.cos() * y - turn.sin() * x,
            ];
            ((along / f64::from(step)).round() as i32, across)
        };
        let places = (0..11).step_by(step as usize);
        let mut order: Vec<[i32; 2]> = places
            .clone()
            .flat_map(|x| places.clone().map(move |y| [x, y]))
            .collect();
        order.sort_by(|&a, &b| {
            lines(a)
                .0
                .cmp(&lines(b).0)
                .then(lines(a).1.total_cmp(&lines(b).1))
        });
        let vertices: Vec<u32> = order.iter().map(|[x, y]| (side * y + x) as u32).collect();
        page.order(&json!({ "do": "reset" }));
        page.order(&json!({ "do": "speed", "rate": 1000.0 }));
        page.press(&vertices);
        let numbers = page.moment["numbers"].clone();
        page.say(&json!({ "do": "save_presses" }));
        page.words(&format!("presses-{}.drape", way + 1));
        println!(
            "{:4.1} degrees: {} presses, score {:.4}, surplus {:.3} mm, {} undraped",
            turn.to_degrees(),
            vertices.len(),
            numbers["score"].as_f64().unwrap(),
            numbers["surplus_mm"].as_f64().unwrap(),
            numbers["undraped"]
        );
    }
}

/// One picture of each view, in different colours and lights, into the folder `DRAPE_VIEW_OUT`.
#[test]
#[ignore = "draws docs/images, needs chromium"]
fn pictures() {
    let Ok(out) = std::env::var("DRAPE_VIEW_OUT") else {
        return println!("DRAPE_VIEW_OUT is not set: no pictures are written");
    };
    let viewer = Viewer::of(task(33), &["quickstart.toml"]);
    let mut browser = page(&viewer, &[]);
    let stroke: Vec<usize> = (4..15)
        .step_by(2)
        .flat_map(|row| {
            (4..15)
                .rev()
                .step_by(2)
                .map(move |column| 33 * row + column)
        })
        .collect();
    browser.eval(&format!("link.send('press', {{ vertices: {stroke:?} }})"));
    browser.until(&format!(
        "moment.numbers.presses === {} && !moment.waiting && !isDirty",
        stroke.len()
    ));
    browser.until("moment.rivals.length");
    for (view, shade, light) in [
        ("free", "distance", false),
        ("top", "shear", true),
        ("side", "progress", false),
    ] {
        browser.eval(&format!(
            "$('light').checked === {light} || $('light').click()"
        ));
        browser.eval(&format!(
            "view('{view}'), $('shade').value = '{shade}', $('shade').onchange()"
        ));
        std::thread::sleep(Duration::from_secs(1));
        browser.until("!isDirty");
        let clip = json!({ "x": 0, "y": 0, "width": 1200, "height": 700, "scale": 0.5 });
        let shot = browser.call(
            "Page.captureScreenshot",
            &json!({ "format": "png", "clip": clip }),
        );
        let bytes = data_encoding::BASE64
            .decode(shot["data"].as_str().unwrap().as_bytes())
            .unwrap();
        fs::write(format!("{out}/view-{view}.png"), bytes).unwrap();
    }
}
