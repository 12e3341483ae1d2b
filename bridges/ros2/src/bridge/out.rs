//! Published results, for programs and for viewers.

use ros2_client::Publisher;
use serde::Serialize;
use tagalong::core::{Frame, Stamp};
use tagalong::log::msgs::{
    Detection3DArray, Header, MarkerArray, Message, People, PoseStamped, StringMsg, TFMessage,
};
use tagalong::log::write::{self, FrameRecord, Trails};
use tagalong::pipeline::FrameReport;

use crate::forecast::{Forecast, Now, OccupancyGrid};
use crate::network::Network;
use crate::{BridgeError, Options};

/// Publishers of the results. They do not wait for subscribers, so a message may be lost.
pub(super) struct Out {
    tracks: Publisher<Detection3DArray>,
    target: Publisher<PoseStamped>,
    state: Publisher<StringMsg>,
    heartbeat: Publisher<Header>,
    people: Option<Publisher<People>>,
    forecast: Option<(Publisher<OccupancyGrid>, Forecast)>,
    transforms: Option<Publisher<TFMessage>>,
    markers: Option<Publisher<MarkerArray>>,
    trails: Trails,
    /// Time and frame id of the last markers.
    drawn: Option<(Stamp, String)>,
}

impl Out {
    /// Creates the publishers that the options request.
    pub(super) fn new(options: &Options, network: &mut Network) -> Result<Self, BridgeError> {
        let forecast = match options.forecast.as_str() {
            "" => None,
            topic => {
                let grid = network.kept_publisher(topic, "nav_msgs/msg/OccupancyGrid")?;
                Some((grid, Forecast::new(options.forecast_settings())))
            }
        };
        Ok(Self {
            tracks: network.publisher(&options.tracks)?,
            target: network.publisher(&options.target)?,
            state: network.publisher(&options.state)?,
            heartbeat: network.publisher_of(&options.heartbeat, "std_msgs/msg/Header")?,
            people: publisher_if_named(network, &options.people)?,
            forecast,
            transforms: publisher_if_named(network, &options.transforms)?,
            markers: publisher_if_named(network, &options.markers)?,
            trails: Trails::default(),
            drawn: None,
        })
    }

    /// Publishes the results of a frame; `world` is the frame for the people's motion, that of the
    /// odometry if there is one.
    pub(super) fn publish(
        &mut self,
        frame: &Frame,
        record: &FrameRecord<'_>,
        report: &FrameReport,
        base_frame: &str,
        world: &str,
    ) {
        let _lost = self.tracks.publish(write::detections(record, base_frame));
        let target = report.tracks.iter().find(|track| Some(track.id) == report.target);
        if let Some(track) = target {
            let _lost = self.target.publish(write::pose(record, track, world));
        }
        if let (Some(command), Some(lock)) = (&report.command, &report.lock) {
            let reason = command.reason.name();
            let state = lock.state.name();
            let why = lock.why;
            let data = format!("{reason}; {state}: {why}");
            let _lost = self.state.publish(StringMsg { data });
        }
        if let Some(people) = &self.people {
            let _lost = people.publish(write::people(record, world));
        }
        if let Some((publisher, forecast)) = &mut self.forecast {
            let odom_from_robot = record.odom_from_robot;
            let now = Now { frame, tracks: record.tracks, odom_from_robot, base_frame, world };
            if let Some(grid) = forecast.grid(now) {
                let _lost = publisher.publish(grid);
            }
        }
        self.draw(record, world);
    }

    /// Publishes the shapes of people and their transforms.
    fn draw(&mut self, record: &FrameRecord<'_>, world: &str) {
        if let Some(publisher) = &self.transforms {
            let transforms = write::person_transforms(record, world);
            // Listeners expect at least one transform in a message.
            if !transforms.transforms.is_empty() {
                let _lost = publisher.publish(transforms);
            }
        }
        let Some(publisher) = &self.markers else { return };
        self.trails.follow(record.stamp, record.tracks, record.odom_from_robot);
        let _lost = publisher.publish(write::markers(record, &self.trails, world));
        self.drawn = Some((record.stamp, world.to_owned()));
    }

    /// Publishes the heartbeat.
    pub(super) fn beat(&self, header: Header) {
        let _lost = self.heartbeat.publish(header);
    }

    /// Removes all people from viewers.
    pub(super) fn clear(&self) {
        if let (Some(publisher), Some((at, world))) = (&self.markers, &self.drawn) {
            let _lost = publisher.publish(write::no_markers(*at, world));
        }
    }
}

/// Returns a publisher for a topic; `None` if the topic has no name.
fn publisher_if_named<M: Message + Serialize>(
    network: &mut Network,
    topic: &str,
) -> Result<Option<Publisher<M>>, BridgeError> {
    if topic.is_empty() {
        return Ok(None);
    }
    network.publisher(topic).map(Some)
}

#[cfg(test)]
mod tests;
