//! Who may come in. A page of another site that a browser has open can reach every port of this machine: so names of
//! hosts are held against a list, in `Host` against such sites that have taken our address, and in `Origin`.

use std::io::{self, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest head of a request [bytes].
const MOST: usize = 16 * 1024;
/// Longest time that it may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// What a request asks for.
#[derive(Debug, PartialEq, Eq)]
pub enum Asked {
    Page,
    /// A socket, with the key of its handshake.
    Socket(String),
    /// Status and reason.
    Refused(u16, &'static str),
}

/// Reads the head of a request.
pub fn read_head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let (start, mut head) = (Instant::now(), Vec::new());
    stream.set_read_timeout(Some(PATIENCE))?;
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let mut bytes = [0; 1024];
        let count = stream.read(&mut bytes)?;
        if count == 0 || head.len() > MOST || start.elapsed() > PATIENCE {
            return Err(io::ErrorKind::InvalidData.into());
        }
        head.extend(&bytes[..count]);
    }
    Ok(head)
}

/// What the head of a request asks for, where `hosts` are the names by which this one goes.
pub fn asked(head: &[u8], hosts: &[String]) -> Asked {
    let mut headers = [httparse::EMPTY_HEADER; 64];
    let mut request = httparse::Request::new(&mut headers);
    if !request.parse(head).is_ok_and(|parsed| parsed.is_complete()) {
        return Asked::Refused(400, "Bad Request");
    }
    let all = |name: &str| {
        let own = request
            .headers
            .iter()
            .filter(|header| header.name.eq_ignore_ascii_case(name));
        own.map(|header| String::from_utf8_lossy(header.value).trim().to_owned())
            .collect()
    };
    let one = |name: &str| {
        let all: Vec<String> = all(name);
        all.into_iter().next()
    };
    let is_known = |host: &str| {
        hosts
            .iter()
            .any(|known| known.eq_ignore_ascii_case(name_of(host)))
    };
    let named: Vec<String> = all("host");
    if named.len() != 1 || !is_known(&named[0]) {
        return Asked::Refused(403, "Forbidden");
    }
    let origins: Vec<String> = all("origin");
    let of_us = |origin: &String| {
        let host = origin.split_once("://").map(|(_, host)| host);
        host.is_some_and(is_known)
    };
    if !origins.iter().all(of_us) {
        return Asked::Refused(403, "Forbidden");
    }
    if request.method != Some("GET") {
        return Asked::Refused(405, "Method Not Allowed");
    }
    let path = request.path.unwrap_or_default();
    let path = path.split('?').next().unwrap_or_default();
    // Whatever a proxy has put before it.
    match path.rsplit('/').next() {
        Some("") => Asked::Page,
        Some("socket") => {
            let is_upgrade = one("upgrade").is_some_and(|to| to.eq_ignore_ascii_case("websocket"));
            let is_current = one("sec-websocket-version").as_deref() == Some("13");
            match one("sec-websocket-key").filter(|_| is_upgrade && is_current) {
                Some(key) => Asked::Socket(key),
                None => Asked::Refused(426, "Upgrade Required"),
            }
        }
        _ => Asked::Refused(404, "Not Found"),
    }
}

/// A host without its port.
fn name_of(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(lines: &str) -> Asked {
        let hosts = ["localhost", "127.0.0.1", "[::1]"].map(String::from);
        asked(
            format!("{}\r\n\r\n", lines.replace('\n', "\r\n")).as_bytes(),
            &hosts,
        )
    }

    #[test]
    fn only_known_hosts_and_origins_come_in() {
        let refused = Asked::Refused(403, "Forbidden");
        for host in [
            "localhost",
            "LocalHost:80",
            "127.0.0.1:9000",
            "[::1]:1",
            "[::1]",
        ] {
            assert_eq!(
                of(&format!("GET / HTTP/1.1\nHost: {host}")),
                Asked::Page,
                "{host}"
            );
        }
        for host in [
            "evil.example",
            "localhost.evil.example",
            "127.0.0.1.nip.io:80",
            "localhost:80@evil.example",
            "",
            "[::2]",
        ] {
            assert_eq!(
                of(&format!("GET / HTTP/1.1\nHost: {host}")),
                refused,
                "{host}"
            );
        }
        assert_eq!(of("GET / HTTP/1.1"), refused);
        assert_eq!(
            of("GET / HTTP/1.1\nHost: localhost\nHost: evil.example"),
            refused
        );
        let from = |origin: &str| {
            of(&format!(
                "GET /a/ HTTP/1.1\nHost: localhost\nOrigin: {origin}"
            ))
        };
        assert_eq!(from("http://localhost:9000"), Asked::Page);
        for origin in [
            "http://evil.example",
            "null",
            "https://localhost.evil.example:80",
            "http://localhost:80@evil.example",
            "",
        ] {
            assert_eq!(from(origin), refused, "{origin}");
        }
    }

    #[test]
    fn nothing_is_given_but_page_and_socket() {
        let socket = "HTTP/1.1\nHost: localhost\nUpgrade: websocket\nSec-WebSocket-Version: 13";
        let key = format!("GET /behind/socket {socket}\nSec-WebSocket-Key: k");
        assert_eq!(of(&key), Asked::Socket("k".into()));
        let status = |lines: &str| match of(lines) {
            Asked::Refused(status, _) => status,
            _ => 200,
        };
        assert_eq!(status(&format!("GET /socket {socket}")), 426);
        assert_eq!(
            status("GET /../../etc/passwd HTTP/1.1\nHost: localhost"),
            404
        );
        assert_eq!(status("POST / HTTP/1.1\nHost: localhost"), 405);
        assert_eq!(status("nonsense"), 400);
    }
}
