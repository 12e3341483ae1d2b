//! Thread that publishes the state of the bridge, even while a frame takes long.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ros2_client::Publisher;
use tagalong::core::Input;
use tagalong::log::msgs::Header;
use tagalong::pipeline::Permission;

use crate::messages::{DiagnosticArray, DiagnosticStatus, KeyValue};
use crate::skill::STUCK;
use crate::stamps::StampClock;
use crate::{BridgeError, threads};

/// Time between two diagnostic messages.
const EACH: Duration = Duration::from_secs(1);
/// Time without a frame from which on the state is stale.
const STALE_AFTER: Duration = Duration::from_secs(1);

const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;
const STALE: u8 = 3;

/// State of the bridge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Status {
    /// Frames that the pipeline processed.
    pub(crate) frames: u64,
    /// Time since which the present frame has been in the pipeline.
    pub(crate) frame_since: Option<Instant>,
    /// Time of the last frame.
    pub(crate) heard: Instant,
    /// Permission to move; `None` without a controller.
    pub(crate) permission: Option<Permission>,
    /// Fault of the pipeline.
    pub(crate) fault: Option<&'static str>,
    /// Number of other command publishers.
    pub(crate) rivals: usize,
    /// Number of enable publishers.
    pub(crate) enable_publishers: usize,
    /// Number of enables and resets that were ignored because of their age.
    pub(crate) untimely: u64,
    /// Number of messages that could not be decoded.
    pub(crate) malformed: u64,
    /// Input that the last frame lacks.
    pub(crate) lacks: Option<Input>,
    /// True while the node is not active.
    pub(crate) is_resting: bool,
    /// State of Nav2's following server, if that drives.
    pub(crate) driver: Option<DriverState>,
}

/// State of Nav2's following server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DriverState {
    /// The server is not on the network.
    Missing,
    /// The server has not confirmed that it ends the goal.
    Unconfirmed,
    /// State of the goal in words.
    Goal(&'static str),
}

/// Publisher of the diagnostics; it ends when it is dropped.
pub(crate) struct Diagnostics {
    status: Arc<Mutex<Option<Status>>>,
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Diagnostics {
    /// Starts the thread.
    ///
    /// # Errors
    /// [`BridgeError::Thread`].
    pub(crate) fn start(
        publisher: Publisher<DiagnosticArray>,
        clock: Arc<StampClock>,
    ) -> Result<Self, BridgeError> {
        let status: Arc<Mutex<Option<Status>>> = Arc::default();
        let theirs = Arc::clone(&status);
        let (end, ended) = channel();
        let thread = threads::start("the diagnostics", move || {
            while ended.recv_timeout(EACH) == Err(RecvTimeoutError::Timeout) {
                let status = *theirs.lock().unwrap_or_else(PoisonError::into_inner);
                let header = Header::new(clock.now(), "");
                let status = status.map(|status| status.message(Instant::now()));
                let status = status.into_iter().collect();
                // The publisher does not wait for subscribers.
                let _lost = publisher.publish(DiagnosticArray { header, status });
            }
        })?;
        Ok(Self { status, end: Some(end), thread: Some(thread) })
    }

    /// Sets the state after an iteration of the loop.
    pub(crate) fn update(&self, status: Status) {
        *self.status.lock().unwrap_or_else(PoisonError::into_inner) = Some(status);
    }

    /// Notes that the node is not active.
    pub(crate) fn rest(&self) {
        if let Some(status) = &mut *self.status.lock().unwrap_or_else(PoisonError::into_inner) {
            status.is_resting = true;
            status.frame_since = None;
        }
    }

    /// Notes that the pipeline starts to process a frame.
    pub(crate) fn begin_frame(&self) {
        if let Some(status) = &mut *self.status.lock().unwrap_or_else(PoisonError::into_inner) {
            status.frame_since = Some(Instant::now());
        }
    }
}

impl Drop for Diagnostics {
    fn drop(&mut self) {
        self.end.take();
        self.thread.take().map(JoinHandle::join);
    }
}

impl Status {
    /// Returns the message at a time: its level is that of the most severe cause.
    fn message(&self, now: Instant) -> DiagnosticStatus {
        let (level, message) = self.worst(now);
        let values = [
            ("frames", self.frames.to_string()),
            ("enable", self.permission.map_or("no controller", Permission::cause).into()),
            ("driver", self.driver_name().into()),
            ("other publishers of commands", self.rivals.to_string()),
            ("publishers of the enable", self.enable_publishers.to_string()),
            ("enables and resets too old or ahead", self.untimely.to_string()),
            ("malformed messages", self.malformed.to_string()),
        ];
        DiagnosticStatus {
            level,
            name: "tagalong: follow".into(),
            message,
            hardware_id: "tagalong".into(),
            values: values.map(|(key, value)| KeyValue { key: key.into(), value }).into(),
        }
    }

    fn driver_name(&self) -> &'static str {
        match self.driver {
            None => "this node",
            Some(DriverState::Missing) => "Nav2: missing",
            Some(DriverState::Unconfirmed) => "Nav2: does not confirm that it stops",
            Some(DriverState::Goal(state)) => state,
        }
    }

    fn worst(&self, now: Instant) -> (u8, String) {
        if self.is_resting {
            return (OK, "the node is not active".into());
        }
        if self.driver == Some(DriverState::Unconfirmed) {
            return (ERROR, "Nav2 does not confirm that it stops".into());
        }
        let stuck_s = self.frame_since.map_or(Duration::ZERO, |since| now - since);
        if stuck_s > STUCK {
            return (ERROR, format!("one frame takes {:.1} s", stuck_s.as_secs_f64()));
        }
        if let Some(fault) = self.fault {
            return (ERROR, format!("fault: {fault}"));
        }
        if self.enable_publishers > 1 {
            let publishers = self.enable_publishers;
            return (ERROR, format!("{publishers} publishers of the enable: end all but one"));
        }
        if now.saturating_duration_since(self.heard) > STALE_AFTER {
            return (STALE, "no frames".into());
        }
        if let Some(input) = self.lacks {
            return (WARN, format!("the last frame has no {input}: the robot stands"));
        }
        match self.permission {
            _ if self.rivals > 0 => (WARN, "other nodes publish commands".into()),
            Some(Permission::Latched(cause)) => (WARN, cause.into()),
            _ if self.driver == Some(DriverState::Missing) => {
                (WARN, "no following server of Nav2".into())
            }
            _ if self.malformed > 0 => (WARN, "messages that do not decode".into()),
            Some(permission) if self.enable_publishers == 0 && !permission.is_granted() => {
                (OK, format!("{}: no node publishes the enable", permission.cause()))
            }
            Some(permission) => (OK, permission.cause().into()),
            None => (OK, "tracks people".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_cause_is_told() {
        let now = Instant::now();
        let well = Status {
            frames: 9,
            frame_since: None,
            heard: now,
            permission: Some(Permission::Granted),
            fault: None,
            rivals: 0,
            enable_publishers: 1,
            untimely: 0,
            malformed: 0,
            lacks: None,
            is_resting: false,
            driver: None,
        };
        let later = now + Duration::from_secs(1);
        assert_eq!(Status { malformed: 1, ..well }.worst(later).0, WARN);
        assert_eq!(Status { rivals: 1, ..well }.worst(later).0, WARN);
        let latched = Some(Permission::Latched("switched off"));
        let late = well.worst(now + Duration::from_millis(1001));
        assert_eq!(late.0, STALE);
        let fault = Status { fault: Some("odometry jumped"), permission: latched, ..well };
        let blind = Status { lacks: Some(Input::Laser), ..well };
        let missing = Status { driver: Some(DriverState::Missing), ..well };
        let unconfirmed = Status { driver: Some(DriverState::Unconfirmed), ..fault };
        let contested = Status { enable_publishers: 2, ..well };
        let not_enabled = Some(Permission::NotEnabled);
        let unheard = Status { permission: not_enabled, enable_publishers: 0, ..well };
        for (status, level, message) in [
            (well, OK, "enabled"),
            (Status { permission: latched, ..well }, WARN, "switched off"),
            (unheard, OK, "not enabled: no node publishes the enable"),
            (contested, ERROR, "2 publishers of the enable: end all but one"),
            (fault, ERROR, "fault: odometry jumped"),
            (blind, WARN, "the last frame has no laser scans: the robot stands"),
            (missing, WARN, "no following server of Nav2"),
            (unconfirmed, ERROR, "Nav2 does not confirm that it stops"),
        ] {
            assert_eq!(status.worst(later), (level, message.into()));
        }
        let resting = Status { is_resting: true, ..fault };
        assert_eq!(resting.worst(later).0, OK, "an inactive node is not ill");
        let stuck = Status { frame_since: Some(now), ..well };
        assert_eq!(stuck.worst(now + Duration::from_millis(501)).0, ERROR);
        assert_eq!(
            stuck.worst(now + Duration::from_secs(3)),
            (ERROR, "one frame takes 3.0 s".into())
        );
    }
}
