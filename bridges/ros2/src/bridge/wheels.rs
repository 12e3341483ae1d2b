//! Arriving enables, and commands that are sent to the wheels.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ros2_client::Publisher;
use tagalong::core::WheelSpeeds;
use tagalong::log::LiveSource;
use tagalong::log::msgs::{Header, Twist as TwistMessage, TwistStamped};
use tagalong::pipeline::{Enable, EnableSwitch, Sources};

use super::CONTESTED;
use crate::network::Network;
use crate::options::{CommandType, Setup};
use crate::publishers::{Gate, Origin, Unfit};
use crate::stamps::{StampClock, system_time};
use crate::wheels::{SwitchHandle, Wheels};
use crate::{BridgeError, Options};

/// Passes a message of the enable topic to the switch: `origin` is that of a message that is true;
/// `None` means false.
pub(super) fn take_enable(switch: &SwitchHandle, gate: &Gate, origin: Option<Origin>) {
    let now = switch.now();
    let Some(origin) = origin else {
        // A stop counts from every publisher and at any age.
        switch.take(Enable::Off, now);
        return;
    };
    let age = match gate.admit(origin, Instant::now(), system_time()) {
        Ok(age) => age,
        Err(Unfit::Contested) => {
            switch.take(Enable::Fault(CONTESTED), now);
            return;
        }
        // Too old to move the robot, but not a release of the button either.
        Err(Unfit::Untimely(age_s)) => Duration::try_from_secs_f64(age_s).unwrap_or(Duration::MAX),
    };
    // A message from before the switch existed does not count, nor does one from the future.
    if let Some(published) = now.checked_sub(age) {
        switch.take(Enable::On, published);
    }
}

/// Reports that messages of a topic are ignored because of their age, once for each series of them.
pub(super) fn tell_untimely(gate: &Gate, what: &str, topic: &str, tell: &dyn Fn(&str)) {
    let Some(age_s) = gate.take_untold() else { return };
    let state = if age_s > 0.0 { "old" } else { "ahead" };
    tell(&format!(
        "a {what} on {topic} was {:.1} s {state} by the clock of its publisher: it is ignored; if \
         all of them are, synchronise the clocks of both machines",
        age_s.abs()
    ));
}

/// Starts the thread of the wheels, which converts their speeds to messages.
pub(super) fn drive(
    options: &Options,
    setup: &Setup,
    switch: EnableSwitch,
    base_frame: &str,
    network: &mut Network,
    clock: &Arc<StampClock>,
) -> Result<Wheels, BridgeError> {
    let half_m = setup.robot.wheels().half_separation_m;
    let publish = command_publisher(options, network)?;
    let base_frame = base_frame.to_owned();
    let clock = Arc::clone(clock);
    let now = {
        let clock = Arc::clone(&clock);
        move || clock.now()
    };
    Wheels::start(Duration::from_secs_f64(1.0 / options.rate), switch, now, move |wheels| {
        let header = Header::new(clock.now(), base_frame.as_str());
        publish(TwistStamped { header, twist: twist(wheels, half_m) });
    })
}

/// Returns a function that publishes commands with the type that the options name.
pub(super) fn command_publisher(
    options: &Options,
    network: &mut Network,
) -> Result<Box<dyn Fn(TwistStamped) + Send>, BridgeError> {
    let topic = &options.command;
    // A full queue means that the previous command has not been read yet.
    Ok(match options.command_type {
        CommandType::TwistStamped => {
            let publisher: Publisher<TwistStamped> = network.publisher(topic)?;
            Box::new(move |command| {
                let _lost = publisher.publish(command);
            })
        }
        CommandType::Twist => {
            let publisher: Publisher<TwistMessage> =
                network.publisher_of(topic, "geometry_msgs/msg/Twist")?;
            Box::new(move |command| {
                let _lost = publisher.publish(command.twist);
            })
        }
    })
}

/// Converts wheel speeds to the velocity of the robot's centre.
pub(super) fn twist(WheelSpeeds { left, right }: WheelSpeeds, half_m: f64) -> TwistMessage {
    let mut twist = TwistMessage::default();
    twist.linear.x = 0.5 * (left + right);
    twist.angular.z = 0.5 * (right - left) / half_m;
    twist
}

/// Returns the sources of data that a controller may need and that have arrived.
pub(crate) fn sources(source: &LiveSource) -> Sources {
    let facts = source.facts();
    Sources {
        depth: facts.depth_topic.is_some(),
        right: facts.right_topic.is_some(),
        laser: facts.laser_topic.is_some(),
        odometry: source.has_odometry(),
    }
}
