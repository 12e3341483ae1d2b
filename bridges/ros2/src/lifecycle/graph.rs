//! States and transitions of a managed node, with the numbers and names of `lifecycle_msgs` and
//! `rcl_lifecycle`.

/// State of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NodeState {
    pub(crate) id: u8,
    pub(crate) label: &'static str,
}

/// Transition between two states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Transition {
    pub(crate) id: u8,
    pub(crate) label: &'static str,
    pub(crate) start: NodeState,
    pub(crate) goal: NodeState,
}

/// End of the work of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Success,
    /// The node stays in the state from which the transition started, or in the one before it.
    Failure,
    Error,
}

const fn state(id: u8, label: &'static str) -> NodeState {
    NodeState { id, label }
}

pub(crate) const UNKNOWN: NodeState = state(0, "unknown");
pub(crate) const UNCONFIGURED: NodeState = state(1, "unconfigured");
pub(crate) const INACTIVE: NodeState = state(2, "inactive");
pub(crate) const ACTIVE: NodeState = state(3, "active");
pub(crate) const FINALIZED: NodeState = state(4, "finalized");
pub(crate) const CONFIGURING: NodeState = state(10, "configuring");
pub(crate) const CLEANING_UP: NodeState = state(11, "cleaningup");
pub(crate) const SHUTTING_DOWN: NodeState = state(12, "shuttingdown");
pub(crate) const ACTIVATING: NodeState = state(13, "activating");
pub(crate) const DEACTIVATING: NodeState = state(14, "deactivating");
pub(crate) const ERROR_PROCESSING: NodeState = state(15, "errorprocessing");

/// All states.
pub(crate) const STATES: [NodeState; 11] = [
    UNKNOWN,
    UNCONFIGURED,
    INACTIVE,
    ACTIVE,
    FINALIZED,
    CONFIGURING,
    CLEANING_UP,
    SHUTTING_DOWN,
    ACTIVATING,
    DEACTIVATING,
    ERROR_PROCESSING,
];

const fn step(id: u8, label: &'static str, start: NodeState, goal: NodeState) -> Transition {
    Transition { id, label, start, goal }
}

pub(crate) const CONFIGURE: Transition = step(1, "configure", UNCONFIGURED, CONFIGURING);
pub(crate) const CLEAN_UP: Transition = step(2, "cleanup", INACTIVE, CLEANING_UP);
pub(crate) const ACTIVATE: Transition = step(3, "activate", INACTIVE, ACTIVATING);
pub(crate) const DEACTIVATE: Transition = step(4, "deactivate", ACTIVE, DEACTIVATING);

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";
const ERROR: &str = "transition_error";

/// All transitions: first those that a caller may request, then those that end them.
pub(crate) const TRANSITIONS: [Transition; 25] = [
    CONFIGURE,
    CLEAN_UP,
    ACTIVATE,
    DEACTIVATE,
    step(5, "shutdown", UNCONFIGURED, SHUTTING_DOWN),
    step(6, "shutdown", INACTIVE, SHUTTING_DOWN),
    step(7, "shutdown", ACTIVE, SHUTTING_DOWN),
    step(10, SUCCESS, CONFIGURING, INACTIVE),
    step(11, FAILURE, CONFIGURING, UNCONFIGURED),
    step(12, ERROR, CONFIGURING, ERROR_PROCESSING),
    step(20, SUCCESS, CLEANING_UP, UNCONFIGURED),
    step(21, FAILURE, CLEANING_UP, INACTIVE),
    step(22, ERROR, CLEANING_UP, ERROR_PROCESSING),
    step(30, SUCCESS, ACTIVATING, ACTIVE),
    step(31, FAILURE, ACTIVATING, INACTIVE),
    step(32, ERROR, ACTIVATING, ERROR_PROCESSING),
    step(40, SUCCESS, DEACTIVATING, INACTIVE),
    step(41, FAILURE, DEACTIVATING, ACTIVE),
    step(42, ERROR, DEACTIVATING, ERROR_PROCESSING),
    step(50, SUCCESS, SHUTTING_DOWN, FINALIZED),
    step(51, FAILURE, SHUTTING_DOWN, FINALIZED),
    step(52, ERROR, SHUTTING_DOWN, ERROR_PROCESSING),
    step(60, SUCCESS, ERROR_PROCESSING, UNCONFIGURED),
    step(61, FAILURE, ERROR_PROCESSING, FINALIZED),
    step(62, ERROR, ERROR_PROCESSING, FINALIZED),
];

impl NodeState {
    /// Returns the transitions that start in this state.
    pub(crate) fn transitions(self) -> impl Iterator<Item = Transition> {
        TRANSITIONS.into_iter().filter(move |transition| transition.start == self)
    }

    /// Returns true for a state in which the node waits for a caller.
    fn is_at_rest(self) -> bool {
        [UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED].contains(&self)
    }

    /// Returns the transition from this state that a caller requests by its label, or by its ID if
    /// the label is empty: `ros2 service call` with only a label sends the ID 0.
    pub(crate) fn asked_for(self, id: u8, label: &str) -> Option<Transition> {
        if !self.is_at_rest() {
            return None;
        }
        self.transitions().find(|transition| {
            if label.is_empty() { transition.id == id } else { transition.label == label }
        })
    }

    /// Returns the transition that ends the work of this state.
    pub(crate) fn ended(self, ending: Ending) -> Option<Transition> {
        let label = match ending {
            Ending::Success => SUCCESS,
            Ending::Failure => FAILURE,
            Ending::Error => ERROR,
        };
        self.transitions().find(|transition| transition.label == label)
    }

    /// Returns the transition on the way to the end of the node; `None` at the end.
    pub(crate) fn shutdown(self) -> Option<Transition> {
        self.transitions().find(|transition| transition.goal == SHUTTING_DOWN)
    }
}

impl Transition {
    /// Returns true if the robot is at rest once the transition has begun.
    pub(crate) fn stops(self) -> bool {
        [CLEANING_UP, DEACTIVATING, SHUTTING_DOWN].contains(&self.goal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caller_asks_by_label_or_by_number_and_only_for_what_starts_here() {
        assert_eq!(UNCONFIGURED.asked_for(1, ""), Some(CONFIGURE));
        assert_eq!(UNCONFIGURED.asked_for(0, "configure"), Some(CONFIGURE));
        assert_eq!(UNCONFIGURED.asked_for(3, ""), None, "not before it is configured");
        assert_eq!(INACTIVE.asked_for(3, ""), Some(ACTIVATE));
        assert_eq!(ACTIVE.asked_for(3, "deactivate"), Some(DEACTIVATE), "the label counts");
        for (state, id) in [(UNCONFIGURED, 5), (INACTIVE, 6), (ACTIVE, 7)] {
            assert_eq!(state.asked_for(0, "shutdown").map(|found| found.id), Some(id));
            assert_eq!(state.shutdown().map(|found| found.id), Some(id));
        }
        assert_eq!(FINALIZED.asked_for(0, "shutdown"), None);
        assert_eq!(CONFIGURING.asked_for(10, ""), None, "the end of a transition is no request");
    }

    #[test]
    fn each_transition_ends_where_its_ending_says() {
        for (state, goals) in [
            (CONFIGURING, Some([INACTIVE, UNCONFIGURED, ERROR_PROCESSING])),
            (ACTIVATING, Some([ACTIVE, INACTIVE, ERROR_PROCESSING])),
            (DEACTIVATING, Some([INACTIVE, ACTIVE, ERROR_PROCESSING])),
            (CLEANING_UP, Some([UNCONFIGURED, INACTIVE, ERROR_PROCESSING])),
            (SHUTTING_DOWN, Some([FINALIZED, FINALIZED, ERROR_PROCESSING])),
            (ERROR_PROCESSING, Some([UNCONFIGURED, FINALIZED, FINALIZED])),
            (ACTIVE, None),
        ] {
            let ended = [Ending::Success, Ending::Failure, Ending::Error]
                .map(|ending| state.ended(ending).map(|transition| transition.goal));
            assert_eq!(ended, goals.map_or([None; 3], |goals| goals.map(Some)), "{state:?}");
        }
    }

    #[test]
    fn what_leaves_the_active_state_stops_the_robot() {
        assert!(ACTIVE.transitions().all(Transition::stops));
        assert!(!CONFIGURE.stops() && !ACTIVATE.stops() && CLEAN_UP.stops());
    }
}
