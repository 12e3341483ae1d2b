//! Waiting for the inputs of the pipeline.

use std::time::{Duration, Instant};

use tagalong::log::{Input, Listening, LiveSource};

use crate::bridge::{Surroundings, TURN, sources};
use crate::inbox::Arrival;
use crate::network::Ear;
use crate::options::Setup;
use crate::{BridgeError, Options};

/// Time between two attempts to start.
const ATTEMPT: Duration = Duration::from_millis(500);
/// Time to wait for other topics after the first image: not every pipeline requires odometry and
/// transforms, but each works better with them.
const GATHER: Duration = Duration::from_secs(2);

/// The ROS 2 variable that limits discovery.
const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";

/// Returns a message why no topic of another node may be visible; `range` is the value of [`RANGE`]
/// for this program.
fn silence(domain: u16, range: Option<&str>) -> String {
    let set = range.map_or("not set".to_owned(), |range| format!("`{range}`"));
    format!(
        "no topic of another node is on ROS domain {domain}: compare ROS_DOMAIN_ID with that of the robot's \
         nodes; let their {RANGE} be SUBNET (here it is {set}; this program always looks by multicast, and \
         asks no ROS_STATIC_PEERS); and see that the network passes multicast (`ros2 multicast receive` \
         here, `ros2 multicast send` there)"
    )
}

/// Listens until all inputs of the pipeline are there; returns `None` if `is_over` becomes true
/// before.
pub(crate) fn listen(
    options: &Options,
    setup: &Setup,
    surroundings: &mut Surroundings,
    is_over: &dyn Fn() -> bool,
    tell: &dyn Fn(&str),
) -> Result<Option<(LiveSource, Vec<Ear>)>, BridgeError> {
    let Surroundings { network, inbox, clock, .. } = surroundings;
    let name = format!("ROS domain {}", options.domain);
    let inputs = setup.pipeline.inputs();
    // The page shows colour, even if the pipeline does not use it.
    let inputs = if options.serve.is_some() { inputs.accept(Input::Colour) } else { inputs };
    let mut listening = Listening::new(&name, &setup.input, &setup.limits, inputs)?;
    let mut ears: Vec<Ear> = Vec::new();
    let further = setup.pipeline.obstacle_sources();
    let deadline = Instant::now() + Duration::from_secs_f64(options.wait);
    let mut attempt = Instant::now() + ATTEMPT;
    let mut first: Option<Instant> = None;
    tell(&format!("listening to {name}"));
    while !is_over() {
        for (topic, kind) in network.topics() {
            if listening.announce(&topic, &kind) && listening.wants(&topic) {
                let is_source = further.iter().any(|source| source.topic == topic);
                let ear = match network.listen(&topic, &kind, inbox, clock)? {
                    None if is_source => Some(network.listen_raw(&topic, &kind, inbox)?),
                    ear => ear,
                };
                ears.extend(ear);
            }
        }
        for Arrival { topic, message, .. } in inbox.take(TURN) {
            listening.take(&topic, &message);
        }
        if first.is_none() && listening.has_image() {
            first = Some(Instant::now());
        }
        if Instant::now() < attempt {
            continue;
        }
        attempt = Instant::now() + ATTEMPT;
        let is_late = Instant::now() > deadline;
        let gathered = first.is_some_and(|first| first.elapsed() > GATHER);
        let started = listening.start().map_err(BridgeError::from).and_then(|source| {
            // Odometry and a laser may arrive later than the images.
            setup.pipeline.check_sources(sources(&source))?;
            Ok(source)
        });
        // Frames may be made from scans alone.
        if started.is_ok() {
            first.get_or_insert_with(Instant::now);
        }
        match started {
            Ok(source) if gathered || is_late => {
                // Unsubscribes from topics that the pipeline does not use.
                ears.retain(|ear| source.topics().any(|topic| topic == ear.topic()));
                return Ok(Some((source, ears)));
            }
            Err(missing) if is_late => {
                if network.topics().is_empty() {
                    let range = std::env::var(RANGE).ok();
                    tell(&silence(options.domain, range.as_deref()));
                }
                return Err(missing);
            }
            _ => {}
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_without_topics_is_explained() {
        let words = silence(7, Some("LOCALHOST"));
        for part in ["ROS domain 7", "here it is `LOCALHOST`", "multicast", "ROS_STATIC_PEERS"] {
            assert!(words.contains(part), "{part}: {words}");
        }
        assert!(silence(0, None).contains("here it is not set"));
    }
}
