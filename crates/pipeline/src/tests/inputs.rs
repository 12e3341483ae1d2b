//! A pipeline receives the inputs that it declares, and no others.

use std::sync::Arc;
use std::time::Duration;

use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, GreyImage, Images, Input, Inputs,
    Query, Reason, Result, RgbImage, RightImage, Sensor, WheelSpeeds,
};

use super::doubles::{Config, PLAIN, World, frame, person, scored};
use crate::{FrameReport, Pipeline, StepError};

fn world() -> World {
    World::of((0..6).map(|_| vec![person(3.0, 0.0)]))
}

fn script(how: &str) -> String {
    PLAIN.replace("'script'", &format!("'script'\nconfig = {{ how = '{how}' }}"))
}

fn with_depth(index: u64) -> Frame {
    let depth = Arc::new(DepthImage::filled(640, 480, 2.0));
    frame(index, index as f64 * 0.1).with_depth(depth)
}

/// The tracks of some frames, in all their digits.
fn tracks(config: &str, frame: impl Fn(u64) -> Frame) -> String {
    let mut pipeline = world().pipeline(config);
    let reports: Vec<FrameReport> =
        (1..=6).map(|index| pipeline.step(frame(index)).unwrap()).collect();
    format!("{:?}", reports.iter().map(|report| &report.tracks).collect::<Vec<_>>())
}

/// A detector that fires only without depth shows that there is none.
#[test]
fn what_a_config_does_without_is_not_there() {
    fn plain(index: u64) -> Frame {
        frame(index, index as f64 * 0.1)
    }

    let config = script("perhaps depth");
    assert_ne!(tracks(&config, with_depth), tracks(&config, plain), "depth makes a difference");
    let without = format!("without = ['depth']\n{config}");
    assert_eq!(tracks(&without, with_depth), tracks(&config, plain));
    assert_eq!(tracks(&without, plain), tracks(&config, plain));
}

#[test]
fn an_image_that_nothing_declares_is_told_from_one_that_the_log_lacks() {
    fn step(frame: &Frame) -> String {
        let mut pipeline = world().pipeline(&script("forgets to declare"));
        pipeline.step(frame).unwrap_err().to_string()
    }

    let undeclared = step(&with_depth(1));
    assert!(undeclared.contains("`script` uses depth images without declaring"), "{undeclared}");
    assert!(undeclared.contains("Input::Depth"), "{undeclared}");
    let lacking = step(&frame(1, 0.1));
    assert!(lacking.contains("which this frame does not have"), "{lacking}");
}

fn inputs(config: &str) -> Inputs {
    Pipeline::inputs(&world().pipeline(config))
}

#[test]
fn a_pipeline_declares_what_its_parts_declare() {
    assert_eq!(inputs(PLAIN), Inputs::NONE);
    let depth = inputs(&script("depth"));
    assert_eq!(depth, Inputs::NONE.require(Input::Depth));
    let controller = format!("{}\n[controller]\nplugin = 'drive'", script("depth"));
    let steering = depth.accept(Input::Colour).accept(Input::Laser).accept(Input::OBSTACLES);
    assert_eq!(inputs(&controller), steering);
    let images = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    assert_eq!(inputs(&format!("odometry = {{}}\n{PLAIN}")), images);
}

/// Depth comes from the pair, but that of a log is used where it is there.
#[test]
fn stereo_stands_in_for_depth() {
    let pair = Inputs::NONE.require(Input::Colour).require(Input::Right).accept(Input::Depth);
    for how in ["depth", "perhaps depth", ""] {
        assert_eq!(inputs(&format!("stereo = {{}}\n{}", script(how))), pair, "{how}");
    }
    let without = format!("without = ['depth']\nstereo = {{}}\n{}", script("depth"));
    assert_eq!(inputs(&without), pair.without(Input::Depth));
}

/// The detector refuses a frame without depth: it receives the pair's, not the log's.
#[test]
fn stereo_replaces_depth_that_the_config_does_without() {
    let stereo = "without = ['depth']\nstereo = { method = 'block', speckle_pixels = 0 }\n";
    let mut pipeline = world().pipeline(&format!("{stereo}{}", script("depth")));
    let plain = frame(1, 0.1);
    let grey = GreyImage::from_fn(640, 480, |x, y| (x * x * 31 + y * y * 17 + x * y) as u8);
    let images = Images {
        colour: Some(Arc::new(RgbImage::filled(640, 480, [9; 3]))),
        right: Some(Arc::new(RightImage { image: grey.clone(), baseline_m: 0.1 })),
        grey: Some(Arc::new(grey)),
        depth: Some(Arc::new(DepthImage::filled(640, 480, 2.0))),
    };
    let frame = Frame::new(plain.index, plain.stamp, plain.camera, plain.motion, images);
    let report = pipeline.step(&frame).unwrap();
    assert!(report.funnel.entries().iter().any(|entry| entry.test.starts_with("stereo pixels: ")));
}

/// The tracks live on, and the motion of the robot during the refused frame is not lost.
#[test]
fn a_frame_without_a_required_input_is_refused_alone() {
    fn moving(mut frame: Frame) -> Frame {
        frame.motion.forward = 0.25;
        frame
    }

    let world = world();
    let mut pipeline = world.pipeline(&script("depth"));
    let first = pipeline.step(moving(with_depth(1))).unwrap();
    for index in [2, 3] {
        let refused = pipeline.step(moving(frame(index, index as f64 * 0.1))).unwrap_err();
        assert_eq!(
            refused,
            StepError::Lacks { plugin: "script".into(), frame: index, input: Input::Depth }
        );
    }
    assert!(
        world.asked.lock().unwrap().iter().all(|(_, index, _)| *index == 1),
        "no plugin saw it"
    );
    let next = pipeline.step(moving(with_depth(4))).unwrap();
    assert_eq!(next.tracks[0].id, first.tracks[0].id);
    let predicted = world.predicted.lock().unwrap();
    assert!((predicted[0].forward - 0.75).abs() < 1e-12 && (predicted[0].dt - 0.3).abs() < 1e-9);
}

/// The robot stands from the refused frame on, though the last command would hold, until the next frame.
#[test]
fn a_refused_frame_gives_no_command_and_ends_the_last_one() {
    fn bare(index: u64) -> Frame {
        frame(index, index as f64 * 0.1)
    }

    fn whole(index: u64) -> Frame {
        bare(index).with_depth(Arc::new(DepthImage::filled(640, 480, 8.0)))
    }

    let rules = "[controller]\nplugin = 'drive'\n[collision_monitor]\nnoiseless = true\n";
    let config = format!("{}\n{rules}", script("depth"));
    let world = World::of((0..30).map(|_| vec![scored(5.0, person(3.0, 0.0))]));
    let mut pipeline = world.pipeline(&config);
    let mut last = None;
    for index in 1..=20 {
        last = pipeline.step(whole(index)).unwrap().command;
    }
    let late = bare(21).stamp;
    let command = last.unwrap();
    assert_ne!(command.wheels, WheelSpeeds::STOP, "{:?}", command.reason);
    assert_eq!(pipeline.command_after(late, Duration::ZERO), Some(command));
    pipeline.step(bare(21)).unwrap_err();
    let stopped = pipeline.command_after(late, Duration::ZERO).unwrap();
    assert_eq!((stopped.wheels, stopped.reason), (WheelSpeeds::STOP, Reason::Expired));
    assert_eq!(pipeline.status().unwrap().command, "expired");
    let next = pipeline.step(whole(22)).unwrap().command.unwrap();
    assert_ne!(next.wheels, WheelSpeeds::STOP, "{:?}", next.reason);
    assert_eq!(pipeline.command_after(late, Duration::ZERO), Some(next));
    let jumped = bare(23).with_odometry_jump(true);
    pipeline.step(jumped).unwrap_err();
    assert_eq!(pipeline.fault(), Some("odometry jumped"), "also in a refused frame");
}

/// A detector that rests needs nothing, and neither does a pipeline after a change of calibration.
#[test]
fn only_what_a_frame_needs_is_required_of_it() {
    let every = script("depth").replace("plugin = 'script'", "plugin = 'script'\nevery = 2");
    let mut pipeline = world().pipeline(&every);
    pipeline.step(with_depth(1)).unwrap();
    pipeline.step(frame(2, 0.2)).unwrap();
    assert!(pipeline.step(frame(3, 0.3)).is_err());
    pipeline.step(frame(4, 0.4).with_changed_calibration(true)).unwrap();
    pipeline.step(frame(5, 0.5)).unwrap();
}

/// Distances straight ahead, m, by a sensor that no crate but this one knows.
struct Radar(Vec<f64>);

impl Sensor for Radar {
    const INPUT: Input = Input::Named("radar");
}

struct RadarDetector;

impl Detector for RadarDetector {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Radar::INPUT);
        Capabilities::new(inputs).discovering()
    }

    fn detect(&mut self, frame: &Frame, _: &Query<'_>, _: &mut Funnel) -> Result<Vec<Detection>> {
        let echoes = frame.sensor::<Radar>()?.0.iter();
        Ok(echoes.map(|metres| person(*metres, 0.0).with_image(None)).collect())
    }
}

#[test]
fn a_sensor_that_another_crate_defines_reaches_the_plugins_that_declare_it() {
    fn seen(index: u64) -> Frame {
        frame(index, index as f64 * 0.1).with_sensor(Radar(vec![2.5]))
    }

    let mut registry = world().registry();
    registry.detector("radar", "reads echoes", |_: Config, _| Ok(RadarDetector));
    let config = PLAIN.replace("'script'", "'radar'");
    let mut pipeline = Pipeline::builder(&registry).from_toml(&config).unwrap();
    assert_eq!(pipeline.inputs(), Inputs::NONE.require(Radar::INPUT));
    let report = pipeline.step(seen(1)).unwrap();
    assert_eq!(report.tracks[0].estimate.person.position.x, 2.5);
    let lacking = pipeline.step(frame(2, 0.2)).unwrap_err().to_string();
    assert!(lacking.contains("radar, which this frame does not have"), "{lacking}");
    assert!(seen(3).restricted_to(&inputs(PLAIN)).unwrap().sensor::<Radar>().is_err());
}
