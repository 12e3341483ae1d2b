//! Sightings of the hat in the camera images of a log.

use std::collections::BTreeMap;
use std::path::Path;

use crate::triangulate::{HatColour, Sight, Station, find_hat};
use nalgebra::{Isometry2, Point2};
use tagalong_app::outcome::Failure;
use tagalong_core::{Stamp, planar_pose};
use tagalong_log::Limits;
use tagalong_log::images::{Pixels, decode_compressed, decode_raw};
use tagalong_log::msgs::{CameraInfo, CompressedImage, Image, PoseStamped, decode};
use tagalong_log::{LogFiles, LogWalker, Message};
use tagalong_sim::WebcamSettings;

/// Topic of the robot's true pose in a simulated log.
const TRUE_ROBOT_TOPIC: &str = "/truth/robot";

/// Sightings of all cameras.
#[derive(Default)]
pub(super) struct CameraSightings {
    /// Stamps and pixels of the hat, by camera.
    pub(super) hats: Vec<(Stamp, Sight)>,
    /// Focal lengths and centres, where the log has them.
    lenses: BTreeMap<usize, (f64, Point2<f64>)>,
    sizes: BTreeMap<usize, (usize, usize)>,
    /// True pose of the robot in the room, by stamp, ns.
    pub(super) robot: BTreeMap<u64, Isometry2<f64>>,
    /// Stamp of the first image.
    pub(super) first: Option<Stamp>,
}

impl CameraSightings {
    /// Searches for the hat in all images of so many cameras.
    pub(super) fn read(log: &Path, cameras: usize, colour: &HatColour) -> Result<Self, Failure> {
        let limits = Limits::default();
        let mut seen = Self::default();
        for part in LogFiles::of(log).map_err(Failure::failed)?.parts() {
            let mut walker = LogWalker::open(part, &limits).map_err(Failure::failed)?;
            while let Some(message) = walker.next() {
                seen.take(&message, cameras, colour, &limits);
            }
        }
        // Messages of several cameras come in no fixed order.
        seen.hats.sort_by_key(|(stamp, sight)| (*stamp, sight.station));
        Ok(seen)
    }

    fn take(&mut self, message: &Message<'_>, cameras: usize, colour: &HatColour, limits: &Limits) {
        let topic = &*message.channel.topic;
        if topic == TRUE_ROBOT_TOPIC {
            let pose: Option<PoseStamped> = decode(message.data).ok();
            if let Some((stamp, pose)) =
                pose.and_then(|p| Some((p.header.stamp(), p.pose.isometry()?)))
            {
                self.robot.insert(stamp.nanos(), planar_pose(&pose));
            }
            return;
        }
        let Some((camera, rest)) = webcam(topic).filter(|(camera, _)| *camera < cameras) else {
            return;
        };
        if rest == "camera_info" {
            if let Ok(info) = decode::<CameraInfo>(message.data) {
                let centre = Point2::new(info.k[2], info.k[5]);
                self.lenses.insert(camera, (info.k[0], centre));
            }
        } else if let Some((stamp, pixels)) = image(message, limits) {
            self.look(camera, stamp, pixels, colour);
        }
    }

    fn look(&mut self, station: usize, stamp: Stamp, pixels: Pixels, colour: &HatColour) {
        let Pixels::Colour(image) = pixels else { return };
        self.sizes.insert(station, (image.width(), image.height()));
        self.first = Some(self.first.map_or(stamp, |first| first.min(stamp)));
        // The centre of a hat at the image's edge would be wrong.
        if let Some(hat) = find_hat(&image, colour).filter(|hat| !hat.cut) {
            self.hats.push((stamp, Sight { station, pixel: hat.centre }));
        }
    }

    /// Converts the guess to stations, with the lenses of the log where it has them.
    pub(super) fn stations(&self, guess: &[WebcamSettings]) -> Vec<Station> {
        let stations = guess.iter().enumerate().map(|(number, guess)| {
            let (width, height) =
                self.sizes.get(&number).copied().unwrap_or((guess.width, guess.height));
            let middle = Point2::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
            let by_view = 0.5 * width as f64 / (0.5 * guess.field_of_view_deg.to_radians()).tan();
            let (focal_px, centre_px) =
                self.lenses.get(&number).copied().unwrap_or((by_view, middle));
            Station {
                at: Point2::from(guess.at),
                heading_rad: guess.heading_deg.to_radians(),
                pitch_down_rad: guess.pitch_down_deg.to_radians(),
                focal_px,
                centre_px,
            }
        });
        stations.collect()
    }
}

/// Returns the number of a webcam, from 0, and the rest of its topic.
fn webcam(topic: &str) -> Option<(usize, &str)> {
    let (number, rest) = topic.strip_prefix("/webcam_")?.split_once('/')?;
    Some((number.parse::<usize>().ok()?.checked_sub(1)?, rest))
}

fn image(message: &Message<'_>, limits: &Limits) -> Option<(Stamp, Pixels)> {
    if message.channel.schema_name.ends_with("CompressedImage") {
        let image: CompressedImage<'_> = decode(message.data).ok()?;
        Some((image.header.stamp(), decode_compressed(&image, None, limits).ok()?))
    } else if message.channel.schema_name.ends_with("/Image") {
        let image: Image<'_> = decode(message.data).ok()?;
        Some((image.header.stamp(), decode_raw(&image, None, limits).ok()?))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn webcams_are_counted_from_one() {
        assert_eq!(webcam("/webcam_2/image_raw"), Some((1, "image_raw")));
        assert_eq!(webcam("/webcam_0/image_raw"), None);
        assert_eq!(webcam("/camera/color"), None);
    }
}
