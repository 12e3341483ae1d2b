//! A small simulated log, and the programs under test.

pub mod broken;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use nalgebra::Isometry3;
use tagalong_core::Stamp;
use tagalong_geometry::{Camera, Distortion, Pinhole};
use tagalong_log::msgs::{
    BoundingBox2D, BoundingBox3D, CameraInfo, Detection2D, Detection2DArray, Detection3D,
    Detection3DArray, Header, Image, Message, ObjectHypothesis, ObjectHypothesisWithPose, Point2D,
    Pose, Pose2D, TFMessage, TransformStamped, Vector3, encode,
};
use tagalong_log::{TRUTH_SCHEMA, TRUTH_TOPIC, TruthFrame};

pub const WIDTH: usize = 160;
pub const HEIGHT: usize = 120;
pub const FIRST_NS: u64 = 1_700_000_000_000_000_000;

/// Output of a command after its stdout was closed early.
pub fn unread(command: &mut Command) -> Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    child.wait_with_output().unwrap()
}

/// The program as it is shipped.
pub fn tagalong() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tagalong"));
    // Networks that are installed on this machine would choose other pipelines.
    command.env("TAGALONG_HOME", concat!(env!("CARGO_TARGET_TMPDIR"), "/nothing-installed"));
    command
}

/// The same program with the plugin of `examples/own_plugin.rs`.
pub fn own_plugin() -> Command {
    let mut path = PathBuf::from(env!("CARGO_BIN_EXE_tagalong"));
    path.pop();
    let program = path.join("examples").join("own_plugin");
    assert!(program.exists(), "cargo test builds the examples; {} is missing", program.display());
    Command::new(program)
}

/// Checks that two files have the same bytes.
pub fn assert_same(one: &Path, other: &Path) {
    let is_same = std::fs::read(one).unwrap() == std::fs::read(other).unwrap();
    assert!(is_same, "{} and {} differ", one.display(), other.display());
}

/// Writes a file into a folder.
pub fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

/// Reads what a command printed as JSON.
pub fn json(output: &Output) -> serde_json::Value {
    assert_eq!(code(output), 0, "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn code(output: &Output) -> i32 {
    output.status.code().expect("the program was not killed")
}

/// Returns what a command printed that succeeded.
#[track_caller]
pub fn results_of(output: &Output) -> String {
    assert_eq!(code(output), 0, "{}", text(&output.stderr));
    text(&output.stdout)
}

/// Returns what a command that ended with this exit code said beside its results.
#[track_caller]
pub fn messages_of(output: &Output, expected: i32) -> String {
    assert_eq!(code(output), expected, "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stderr)
}

/// A config that tracks the nearest object.
pub fn config(folder: &Path, extra: &str) -> PathBuf {
    let path = folder.join("nearest.toml");
    let text = format!(
        "seed = 7\n[[detectors]]\nplugin = \"nearest-thing\"\nroles = [\"discover\"]\n{extra}\n\
         [filter]\nplugin = \"ekf\"\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

const LENS: Pinhole =
    Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };

pub fn camera() -> Camera {
    Camera::mounted(LENS, WIDTH, HEIGHT, 1.2, 0.0, 0.0)
}

/// Contents of a simulated log.
pub struct Drawn {
    pub frames: u64,
    pub depth: bool,
    /// Frames that are written twice, with the same stamp.
    pub twice: u64,
    /// Truth that is written into the log itself.
    pub truth: Vec<TruthFrame>,
    /// Boxes of the walker on `/detections`, as another program records them.
    pub boxes: bool,
    /// The same in space, in the frame of the camera.
    pub in_space: bool,
}

impl Drawn {
    pub fn of(frames: u64) -> Self {
        Self { frames, depth: true, twice: 0, truth: Vec::new(), boxes: false, in_space: false }
    }

    /// Writes a log of a person walking to the left, ten frames a second.
    pub fn write(&self, path: &Path) {
        let mut log = Log::create(path);
        log.send("/tf_static", FIRST_NS, &mount());
        for index in 0..self.frames {
            let stamp = FIRST_NS + index * 100_000_000;
            for _ in 0..=u64::from(index == self.twice && self.twice > 0) {
                self.write_frame(&mut log, stamp, index);
            }
        }
        log.send_truth(&self.truth);
        log.writer.finish().unwrap();
    }

    fn write_frame(&self, log: &mut Log, stamp: u64, index: u64) {
        let header = Header::new(Stamp::from_nanos(stamp), "camera_optical");
        let info = CameraInfo::of_lens(&header, &LENS, (WIDTH, HEIGHT), 0.0);
        log.send("/camera/color/camera_info", stamp, &info);
        let colour = colour(index);
        log.send("/camera/color/image_raw", stamp, &image(&header, "rgb8", &colour));
        if self.in_space {
            log.send("/detections", stamp, &space(&header, index));
        }
        if self.boxes {
            log.send("/detections", stamp, &boxes(&header, index));
        }
        if self.depth {
            log.send("/camera/depth/camera_info", stamp, &info);
            let depth = depth(index);
            log.send("/camera/depth/image_raw", stamp, &image(&header, "16UC1", &depth));
        }
    }
}

/// The walker's whole body: 1.7 m at 2.8 m are 79 pixels.
fn boxes(header: &Header, index: u64) -> Detection2DArray {
    let centre = walker(index).start as f64 + 13.0;
    let position = Point2D { x: centre, y: 40.0 + 39.5 };
    let center = Pose2D { position, theta: 0.0 };
    let hypothesis = ObjectHypothesis { class_id: "person".into(), score: 0.9 };
    let detection = Detection2D {
        header: header.clone(),
        results: vec![ObjectHypothesisWithPose { hypothesis, ..Default::default() }],
        bbox: BoundingBox2D { center, size_x: 26.0, size_y: 79.0 },
        id: String::new(),
    };
    Detection2DArray { header: header.clone(), detections: vec![detection] }
}

/// The walker from the floor to the crown, 1.62 m up, seen from 1.2 m.
fn space(header: &Header, index: u64) -> Detection3DArray {
    let centre = walker(index).start as f64 + 13.0;
    let x = (centre - 79.5) * 2.88 / 130.0;
    let center = Pose::from(&Isometry3::translation(x, 1.2 - 0.81, 2.88));
    let size = Vector3 { x: 0.5, y: 1.62, z: 0.5 };
    let hypothesis = ObjectHypothesis { class_id: "person".into(), score: 0.9 };
    let detection = Detection3D {
        header: header.clone(),
        results: vec![ObjectHypothesisWithPose { hypothesis, ..Default::default() }],
        bbox: BoundingBox3D { center, size },
        id: String::new(),
    };
    Detection3DArray { header: header.clone(), detections: vec![detection] }
}

/// Columns that the walker covers.
fn walker(index: u64) -> std::ops::Range<usize> {
    let left = 90usize.saturating_sub(index as usize % 60);
    left..left + 26
}

fn colour(index: u64) -> Vec<u8> {
    let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let pixels = places.flat_map(|(x, y)| {
        if walker(index).contains(&x) && y >= 40 { [200, 120, 40] } else { [x as u8, y as u8, 90] }
    });
    pixels.collect()
}

fn depth(index: u64) -> Vec<u8> {
    let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let millimetres =
        places.map(|(x, y)| if walker(index).contains(&x) && y >= 40 { 2800_u16 } else { 6000 });
    millimetres.flat_map(u16::to_le_bytes).collect()
}

fn image<'a>(header: &Header, encoding: &str, data: &'a [u8]) -> Image<'a> {
    Image::packed(header.clone(), encoding, WIDTH as u32, HEIGHT as u32, data)
}

fn mount() -> TFMessage {
    let pose: Isometry3<f64> = camera().robot_from_camera;
    TFMessage {
        transforms: vec![TransformStamped {
            header: Header::new(Stamp::from_nanos(FIRST_NS), "base_link"),
            child_frame_id: "camera_optical".into(),
            transform: (&pose).into(),
        }],
    }
}

/// Positions of the walker of the simulated log, as `people.csv`.
pub fn people(frames: u64) -> String {
    let header = "frame,id,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,head_x,head_y,head_z,\
                  visible,occluder,ignore,interpolated\n";
    let rows = (0..frames).map(|index| {
        let depth = 2.8;
        let centre = 90.0 - index as f64 + 13.0;
        let scale = 130.0 / depth;
        let side = 0.57 * scale;
        let top = 40.0 - 0.025 * scale;
        let x = (centre - 79.5) * depth / 130.0;
        let y = (top + 0.14 * scale - 59.5) * depth / 130.0;
        let left = centre - 0.5 * side;
        format!(
            "{},1,{left},{top},{side},{side},{left},{top},{side},80,{x},{y},{depth},1,0,0,0\n",
            index + 1
        )
    });
    header.to_owned() + &rows.collect::<String>()
}

struct Log {
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
}

impl Log {
    fn create(path: &Path) -> Self {
        let file = BufWriter::new(File::create(path).unwrap());
        let options = WriteOptions::new()
            .profile("ros2")
            .compression(Some(mcap::Compression::Zstd))
            .compression_threads(1)
            .chunk_size(Some(1 << 18));
        Self { writer: options.create(file).unwrap(), channels: BTreeMap::new() }
    }

    fn send_truth(&mut self, frames: &[TruthFrame]) {
        if frames.is_empty() {
            return;
        }
        let schema = TruthFrame::schema();
        let schema = self.writer.add_schema(TRUTH_SCHEMA, "jsonschema", schema.as_bytes()).unwrap();
        let about = BTreeMap::new();
        let channel_id = self.writer.add_channel(schema, TRUTH_TOPIC, "json", &about).unwrap();
        for frame in frames {
            let log_time = frame.stamp_ns;
            let publish_time = frame.stamp_ns;
            let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time };
            self.writer
                .write_to_known_channel(&header, &serde_json::to_vec(frame).unwrap())
                .unwrap();
        }
    }

    fn send<M: Message + serde::Serialize>(&mut self, topic: &str, at: u64, message: &M) {
        if !self.channels.contains_key(topic) {
            let definition = M::DEFINITION.as_bytes();
            let schema = self.writer.add_schema(M::TYPE, "ros2msg", definition).unwrap();
            let about = BTreeMap::new();
            let id = self.writer.add_channel(schema, topic, "cdr", &about).unwrap();
            self.channels.insert(topic.to_owned(), id);
        }
        let header = MessageHeader {
            channel_id: self.channels[topic],
            sequence: 0,
            log_time: at + 15_000_000,
            publish_time: at,
        };
        self.writer.write_to_known_channel(&header, &encode(message)).unwrap();
    }
}
