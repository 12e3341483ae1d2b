//! Readers of the sources: they convert messages to readings at the pose of the robot at the time
//! of a frame.

use std::sync::Arc;

use nalgebra::Isometry3;
use tagalong_core::{DepthImage, ObstacleData, ObstacleReading, RangeReading, Stamp, spatial_pose};
use tagalong_geometry::{Camera, Lens};

use super::bumper::{Bumper, Contact};
use super::plan::PlannedSource;
use super::timed::{Readings, Timed};
use super::{ObstacleKind, ObstacleTopic};
use crate::Limits;
use crate::camera_info::{Intrinsics, check_size};
use crate::images::{ImageError, Pixels, decode_compressed, decode_raw};
use crate::msgs::{CdrError, CompressedImage, Image, LaserScan, Range, decode};
use crate::odometry::AHEAD_S;
use crate::pairing::Payload;
use crate::scan::Type;
use crate::sensors::Moment;
use crate::sensors::laser::{lose_scan, scan_fault, seen_from};
use crate::tally::Tally;

/// Reader of one source.
pub(crate) struct ObstacleReader {
    source: ObstacleTopic,
    name: Arc<str>,
    messages: Messages,
    /// Time by which a reading may be later than its frame, s.
    later_s: f64,
}

/// Stored messages of a source.
enum Messages {
    Scan(Readings<LaserScan>),
    Range(Readings<Range>),
    Depth(Box<DepthMessages>),
    Bumper(Bumper),
}

/// Depth images of a camera; only the newest is decoded.
struct DepthMessages {
    kind: Type,
    lens: Intrinsics,
    images: Readings<Payload>,
    /// Last decoded image with its index; `None` for a damaged one.
    decoded: Option<(u64, Option<Arc<DepthImage>>)>,
}

/// Settings for decoding depth images.
#[derive(Clone, Copy)]
pub(crate) struct DepthFormat<'a> {
    /// Metres per unit, if it differs from that of the encoding.
    pub(crate) unit_m: Option<f64>,
    /// Maximum sizes.
    pub(crate) limits: &'a Limits,
}

impl ObstacleReader {
    /// Creates the reader of a source; `None` for a planned source that lacks a part.
    ///
    /// On a robot all readings that have arrived count, even those later than the frame, because
    /// images take time to process. A log is read ahead, so only readings before the frame count.
    pub(crate) fn new(planned: &PlannedSource, is_live: bool) -> Option<Self> {
        let later_s = if is_live { AHEAD_S } else { 0.0 };
        let PlannedSource { topic: source, schema, lens, .. } = planned;
        let messages = match source.kind {
            ObstacleKind::Scan => Messages::Scan(Readings::default()),
            ObstacleKind::Range => Messages::Range(Readings::default()),
            ObstacleKind::Bumper => Messages::Bumper(Bumper::new(Contact::of(schema)?)),
            ObstacleKind::Depth => Messages::Depth(Box::new(DepthMessages {
                kind: Type::of(schema),
                lens: (*lens)?,
                images: Readings::default(),
                decoded: None,
            })),
        };
        let name = source.name.as_str().into();
        Some(Self { source: source.clone(), name, messages, later_s })
    }

    /// Returns the topic of the source.
    pub(crate) fn topic(&self) -> &str {
        &self.source.topic
    }

    /// Returns the frame id whose pose in tf the newest reading has; `None` if the settings give the
    /// pose, or before the first reading.
    pub(crate) fn mount_frame(&self) -> Option<&str> {
        if self.source.mount.is_some() {
            return None;
        }
        match &self.messages {
            Messages::Scan(scans) => scans.newest().map(|scan| scan.header.frame_id.as_str()),
            Messages::Range(ranges) => ranges.newest().map(|range| range.header.frame_id.as_str()),
            Messages::Depth(depth) => depth.images.newest().map(|image| image.frame_id.as_str()),
            Messages::Bumper(_) => None,
        }
    }

    /// Adds a message. If it has no stamp of its own, its arrival is the stamp.
    ///
    /// # Errors
    /// A message that cannot be decoded.
    pub(crate) fn take(
        &mut self,
        data: &[u8],
        arrival: Stamp,
        tally: &mut Tally,
    ) -> Result<(), CdrError> {
        match &mut self.messages {
            Messages::Scan(scans) => {
                let scan: LaserScan = decode(data)?;
                match scan_fault(&scan) {
                    None => scans.push(scan.header.stamp(), data.len(), scan),
                    Some(why) => lose_scan(&self.source.topic, &why, tally),
                }
            }
            Messages::Range(ranges) => {
                let range: Range = decode(data)?;
                if is_possible(&range) {
                    ranges.push(range.header.stamp(), data.len(), range);
                } else {
                    let name = &self.source.name;
                    tally.lose("ranges_invalid", || {
                        format!("source `{name}`: a range has no angle or no limits")
                    });
                }
            }
            Messages::Depth(depth) => {
                let header = match depth.kind {
                    Type::Image => decode::<Image<'_>>(data)?.header,
                    _ => decode::<CompressedImage<'_>>(data)?.header,
                };
                let image = Payload::new(header, data);
                depth.images.push(image.stamp, data.len(), image);
            }
            Messages::Bumper(bumper) => bumper.take(data, arrival)?,
        }
        Ok(())
    }

    /// Returns the newest reading for a frame; `None` without one, or if the pose of the sensor is
    /// unknown.
    pub(crate) fn reading(
        &mut self,
        moment: &Moment<'_>,
        format: DepthFormat<'_>,
        tally: &mut Tally,
    ) -> Option<ObstacleReading> {
        self.note_ahead(moment, tally);
        let latest = moment.stamp.plus_seconds(self.later_s);
        let Self { source, messages, .. } = self;
        let (stamp, data) = match messages {
            Messages::Bumper(bumper) => {
                let (stamp, is_pressed) = bumper.state(moment.stamp, latest)?;
                (stamp, ObstacleData::Bumper(is_pressed))
            }
            Messages::Range(ranges) => {
                let Timed { stamp, value, .. } = ranges.newest_until(latest)?;
                let mount = mount_at(source, moment, &value.header.frame_id, *stamp, tally)?;
                let pose = spatial_pose(&moment.robot_from(*stamp)) * mount;
                (*stamp, ObstacleData::Range(range_reading(value, pose)))
            }
            Messages::Scan(scans) => {
                let Timed { stamp, value, .. } = scans.newest_until(latest)?;
                let mount = mount_at(source, moment, &value.header.frame_id, *stamp, tally)?;
                let scan = seen_from(value, &mount, |then| moment.robot_from(then));
                (*stamp, ObstacleData::Scan(scan))
            }
            Messages::Depth(depth) => {
                let (stamp, frame_id, image) = depth.newest(source, latest, format, tally)?;
                let mount = mount_at(source, moment, &frame_id, stamp, tally)?;
                let pose = spatial_pose(&moment.robot_from(stamp)) * mount;
                let lens = Lens::Pinhole(depth.lens.lens);
                let camera = Camera {
                    lens,
                    width: image.width(),
                    height: image.height(),
                    robot_from_camera: pose,
                };
                (stamp, ObstacleData::Depth { image, camera: Arc::new(camera) })
            }
        };
        // A reading later than the frame has age 0.
        let age_s = moment.stamp.seconds_since(stamp).max(0.0);
        Some(ObstacleReading::new(Arc::clone(&self.name), stamp, age_s, data))
    }

    /// Counts a frame for which the source only has readings of much later times.
    fn note_ahead(&self, moment: &Moment<'_>, tally: &mut Tally) {
        let first = match &self.messages {
            Messages::Scan(scans) => scans.first_stamp(),
            Messages::Range(ranges) => ranges.first_stamp(),
            Messages::Depth(depth) => depth.images.first_stamp(),
            Messages::Bumper(bumper) => bumper.first_stamp(),
        };
        let ahead_s = first.map_or(0.0, |first| first.seconds_since(moment.stamp));
        if ahead_s > AHEAD_S {
            let name = &self.source.name;
            let stamp = moment.stamp;
            tally.remark("source_readings_ahead", || {
                format!(
                    "source `{name}` is stamped {ahead_s:.1} s after the frame at {stamp} and is \
                     not used for it: compare its clock with that of the camera"
                )
            });
        }
    }
}

impl DepthMessages {
    /// Returns the newest image up to a time, with its stamp and frame.
    fn newest(
        &mut self,
        source: &ObstacleTopic,
        latest: Stamp,
        format: DepthFormat<'_>,
        tally: &mut Tally,
    ) -> Option<(Stamp, String, Arc<DepthImage>)> {
        let Self { kind, lens, images, decoded } = self;
        let newest = images.newest_until(latest)?;
        // Frames may be more frequent than the images of another camera.
        if decoded.as_ref().is_none_or(|(number, _)| *number != newest.number) {
            let image = depth_of(*kind, &newest.value, format).and_then(|image| {
                let size = check_size(lens, image.width(), image.height());
                size.map_err(|misfit| ImageError::Codec(misfit.to_string()))?;
                Ok(image)
            });
            let name = &source.name;
            let topic = &source.topic;
            let image = image.map_err(|error| {
                tally.lose("source_images_unusable", || {
                    format!("source `{name}`: {topic} at {}: {error}", newest.stamp)
                });
            });
            *decoded = Some((newest.number, image.ok().map(Arc::new)));
        }
        let (_, image) = decoded.as_ref()?;
        Some((newest.stamp, newest.value.frame_id.clone(), Arc::clone(image.as_ref()?)))
    }
}

/// Decodes a depth image.
fn depth_of(
    kind: Type,
    image: &Payload,
    format: DepthFormat<'_>,
) -> Result<DepthImage, ImageError> {
    let DepthFormat { unit_m, limits } = format;
    let pixels = match kind {
        Type::Image => decode_raw(&decode(&image.data).map_err(undecodable)?, unit_m, limits),
        _ => decode_compressed(&decode(&image.data).map_err(undecodable)?, unit_m, limits),
    };
    match pixels? {
        Pixels::Depth(depth) => Ok(depth),
        Pixels::Colour(_) | Pixels::Grey(_) => {
            Err(ImageError::Codec("the pixels are a picture, not depth".to_owned()))
        }
    }
}

fn undecodable(error: CdrError) -> ImageError {
    ImageError::Codec(error.to_string())
}

/// Returns the pose of a sensor on the robot: from the settings, or otherwise from tf at the time
/// of the reading. An unknown pose is counted.
fn mount_at(
    source: &ObstacleTopic,
    moment: &Moment<'_>,
    frame_id: &str,
    stamp: Stamp,
    tally: &mut Tally,
) -> Option<Isometry3<f64>> {
    let found = source
        .robot_from_sensor()
        .or_else(|| moment.tf.lookup(moment.robot_frame, frame_id, stamp));
    if found.is_none() {
        tally.count("source_readings_without_pose");
        tally.note(format!(
            "tf does not connect `{frame_id}` of source `{}` with `{}`, so that it is not used: \
             give its pose as `mount`",
            source.name, moment.robot_frame
        ));
    }
    found
}

/// Returns false for a range whose cone or limits are impossible.
fn is_possible(range: &Range) -> bool {
    let limits = range.min_range..=range.max_range;
    let cone = 0.0..=std::f32::consts::TAU;
    range.min_range >= 0.0
        && range.max_range.is_finite()
        && !limits.is_empty()
        && cone.contains(&range.field_of_view)
}

fn range_reading(range: &Range, robot_from_sensor: Isometry3<f64>) -> RangeReading {
    // REP 117: minus infinity means a surface nearer than the minimum range.
    let is_too_near = range.range == f32::NEG_INFINITY;
    RangeReading {
        robot_from_sensor,
        field_of_view_rad: f64::from(range.field_of_view),
        min_m: f64::from(range.min_range),
        max_m: f64::from(range.max_range),
        range_m: f64::from(if is_too_near { range.min_range } else { range.range }),
    }
}
