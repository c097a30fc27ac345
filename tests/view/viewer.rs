//! A served session, and a page of it without a browser.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket, client};

use super::TASK;

/// Longest that anything may take.
const PATIENCE: Duration = Duration::from_secs(300);

pub fn drape() -> Command {
    Command::new(env!("CARGO_BIN_EXE_drape"))
}

/// `drape view`, ended with this.
pub struct Viewer {
    pub child: Child,
    /// As in `127.0.0.1:8000`.
    pub host: String,
    pub token: String,
    pub folder: TempDir,
}

impl Viewer {
    /// On the coarse task.
    pub fn new() -> Self {
        Self::of(tempfile::tempdir().unwrap(), &["task.toml"])
    }

    /// With these arguments, in a folder that has the coarse task.
    pub fn of(folder: TempDir, args: &[&str]) -> Self {
        fs::write(folder.path().join("task.toml"), TASK).unwrap();
        let mut child = drape()
            .args(["view", "--no-open", "--json"])
            .args(args)
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let stdout = child.stdout.take().unwrap();
        BufReader::new(stdout).read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).expect(&line);
        let address = said["address"].as_str().unwrap();
        Self {
            host: address
                .trim_start_matches("http://")
                .trim_end_matches('/')
                .into(),
            token: said["token"].as_str().unwrap().into(),
            child,
            folder,
        }
    }

    /// What the browser is given.
    pub fn page_address(&self) -> String {
        format!("http://{}/#{}", self.host, self.token)
    }

    /// What is answered to a request whose head has these lines, up to the end of the connection.
    pub fn answer(&self, head: &str) -> String {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let head = format!("{}\r\n\r\n", head.replace('\n', "\r\n"));
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        answer
    }

    /// A socket whose page comes from `origin`, or why there is none.
    pub fn socket(&self, origin: &str) -> Result<WebSocket<TcpStream>, String> {
        let mut request = format!("ws://{}/socket", self.host)
            .into_client_request()
            .unwrap();
        request
            .headers_mut()
            .insert("Origin", origin.parse().unwrap());
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let opened = client(request, stream);
        opened
            .map(|(socket, _)| socket)
            .map_err(|error| error.to_string())
    }

    /// A page that has given the token.
    pub fn page(&self) -> Page {
        let socket = self.socket(&format!("http://{}", self.host)).unwrap();
        let mut page = Page {
            socket,
            stage: json!(null),
            robot: json!(null),
            moment: json!({ "number": 0 }),
            bytes: 0,
        };
        page.say(&json!({ "token": self.token }));
        page
    }

    /// Memory that it has now [bytes].
    #[cfg(target_os = "linux")]
    pub fn memory(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status
            .lines()
            .find(|line| line.starts_with("VmRSS"))
            .unwrap();
        let kib = line.split_whitespace().nth(1).unwrap();
        1024 * kib.parse::<u64>().unwrap()
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page without a browser.
pub struct Page {
    pub socket: WebSocket<TcpStream>,
    /// Headers of what it has been told last, and the size of the last message.
    pub stage: Value,
    pub robot: Value,
    pub moment: Value,
    pub bytes: usize,
}

impl Page {
    pub fn say(&mut self, what: &Value) {
        self.socket.send(Message::text(what.to_string())).unwrap();
    }

    /// Asks for what has come since, and waits for it.
    pub fn next(&mut self) -> &Value {
        let (next, stage) = (&self.moment["number"], self.stage["stage"].as_u64());
        let robot = self.robot["robot"].as_u64().unwrap_or(0);
        let asked = json!({ "next": next, "stage": stage.unwrap_or(0), "robot": robot, "shade": "distance" });
        self.say(&asked);
        loop {
            let bytes = match self.socket.read() {
                Ok(Message::Binary(bytes)) => bytes,
                Ok(_) => continue,
                Err(error) => panic!("{error}: {}", self.moment),
            };
            let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
            let said: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
            self.bytes = bytes.len();
            match said["kind"].as_str() {
                Some("stage") => self.stage = said,
                Some("robot") => self.robot = said,
                _ => break self.moment = said,
            }
        }
        &self.moment
    }

    /// Waits for a moment like this.
    pub fn until(&mut self, is_it: impl Fn(&Value) -> bool) -> &Value {
        let start = Instant::now();
        while !is_it(&self.moment) {
            self.next();
            assert!(start.elapsed() < PATIENCE, "{}", self.moment);
        }
        &self.moment
    }

    /// Waits until the blank lies.
    pub fn ready(&mut self) -> String {
        self.until(|moment| moment["phase"] == "ready");
        self.bits()
    }

    pub fn bits(&self) -> String {
        self.moment["bits"].as_str().unwrap().into()
    }

    /// Presses in the moment that is shown, and waits until it is done.
    pub fn press(&mut self, vertices: &[u32]) -> String {
        let at = self.moment["at"].as_u64().unwrap() + vertices.len() as u64;
        self.say(&json!({ "do": "press", "vertices": vertices }));
        self.until(|moment| moment["at"] == at);
        self.bits()
    }

    /// Obeyed at once: the next moment shows it.
    pub fn order(&mut self, what: &Value) -> String {
        self.say(what);
        self.next();
        self.bits()
    }

    /// Waits for words to the user.
    pub fn words(&mut self, part: &str) -> String {
        let last = |moment: &Value| {
            moment["notices"].as_array()?.last()?[1]
                .as_str()
                .map(String::from)
        };
        let said = self.until(|moment| last(moment).is_some_and(|words| words.contains(part)));
        last(said).unwrap()
    }
}
