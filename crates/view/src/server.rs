use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::mpsc::{SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant};

use serde::Deserialize;
use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use super::command::Command;
use super::door::{Asked, asked, read_head};
use super::export::page;
use super::moment::Shared;
use super::picture::{Look, picture};
use super::shade::Shade;

/// Connections at once; more are refused.
const MOST_CONNECTIONS: usize = 64;
/// Longest message from a page [bytes].
const MOST_MESSAGE: usize = 64 * 1024;
/// A page that takes longer than this for a message is gone.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time in which a page has to give the token.
const TOKEN_TIME: Duration = Duration::from_secs(5);
/// How long a page is heard out that is sent away.
const FAREWELL: Duration = Duration::from_secs(1);
/// How long a page is listened to before it is looked for something to tell it.
const TURN: Duration = Duration::from_millis(4);

/// Gives the page and its socket.
pub struct Server {
    listener: TcpListener,
    door: Door,
}

/// What every connection needs.
#[derive(Clone)]
struct Door {
    hosts: Arc<[String]>,
    token: Arc<str>,
    shared: Arc<Shared>,
    commands: SyncSender<Command>,
    count: Arc<AtomicUsize>,
}

/// What a page says.
#[derive(Deserialize)]
#[serde(untagged)]
enum Said {
    Token(Token),
    Next(Next),
    Command(Command),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Token {
    token: String,
}

/// Asks for the next moment.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Next {
    /// Numbers of the moment and the stage that the page has; 0 for none.
    next: u64,
    stage: u64,
    /// That of the robot.
    #[serde(default)]
    robot: u64,
    shade: Shade,
    /// A picture is wanted beside it.
    #[serde(default)]
    look: Option<Look>,
}

impl Server {
    /// Takes a port of this machine, which 0 chooses. `hosts` are further names by which pages may call it.
    pub fn open(
        port: u16,
        hosts: &[String],
        shared: Arc<Shared>,
        commands: SyncSender<Command>,
    ) -> io::Result<Self> {
        let own = ["localhost", "127.0.0.1", "[::1]"].map(String::from);
        let token = rand::random::<[u8; 16]>().map(|byte| format!("{byte:02x}"));
        Ok(Self {
            listener: TcpListener::bind((Ipv4Addr::LOCALHOST, port))?,
            door: Door {
                hosts: own.iter().chain(hosts).cloned().collect(),
                token: token.concat().into(),
                shared,
                commands,
                count: Arc::default(),
            },
        })
    }

    /// Where it listens.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// What a page has to know; a new one each time.
    pub fn token(&self) -> &str {
        &self.door.token
    }

    /// Lets pages in until the program ends, on a thread of its own.
    pub fn start(self) {
        thread::spawn(move || {
            for stream in self.listener.incoming() {
                let Ok(stream) = stream else {
                    // Too many files are open, for a while.
                    thread::sleep(TURN);
                    continue;
                };
                let door = self.door.clone();
                if door.count.fetch_add(1, SeqCst) >= MOST_CONNECTIONS {
                    door.count.fetch_sub(1, SeqCst);
                    let _ = refuse(stream, 503, "Service Unavailable");
                    continue;
                }
                let count = door.count.clone();
                let begun = thread::Builder::new().spawn(move || {
                    // Whatever has become of a connection is its own affair.
                    let _ = door.receive(stream);
                    door.count.fetch_sub(1, SeqCst);
                });
                if begun.is_err() {
                    count.fetch_sub(1, SeqCst);
                }
            }
        });
    }
}

/// What no response goes without.
const HEADERS: &str = "Connection: close\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
     Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
     Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
     connect-src 'self'; img-src blob: data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'\r\n";

fn refuse(stream: TcpStream, status: u16, reason: &str) -> io::Result<()> {
    respond(stream, &format!("{status} {reason}"), "text/plain", reason)
}

fn respond(mut stream: TcpStream, status: &str, kind: &str, body: &str) -> io::Result<()> {
    stream.set_write_timeout(Some(PATIENCE))?;
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\n{HEADERS}\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())?;
    stream.shutdown(Shutdown::Write)
}

impl Door {
    fn receive(&self, mut stream: TcpStream) -> Result<(), Error> {
        let head = read_head(&mut stream)?;
        let key = match asked(&head, &self.hosts) {
            Asked::Page => return Ok(respond(stream, "200 OK", "text/html", page())?),
            Asked::Refused(status, reason) => return Ok(refuse(stream, status, reason)?),
            Asked::Socket(key) => derive_accept_key(key.as_bytes()),
        };
        let switch = format!(
            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Accept: {key}\r\n\r\n"
        );
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.write_all(switch.as_bytes())?;
        stream.set_read_timeout(Some(TURN))?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(MOST_MESSAGE))
            .max_frame_size(Some(MOST_MESSAGE));
        let mut holds = false;
        let socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
        let ended = self.converse(socket, &mut holds);
        if holds {
            // A page that is gone lets go.
            let _ = self.commands.send(Command::Release {});
        }
        ended
    }

    /// Talks with a page until it leaves or says what none should. `holds` tells whether it pulls at the cloth.
    fn converse(&self, mut socket: WebSocket<TcpStream>, holds: &mut bool) -> Result<(), Error> {
        let (start, mut is_known) = (Instant::now(), false);
        let mut next: Option<Next> = None;
        loop {
            let said = match socket.read() {
                Ok(Message::Text(text)) => Some(serde_json::from_str(&text)),
                Ok(Message::Binary(_)) => return close(socket, "text was expected"),
                Ok(_) => None,
                Err(Error::Io(error)) if is_quiet(&error) => None,
                Err(error) => return Err(error),
            };
            match said {
                Some(Ok(Said::Token(found))) if is_same(&found.token, &self.token) => {
                    is_known = true
                }
                Some(_) if !is_known => return close(socket, "the token is another"),
                None if !is_known && start.elapsed() > TOKEN_TIME => {
                    return close(socket, "no token");
                }
                Some(Ok(Said::Next(asked))) => next = Some(asked),
                Some(Ok(Said::Command(command))) => {
                    *holds = match command {
                        Command::Pull { .. } => true,
                        Command::Release {} => false,
                        _ => *holds,
                    };
                    match self.commands.try_send(command) {
                        Ok(()) => {}
                        Err(TrySendError::Full(_)) => return close(socket, "too many commands"),
                        Err(TrySendError::Disconnected(_)) => {
                            return close(socket, "the session is over");
                        }
                    }
                }
                Some(_) => return close(socket, "not a command"),
                None => {}
            }
            if let Some(asked) = next.take_if(|asked| asked.next != self.shared.number()) {
                self.tell(&mut socket, &asked)?;
            }
        }
    }

    /// Sends what a page has asked for.
    fn tell(&self, socket: &mut WebSocket<TcpStream>, asked: &Next) -> Result<(), Error> {
        let Some(moment) = self.shared.newest() else {
            return Ok(());
        };
        if let Some(stage) = moment
            .stage
            .as_ref()
            .filter(|stage| stage.number != asked.stage)
        {
            socket.send(Message::binary(stage.message()))?;
        }
        if let Some(robot) = (moment.robot.as_ref()).filter(|robot| robot.number != asked.robot) {
            socket.send(Message::binary(robot.message()))?;
        }
        let mut message = moment.message(asked.shade);
        if let Some(picture) = asked
            .look
            .as_ref()
            .and_then(|look| picture(&moment, asked.shade, look))
        {
            message = message.with("picture", picture);
        }
        socket.send(Message::binary(message.bytes()))
    }
}

/// Nothing has come in time.
fn is_quiet(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

/// Compares in a time that does not tell how much is alike.
fn is_same(found: &str, token: &str) -> bool {
    let pairs = found.bytes().zip(token.bytes());
    found.len() == token.len() && pairs.fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

fn close(mut socket: WebSocket<TcpStream>, reason: &'static str) -> Result<(), Error> {
    let frame = CloseFrame {
        code: CloseCode::Policy,
        reason: reason.into(),
    };
    socket.close(Some(frame))?;
    socket.flush()?;
    // With something unread the connection would be reset, and the reason lost.
    let (mut stream, start) = (socket.get_ref(), Instant::now());
    stream.shutdown(Shutdown::Write)?;
    let mut bytes = [0; 4096];
    while start.elapsed() < FAREWELL {
        match stream.read(&mut bytes) {
            Ok(0) => break,
            Err(error) if !is_quiet(&error) => break,
            _ => {}
        }
    }
    Ok(())
}
