use serde_json::{Value, json};

use super::viewer::Viewer;

/// A vertex of the coarse blank by its row and column.
const fn vertex(row: u32, column: u32) -> u32 {
    17 * row + column
}

#[test]
fn presses_change_the_sheet_and_undo_brings_back_the_bits() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    let stroke: Vec<u32> = (2..8).map(|column| vertex(5, column)).collect();
    let mut all = vec![start.clone()];
    for &v in &stroke {
        all.push(page.press(&[v]));
        assert_ne!(all[all.len() - 1], all[all.len() - 2]);
    }
    let score = page.moment["numbers"]["score"].as_f64().unwrap();
    assert!(score.abs() > 1e-3);
    assert_eq!(page.moment["numbers"]["presses"], 6);
    let pressed = page.moment["strokes"].as_array().unwrap();
    let pressed = pressed
        .iter()
        .flat_map(|stroke| stroke.as_array().unwrap().clone());
    assert_eq!(Value::from_iter(pressed), json!(stroke));
    for bits in all.iter().rev().skip(1) {
        assert_eq!(page.order(&json!({ "do": "undo" })), *bits);
    }
    assert_eq!(page.order(&json!({ "do": "undo" })), start);
    for bits in &all[1..] {
        assert_eq!(page.order(&json!({ "do": "redo" })), *bits);
    }
    // The same presses at once, and from a start that was gone back to, are the same bits.
    assert_eq!(page.order(&json!({ "do": "reset" })), start);
    assert_eq!(page.press(&stroke), all[6]);
    assert_eq!(page.moment["numbers"]["score"], score);
    // From the middle on other ways are gone, and what came after is forgotten.
    let at = page.moment["at"].as_u64().unwrap();
    assert_eq!(page.order(&json!({ "do": "seek", "to": at - 3 })), all[3]);
    let other = page.press(&[vertex(3, 3)]);
    assert!(!all.contains(&other));
    assert_eq!(page.moment["count"], at - 1);
    page.say(&json!({ "do": "press", "vertices": [289] }));
    page.words("beyond the blank");
    // What is not offered changes nothing.
    page.say(&json!({ "do": "task", "change": { "tool": "nonsense" } }));
    page.words("there is no tool nonsense");
    assert_eq!(page.bits(), other);
    // Where all lies on the tool there is no score, and no rival has one.
    let flat = json!({ "tool": "plate", "region_mm": null });
    page.say(&json!({ "do": "task", "change": flat }));
    page.until(|moment| moment["phase"] == "falling");
    page.ready();
    assert!(page.moment["numbers"]["score"].is_null());
    assert_eq!(page.moment["oddities"], json!([]));
    assert_eq!(page.moment["rivals"], json!([]));
}

#[test]
fn two_pages_see_the_same_and_one_may_leave() {
    let viewer = Viewer::new();
    let (mut one, mut other) = (viewer.page(), viewer.page());
    let start = one.ready();
    assert_eq!(other.ready(), start);
    let pressed = one.press(&[vertex(4, 4)]);
    other.until(|moment| moment["bits"] == pressed);
    drop(one);
    assert_eq!(other.order(&json!({ "do": "undo" })), start);
    assert_eq!(viewer.page().ready(), start);
}

#[test]
fn presses_wait_while_paused_and_go_on_one_by_one() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    page.ready();
    let at = page.moment["at"].as_u64().unwrap();
    page.order(&json!({ "do": "pause", "on": true }));
    page.order(&json!({ "do": "press", "vertices": [vertex(2, 2), vertex(3, 3), vertex(4, 4)] }));
    assert_eq!(
        (&page.moment["at"], &page.moment["waiting"]),
        (&json!(at), &json!(3))
    );
    page.order(&json!({ "do": "step" }));
    assert_eq!(
        (&page.moment["at"], &page.moment["waiting"]),
        (&json!(at + 1), &json!(2))
    );
    page.order(&json!({ "do": "pause", "on": false }));
    page.until(|moment| moment["at"] == at + 3);
}

#[test]
fn the_fall_can_be_watched_again() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    let fall = page.moment["fall"].as_u64().unwrap();
    // 1.3 s in frames of 1/60 s, and where it hung.
    assert_eq!(fall, 79);
    let bits =
        |page: &mut super::viewer::Page, to: u64| page.order(&json!({ "do": "seek", "to": to }));
    let hung = bits(&mut page, 0);
    let height = |moment: &Value| moment["boxes"][0]["low"][2].as_f64().unwrap();
    let before = height(&page.moment);
    assert_ne!(bits(&mut page, 12), hung);
    assert!(height(&page.moment) < before - 1e-3);
    page.order(&json!({ "do": "speed", "rate": 500.0 }));
    page.say(&json!({ "do": "play", "on": true }));
    page.until(|moment| moment["at"] == fall && moment["playing"] == false);
    assert_eq!(page.bits(), start);
}

#[test]
fn cloth_can_be_pulled_and_comes_back_bit_for_bit() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    let at = page.moment["at"].clone();
    let top = |page: &super::viewer::Page| {
        page.moment["boxes"][0]["low"][2].as_f64().unwrap()
            + page.moment["boxes"][0]["size"][2].as_f64().unwrap()
    };
    let before = top(&page);
    page.say(&json!({ "do": "pull", "vertex": vertex(16, 16), "to": [0.13, 0.13, 0.2] }));
    page.until(|moment| {
        moment["boxes"][0]["low"][2].as_f64().unwrap()
            + moment["boxes"][0]["size"][2].as_f64().unwrap()
            > 0.15
    });
    assert!(top(&page) > before + 0.05 && page.moment["pulled"] == true);
    page.order(&json!({ "do": "release" }));
    let released = page.bits();
    page.order(&json!({ "do": "save_presses" }));
    page.words("no task pulls at cloth");
    assert_eq!(page.order(&json!({ "do": "undo" })), start);
    assert_eq!(
        (&page.moment["at"], &page.moment["pulled"]),
        (&at, &json!(false))
    );
    assert_eq!(page.order(&json!({ "do": "redo" })), released);
}

#[test]
fn finer_steps_press_the_same_to_another_end() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    let pressed = page.press(&[vertex(4, 4), vertex(5, 5)]);
    let finer = page.order(&json!({ "do": "accuracy", "name": "accurate" }));
    assert_eq!(page.moment["accuracy"], "accurate");
    assert_eq!(page.moment["numbers"]["presses"], 2);
    assert_ne!(finer, pressed);
    assert_eq!(page.order(&json!({ "do": "reset" })), start);
}

#[test]
fn pictures_are_drawn_for_those_who_cannot() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    page.ready();
    let look = json!({ "direction": [0, 0, -1], "up": [0, 1, 0], "low": [-0.15, -0.15, 0.0], "high": [0.15, 0.15, 0.1],
                       "size": [200, 160], "range": [0, 25] });
    page.say(&json!({ "next": 0, "stage": 1, "shade": "distance", "look": look }));
    let bytes = loop {
        if let tungstenite::Message::Binary(bytes) = page.socket.read().unwrap() {
            break bytes;
        }
    };
    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
    let parts = header["parts"].as_array().unwrap();
    let before = &parts[..parts.len() - 1];
    assert_eq!(parts[parts.len() - 1][0], "picture");
    let size = |part: &Value| {
        let width = match part[1].as_str().unwrap() {
            "u8" | "i8" => 1,
            "u16" => 2,
            _ => 4,
        };
        (part[2].as_u64().unwrap() as usize * width).next_multiple_of(4)
    };
    let start = 4 + length + before.iter().map(size).sum::<usize>();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes[start..]))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (200, 160));
    // Cloth lies on the top of the dome, and stands off it elsewhere; the tool is grey.
    let colors = || pixels.as_chunks::<3>().0.iter();
    let middle = pixels[3 * (200 * 80 + 100)..][..3].to_vec();
    let is_yellow = |c: &&[u8; 3]| c[0] > c[2].saturating_add(60);
    let is_grey = |c: &&[u8; 3]| c[0] > 40 && c[0].abs_diff(c[2]) < 4;
    assert!(middle[2] > middle[1].saturating_add(25), "{middle:?}");
    let counts = [
        colors().filter(is_yellow).count(),
        colors().filter(is_grey).count(),
    ];
    assert!(counts[0] > 500 && counts[1] > 2000, "{counts:?}");
}

/// Presses are asked of an arm, which is moved away and back.
#[test]
fn a_robot_presses_what_it_reaches() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    page.press(&[vertex(8, 5), vertex(8, 6)]);
    let bits = page.bits();
    let mut ask = |place: Value, plan: bool| {
        let before = page.robot["robot"].as_u64().unwrap_or(0);
        page.say(&json!({ "do": "robot", "place": place, "plan": plan }));
        while page.robot["robot"].as_u64().unwrap_or(0) == before {
            page.next();
        }
        page.robot.clone()
    };
    let planned = ask(json!(null), true);
    assert_eq!(planned["faults"], json!([null, null]));
    assert!(planned["program_s"].as_f64().unwrap() > 1.0);
    let columns = |robot: &Value| -> Vec<u64> {
        let parts = robot["parts"].as_array().unwrap().iter();
        parts.map(|part| part[2].as_u64().unwrap()).collect()
    };
    let [vertices, parts, corners, at, pressed, poses] = columns(&planned).try_into().unwrap();
    assert_eq!((vertices, parts, pressed, poses), (2, 10, at, 120 * at));
    assert!(corners > 300 && at > 20);
    let mut place = planned["place"].clone();
    place["at_mm"] = json!([-3000, 0, 0]);
    let away = ask(place.clone(), false);
    assert_eq!(away["faults"], json!(["out of reach", "out of reach"]));
    assert_eq!((&away["program_s"], columns(&away)[3]), (&json!(null), 1));
    let back = ask(planned["place"].clone(), true);
    assert_eq!(back["program_s"], planned["program_s"]);
    // The cloth is as it was, and what cannot be is said.
    page.next();
    assert_eq!(page.bits(), bits);
    place["at_mm"] = json!([0, 0, 20]);
    page.say(&json!({ "do": "robot", "place": place, "plan": true }));
    page.words("base");
    // A hand that holds cloth is not made to let go, and what it did is not planned.
    page.say(&json!({ "do": "pull", "vertex": vertex(12, 12), "to": [0.1, 0.1, 0.2] }));
    page.say(&json!({ "do": "robot", "place": null, "plan": true }));
    page.until(|moment| moment["pulled"] == true);
    page.say(&json!({ "do": "release" }));
    page.words("no robot pulls");
    assert_eq!(page.order(&json!({ "do": "reset" })), start);
}
