//! The page in a real browser, driven by its debugging protocol.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket, client};

use super::viewer::{Viewer, drape};

const PATIENCE: Duration = Duration::from_secs(300);
/// Of the page without the panel beside it [px].
const SIZE: [f64; 2] = [880.0, 700.0];

/// A browser with one page, ended with this.
pub struct Browser {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: Option<String>,
    count: u64,
    /// What the page has complained of.
    complaints: Vec<String>,
    _profile: TempDir,
}

impl Browser {
    pub fn open(address: &str, flags: &[&str]) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new("chromium")
            .args([
                "--headless",
                "--no-sandbox",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
            ])
            .args([
                "--disable-dev-shm-usage",
                "--force-color-profile=srgb",
                "--remote-debugging-port=0",
            ])
            .args([
                "--window-size=1200,700",
                "--hide-scrollbars",
                "--no-first-run",
            ])
            .args(flags)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("chromium runs");
        let said = BufReader::new(child.stderr.take().unwrap()).lines();
        let mut addresses = said
            .map_while(Result::ok)
            .filter_map(|line| Some(line.split_once("listening on ")?.1.to_owned()));
        let debugger = addresses.next().expect("chromium tells its address");
        // It would stop where nobody reads.
        std::thread::spawn(move || addresses.for_each(drop));
        let host = debugger
            .trim_start_matches("ws://")
            .split('/')
            .next()
            .unwrap();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let config = tungstenite::protocol::WebSocketConfig::default();
        let config = config.max_message_size(None).max_frame_size(None);
        let opened = client::client_with_config(&debugger, stream, Some(config));
        let mut browser = Self {
            child,
            socket: opened.unwrap().0,
            session: None,
            count: 0,
            complaints: Vec::new(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attached = browser.call(
            "Target.attachToTarget",
            &json!({ "targetId": target["targetId"], "flatten": true }),
        );
        browser.session = Some(attached["sessionId"].as_str().unwrap().into());
        for domain in ["Runtime.enable", "Page.enable", "Log.enable"] {
            browser.call(domain, &json!({}));
        }
        let metrics =
            json!({ "width": 1200, "height": 700, "deviceScaleFactor": 1, "mobile": false });
        browser.call("Emulation.setDeviceMetricsOverride", &metrics);
        browser.call("Page.navigate", &json!({ "url": address }));
        browser
    }

    pub fn call(&mut self, method: &str, params: &Value) -> Value {
        self.count += 1;
        let mut call = json!({ "id": self.count, "method": method, "params": params });
        if let Some(session) = &self.session {
            call["sessionId"] = session.as_str().into();
        }
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else {
                continue;
            };
            let mut said: Value = serde_json::from_str(&text).unwrap();
            if said["id"] == self.count {
                // It may just be loading another.
                let is_gone = said["error"]["message"].to_string().contains("navigated");
                assert!(is_gone || said.get("error").is_none(), "{method}: {said}");
                return said["result"].take();
            }
            if said["method"] == "Runtime.exceptionThrown"
                || said["params"]["entry"]["level"] == "error"
            {
                self.complaints.push(said["params"].to_string());
            }
        }
    }

    pub fn eval(&mut self, script: &str) -> Value {
        let params = json!({ "expression": script, "returnByValue": true, "awaitPromise": true });
        let mut found = self.call("Runtime.evaluate", &params);
        assert!(found.get("exceptionDetails").is_none(), "{script}: {found}");
        found["result"]["value"].take()
    }

    /// Waits until a script says so.
    pub fn until(&mut self, script: &str) {
        let start = Instant::now();
        while self.eval(&format!("Boolean({script})")) != json!(true) {
            let words = || "document.body.innerText.slice(0, 400)";
            assert!(
                start.elapsed() < PATIENCE,
                "{script}: {}",
                self.eval(words())
            );
            sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the blank lies and what is told has been drawn.
    fn ready(&mut self) {
        self.until("typeof moment !== 'undefined' && moment && stage && moment.phase === 'ready' && !isDirty");
    }

    /// Waits until a script gives the same again, with what it gives now.
    fn bits(&mut self) -> String {
        self.eval("moment.bits").as_str().unwrap().into()
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2]) {
        let held = u8::from(kind == "mousePressed" || kind == "mouseDragged");
        let kind = if kind == "mouseDragged" {
            "mouseMoved"
        } else {
            kind
        };
        let params = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": held, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", &params);
    }

    fn key(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.call(
                "Input.dispatchKeyEvent",
                &json!({ "type": kind, "key": key, "text": key }),
            );
        }
    }

    /// Where a vertex is seen [px].
    fn place(&mut self, vertex: u32) -> [f64; 2] {
        let place = self.eval(&format!(
            "project(eye.onto(...size()), ...place({vertex})).slice(0, 2)"
        ));
        [0, 1].map(|k| place[k].as_f64().unwrap())
    }

    /// What is drawn, without the panel: rows of colours.
    fn picture(&mut self) -> Vec<Vec<[u8; 3]>> {
        self.until("!isDirty");
        let clip = json!({ "x": 0, "y": 0, "width": SIZE[0], "height": SIZE[1], "scale": 1 });
        let shot = self.call(
            "Page.captureScreenshot",
            &json!({ "format": "png", "clip": clip }),
        );
        let bytes = data_encoding::BASE64
            .decode(shot["data"].as_str().unwrap().as_bytes())
            .unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let wide = info.color_type.samples();
        let colors = pixels[..info.buffer_size()]
            .chunks(wide)
            .map(|p| [p[0], p[1], p[2]]);
        let colors: Vec<_> = colors.collect();
        colors
            .chunks(info.width as usize)
            .map(<[_]>::to_vec)
            .collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        if !std::thread::panicking() {
            assert_eq!(self.complaints, [""; 0]);
        }
    }
}

pub fn page(viewer: &Viewer, flags: &[&str]) -> Browser {
    let mut browser = Browser::open(&viewer.page_address(), flags);
    browser.ready();
    browser
}

/// How many pixels are like this.
fn count(picture: &[Vec<[u8; 3]>], is_one: impl Fn([u8; 3]) -> bool) -> usize {
    picture
        .iter()
        .flatten()
        .filter(|&&color| is_one(color))
        .count()
}

/// Yellow of far cloth, violet of near cloth, and the grey of the tool.
fn is_far([r, g, b]: [u8; 3]) -> bool {
    r > 120 && g > 110 && b < 90
}
fn is_near([r, g, b]: [u8; 3]) -> bool {
    b > r.saturating_add(10) && g < 60 && b > 30
}
fn is_tool([r, g, b]: [u8; 3]) -> bool {
    r > 35 && r < 200 && r.abs_diff(g) < 4 && g.abs_diff(b) < 6
}

#[test]
#[ignore = "needs chromium"]
fn cloth_falls_is_clicked_and_comes_back() {
    let viewer = Viewer::new();
    let mut browser = page(&viewer, &[]);
    assert!(
        browser.eval("drawing !== null && !document.querySelector('#picture').checkVisibility()")
            == true
    );
    browser.eval("document.querySelector('#allowed').click(), view('top')");
    let lies = browser.picture();
    // The dome's top is touched, corners stand off it, and there is tool round the blank.
    let counts = [
        count(&lies, is_far),
        count(&lies, is_near),
        count(&lies, is_tool),
    ];
    assert!(
        counts[0] > 5_000 && counts[1] > 5_000 && counts[2] > 50_000,
        "{counts:?}"
    );
    assert!(is_near(lies[350][440]), "{:?}", lies[350][440]);
    // Scrubbed back to where it hung, it is far off everywhere.
    let scrub =
        |to: &str| format!("$('time').value = {to}, $('time').oninput(), $('time').onchange()");
    browser.eval(&scrub("0"));
    browser.until("moment.at === 0 && !isDirty");
    let hangs = browser.picture();
    let far = count(&hangs, is_far);
    assert!(
        far > counts[0] + 5_000 && count(&hangs, is_near) < counts[1] / 2,
        "{far} {counts:?}"
    );
    browser.eval(&scrub("moment.fall"));
    browser.until("moment.at === moment.fall && !isDirty");

    let start = browser.bits();
    let at = browser.place(4 * 17 + 4);
    browser.mouse("mouseMoved", at);
    browser.until(
        "hovered && hovered.vertex === 72 && $('under').textContent.startsWith('vertex 72 at')",
    );
    browser.mouse("mousePressed", at);
    browser.mouse("mouseReleased", at);
    browser.until("moment.numbers.presses === 1 && !isDirty");
    assert_ne!(browser.bits(), start);
    let pressed = browser.picture();
    let near = count(&pressed, is_near);
    assert!(near > counts[1] + 2_000, "{near} {counts:?}");
    browser.key("z");
    browser.until("moment.numbers.presses === 0 && !isDirty");
    assert_eq!(browser.bits(), start);
    browser.mouse("mouseMoved", [5.0, 5.0]);
    browser.until("!hovered");
    assert!(
        browser.picture() == lies,
        "undone, it does not look as before"
    );

    // A drag is a stroke.
    let along: Vec<[f64; 2]> = (2..8).map(|row| browser.place(17 * row + 5)).collect();
    browser.mouse("mousePressed", along[0]);
    along
        .iter()
        .for_each(|&at| browser.mouse("mouseDragged", at));
    browser.mouse("mouseReleased", along[5]);
    browser.until("moment.numbers.presses >= 3 && !moment.waiting");
    browser.key("r");
    browser.until("moment.numbers.presses === 0");
    assert_eq!(browser.bits(), start);
}

#[test]
#[ignore = "needs chromium"]
fn every_view_and_colouring_shows_cloth() {
    let viewer = Viewer::new();
    let mut browser = page(&viewer, &[]);
    let mut seen = Vec::new();
    for (key, name) in [("1", "free"), ("2", "top"), ("3", "side")] {
        browser.key(key);
        sleep(Duration::from_millis(50));
        let picture = browser.picture();
        let cloth = count(&picture, is_far) + count(&picture, is_near);
        assert!(cloth > 5_000, "{name}: {cloth}");
        seen.push(picture);
    }
    assert!(seen[0] != seen[1] && seen[1] != seen[2]);
    browser.key("2");
    for shade in ["surplus", "shear", "angle", "warp", "weft", "progress"] {
        let heard = browser.eval("told.heard");
        browser.eval(&format!(
            "$('shade').value = '{shade}', $('fit').checked = true, $('shade').onchange()"
        ));
        browser.until(&format!("told.heard > {heard} && !isDirty"));
        let picture = browser.picture();
        assert!(picture != seen[1], "{shade}");
    }
    // Draped blue where it was pressed.
    let blue = |[r, _, b]: [u8; 3]| b > 90 && b > r.saturating_add(50);
    assert!(count(&browser.picture(), blue) < 50);
    browser.eval("link.send('press', { vertices: [90, 91, 92, 107, 108, 109, 124, 125, 126] })");
    browser.until("moment.numbers.presses === 9 && !moment.waiting && !isDirty");
    assert!(count(&browser.picture(), blue) > 1_000);
    browser.eval("$('light').click(), $('light').checked || $('light').click()");
    let white = |color: [u8; 3]| color == [255; 3];
    assert!(count(&browser.picture(), white) > 20_000);
    browser.eval("$('light').click()");
    assert!(count(&browser.picture(), white) < 2_000);
    let shot = browser.eval("canvas.toDataURL('image/png').length");
    assert!(shot.as_u64().unwrap() > 10_000, "{shot}");
}

#[test]
#[ignore = "needs chromium"]
fn without_webgl_the_server_draws() {
    let viewer = Viewer::new();
    let mut browser = page(&viewer, &["--disable-3d-apis"]);
    browser.until("$('words').textContent.includes('the server draws the pictures') && $('picture').naturalWidth > 300");
    browser.eval("view('top')");
    sleep(Duration::from_millis(300));
    let start = browser.bits();
    let at = browser.place(4 * 17 + 4);
    browser.mouse("mousePressed", at);
    browser.mouse("mouseReleased", at);
    browser.until("moment.numbers.presses === 1 && !isDirty");
    assert_ne!(browser.bits(), start);
    // As reports colour it: violet to blue on the tool.
    let blue = |[_, g, b]: [u8; 3]| b > 40 && b > g.saturating_add(25);
    browser.until("$('picture').complete");
    let picture = browser.picture();
    assert!(
        count(&picture, blue) > 5_000 && blue(picture[350][440]),
        "{:?}",
        picture[350][440]
    );

    let mut browser = page(&viewer, &[]);
    browser.eval("window.loss = drawing.gl.getExtension('WEBGL_lose_context'), loss.loseContext()");
    browser.until("!drawing && $('words').textContent.includes('dropped this page') && $('picture').naturalWidth > 300");
    browser.eval("loss.restoreContext()");
    browser.until("drawing && !isDirty && $('picture').hidden");
    let picture = browser.picture();
    assert!(
        count(&picture, is_far) > 2_000,
        "{}",
        count(&picture, is_far)
    );
}

#[test]
#[ignore = "needs chromium"]
fn regions_are_dragged_and_policies_asked() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("task.toml"), super::TASK).unwrap();
    let trained = drape()
        .args([
            "train",
            "task.toml",
            "--name",
            "a",
            "--polish",
            "0",
            "--json",
        ])
        .current_dir(folder.path())
        .output();
    assert!(trained.unwrap().status.success());
    let viewer = Viewer::of(folder, &["runs/a"]);
    let mut browser = page(&viewer, &[]);
    browser.eval("view('top'), $('shade').value = 'policy', $('shade').onchange()");
    // Per cent, which sum to 100: the colouring before has a range, too.
    browser.until("Math.abs(moment.value.reduce((a, b) => a + b) - 100) < 1 && !isDirty");
    let most = browser.eval("moment.value.indexOf(Math.max(...moment.value))");
    assert!(browser.eval(&format!("Boolean(moment.marks[{most}] & MARK.allowed)")) == true);
    browser.key("f");
    browser.until("moment.numbers.presses > 2 && !moment.following && moment.over");
    browser
        .until("$('trainings').checkVisibility() && $('runs').textContent.startsWith('a: best')");

    browser.eval("document.querySelector('[value=region]').click()");
    let [[x0, y0], [x1, y1]] = [browser.place(0), browser.place(10 * 17 + 12)];
    browser.mouse("mousePressed", [x0 - 4.0, y0 + 4.0]);
    browser.mouse("mouseDragged", [x1, y1]);
    browser.mouse("mouseReleased", [x1 + 2.0, y1 - 2.0]);
    browser.until("stage.region_mm && stage.region_mm[2] > 0 && !moment.has_policy");
    assert!(browser.eval("Boolean(moment.marks[0] & moment.marks[182] & MARK.region)") == true);
    browser.eval("$('task').click()");
    browser.until("$('words').textContent.includes('task-1.toml')");
    let trained = drape()
        .args(["train", "task-1.toml", "--name", "b", "--polish", "0"])
        .current_dir(viewer.folder.path())
        .output();
    assert!(trained.unwrap().status.success());
}

fn export(folder: &Path) {
    let exported = drape()
        .args(["view", "presses-1.drape", "--export", "page.html"])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(
        exported.status.success(),
        "{}",
        String::from_utf8_lossy(&exported.stderr)
    );
}

#[test]
#[ignore = "needs chromium"]
fn a_file_replays_without_a_server() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    page.ready();
    let end = page.press(&[70, 71, 72, 73]);
    page.say(&json!({ "do": "save_presses" }));
    page.words("presses-1.drape");
    let folder = viewer.folder.path().to_path_buf();
    export(&folder);
    let mut browser = Browser::open(
        &format!("file://{}", folder.join("page.html").display()),
        &[],
    );
    browser.ready();
    assert_eq!(
        browser.eval("[moment.at - moment.fall, moment.numbers.presses]"),
        json!([0, 0])
    );
    assert!(browser.eval("document.querySelector('#save').checkVisibility()") == false);
    browser.eval("$('speed').value = 3, $('speed').oninput(), $('play').click()");
    browser.until("moment.numbers.presses === 4");
    assert_eq!(browser.bits(), end);
    browser.key("z");
    browser.until("moment.numbers.presses === 3 && !isDirty");
    browser.eval("$('time').value = 2, $('time').oninput(), $('time').onchange()");
    browser.until("moment.numbers.presses === 2 && !isDirty");
    assert!(count(&browser.picture(), is_far) > 2_000);
}

#[test]
#[ignore = "needs chromium"]
fn pages_that_are_loaded_again_and_again_do_no_harm() {
    let viewer = Viewer::new();
    let mut browser = page(&viewer, &[]);
    let start = browser.bits();
    for _ in 0..20 {
        browser.eval("window.isOld = true");
        browser.call("Page.reload", &json!({}));
        browser.until("!window.isOld");
        browser.ready();
    }
    assert_eq!(browser.bits(), start);
    browser.eval("link.socket.close()");
    browser.until("link.socket.readyState === 1 && !$('words').textContent");
    // Another site finds no way in.
    let script = format!(
        "new Promise((done) => {{ const socket = new WebSocket('ws://{}/socket'); socket.onerror = () => done('refused'); socket.onopen = () => done('open'); }})",
        viewer.host
    );
    browser.call(
        "Page.navigate",
        &json!({ "url": "data:text/html,elsewhere" }),
    );
    sleep(Duration::from_millis(200));
    assert_eq!(browser.eval(&script), "refused");
    browser.complaints.clear();
}

#[test]
#[ignore = "needs chromium"]
fn a_robot_is_driven_and_dragged() {
    let viewer = Viewer::new();
    let mut browser = page(&viewer, &[]);
    browser.eval("$('allowed').click(), $('shade').value = 'progress', $('shade').onchange()");
    browser.eval("link.send('press', { vertices: [141, 142] })");
    browser.until("moment.numbers.presses === 2 && !moment.waiting");
    let is_arm = |[r, g, b]: [u8; 3]| r > b.saturating_add(40) && r > g && g > b.saturating_add(20);
    assert!(count(&browser.picture(), is_arm) < 2_000);
    browser.eval("document.querySelector('#robot details').open = true, askRobot(null, true)");
    browser.until("robot && !moment.plans && !isDirty");
    let stands = browser.picture();
    assert!(count(&stands, is_arm) > 10_000);
    // Driven from the start, the cloth is pressed as the arm comes to it.
    browser.eval("$('driven').value = 0, $('driven').oninput()");
    browser.until("moment.numbers.presses === 0 && !isDirty");
    assert!(browser.picture() != stands);
    browser.eval("$('driven').value = $('driven').max, $('driven').oninput()");
    browser.until("moment.numbers.presses === 2");
    // By itself, in the clock's time, which is slowed down, lest a slow browser skip a press.
    browser.eval("var clock = performance.now.bind(performance), ahead = 0; performance.now = () => ahead + clock() / 100");
    browser.eval("$('drive').click()");
    browser.until("moment.numbers.presses === 0");
    browser.eval("ahead += 1e3 * robot.at[robot.pressed.indexOf(1)]");
    browser.until("moment.numbers.presses === 1");
    browser.eval("ahead += 1e3 * robot.program_s");
    browser.until("moment.numbers.presses === 2 && driving === null");
    // Dragged far off, it reaches nothing, and says so.
    browser.eval("view('top'), [...document.getElementsByName('mode')].find((is) => is.value === 'robot').click()");
    let drag = |browser: &mut Browser, from: f64, to: f64| {
        browser.mouse("mousePressed", [from, 350.0]);
        browser.mouse("mouseDragged", [to, 350.0]);
        browser.mouse("mouseReleased", [to, 350.0]);
    };
    let before = browser.eval("robot.place.at_mm");
    drag(&mut browser, 860.0, 10.0);
    browser.until("!moment.plans && robot.program_s !== null && robot.faults.every(Boolean)");
    let after = browser.eval("robot.place.at_mm");
    let [from, to] = [before, after].map(|at| [0, 1, 2].map(|k| at[k].as_f64().unwrap()));
    assert!(to[0] < from[0] - 500.0, "{from:?} {to:?}");
    assert!(
        (to[1] - from[1]).abs() < 1.0 && to[2] == from[2],
        "{from:?} {to:?}"
    );
    assert_eq!(browser.eval("$('faults').children.length"), 2);
}
