//! A run of the node: its lifecycle states, and the bridge while it is active.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tagalong::config::Registry;
use tagalong_view::Live;

use crate::bridge::{Bridge, Callers, Surroundings, TURN};
use crate::http::HttpServer;
use crate::inbox::Inbox;
use crate::lifecycle::{
    ACTIVATE, ACTIVATING, ACTIVE, CLEANING_UP, CONFIGURE, CONFIGURING, DEACTIVATE, DEACTIVATING,
    Ending, INACTIVE, Lifecycle, Order, SHUTTING_DOWN, Transition,
};
use crate::listen::listen;
use crate::network::{Ear, Network};
use crate::options::Setup;
use crate::skill::Desk;
use crate::stamps::StampClock;
use crate::summary::Summary;
use crate::{BridgeError, Options};

/// Runs the bridge until `stop` is set, with the plugins of the catalog. `tell` receives log
/// messages.
///
/// # Errors
/// [`BridgeError`]. The robot is told to stop in any case.
pub fn run(
    options: &Options,
    stop: &AtomicBool,
    tell: &dyn Fn(&str),
) -> Result<Summary, BridgeError> {
    let registry = tagalong::builtin_registry();
    run_with(options, &registry, stop, tell)
}

/// Runs the bridge as [`run`] does, with these plugins.
///
/// # Errors
/// [`BridgeError`]. The robot is told to stop in any case.
pub fn run_with(
    options: &Options,
    registry: &Registry,
    stop: &AtomicBool,
    tell: &dyn Fn(&str),
) -> Result<Summary, BridgeError> {
    // Done first, so that an error in the config ends the program at once.
    let setup = options.setup(registry)?;
    // Before the network, so that a port that is in use ends the program at once.
    let live = options.serve.map(|at| serve(at, options, &setup, registry, tell)).transpose()?;
    let (desk, requests) = Desk::new();
    // Before the topics are there, so that a supervisor can query the state of the bridge.
    let http = options.http.map(|address| HttpServer::start(address, desk.clone())).transpose()?;
    if let Some(http) = &http {
        tell(&format!("answers at {}", http.address()));
    }
    let mut network = Network::join(options.domain, &options.namespace)?;
    let (lifecycle, ears) = Lifecycle::offer(&mut network, options.rmw)?;
    let inbox = Arc::new(Inbox::default());
    let clock = Arc::new(StampClock::new(options.clock));
    let callers = Callers { desk: desk.clone(), requests };
    let surroundings = Surroundings { network, inbox, clock, callers, live };
    let mut node = Node {
        options,
        registry,
        stop,
        tell,
        lifecycle,
        desk,
        body: Body::Bare(surroundings),
        checked: Some(setup),
        summary: Summary::default(),
    };
    let ended = node.live();
    node.shut_down();
    let Node { body, summary, .. } = node;
    if let Body::Bare(Surroundings { live, network, .. }) = body {
        if let Some(live) = live {
            live.finish("The bridge has ended.");
        }
        drop((ears, http));
        drop(network);
    }
    ended.map(|()| summary)
}

/// Starts serving the live page.
fn serve(
    at: SocketAddr,
    options: &Options,
    setup: &Setup,
    registry: &Registry,
    tell: &dyn Fn(&str),
) -> Result<Live, BridgeError> {
    let config = setup.pipeline.config().values();
    let name = options.config.file_stem().unwrap_or_default().to_string_lossy();
    let input = format!("ROS domain {}", options.domain);
    let live = Live::start(at, &name, &input, config, registry);
    let live = live.map_err(|error| BridgeError::Serve(at, error))?;
    tell(&format!(
        "live: open {} in a browser; anyone with this address sees the page",
        live.address()
    ));
    Ok(live)
}

/// Parts of the node that exist in its present state.
enum Body {
    /// Only the connection to the network.
    Bare(Surroundings),
    /// A pipeline whose inputs are not there yet, or are not waited for yet.
    Configured(Surroundings, Box<Setup>),
    /// A bridge with its subscriptions.
    Working(Box<Bridge>, Vec<Ear>),
    /// Placeholder between two states, and after a failure to leave one.
    Gone,
}

/// A managed node.
struct Node<'a> {
    options: &'a Options,
    registry: &'a Registry,
    stop: &'a AtomicBool,
    tell: &'a dyn Fn(&str),
    lifecycle: Lifecycle,
    desk: Desk,
    body: Body,
    /// Config that was checked before the node joined the network, for the first use.
    checked: Option<Setup>,
    summary: Summary,
}

impl Node<'_> {
    /// Passes through the states until the program ends.
    fn live(&mut self) -> Result<(), BridgeError> {
        if self.options.lifecycle {
            self.show_state();
            (self.tell)("unconfigured: a manager has to configure and to activate the node");
        } else {
            self.pass(CONFIGURE);
            self.pass(ACTIVATE);
        }
        while !self.stop.load(Ordering::Relaxed) {
            let is_active = self.lifecycle.state() == ACTIVE;
            let patience = if is_active { Duration::ZERO } else { TURN };
            if let Some(order) = self.lifecycle.next_order(patience) {
                self.carry_out(order);
            } else if is_active && let Err(error) = self.work() {
                self.fail(error)?;
            }
        }
        Ok(())
    }

    /// Carries out a transition that a caller requested.
    fn carry_out(&mut self, order: Order) {
        // The state may have changed in the meantime because of an error.
        let is_current = order.transition.start == self.lifecycle.state();
        let success = is_current && self.pass(order.transition) == Ending::Success;
        order.answer(success);
    }

    /// Passes through a transition.
    fn pass(&mut self, transition: Transition) -> Ending {
        self.lifecycle.begin(transition);
        let ending = match transition.goal {
            CONFIGURING => self.configure(),
            ACTIVATING => self.activate(),
            DEACTIVATING => {
                self.rest();
                Ending::Success
            }
            CLEANING_UP | SHUTTING_DOWN => {
                self.dismantle();
                Ending::Success
            }
            _ => Ending::Failure,
        };
        let state = self.lifecycle.end(ending);
        self.show_state();
        // A node that manages itself reports what it does, but not that it may be activated.
        if self.options.lifecycle || ![INACTIVE, ACTIVE].contains(&state) {
            (self.tell)(&format!("{}: {}", transition.label, state.label));
        }
        ending
    }

    /// Publishes the state for callers; requests are rejected until the bridge works.
    fn show_state(&self) {
        self.desk.close(self.lifecycle.state().label);
    }

    fn configure(&mut self) -> Ending {
        let setup = match self.checked.take().map_or_else(|| self.options.setup(self.registry), Ok)
        {
            Ok(setup) => setup,
            Err(error) => {
                (self.tell)(&format!("not configured: {error}"));
                return Ending::Failure;
            }
        };
        self.body = match std::mem::replace(&mut self.body, Body::Gone) {
            Body::Bare(surroundings) => Body::Configured(surroundings, Box::new(setup)),
            body => body,
        };
        Ending::Success
    }

    fn activate(&mut self) -> Ending {
        if let Body::Working(bridge, _) = &mut self.body {
            bridge.resume(self.tell);
        }
        Ending::Success
    }

    /// Stops the robot; the bridge is kept.
    fn rest(&mut self) {
        if let Body::Working(bridge, _) = &mut self.body {
            bridge.rest();
        }
    }

    /// Stops the robot and takes the bridge down.
    fn dismantle(&mut self) {
        self.lifecycle.set_switch(None);
        self.body = match std::mem::replace(&mut self.body, Body::Gone) {
            Body::Configured(surroundings, _) => Body::Bare(surroundings),
            Body::Working(bridge, ears) => {
                let (summary, surroundings) = bridge.finish();
                self.summary.add(summary);
                drop(ears);
                Body::Bare(surroundings)
            }
            body => body,
        };
    }

    /// Waits for the inputs, and works until the end or the next transition.
    fn work(&mut self) -> Result<(), BridgeError> {
        let Self { options, stop, tell, lifecycle, .. } = self;
        let is_over = || stop.load(Ordering::Relaxed) || lifecycle.is_asked();
        if let Body::Configured(surroundings, setup) = &mut self.body {
            let Some((source, mut ears)) = listen(options, setup, surroundings, &is_over, tell)?
            else {
                return Ok(());
            };
            let Body::Configured(surroundings, setup) =
                std::mem::replace(&mut self.body, Body::Gone)
            else {
                return Ok(());
            };
            let mut bridge = Bridge::new(options, *setup, source, surroundings)?;
            ears.extend(bridge.listen_to_switch()?);
            ears.extend(bridge.offer_services()?);
            bridge.tell_topics(tell);
            lifecycle.set_switch(bridge.switch());
            self.body = Body::Working(Box::new(bridge), ears);
        }
        match &mut self.body {
            Body::Working(bridge, _) => bridge.work(&is_over, tell),
            _ => Ok(()),
        }
    }

    /// Stops the robot after an error: a managed node is then unconfigured, another node ends.
    fn fail(&mut self, error: BridgeError) -> Result<(), BridgeError> {
        self.lifecycle.begin(DEACTIVATE);
        self.lifecycle.end(Ending::Error);
        self.dismantle();
        let is_whole = matches!(self.body, Body::Bare(_));
        let ending = if is_whole { Ending::Success } else { Ending::Failure };
        self.lifecycle.end(ending);
        self.show_state();
        if !self.options.lifecycle || !is_whole {
            return Err(error);
        }
        (self.tell)(&format!("error: {error}"));
        (self.tell)(&format!(
            "{}: configure and activate the node again",
            self.lifecycle.state().label
        ));
        Ok(())
    }

    /// Shuts the node down.
    fn shut_down(&mut self) {
        if let Some(transition) = self.lifecycle.state().shutdown() {
            self.lifecycle.begin(transition);
            self.dismantle();
            self.lifecycle.end(Ending::Success);
        }
        self.dismantle();
    }
}
