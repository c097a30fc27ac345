use std::io::Write;
use std::net::TcpStream;
use std::time::Duration;

use serde_json::json;
use tungstenite::Message;

use super::viewer::{Page, Viewer};

/// What a flood may leave behind [bytes].
const MOST: u64 = 48 << 20;

/// 100 connections at once, 10 000 messages of noise, pages that never read, and one that is loaded 200 times: who is in
/// goes on, and memory stays.
#[cfg(target_os = "linux")]
#[test]
fn floods_do_no_harm() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    page.press(&[40, 41, 42]);
    let before = viewer.memory();

    let idle: Vec<TcpStream> = (0..100)
        .map(|_| TcpStream::connect(&viewer.host).unwrap())
        .collect();
    assert_ne!(page.press(&[90]), start);
    drop(idle);

    // Asks again and again and never reads; what it would be told is not kept for it.
    let mut slow: Vec<Page> = (0..4).map(|_| viewer.page()).collect();
    for k in 0..10_000 {
        let noise = match k % 4 {
            0 => "nonsense".to_owned(),
            1 => json!({ "do": "nothing" }).to_string(),
            2 => json!({ "token": k }).to_string(),
            _ => "{".repeat(1000),
        };
        let origin = format!("http://{}", viewer.host);
        if k % 40 == 0 {
            // Each is closed for its first message.
            let mut socket = viewer.socket(&origin).unwrap();
            for _ in 0..40 {
                if socket.send(Message::text(noise.clone())).is_err() {
                    break;
                }
            }
        }
        let page = &mut slow[k % 4];
        let asked = json!({ "next": 0, "stage": 0, "shade": "shear" });
        page.socket
            .get_ref()
            .set_write_timeout(Some(Duration::from_millis(1)))
            .unwrap();
        let _ = page.socket.send(Message::text(asked.to_string()));
    }
    for _ in 0..200 {
        let answer = viewer.answer(&format!("GET / HTTP/1.1\nHost: {}", viewer.host));
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer:.60}");
        let mut half = TcpStream::connect(&viewer.host).unwrap();
        half.write_all(b"GET / HT").unwrap();
    }
    drop(slow);
    let mut other = viewer.page();
    other.ready();
    let pressed = page.press(&[91]);
    other.until(|moment| moment["bits"] == pressed);
    let grown = viewer.memory().saturating_sub(before);
    println!("memory grew by {} KiB", grown >> 10);
    assert!(grown < MOST, "{grown} bytes more");
}
