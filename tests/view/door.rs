use std::process::Output;

use serde_json::json;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Error, Message, WebSocket};

use super::viewer::{Viewer, drape};

/// How the other side closes a socket.
fn closed(mut socket: WebSocket<std::net::TcpStream>) -> (CloseCode, String) {
    loop {
        match socket.read() {
            Ok(Message::Close(Some(frame))) => return (frame.code, frame.reason.to_string()),
            Ok(Message::Close(None)) | Err(_) => panic!("closed without a word"),
            Ok(_) => {}
        }
    }
}

#[test]
fn only_pages_of_this_machine_are_served_and_only_the_page() {
    let viewer = Viewer::new();
    let host = &viewer.host;
    let page = viewer.answer(&format!("GET / HTTP/1.1\nHost: {host}"));
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page:.200}");
    assert!(page.contains("<title>drape view</title>") && page.ends_with("</html>\n"));
    assert!(page.contains("default-src 'none'"));
    // The token is nowhere to be had.
    assert!(!page.contains(&viewer.token));
    // As through `ssh -L 9000:...`, and behind a proxy with a path.
    for head in [
        "/ HTTP/1.1\nHost: localhost:9000",
        "/a/b/ HTTP/1.1\nHost: 127.0.0.1",
    ] {
        assert!(
            viewer
                .answer(&format!("GET {head}"))
                .starts_with("HTTP/1.1 200"),
            "{head}"
        );
    }
    for (head, status) in [
        ("GET / HTTP/1.1\nHost: evil.example", 403),
        (
            "GET / HTTP/1.1\nHost: localhost\nOrigin: http://evil.example",
            403,
        ),
        ("GET / HTTP/1.1", 403),
        ("GET /task.toml HTTP/1.1\nHost: localhost", 404),
        (
            "GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\nHost: localhost",
            404,
        ),
        ("POST / HTTP/1.1\nHost: localhost", 405),
        ("GET /socket HTTP/1.1\nHost: localhost", 426),
        ("\u{1}", 400),
    ] {
        let answer = viewer.answer(head);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status} ")),
            "{head}: {answer:.60}"
        );
    }
}

#[test]
fn sockets_need_an_origin_of_ours_and_the_token() {
    let viewer = Viewer::new();
    let own = format!("http://{}", viewer.host);
    for origin in [
        "http://evil.example",
        "null",
        "http://localhost.evil.example",
    ] {
        let refused = viewer.socket(origin).map(|_| ()).unwrap_err();
        assert!(refused.contains("403"), "{origin}: {refused}");
    }
    for first in [
        json!({ "token": "" }),
        json!({ "token": "0".repeat(32) }),
        json!({ "token": &viewer.token[1..] }),
        json!({ "do": "reset" }),
        json!({ "next": 0, "stage": 0, "shade": "distance" }),
        json!("nonsense"),
    ] {
        let mut socket = viewer.socket(&own).unwrap();
        // What it has said since is not read, and the reason reaches it all the same.
        for _ in 0..50 {
            let _ = socket.send(Message::text(first.to_string()));
        }
        assert_eq!(
            closed(socket),
            (CloseCode::Policy, "the token is another".into()),
            "{first}"
        );
    }
    let mut page = viewer.page();
    page.ready();
    // Who is in is put out again for what is no command.
    page.say(&json!({ "do": "press", "vertices": [1], "file": "/etc/passwd" }));
    assert_eq!(
        closed(page.socket),
        (CloseCode::Policy, "not a command".into())
    );
    let mut page = viewer.page();
    let long = json!({ "do": "press", "vertices": vec![1u32; 100_000] });
    // It may be closed before all is sent.
    let _ = page.socket.send(Message::text(long.to_string()));
    let lost = loop {
        match page.socket.read() {
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert!(
        !matches!(lost, Error::Io(ref error) if error.kind() == std::io::ErrorKind::WouldBlock),
        "{lost}"
    );
    viewer.page().ready();
}

#[test]
fn names_of_hosts_may_be_added() {
    let viewer = Viewer::of(
        tempfile::tempdir().unwrap(),
        &["task.toml", "--allow-host", "lab.example"],
    );
    let from = |host: &str| viewer.answer(&format!("GET / HTTP/1.1\nHost: {host}"));
    assert!(from("lab.example:443").starts_with("HTTP/1.1 200"));
    assert!(from("lab.example.org").starts_with("HTTP/1.1 403"));
    assert!(viewer.socket("https://lab.example").is_ok());
}

fn failed(args: &[&str], code: i32, words: &[&str]) {
    let output: Output = drape()
        .args(["view", "--no-open"])
        .args(args)
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
    assert!(
        stderr.starts_with("error: ") && stderr.lines().count() == 1,
        "{stderr}"
    );
    words
        .iter()
        .for_each(|word| assert!(stderr.contains(word), "no `{word}` in {stderr}"));
}

#[test]
fn what_cannot_be_shown_is_told_in_one_line() {
    failed(&["missing.toml"], 2, &["missing.toml"]);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    failed(&[&path("")], 2, &["is not a run folder"]);
    std::fs::write(path("a.toml"), "[tool]\nsorce = 1").unwrap();
    failed(&[&path("a.toml")], 2, &["a.toml", "sorce"]);
    failed(&["--out", &path("none")], 2, &["--out", "no such folder"]);
    let viewer = Viewer::new();
    let port = viewer.host.split(':').next_back().unwrap();
    failed(
        &["--port", port],
        1,
        &[&format!("cannot listen on port {port}")],
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_while_pages_look_on() {
    use std::os::unix::process::ExitStatusExt;
    let mut viewer = Viewer::new();
    let mut page = viewer.page();
    page.ready();
    let killed = std::process::Command::new("kill")
        .args(["-INT", &viewer.child.id().to_string()])
        .status();
    assert!(killed.unwrap().success());
    let status = viewer.child.wait().unwrap();
    assert!(
        status.signal() == Some(2) || status.code() == Some(130),
        "{status}"
    );
    assert!(page.socket.read().is_err());
}
