//! A camera that publishes video in H.264.

use std::fmt::Debug;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

use serde::Serialize;
use tagalong::geometry::{Camera, Pinhole};
use tagalong::log::msgs::{CameraInfo, CompressedVideo, FfmpegPacket, Header, Message};
use tagalong_ros2::{Options, Summary};

use crate::peers::*;

/// Twelve pictures of 160 x 120 pixels; the packet of each begins with a delimiter.
const WALK: &[u8] = include_bytes!("../../../../crates/log/tests/data/walk.h264");
const TOPIC: &str = "/camera/video";
/// Times that the pictures are published, at ten a second.
const REPEATS: usize = 6;

#[test]
#[ignore = "waits for messages for a minute"]
fn packets_of_a_foxglove_video_become_frames() {
    let summary = watched(8, |header, data| CompressedVideo {
        timestamp: header.stamp,
        frame_id: header.frame_id,
        data,
        format: "h264".into(),
    });
    if let Some(summary) = summary {
        check(&summary);
    }
}

#[test]
fn packets_of_ffmpeg_image_transport_become_frames() {
    let summary = watched(9, |header, data| FfmpegPacket {
        header,
        width: 160,
        height: 120,
        encoding: "h264;yuv420p;bgr8;bgr8".into(),
        data,
        ..FfmpegPacket::default()
    });
    if let Some(summary) = summary {
        check(&summary);
    }
}

/// Runs the bridge on a robot whose camera publishes these messages; `None` where participants do not
/// hear each other.
fn watched<M>(offset: u32, message: impl Fn(Header, &'static [u8]) -> M) -> Option<Summary>
where
    M: Message + Serialize + Debug,
{
    let _alone = alone()?;
    let stop = Arc::new(AtomicBool::new(false));
    let lens = Pinhole::centred(140.0, 160, 120);
    let camera = Camera::mounted(lens, 160, 120, 1.0, 0.0, 0.0);
    let mut robot = Robot::new(domain(offset), &camera);
    let video = robot.peer.publisher::<M>(TOPIC, reliable());
    let info = robot.peer.publisher::<CameraInfo>("/camera/camera_info", reliable());
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/mono.toml");
    let options = Options { config, ..options(domain(offset), "20") };
    let (bridge, _) = bridge_with(options, tagalong::builtin_registry(), &stop);

    robot.fixed.publish(robot.mount()).unwrap();
    for (count, packet) in std::iter::repeat_n(packets(), REPEATS).flatten().enumerate() {
        let header = robot.header(100_000_000 * count as u64, "camera");
        info.publish(robot.calibration(&header)).unwrap();
        video.publish(message(header, packet)).unwrap();
        sleep(Duration::from_millis(100));
    }
    stop.store(true, Ordering::Relaxed);
    Some(bridge.join().unwrap().unwrap())
}

fn packets() -> Vec<&'static [u8]> {
    let starts: Vec<usize> =
        (0..WALK.len()).filter(|at| WALK[*at..].starts_with(&[0, 0, 0, 1, 9])).collect();
    let ends = starts.iter().copied().skip(1).chain([WALK.len()]);
    starts.iter().zip(ends).map(|(start, end)| &WALK[*start..end]).collect()
}

/// Of 72 packets those of the first seconds tell the camera, and each one after them is a frame.
fn check(summary: &Summary) {
    eprintln!("{summary}");
    let traffic = summary.traffic[TOPIC];
    assert_eq!((traffic.dropped, traffic.malformed), (0, 0), "{summary}");
    assert!(summary.frames > 20, "{summary}");
}
