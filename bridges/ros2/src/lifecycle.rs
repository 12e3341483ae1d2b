//! The node as a managed node (`lifecycle_msgs`): its services and its topic of transitions.
//!
//! The services have their own threads. There a request is checked against the state, and one that
//! ends the work stops the robot at once, even while a frame takes long; the thread that owns the
//! pipeline then carries it out and answers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ros2_client::{Message, Publisher};
use serde::{Deserialize, Serialize};

use crate::BridgeError;
use crate::network::{Ear, Network};
use crate::services::{Middleware, serve};
use crate::skill::NOT_ACTIVE;
use crate::stamps::system_time;
use crate::wheels::SwitchHandle;

mod graph;

pub(crate) use graph::{
    ACTIVATE, ACTIVATING, ACTIVE, CLEANING_UP, CONFIGURE, CONFIGURING, DEACTIVATE, DEACTIVATING,
    Ending, INACTIVE, NodeState, SHUTTING_DOWN, Transition, UNCONFIGURED,
};
use graph::{STATES, TRANSITIONS};

/// Maximum time for a transition before the caller gets a refusal; a pipeline that is stuck in a
/// frame completes the transition afterwards.
const PATIENCE: Duration = Duration::from_secs(4);

/// `lifecycle_msgs/State`, and `lifecycle_msgs/Transition`, which has the same fields.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Named {
    id: u8,
    label: String,
}

/// Request without fields, which is one byte in DDS.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct NoRequest {
    structure_needs_at_least_one_member: u8,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct GetStateResponse {
    current_state: Named,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct ChangeStateRequest {
    transition: Named,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct ChangeStateResponse {
    success: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct AvailableStates {
    states: Vec<Named>,
}

/// `lifecycle_msgs/TransitionDescription`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    transition: Named,
    start_state: Named,
    goal_state: Named,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct AvailableTransitions {
    transitions: Vec<Description>,
}

/// `lifecycle_msgs/TransitionEvent`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct TransitionEvent {
    /// Time, ns.
    timestamp: u64,
    description: Description,
}

impl Message for NoRequest {}
impl Message for GetStateResponse {}
impl Message for ChangeStateRequest {}
impl Message for ChangeStateResponse {}
impl Message for AvailableStates {}
impl Message for AvailableTransitions {}

impl From<NodeState> for Named {
    fn from(NodeState { id, label }: NodeState) -> Self {
        Self { id, label: label.to_owned() }
    }
}

impl From<Transition> for Description {
    fn from(Transition { id, label, start, goal }: Transition) -> Self {
        let transition = Named { id, label: label.to_owned() };
        Self { transition, start_state: start.into(), goal_state: goal.into() }
    }
}

/// Transition that a caller requested, with the channel for the answer.
pub(crate) struct Order {
    pub(crate) transition: Transition,
    answer: SyncSender<bool>,
}

impl Order {
    /// Tells the caller whether the transition succeeded.
    pub(crate) fn answer(self, success: bool) {
        // If the caller has timed out, the answer is not needed.
        let _gone = self.answer.send(success);
    }
}

/// State of the node, for the thread that owns the pipeline.
pub(crate) struct Lifecycle {
    desk: Arc<StateDesk>,
    orders: Receiver<Order>,
    events: Publisher<TransitionEvent>,
}

/// State that is shared by the threads of the services.
struct StateDesk {
    state: Mutex<NodeState>,
    /// Switch of the wheels; `None` without wheels.
    switch: Mutex<Option<SwitchHandle>>,
    orders: SyncSender<Order>,
    /// True while an order waits, until its owner takes it.
    is_asked: AtomicBool,
}

impl Lifecycle {
    /// Offers the services and the topic of a managed node.
    ///
    /// # Errors
    /// [`BridgeError::Network`] and [`BridgeError::Thread`].
    pub(crate) fn offer(
        network: &mut Network,
        middleware: Middleware,
    ) -> Result<(Self, Vec<Ear>), BridgeError> {
        let event = "lifecycle_msgs/msg/TransitionEvent";
        let events = network.event_publisher("tagalong/transition_event", event)?;
        let (orders, waiting) = sync_channel(1);
        let desk = Arc::new(StateDesk {
            state: Mutex::new(UNCONFIGURED),
            switch: Mutex::new(None),
            orders,
            is_asked: AtomicBool::new(false),
        });
        let mapping = middleware.mapping();
        let mut ears = Vec::new();

        let name = "tagalong/get_state";
        let server = network.server(name, "lifecycle_msgs/srv/GetState", mapping)?;
        let theirs = Arc::clone(&desk);
        ears.push(serve(name, server, move |_: NoRequest| {
            let current_state = theirs.state().into();
            GetStateResponse { current_state }
        })?);
        let name = "tagalong/change_state";
        let server = network.server(name, "lifecycle_msgs/srv/ChangeState", mapping)?;
        let theirs = Arc::clone(&desk);
        ears.push(serve(name, server, move |request: ChangeStateRequest| {
            let success = theirs.change(request.transition.id, &request.transition.label);
            ChangeStateResponse { success }
        })?);
        let name = "tagalong/get_available_states";
        let server = network.server(name, "lifecycle_msgs/srv/GetAvailableStates", mapping)?;
        ears.push(serve(name, server, |_: NoRequest| {
            let states = STATES.into_iter().map(Named::from).collect();
            AvailableStates { states }
        })?);
        let name = "tagalong/get_available_transitions";
        let kind = "lifecycle_msgs/srv/GetAvailableTransitions";
        let server = network.server(name, kind, mapping)?;
        let theirs = Arc::clone(&desk);
        ears.push(serve(name, server, move |_: NoRequest| {
            let transitions = theirs.state().transitions().map(Description::from).collect();
            AvailableTransitions { transitions }
        })?);
        let name = "tagalong/get_transition_graph";
        let server = network.server(name, kind, mapping)?;
        ears.push(serve(name, server, |_: NoRequest| {
            let transitions = TRANSITIONS.into_iter().map(Description::from).collect();
            AvailableTransitions { transitions }
        })?);
        Ok((Self { desk, orders: waiting, events }, ears))
    }

    /// Returns the state.
    pub(crate) fn state(&self) -> NodeState {
        self.desk.state()
    }

    /// Returns true if an order waits.
    pub(crate) fn is_asked(&self) -> bool {
        self.desk.is_asked.load(Ordering::Relaxed)
    }

    /// Returns the transition that a caller requests within `patience`, if any.
    pub(crate) fn next_order(&self, patience: Duration) -> Option<Order> {
        self.desk.is_asked.store(false, Ordering::Relaxed);
        // The desk holds a sender for the lifetime of this value, so the channel cannot be closed.
        self.orders.recv_timeout(patience).ok()
    }

    /// Sets the switch that is latched by a request to end the work.
    pub(crate) fn set_switch(&self, switch: Option<SwitchHandle>) {
        *self.desk.switch() = switch;
    }

    /// Starts a transition.
    pub(crate) fn begin(&self, transition: Transition) {
        if transition.stops() {
            self.desk.halt();
        }
        self.pass(transition);
    }

    /// Ends the transition that was started; returns the new state.
    pub(crate) fn end(&self, ending: Ending) -> NodeState {
        if let Some(transition) = self.state().ended(ending) {
            self.pass(transition);
        }
        self.state()
    }

    fn pass(&self, transition: Transition) {
        *self.desk.lock() = transition.goal;
        let timestamp = system_time().nanos();
        let description = transition.into();
        // The publisher does not wait for subscribers.
        let _lost = self.events.publish(TransitionEvent { timestamp, description });
    }
}

impl StateDesk {
    fn lock(&self) -> MutexGuard<'_, NodeState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn state(&self) -> NodeState {
        *self.lock()
    }

    fn switch(&self) -> MutexGuard<'_, Option<SwitchHandle>> {
        self.switch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn halt(&self) {
        if let Some(switch) = &*self.switch() {
            switch.halt(NOT_ACTIVE);
        }
    }

    /// Requests a transition and waits for its end; returns true if it succeeded.
    fn change(&self, id: u8, label: &str) -> bool {
        let Some(transition) = self.state().asked_for(id, label) else { return false };
        if transition.stops() {
            self.halt();
        }
        let (answer, answered) = sync_channel(1);
        let is_taken = self.orders.try_send(Order { transition, answer }).is_ok();
        // Set after the order was sent, so that the order is there when the flag is seen.
        self.is_asked.store(true, Ordering::Relaxed);
        is_taken && answered.recv_timeout(PATIENCE).unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    fn desk() -> (Arc<StateDesk>, Receiver<Order>) {
        let (orders, waiting) = sync_channel(1);
        let desk = StateDesk {
            state: Mutex::new(UNCONFIGURED),
            switch: Mutex::new(None),
            orders,
            is_asked: AtomicBool::new(false),
        };
        (Arc::new(desk), waiting)
    }

    #[test]
    fn a_request_waits_for_the_end_of_its_transition() {
        let (desk, orders) = desk();
        let owner = thread::spawn(move || {
            let order = orders.recv().unwrap();
            let transition = order.transition;
            order.answer(true);
            (transition, orders)
        });
        assert!(desk.change(0, "configure"));
        let (transition, orders) = owner.join().unwrap();
        assert_eq!(transition, CONFIGURE);
        assert!(!desk.change(3, ""), "not from here");
        drop(orders);
        assert!(!desk.change(1, ""), "the node ends");
    }
}
