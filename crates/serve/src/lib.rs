//! A small HTTP server of pages for this computer.
//!
//! A [`Site`] turns a [`Request`] into a [`Response`]; [`Server`] does the rest: it listens on the
//! loopback interface by default, checks the origin of requests ([`Access`]), limits the length of
//! requests, their time and the number of connections, and ends on request. Each complete request
//! has a thread, so that a slow site only delays that request. Clients that send or read slowly do
//! not delay others: one thread serves all of them, and if there are too many, the connection that
//! has waited longest is closed. If the system starts no more threads, requests are answered one
//! after the other.
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
//! Any page in a browser may send requests to this computer. Therefore
//! * the `Host` must be the address of the server: a numeric address, or `localhost`. A foreign
//!   name that resolves to this computer (DNS rebinding) is refused with 403;
//! * the `Origin`, if there is one, must be the server itself;
//! * a change (`POST`) is refused with 405 unless [`Access::changes`] allows it, and must then be
//!   `application/json`, which no form of another page can send;
//! * with [`Access::key`], the address begins with 128 random bits that are new at each start.

mod http;
mod server;

pub use http::{Request, Response};
pub use server::{Access, Changes, Server, Site};
