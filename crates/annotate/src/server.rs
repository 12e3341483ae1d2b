//! Content of the server: the page, the images, and the changes that the page sends.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use tagalong_report::BASE_STYLE;
use tagalong_serve::{Request, Response, Site};

use crate::document::Change;
use crate::film::Film;
use crate::session::Session;

const PAGE: &str = include_str!("page/page.html");
const SCRIPT: &str = include_str!("page/page.js");
const STYLE: &str = include_str!("page/page.css");
const ICON: &str = include_str!("page/icon.svg");

/// State of the server.
pub struct App {
    /// Images.
    pub film: Arc<Film>,
    /// People, and the file.
    pub session: Mutex<Session>,
    /// The log.
    pub log: PathBuf,
    /// Origin of the initial boxes, in words.
    pub origin: String,
    /// True after the page has been told that the annotation is finished.
    pub finished: AtomicBool,
}

impl Site for App {
    fn answer(&self, request: &Request, path: &str) -> Response {
        match (request.is_read(), path) {
            (true, "") => Response::ok("text/html; charset=utf-8", PAGE),
            (true, "page.js") => Response::ok("text/javascript; charset=utf-8", SCRIPT),
            (true, "page.css") => {
                Response::ok("text/css; charset=utf-8", [BASE_STYLE, STYLE].concat())
            }
            (true, "icon.svg") => Response::ok("image/svg+xml", ICON),
            (true, "state") => self.state(),
            (true, image) if image.starts_with("frame/") => self.image(image),
            (false, "change") => self.change(&request.body),
            (false, "finish") => self.finish(),
            _ => Response::not_found(),
        }
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
        Response::json(&State {
            about: session.about(&self.log, &self.origin),
            all: session.everything(),
        })
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
            Ok(answer) => Response::json(&answer),
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::fs;
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::thread;
    use std::time::Duration;

    use tagalong_serve::{Access, Changes, Server};

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
            let access = Access::loopback(0).with_changes(Changes::FromPage);
            let server = Server::open(access).unwrap();
            let port = server.bound().port();
            let token = server.address().split('/').nth(3).unwrap().to_owned();
            let stop = Arc::new(AtomicBool::new(false));
            let app_of = Arc::clone(&app);
            let stop_of = Arc::clone(&stop);
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
            let port = self.port;
            let token = &self.token;
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
    fn no_two_buttons_have_one_name_and_finish_is_in_the_header() {
        let ends = PAGE.split("</button>");
        let all =
            ends.filter(|part| part.contains("<button")).filter_map(|part| part.rsplit('>').next());
        let mut names: Vec<&str> = all.collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!((names.len(), count > 10), (count, true), "{names:?}");
        let header = PAGE.split("</header>").next().unwrap();
        assert!(header.contains("id=\"finish\""), "{header}");
    }

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
        let port = running.port;
        let token = &running.token;
        let request = format!(
            "POST /{token}/finish HTTP/1.1\r\nHost: localhost:{port}\r\n\
             Origin: http://localhost:{port}\r\nContent-Type: application/json\r\n\r\n"
        );
        assert_eq!(running.send(request.as_bytes()).0, 200);
        assert!(running.app.finished.load(Ordering::Relaxed));
        assert!(running.file.exists());
    }
}
