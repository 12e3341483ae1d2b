//! The server of the page: on this computer alone, for the owner of the address alone.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use serde::Serialize;

use crate::document::Change;
use crate::film::Film;
use crate::http::{self, Request, Response};
use crate::session::Session;

/// Connections at once; browsers open about six.
const CONNECTIONS: usize = 32;

/// Pause between two looks for a connection or a reason to stop.
const PAUSE: Duration = Duration::from_millis(20);

/// Longest wait for the next bytes of a connection.
const SILENCE: Duration = Duration::from_secs(5);

const PAGE: &str = include_str!("page/page.html");
const SCRIPT: &str = include_str!("page/page.js");
const STYLE: &str = include_str!("page/page.css");
const ICON: &str = include_str!("page/icon.svg");

/// Everything that answers need.
pub struct App {
    /// Images.
    pub film: Arc<Film>,
    /// People, and the file.
    pub session: Mutex<Session>,
    /// The log.
    pub log: PathBuf,
    /// Origin of the first boxes, in words.
    pub origin: String,
    /// True after the page was told that all is done.
    pub finished: AtomicBool,
}

/// Server that listens and has not answered yet.
pub struct Server {
    listener: TcpListener,
    guard: Guard,
}

/// Conditions on a request: any page that a browser shows could send one to this computer.
#[derive(Clone, Debug)]
struct Guard {
    port: u16,
    token: String,
}

impl Server {
    /// Listens on this computer; port 0 takes a free one.
    ///
    /// # Errors
    /// A port that is taken, a system without random numbers.
    pub fn open(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port)))?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        Ok(Self { listener, guard: Guard { port, token: random_token()? } })
    }

    /// Returns the address of the page, which is the key to it.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.guard.port, self.guard.token)
    }

    /// Answers requests until `stop` says so or the page is finished.
    pub fn serve(&self, app: &Arc<App>, stop: impl Fn() -> bool) {
        let open = Arc::new(AtomicUsize::new(0));
        while !stop() && !app.finished.load(Ordering::Relaxed) {
            match self.listener.accept() {
                Ok((stream, _)) => self.take(stream, app, &open),
                // An attempt that failed is not the end of the server.
                Err(_) => thread::sleep(PAUSE),
            }
        }
        // The answer to the last request is still under way.
        for _ in 0..50 {
            if open.load(Ordering::Relaxed) == 0 {
                break;
            }
            thread::sleep(PAUSE);
        }
    }

    /// Answers one connection in a thread.
    fn take(&self, mut stream: TcpStream, app: &Arc<App>, open: &Arc<AtomicUsize>) {
        let prepared = stream
            .set_nonblocking(false)
            .and_then(|()| stream.set_read_timeout(Some(SILENCE)))
            .and_then(|()| stream.set_write_timeout(Some(SILENCE)));
        if prepared.is_err() {
            return;
        }
        if open.load(Ordering::Relaxed) >= CONNECTIONS {
            let _ = Response::refusal(503, "too many connections").send(&mut stream, false);
            return;
        }
        open.fetch_add(1, Ordering::Relaxed);
        let (guard, app, open) = (self.guard.clone(), Arc::clone(app), Arc::clone(open));
        thread::spawn(move || {
            let (answer, head_only) = match http::read(&mut stream) {
                Ok(request) => (guard.answer(&request, &app), request.method == "HEAD"),
                Err(Some(refusal)) => (refusal, false),
                Err(None) => (Response::refusal(400, "the request is cut off"), false),
            };
            // A browser that is gone needs no answer.
            let _ = answer.send(&mut stream, head_only);
            open.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

impl Guard {
    fn answer(&self, request: &Request, app: &App) -> Response {
        let path = match self.admit(request) {
            Ok(path) => path,
            Err(refusal) => return refusal,
        };
        match (request.method.as_str(), path) {
            ("GET" | "HEAD", "") => Response::ok("text/html; charset=utf-8", PAGE),
            ("GET" | "HEAD", "page.js") => Response::ok("text/javascript; charset=utf-8", SCRIPT),
            ("GET" | "HEAD", "page.css") => Response::ok("text/css; charset=utf-8", STYLE),
            ("GET" | "HEAD", "icon.svg") => Response::ok("image/svg+xml", ICON),
            ("GET" | "HEAD", "state") => app.state(),
            ("GET" | "HEAD", image) if image.starts_with("frame/") => app.image(image),
            ("POST", "change") => app.change(&request.body),
            ("POST", "finish") => app.finish(),
            ("GET" | "HEAD" | "POST", _) => Response::refusal(404, "there is no such page"),
            _ => Response::refusal(405, "GET and POST are all there is"),
        }
    }

    /// Returns the path behind the token of a request that may be answered.
    fn admit<'a>(&self, request: &'a Request) -> Result<&'a str, Response> {
        let refuse = |why: &str| Err(Response::refusal(403, why));
        let names = [format!("127.0.0.1:{}", self.port), format!("localhost:{}", self.port)];
        // A foreign name that resolves to this computer (DNS rebinding) stops here.
        let host = request.header("host").unwrap_or_default();
        if !names.iter().any(|name| name == host) {
            return refuse("the host is not this computer");
        }
        let is_own = |origin: &str| names.iter().any(|name| origin == format!("http://{name}"));
        let origin = request.header("origin");
        let is_change = request.method == "POST";
        if origin.map_or(is_change, |origin| !is_own(origin)) {
            return refuse("the request comes from another page");
        }
        let inside = request.path[1..].split_once('/');
        let Some((_, path)) = inside.filter(|(token, _)| same(token, &self.token)) else {
            return refuse("open the address that `tagalong annotate` printed");
        };
        let kind = request.header("content-type").unwrap_or_default();
        if is_change && !kind.starts_with("application/json") {
            return Err(Response::refusal(415, "changes are application/json"));
        }
        Ok(path)
    }
}

impl App {
    fn state(&self) -> Response {
        #[derive(Serialize)]
        struct State {
            about: crate::session::About,
            all: crate::session::Answer,
        }
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        json(&State { about: session.about(&self.log, &self.origin), all: session.everything() })
    }

    fn image(&self, path: &str) -> Response {
        let name = path.strip_prefix("frame/").and_then(|name| name.strip_suffix(".jpg"));
        let Some(number) = name.and_then(|name| name.parse().ok()) else {
            return Response::refusal(404, "there is no such image");
        };
        match self.film.image(number) {
            Ok(Some(bytes)) => Response::ok("image/jpeg", bytes),
            Ok(None) => Response::refusal(404, "the frame has no image"),
            Err(error) => Response::refusal(500, format!("the image cannot be read: {error}")),
        }
    }

    fn change(&self, body: &[u8]) -> Response {
        let change: Change = match serde_json::from_slice(body) {
            Ok(change) => change,
            Err(error) => return Response::refusal(400, format!("no change: {error}")),
        };
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        match session.apply(&change) {
            Ok(answer) => json(&answer),
            Err(why) => Response::refusal(409, why),
        }
    }

    fn finish(&self) -> Response {
        let saved = self.session.lock().unwrap_or_else(PoisonError::into_inner).save();
        match saved {
            Ok(()) => {
                self.finished.store(true, Ordering::Relaxed);
                Response::ok("application/json", "{}")
            }
            Err(why) => Response::refusal(409, why),
        }
    }
}

fn json(data: &impl Serialize) -> Response {
    match serde_json::to_vec(data) {
        Ok(bytes) => Response::ok("application/json", bytes),
        Err(error) => Response::refusal(500, error.to_string()),
    }
}

/// Compares in a time that does not depend on where two texts differ.
fn same(a: &str, b: &str) -> bool {
    let differences = a.bytes().zip(b.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    a.len() == b.len() && differences == 0
}

/// Returns 128 random bits of the system, hexadecimal.
fn random_token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)
        .map_err(|error| io::Error::other(format!("no random numbers: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::fs;
    use std::io::{Read, Write};

    use super::*;
    use crate::film::tests::film;

    /// Server of a log with twelve frames, with the file that it writes.
    struct Running {
        port: u16,
        token: String,
        file: PathBuf,
        app: Arc<App>,
        stop: Arc<AtomicBool>,
        thread: Option<thread::JoinHandle<()>>,
        _home: tempfile::TempDir,
    }

    impl Running {
        fn new() -> Self {
            let home = tempfile::tempdir().unwrap();
            let file = home.path().join("walk.people.csv");
            let film = Arc::new(film(12));
            let session = Session::new(Arc::clone(&film), BTreeMap::new(), file.clone());
            let app = Arc::new(App {
                film,
                session: Mutex::new(session),
                log: "walk.mcap".into(),
                origin: "nothing".into(),
                finished: AtomicBool::new(false),
            });
            let server = Server::open(0).unwrap();
            let (port, token) = (server.guard.port, server.guard.token.clone());
            let stop = Arc::new(AtomicBool::new(false));
            let (app_of, stop_of) = (Arc::clone(&app), Arc::clone(&stop));
            let thread = Some(thread::spawn(move || {
                server.serve(&app_of, || stop_of.load(Ordering::Relaxed));
            }));
            Self { port, token, file, app, stop, thread, _home: home }
        }

        /// Sends bytes, and returns the status and the whole answer.
        fn send(&self, bytes: &[u8]) -> (u16, Vec<u8>) {
            let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            // A server that refuses early may close before all is sent.
            let _ = stream.write_all(bytes);
            let _ = stream.shutdown(std::net::Shutdown::Write);
            let mut answer = Vec::new();
            let _ = stream.read_to_end(&mut answer);
            let text = String::from_utf8_lossy(&answer).into_owned();
            let status = text.split(' ').nth(1).and_then(|code| code.parse().ok());
            (status.unwrap_or(0), answer)
        }

        fn get(&self, path: &str) -> (u16, Vec<u8>) {
            let (port, token) = (self.port, &self.token);
            let host = format!("127.0.0.1:{port}");
            self.send(format!("GET /{token}/{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes())
        }

        /// Posts a change with some of its headers replaced.
        fn post(&self, change: &str, replaced: &[(&str, &str)]) -> u16 {
            let host = format!("127.0.0.1:{}", self.port);
            let origin = format!("http://{host}");
            let length = change.len().to_string();
            let mut headers: BTreeMap<&str, &str> = BTreeMap::from([
                ("Host", host.as_str()),
                ("Origin", origin.as_str()),
                ("Content-Type", "application/json"),
                ("Content-Length", length.as_str()),
            ]);
            headers.extend(replaced.iter().copied());
            let token = headers.remove("token").unwrap_or(&self.token);
            let mut text = format!("POST /{token}/change HTTP/1.1\r\n");
            for (name, value) in headers.iter().filter(|(_, value)| !value.is_empty()) {
                text += &format!("{name}: {value}\r\n");
            }
            self.send((text + "\r\n" + change).as_bytes()).0
        }
    }

    impl Drop for Running {
        fn drop(&mut self) {
            self.stop.store(true, Ordering::Relaxed);
            if let Some(thread) = self.thread.take() {
                thread.join().unwrap();
            }
        }
    }

    const HEAD: &str = r#"{"op":"head","frame":3,"id":null,"at":[160,90]}"#;

    #[test]
    fn the_page_its_parts_and_the_images_are_served() {
        let running = Running::new();
        for (path, part) in [
            ("", "<!DOCTYPE html>"),
            ("page.js", "use strict"),
            ("page.css", "{"),
            ("state", "\"frames\":[1,2,3"),
            ("frame/3.jpg", "JFIF"),
        ] {
            let (status, answer) = running.get(path);
            let text = String::from_utf8_lossy(&answer);
            assert_eq!(status, 200, "{path}");
            assert!(text.contains(part), "{path}");
            assert!(text.contains("default-src 'none'") && text.contains("no-referrer"));
        }
        for path in ["frame/99.jpg", "frame/x.jpg", "../etc/passwd", "change", "frame/-1.jpg"] {
            assert_eq!(running.get(path).0, 404, "{path}");
        }
    }

    #[test]
    fn a_change_is_in_the_file_when_it_is_answered() {
        let running = Running::new();
        assert_eq!(running.post(HEAD, &[]), 200);
        let text = fs::read_to_string(&running.file).unwrap();
        assert!(text.lines().nth(1).unwrap().starts_with("3,1,"), "{text}");
        assert_eq!(running.post(r#"{"op":"undo"}"#, &[]), 200);
        assert_eq!(fs::read_to_string(&running.file).unwrap().lines().count(), 1);
    }

    #[test]
    fn requests_from_elsewhere_are_refused_and_change_nothing() {
        let running = Running::new();
        let foreign = format!("evil.example:{}", running.port);
        let wrong_token = "0".repeat(32);
        for replaced in [
            ("Host", "evil.example"),
            ("Host", foreign.as_str()),
            ("Host", ""),
            ("Origin", "http://evil.example"),
            ("Origin", "null"),
            ("Origin", ""),
            ("token", wrong_token.as_str()),
            ("token", "x"),
            ("token", &running.token[1..]),
        ] {
            assert_eq!(running.post(HEAD, &[replaced]), 403, "{replaced:?}");
        }
        assert_eq!(running.post(HEAD, &[("Content-Type", "text/plain")]), 415);
        let no_token = format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", running.port);
        assert_eq!(running.send(no_token.as_bytes()).0, 403);
        assert!(!running.file.exists());
    }

    #[test]
    fn hostile_bytes_are_answered_and_the_server_goes_on() {
        let running = Running::new();
        for bytes in [&b"\0\xff\xfe\r\n\r\n"[..], b"GET\r\n\r\n", b"\r\n\r\n", b"G"] {
            assert_eq!(running.send(bytes).0, 400, "{bytes:?}");
        }
        assert_eq!(running.post(HEAD, &[("Content-Length", "1000000000000")]), 413);
        assert_eq!(running.send(&vec![b'a'; 1 << 20]).0 / 100 % 4, 0, "refused or cut off");
        for body in ["", "{", "[]", "null", r#"{"op":"format"}"#, r#"{"op":"pin","frame":1}"#] {
            assert_eq!(running.post(body, &[]), 400, "{body}");
        }
        let deep = "[".repeat(10_000);
        assert_eq!(running.post(&deep, &[]), 400);
        assert_eq!(running.post(r#"{"op":"pin","frame":1,"id":5}"#, &[]), 409);
        let nothing = r#"{"op":"box","frame":4000000000,"id":1,"region":[0,0,9,9]}"#;
        assert_eq!(running.post(nothing, &[]), 409);
        assert_eq!(running.get("").0, 200);
        assert!(!running.file.exists());
    }

    #[test]
    fn the_page_can_end_the_server() {
        let running = Running::new();
        let (port, token) = (running.port, &running.token);
        let request = format!(
            "POST /{token}/finish HTTP/1.1\r\nHost: localhost:{port}\r\n\
             Origin: http://localhost:{port}\r\nContent-Type: application/json\r\n\r\n"
        );
        assert_eq!(running.send(request.as_bytes()).0, 200);
        assert!(running.app.finished.load(Ordering::Relaxed));
        assert!(running.file.exists());
    }

    #[test]
    fn two_servers_have_different_keys() {
        let tokens = [Server::open(0).unwrap(), Server::open(0).unwrap()].map(|s| s.guard.token);
        assert_ne!(tokens[0], tokens[1]);
        assert!(tokens.iter().all(|token| token.len() == 32));
    }
}
