use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{Ipv6Addr, TcpStream};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::connections::{CONNECTIONS, THREADS};
use super::*;

/// Deadline of events that normally happen at once, so that a hanging server fails its test.
const DEADLINE: Duration = Duration::from_secs(60);

/// Times of clients that are far beyond any test: a server that waits for them hangs.
const FOR_EVER: Limits = {
    let far = Duration::from_secs(24 * 3600);
    Limits { silence: far, request: far, reading: far }
};

/// Answer beyond the buffers of a connection, bytes.
const LARGE_BYTES: usize = 12 << 20;

/// Server that notes the changes it was asked for.
struct Running {
    bound: SocketAddr,
    token: Option<String>,
    changes: Arc<Mutex<Vec<String>>>,
    stop: Arc<AtomicBool>,
    thread: Option<thread::JoinHandle<()>>,
}

impl Running {
    fn new(access: Access) -> Self {
        Self::with(access, start_thread)
    }

    fn with(access: Access, start: StartThread) -> Self {
        Self::with_limits(access, start, Limits::default())
    }

    fn with_limits(access: Access, start: StartThread, limits: Limits) -> Self {
        let mut server = Server::open(access).unwrap();
        Arc::get_mut(&mut server.guard).unwrap().limits = limits;
        let bound = server.bound();
        let token = server.guard.token.clone();
        let changes = Arc::new(Mutex::new(Vec::new()));
        let stop = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&changes);
        let stopped = Arc::clone(&stop);
        let asked = AtomicBool::new(false);
        let site = move |request: &Request, path: &str| match path {
            "panic" => panic!("a site with a mistake"),
            "large" => Response::ok("application/octet-stream", vec![7; LARGE_BYTES]),
            "slow" => Response::json(&is_set_in_time(&asked)),
            "next" => {
                asked.store(true, Ordering::Relaxed);
                Response::json(&path)
            }
            _ => {
                if !request.is_read() {
                    theirs.lock().unwrap().push(path.to_owned());
                }
                Response::json(&path)
            }
        };
        Self {
            bound,
            token,
            changes,
            stop,
            thread: Some(thread::spawn(move || {
                server.serve_with(&Arc::new(site), start, || stopped.load(Ordering::Relaxed))
            })),
        }
    }

    /// Sends bytes, and returns the status and the whole answer.
    fn send(&self, bytes: &[u8]) -> (u16, String) {
        let mut stream = TcpStream::connect(self.bound).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        // A server that refuses early may close before all is sent.
        let _ = stream.write_all(bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer).into_owned();
        let status = text.split(' ').nth(1).and_then(|code| code.parse().ok());
        (status.unwrap_or(0), text)
    }

    /// Sends a request with some of its usual headers replaced, or left out where they are empty.
    fn ask(&self, method: &str, path: &str, replaced: &[(&str, &str)]) -> (u16, String) {
        let host = self.bound.to_string();
        let mut headers = BTreeMap::from([("Host", host.as_str())]);
        if method == "POST" {
            headers.extend([("Content-Type", "application/json"), ("Content-Length", "0")]);
        }
        headers.extend(replaced.iter().copied());
        let key = self.token.as_ref().map(|token| format!("{token}/")).unwrap_or_default();
        let key = headers.remove("key").map_or(key, str::to_owned);
        let mut text = format!("{method} /{key}{path} HTTP/1.1\r\n");
        for (name, value) in headers.iter().filter(|(_, value)| !value.is_empty()) {
            text += &format!("{name}: {value}\r\n");
        }
        self.send((text + "\r\n").as_bytes())
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

/// Waits until a flag is set by another request, but not for ever.
fn is_set_in_time(flag: &AtomicBool) -> bool {
    for _ in 0..500 {
        if flag.load(Ordering::Relaxed) {
            return true;
        }
        thread::sleep(Duration::from_millis(20));
    }
    false
}

fn open_access(changes: Changes) -> Access {
    Access { key: false, ..Access::loopback(0).with_changes(changes) }
}

#[test]
fn a_site_answers_behind_the_key() {
    let running = Running::new(Access::loopback(0));
    let (status, answer) = running.ask("GET", "a/b?c", &[]);
    assert_eq!(status, 200);
    assert!(answer.ends_with("\"a/b?c\""), "{answer}");
    assert!(answer.contains("default-src 'none'") && answer.contains("no-referrer"));
    let (status, answer) = running.ask("HEAD", "a", &[]);
    assert!(status == 200 && answer.ends_with("\r\n\r\n"), "{answer}");
    let token = running.token.clone().unwrap();
    for key in ["", "x/", &format!("{}/", &token[1..]), &format!("{}/", "0".repeat(32))] {
        assert_eq!(running.ask("GET", "a", &[("key", key)]).0, 403, "{key}");
    }
}

#[test]
fn a_foreign_host_or_origin_is_refused() {
    for changes in [Changes::Refused, Changes::FromPage, Changes::FromPrograms] {
        let running = Running::new(open_access(changes));
        let port = running.bound.port();
        for host in [format!("127.0.0.1:{port}"), format!("localhost:{port}")] {
            let own = format!("http://{host}");
            let headers = [("Host", host.as_str()), ("Origin", own.as_str())];
            assert_eq!(running.ask("GET", "a", &headers[..1]).0, 200, "{host}");
            assert_eq!(running.ask("GET", "a", &headers).0, 200, "{host}");
        }
        let other = format!("evil.example:{port}");
        let elsewhere = format!("192.0.2.1:{port}");
        for host in ["", "evil.example", "127.0.0.1", "127.0.0.1:1", &other, &elsewhere] {
            assert_eq!(running.ask("GET", "a", &[("Host", host)]).0, 403, "{host}");
        }
        let secure = format!("https://127.0.0.1:{port}");
        for origin in ["null", "http://evil.example", "http://127.0.0.1:1", &secure] {
            for method in ["GET", "POST"] {
                let status = running.ask(method, "a", &[("Origin", origin)]).0;
                assert_eq!(status, 403, "{method} {origin}");
            }
        }
        assert!(running.changes.lock().unwrap().is_empty());
    }
}

#[test]
fn changes_come_in_only_where_they_are_allowed() {
    for (changes, own, none) in [
        (Changes::Refused, 405, 403),
        (Changes::FromPage, 200, 403),
        (Changes::FromPrograms, 200, 200),
    ] {
        let running = Running::new(open_access(changes));
        let origin = format!("http://{}", running.bound);
        assert_eq!(running.ask("POST", "own", &[("Origin", &origin)]).0, own, "{changes:?}");
        assert_eq!(running.ask("POST", "none", &[]).0, none, "{changes:?}");
        let expected = [("own", own), ("none", none)].into_iter().filter(|(_, code)| *code == 200);
        let expected: Vec<&str> = expected.map(|(path, _)| path).collect();
        assert_eq!(*running.changes.lock().unwrap(), expected);
        let form = [("Origin", origin.as_str()), ("Content-Type", "text/plain")];
        let status = running.ask("POST", "form", &form).0;
        assert_eq!(status, if own == 200 { 415 } else { own }, "{changes:?}");
        for method in ["PUT", "DELETE", "OPTIONS", "PATCH"] {
            assert_eq!(running.ask(method, "a", &[]).0, 405, "{method}");
        }
        assert_eq!(*running.changes.lock().unwrap(), expected);
    }
}

#[test]
fn only_the_loopback_interface_listens_unless_told_otherwise() {
    let server = Server::open(Access::loopback(0)).unwrap();
    assert!(server.bound().ip().is_loopback());
    let all = Server::open(Access::at((Ipv4Addr::UNSPECIFIED, 0).into())).unwrap();
    assert!(all.bound().ip().is_unspecified());
    let port = all.bound().port();
    assert!(all.address().starts_with(&format!("http://127.0.0.1:{port}/")), "{}", all.address());
    // A server on all interfaces is reached by a numeric address; a name could be that of another
    // page.
    assert!(all.guard.is_own(&format!("192.0.2.7:{port}")));
    assert!(all.guard.is_own(&format!("localhost:{port}")));
    assert!(!all.guard.is_own(&format!("robot.example:{port}")));
    assert!(!all.guard.is_own("192.0.2.7:1"));
}

#[test]
fn an_address_of_version_six_is_printed_as_browsers_take_it() {
    let Ok(server) = Server::open(Access::at((Ipv6Addr::LOCALHOST, 0).into())) else {
        return eprintln!("skipped: this computer has no IPv6");
    };
    let port = server.bound().port();
    assert!(server.address().starts_with(&format!("http://[::1]:{port}/")));
    assert!(server.guard.is_own(&format!("[::1]:{port}")));
}

#[test]
fn hostile_bytes_are_answered_and_the_server_goes_on() {
    let running = Running::new(open_access(Changes::FromPrograms));
    for bytes in [&b"\0\xff\xfe\r\n\r\n"[..], b"GET\r\n\r\n", b"\r\n\r\n", b"G"] {
        assert_eq!(running.send(bytes).0, 400, "{bytes:?}");
    }
    assert_eq!(running.ask("POST", "a", &[("Content-Length", "16385")]).0, 413);
    assert_eq!(running.send(&vec![b'a'; 1 << 20]).0 / 100 % 4, 0, "refused or cut off");
    assert_eq!(running.ask("GET", "a", &[]).0, 200);
    assert!(running.changes.lock().unwrap().is_empty());
}

#[test]
fn a_site_that_panics_or_is_slow_holds_up_no_other_request() {
    let running = Running::new(open_access(Changes::Refused));
    for _ in 0..2 * THREADS {
        assert_eq!(running.ask("GET", "panic", &[]).0, 0, "no answer");
    }
    thread::scope(|scope| {
        let slow = scope.spawn(|| running.ask("GET", "slow", &[]).1);
        assert_eq!(running.ask("GET", "next", &[]).0, 200);
        assert!(slow.join().unwrap().ends_with("true"), "the next request waited for the slow one");
    });
}

/// Opens connections that begin a request, or ask for a page, and then do nothing more.
fn slow_clients(running: &Running, count: usize, sent: &[u8]) -> Vec<TcpStream> {
    (0..count)
        .map(|_| {
            let mut stream = TcpStream::connect(running.bound).unwrap();
            stream.write_all(sent).unwrap();
            stream
        })
        .collect()
}

#[test]
fn slow_clients_lock_no_other_out() {
    let running = Running::with_limits(open_access(Changes::Refused), start_thread, FOR_EVER);
    let host = running.bound;
    let unread = format!("GET /large HTTP/1.1\r\nHost: {host}\r\n\r\n");
    // More than are held at once: the oldest make room.
    for (count, sent) in
        [(CONNECTIONS + 40, &b"GET / HTTP/1.1\r\n"[..]), (THREADS + 8, unread.as_bytes())]
    {
        let slow = slow_clients(&running, count, sent);
        for _ in 0..5 {
            // The slow clients have all the time that there is, so that waiting for one has no end.
            assert_eq!(running.ask("GET", "a", &[]).0, 200, "{count}");
        }
        drop(slow);
    }
}

#[test]
fn a_slow_client_gets_its_whole_answer() {
    let running = Running::new(open_access(Changes::Refused));
    let mut stream = TcpStream::connect(running.bound).unwrap();
    let request = format!("GET /large HTTP/1.1\r\nHost: {}\r\n\r\n", running.bound);
    for part in request.as_bytes().chunks(7) {
        stream.write_all(part).unwrap();
        thread::sleep(Duration::from_millis(15));
    }
    thread::sleep(Duration::from_millis(300));
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200 OK\r\n"));
    assert!(answer.ends_with(&vec![7; LARGE_BYTES]), "{} bytes", answer.len());
}

#[test]
fn requests_are_answered_where_no_thread_can_start() {
    let running =
        Running::with(open_access(Changes::Refused), |_| Err(io::Error::other("no thread")));
    for _ in 0..3 {
        assert_eq!(running.ask("GET", "a", &[]).0, 200);
        assert_eq!(running.ask("GET", "panic", &[]).0, 0, "no answer, and no end of the server");
    }
}

#[test]
fn silent_clients_are_told_and_the_end_does_not_wait_for_them() {
    let short = Limits { silence: Duration::from_millis(200), ..FOR_EVER };
    let running = Running::with_limits(open_access(Changes::Refused), start_thread, short);
    let mut silent = slow_clients(&running, 1, b"GET /");
    let mut answer = String::new();
    silent[0].read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    let running = Running::with_limits(open_access(Changes::Refused), start_thread, FOR_EVER);
    let silent = slow_clients(&running, 3, b"GET /");
    let (ended, told) = std::sync::mpsc::channel();
    thread::spawn(move || {
        drop(running);
        let _ = ended.send(());
    });
    assert!(told.recv_timeout(DEADLINE).is_ok(), "the end waits for silent clients");
    for mut stream in silent {
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        let mut rest = Vec::new();
        // A connection that is reset is closed as well.
        let failed = stream.read_to_end(&mut rest).err().map(|error| error.kind());
        let is_open = matches!(failed, Some(io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut));
        assert!(!is_open && rest.is_empty(), "closed without an answer: {failed:?}");
    }
}

#[test]
fn two_servers_have_different_keys() {
    let servers = [(); 2].map(|()| Server::open(Access::loopback(0)).unwrap());
    let tokens = servers.map(|server| server.guard.token.clone().unwrap());
    assert_ne!(tokens[0], tokens[1]);
    assert!(tokens.iter().all(|token| token.len() == 32));
}
