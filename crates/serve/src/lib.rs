//! A server of pages and answers for this computer, as small as that can be.
//!
//! A [`Site`] turns a [`Request`] into a [`Response`]; [`Server`] does the rest: it listens on the
//! loopback interface unless told otherwise, checks where a request comes from ([`Access`]), bounds
//! the length of requests, the time that they take and the number of connections, and ends when it
//! is told to. A request that is whole has a thread; a site that is slow holds up that request
//! alone. Clients that are slow to send or to read hold up no other: one thread looks after all of
//! them, and where there are too many, the one that has waited longest is closed. Where the system
//! starts no more threads, requests are answered one after the other.
//!
//! ```
//! use std::sync::Arc;
//! use tagalong_serve::{Access, Request, Response, Server};
//!
//! let server = Server::open(Access::loopback(0)).unwrap();
//! let site = |request: &Request, path: &str| match (request.is_read(), path) {
//!     (true, "healthz") => Response::ok("application/json", "{}"),
//!     _ => Response::not_found(),
//! };
//! println!("{}", server.address());
//! server.serve(&Arc::new(site), || true); // a real one asks for a signal
//! ```
//!
//! # Which requests are answered
//!
//! Any page that a browser shows may send requests to this computer. So
//! * the `Host` must be the address of the server: a number, or `localhost`. A foreign name that
//!   resolves to this computer (DNS rebinding) is refused with 403;
//! * the `Origin`, where there is one, must be the server itself;
//! * a change (`POST`) is refused with 405 unless [`Access::changes`] allows it, and must then be
//!   `application/json`, which no form of another page can send;
//! * with [`Access::key`], the address begins with 128 random bits that are new at each start.

mod http;
mod server;

pub use http::{Request, Response};
pub use server::{Access, Changes, Server, Site};
