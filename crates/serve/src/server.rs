mod connections;

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use self::connections::{Connections, Limits, StartThread};
use crate::http::{Request, Response};

/// Pause between two polls for a connection, for bytes or for a reason to stop.
const PAUSE: Duration = Duration::from_millis(5);

/// Longest wait at the end for answers that are still being sent.
const FAREWELL: Duration = Duration::from_secs(1);

/// Changes that a server accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changes {
    /// None: every `POST` is refused.
    Refused,
    /// Changes that the page of the server itself sends: the `Origin` is required.
    FromPage,
    /// Also changes from programs, which send no `Origin`.
    FromPrograms,
}

/// Address of a server, and the requests that it answers.
#[derive(Clone, Debug)]
pub struct Access {
    /// Interface and port; port 0 selects a free one.
    pub address: SocketAddr,
    /// True for a URL with a random key, which keeps other users of this computer out.
    pub key: bool,
    /// Changes that it accepts.
    pub changes: Changes,
    /// Longest body of a request, bytes.
    pub body_bytes: usize,
}

impl Access {
    /// Returns the access to a page on this computer, with a key and without changes.
    pub fn loopback(port: u16) -> Self {
        Self::at(SocketAddr::from((Ipv4Addr::LOCALHOST, port)))
    }

    /// Returns the same for any interface.
    pub fn at(address: SocketAddr) -> Self {
        Self { address, key: true, changes: Changes::Refused, body_bytes: 16 << 10 }
    }

    /// Allows changes.
    #[must_use]
    pub fn with_changes(mut self, changes: Changes) -> Self {
        self.changes = changes;
        self
    }
}

/// Content of a server.
pub trait Site: Send + Sync + 'static {
    /// Answers a request that has passed all checks. The path is the part after the key, without
    /// the leading slash and with the query. A `HEAD` is answered like a `GET`, but the server does
    /// not send the body.
    fn answer(&self, request: &Request, path: &str) -> Response;
}

impl<F: Fn(&Request, &str) -> Response + Send + Sync + 'static> Site for F {
    fn answer(&self, request: &Request, path: &str) -> Response {
        self(request, path)
    }
}

/// Server that listens.
pub struct Server {
    listener: TcpListener,
    guard: Arc<Guard>,
}

/// Conditions on a request.
#[derive(Debug)]
struct Guard {
    bound: SocketAddr,
    token: Option<String>,
    changes: Changes,
    body_bytes: usize,
    limits: Limits,
}

impl Server {
    /// Listens; requests wait until [`Server::serve`] answers them.
    ///
    /// # Errors
    /// A port that is in use, an interface that this computer does not have, or a system without a
    /// source of random numbers.
    pub fn open(access: Access) -> io::Result<Self> {
        let listener = TcpListener::bind(access.address)?;
        listener.set_nonblocking(true)?;
        let token = access.key.then(random_token).transpose()?;
        let Access { changes, body_bytes, .. } = access;
        let limits = Limits::default();
        let guard = Guard { bound: listener.local_addr()?, token, changes, body_bytes, limits };
        Ok(Self { listener, guard: Arc::new(guard) })
    }

    /// Returns the URL to open, with the key. For a server on all interfaces it is the URL that
    /// works on this computer.
    pub fn address(&self) -> String {
        let mut at = self.guard.bound;
        if at.ip().is_unspecified() {
            let is_v4 = at.is_ipv4();
            at.set_ip(if is_v4 {
                Ipv4Addr::LOCALHOST.into()
            } else {
                "::1".parse().unwrap_or(at.ip())
            });
        }
        match &self.guard.token {
            Some(token) => format!("http://{at}/{token}/"),
            None => format!("http://{at}/"),
        }
    }

    /// Returns interface and port.
    pub fn bound(&self) -> SocketAddr {
        self.guard.bound
    }

    /// Answers requests until `stop` returns true, which is called at least 50 times a second; then
    /// waits up to a second for answers that are still being sent.
    pub fn serve<S: Site>(&self, site: &Arc<S>, stop: impl Fn() -> bool) {
        self.serve_with(site, start_thread, stop);
    }

    fn serve_with<S: Site>(&self, site: &Arc<S>, start: StartThread, stop: impl Fn() -> bool) {
        let mut connections = Connections::new(&self.guard, site, start);
        while !stop() {
            let has_new = connections.accept(&self.listener);
            if !connections.turn() && !has_new {
                thread::sleep(PAUSE);
            }
        }
        connections.close_unread();
        let end = Instant::now();
        while !connections.is_empty() && end.elapsed() < FAREWELL {
            if !connections.turn() {
                thread::sleep(PAUSE);
            }
        }
    }
}

/// Starts a thread for an answer.
fn start_thread(work: Box<dyn FnOnce() + Send>) -> io::Result<()> {
    thread::Builder::new().name("answer".into()).spawn(work).map(drop)
}

impl Guard {
    fn answer(&self, request: &Request, site: &impl Site) -> Response {
        match self.admit(request) {
            Ok(path) => site.answer(request, path),
            Err(refusal) => refusal,
        }
    }

    /// Returns the path after the key, if the request may be answered.
    fn admit<'a>(&self, request: &'a Request) -> Result<&'a str, Response> {
        fn refuse(why: &str) -> Result<&str, Response> {
            Err(Response::refusal(403, why))
        }

        let host = request.header("host").unwrap_or_default();
        if !self.is_own(host) {
            return refuse("the host is not this server; open its address as numbers");
        }
        let is_change = request.method == "POST";
        let needs_origin = is_change && self.changes != Changes::FromPrograms;
        // If a browser sends the request, its page must have exactly this address.
        let is_foreign = match request.header("origin") {
            Some(origin) => origin.strip_prefix("http://") != Some(host),
            None => needs_origin,
        };
        if is_foreign {
            return refuse("the request comes from another page");
        }
        let Some(path) = self.behind_key(&request.path) else {
            return refuse("open the address with the key that the program printed");
        };
        self.check_method(request, is_change)?;
        Ok(path)
    }

    fn check_method(&self, request: &Request, is_change: bool) -> Result<(), Response> {
        if !is_change {
            let is_read = request.is_read();
            let refusal = Response::refusal(405, "only GET and POST are supported");
            return if is_read { Ok(()) } else { Err(refusal) };
        }
        if self.changes == Changes::Refused {
            return Err(Response::refusal(405, "nothing can be changed here"));
        }
        let kind = request.header("content-type").unwrap_or_default();
        match kind.split(';').next().map(str::trim) {
            Some("application/json") => Ok(()),
            _ => Err(Response::refusal(415, "changes are application/json")),
        }
    }

    /// Returns true for a name of this server. A foreign page could have its own host name resolve
    /// to this computer, but it cannot do so for a numeric address.
    fn is_own(&self, host: &str) -> bool {
        let port = self.bound.port();
        if host == format!("localhost:{port}") {
            return true;
        }
        let Ok(named) = host.parse::<SocketAddr>() else { return false };
        let is_reached = match self.bound.ip() {
            ip if ip.is_unspecified() => true,
            ip => same_host(ip, named.ip()),
        };
        named.port() == port && is_reached
    }

    fn behind_key<'a>(&self, path: &'a str) -> Option<&'a str> {
        let inside = path.strip_prefix('/')?;
        let Some(token) = &self.token else { return Some(inside) };
        let (key, path) = inside.split_once('/')?;
        same(key, token).then_some(path)
    }
}

/// Returns true for two names of one interface.
fn same_host(bound: IpAddr, named: IpAddr) -> bool {
    bound == named || (bound.is_loopback() && named.is_loopback())
}

/// Compares two texts in a time that does not depend on where they differ.
fn same(a: &str, b: &str) -> bool {
    let differences = a.bytes().zip(b.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    a.len() == b.len() && differences == 0
}

/// Returns 128 random bits from the system, in hexadecimal.
fn random_token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)
        .map_err(|error| io::Error::other(format!("no random numbers: {error}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests;
