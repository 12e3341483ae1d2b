//! The page of a live run, for `tagalong run --serve` and the bridges.
//!
//! [`Live::offer`] replaces the newest frame and returns at once; separate threads answer browsers,
//! and encode an image only when a browser requests it. Therefore a slow, silent or absent browser
//! does not delay the pipeline: it gets fewer frames, and no frame waits for it. Nothing can be
//! changed through the page.

mod newest;
mod site;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::page::html::Heading;
use nalgebra::Isometry2;
use tagalong_app::remedies::Remedies;
use tagalong_config::Registry;
use tagalong_core::Frame;
use tagalong_pipeline::FrameReport;
use tagalong_serve::{Access, Server};
use toml::Table;

use crate::live::newest::Newest;
use crate::live::site::Page;

/// Time after the end during which browsers are informed of it.
const FAREWELL: Duration = Duration::from_millis(400);

/// Server of the page of one run.
pub struct Live {
    newest: Arc<Newest>,
    address: String,
    bound: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Live {
    /// Starts the server. `name` is that of the pipeline, `input` that of the log or the robot, and
    /// `config` is the resolved config, whose settings the page quotes with the advice of its
    /// plugins.
    ///
    /// # Errors
    /// A port that is in use, or an interface that this computer does not have.
    pub fn start(
        at: SocketAddr,
        name: &str,
        input: &str,
        config: &Table,
        registry: &Registry,
    ) -> io::Result<Self> {
        let server = Server::open(Access::at(at))?;
        let address = server.address();
        let bound = server.bound();
        let heading = Heading {
            log: input.to_owned(),
            runs: vec![format!("{name}, as it happens")],
            notes: Vec::new(),
        };
        let newest = Arc::new(Newest::new(config.clone(), Remedies::new(registry)));
        let page =
            Page::new(&heading, name, config, Arc::clone(&newest)).map_err(io::Error::other)?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name("live page".into())
            .spawn(move || server.serve(&Arc::new(page), || stopped.load(Ordering::Relaxed)))?;
        Ok(Self { newest, address, bound, stop, thread: Some(thread) })
    }

    /// Returns the URL to open in a browser, which contains the key to the page.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns interface and port.
    pub fn bound(&self) -> SocketAddr {
        self.bound
    }

    /// Shows a frame until the next one. It never waits for a browser.
    pub fn offer(&self, frame: &Frame, odom_from_robot: &Isometry2<f64>, report: &FrameReport) {
        if report.outcome.is_processed() {
            self.newest.put(frame, odom_from_robot, report);
        }
    }

    /// Tells browsers with recent requests how the run ended, and stops the server.
    pub fn finish(mut self, ended: &str) {
        self.newest.end(ended);
        let start = Instant::now();
        while self.newest.is_watched() && start.elapsed() < FAREWELL {
            thread::sleep(Duration::from_millis(20));
        }
        self.close();
    }

    fn close(&mut self) {
        self.newest.end("The run has ended.");
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the server does not affect the run.
            let _ = thread.join();
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.close();
    }
}

/// Reads `PORT`, `ADDRESS` or `ADDRESS:PORT`; without an address it is only this computer, and
/// without a port a free one.
///
/// # Errors
/// A sentence with the supported forms.
pub fn parse_address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse() {
        return Ok((Ipv4Addr::LOCALHOST, port).into());
    }
    let bare = text.trim_start_matches('[').trim_end_matches(']');
    if let Ok(ip) = bare.parse() {
        return Ok(SocketAddr::new(ip, 0));
    }
    text.parse().map_err(|_| {
        "no address: give a port (8080), a number of an interface (192.0.2.7), or both \
         (192.0.2.7:8080, 0.0.0.0:8080 for all interfaces)"
            .to_owned()
    })
}

#[cfg(test)]
mod tests;
