//! The requests of callers as HTTP with JSON on loopback.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use serde::Serialize;
use tagalong::pipeline::Enrollment;
use tagalong_serve::{Access, Changes, Request, Response, Server, Site};

use crate::BridgeError;
use crate::skill::{Desk, Refusal, Verb};

/// Maximum length of a request body, bytes; an enrollment takes some dozens.
const BODY_BYTES: usize = 4 << 10;

/// HTTP server for the desk; it ends when it is dropped.
pub(crate) struct HttpServer {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Answer to a change.
#[derive(Serialize)]
struct Answer<'a> {
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'a str>,
}

impl HttpServer {
    /// Starts listening.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for an address that is not on loopback, or that is in use.
    pub(crate) fn start(address: SocketAddr, desk: Desk) -> Result<Self, BridgeError> {
        // Any program that reaches the port can choose the person that the robot follows.
        if !address.ip().is_loopback() {
            let why = "must be an address of this computer, such as 127.0.0.1:8080; for other \
                       computers, put a proxy with authentication in front of it";
            return Err(BridgeError::Config(format!("--http {address}: {why}")));
        }
        let mut access = Access::at(address).with_changes(Changes::FromPrograms);
        (access.key, access.body_bytes) = (false, BODY_BYTES);
        let server = Server::open(access)
            .map_err(|error| BridgeError::Config(format!("--http {address}: {error}")))?;
        let bound = server.address();
        let stop = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name("http".into())
            .spawn(move || server.serve(&Arc::new(Skill(desk)), || theirs.load(Ordering::Relaxed)));
        let thread = thread.map_err(|error| {
            let why = format!("no thread for it can be started: {error}");
            BridgeError::Config(format!("--http {address}: {why}"))
        })?;
        Ok(Self { address: bound, stop, thread: Some(thread) })
    }

    /// Returns the address of the server, with a slash at its end.
    pub(crate) fn address(&self) -> &str {
        &self.address
    }
}

impl Drop for HttpServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

/// Requests by their paths.
struct Skill(Desk);

impl Site for Skill {
    fn answer(&self, request: &Request, path: &str) -> Response {
        match (request.is_read(), path) {
            (true, "status") => Response::json(&self.0.status()),
            (true, "healthz") => self.health(),
            (false, "enroll") => self.enroll(&request.body),
            (false, "clear") => self.change(Verb::Clear),
            (_, "status" | "healthz" | "enroll" | "clear") => {
                Response::refusal(405, "GET /status and /healthz, POST /enroll and /clear")
            }
            _ => Response::not_found(),
        }
    }
}

impl Skill {
    fn health(&self) -> Response {
        let health = self.0.health();
        let status = if health.ok { 200 } else { 503 };
        Response { status, ..Response::json(&health) }
    }

    fn enroll(&self, body: &[u8]) -> Response {
        match serde_json::from_slice::<Enrollment>(body) {
            Ok(enrollment) => self.change(Verb::Enroll(enrollment)),
            Err(error) => {
                let example = r#"send {"person": "nearest"}, "approach", "raised-hand", {"track": 3} or {"point": [320, 240]}"#;
                refused(400, &format!("{error}; {example}"))
            }
        }
    }

    fn change(&self, verb: Verb) -> Response {
        match self.0.ask(verb) {
            Ok(()) => Response::json(&Answer { ok: true, reason: None }),
            Err(refusal @ Refusal::Refused(_)) => refused(409, refusal.reason()),
            Err(refusal @ Refusal::Busy(_)) => refused(503, refusal.reason()),
        }
    }
}

fn refused(status: u16, reason: &str) -> Response {
    Response { status, ..Response::json(&Answer { ok: false, reason: Some(reason) }) }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use super::*;

    /// Returns status and body.
    fn send(server: &HttpServer, head: &str, body: &str) -> (u16, String) {
        send_length(server, head, body.len(), body)
    }

    /// Sends a body that is said to be of this length.
    fn send_length(server: &HttpServer, head: &str, length: usize, body: &str) -> (u16, String) {
        let host = server.address().trim_start_matches("http://").trim_end_matches('/').to_owned();
        let mut stream = TcpStream::connect(&host).unwrap();
        let head = head.replace("HOST", &host);
        write!(stream, "{head}\r\nContent-Length: {length}\r\n\r\n{body}").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let status = text.split(' ').nth(1).unwrap().parse().unwrap();
        (status, text.split_once("\r\n\r\n").unwrap().1.to_owned())
    }

    fn post(server: &HttpServer, path: &str, body: &str) -> (u16, String) {
        let head = format!("POST /{path} HTTP/1.1\r\nHost: HOST\r\nContent-Type: application/json");
        send(server, &head, body)
    }

    /// Returns a server whose pipeline follows tracks below 5.
    fn server() -> HttpServer {
        let (desk, requests) = Desk::new();
        desk.open();
        desk.frame(None, 1);
        thread::spawn(move || {
            for request in requests {
                let refuses = format!("{:?}", request.verb).contains("TrackId(7)");
                let answer = if refuses { Err("there is no track 7".to_owned()) } else { Ok(()) };
                request.answer.send(answer).unwrap();
            }
        });
        HttpServer::start("127.0.0.1:0".parse().unwrap(), desk).unwrap()
    }

    #[test]
    fn a_program_enrolls_clears_and_asks() {
        let server = server();
        for body in [
            r#"{"person": "nearest"}"#,
            r#"{"person": "approach", "lose_after_s": 3.0, "search": false}"#,
            r#"{"person": {"point": [320, 240.5]}}"#,
            r#"{"person": {"track": 3}, "give_up_s": 30}"#,
        ] {
            assert_eq!(post(&server, "enroll", body), (200, r#"{"ok":true}"#.into()), "{body}");
        }
        assert_eq!(post(&server, "clear", "").0, 200);
        let (status, text) = post(&server, "enroll", r#"{"person": {"track": 7}}"#);
        assert_eq!(
            (status, text.as_str()),
            (409, r#"{"ok":false,"reason":"there is no track 7"}"#)
        );
        let (status, text) = send(&server, "GET /status HTTP/1.1\r\nHost: HOST", "");
        assert!(status == 200 && text.contains(r#""frames":1"#), "{text}");
        let (status, text) = send(&server, "GET /healthz HTTP/1.1\r\nHost: HOST", "");
        assert_eq!((status, text.as_str()), (200, r#"{"ok":true,"reason":null}"#));
    }

    #[test]
    fn what_is_no_request_of_the_skill_is_refused() {
        let server = server();
        let json = "Content-Type: application/json";
        for (head, body, wanted) in [
            (format!("POST /enroll HTTP/1.1\r\nHost: HOST\r\n{json}"), "{}", 400),
            (format!("POST /enroll HTTP/1.1\r\nHost: HOST\r\n{json}"), r#"{"person":"me"}"#, 400),
            (
                format!("POST /enroll HTTP/1.1\r\nHost: HOST\r\n{json}"),
                r#"{"person":"nearest","speed":9}"#,
                400,
            ),
            ("POST /clear HTTP/1.1\r\nHost: HOST".to_owned(), "", 415),
            (format!("POST /status HTTP/1.1\r\nHost: HOST\r\n{json}"), "", 405),
            ("GET /clear HTTP/1.1\r\nHost: HOST".to_owned(), "", 405),
            ("GET / HTTP/1.1\r\nHost: HOST".to_owned(), "", 404),
            ("GET /status HTTP/1.1\r\nHost: evil.example:80".to_owned(), "", 403),
            (
                format!(
                    "POST /clear HTTP/1.1\r\nHost: HOST\r\nOrigin: http://evil.example\r\n{json}"
                ),
                "",
                403,
            ),
            (format!("PUT /enroll HTTP/1.1\r\nHost: HOST\r\n{json}"), "", 405),
        ] {
            assert_eq!(send(&server, &head, body).0, wanted, "{head} {body}");
        }
        let head = format!("POST /enroll HTTP/1.1\r\nHost: HOST\r\n{json}");
        assert_eq!(send_length(&server, &head, BODY_BYTES + 1, "").0, 413);
    }

    #[test]
    fn only_this_computer_is_served() {
        let (desk, _requests) = Desk::new();
        let error = HttpServer::start("0.0.0.0:0".parse().unwrap(), desk).err().unwrap();
        assert!(error.to_string().contains("127.0.0.1:8080"), "{error}");
        assert_eq!(error.exit_code(), 2);
    }
}
