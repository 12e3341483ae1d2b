//! Prints the time of a frame of the whole tracker with given detections, for each number of people
//! that is named: the median processor time, in microseconds. Everyone stands 1.1 m from the next, before a camera.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_tracker -- 5 20 100
//! ```
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program for developers")]

use std::sync::Arc;

use cpu_time::ThreadTime;
use nalgebra::{Matrix3, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_benches::timing::statistic_us;
use tagalong_core::{
    Capabilities, Detection, Detector, EgoMotion, Frame, Funnel, Images, Inputs, Query, Result,
    Stamp,
};
use tagalong_geometry::{Camera, ImageBox, Pinhole};
use tagalong_math::{RandomSource, SplitMix64};
use tagalong_pipeline::Pipeline;

/// Frames until all tracks are confirmed, and those that are timed.
const FIRST: u64 = 30;
const TIMED: u64 = 300;
const FRAME_NS: u64 = 100_000_000;

fn main() {
    for people in std::env::args().skip(1).filter_map(|text| text.parse().ok()) {
        println!("{people} {:.2}", median_us(people));
    }
}

/// Settings of `grid`.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct GridSettings {
    people: usize,
}

/// Detects people at the crossings of a grid, a few centimetres off.
struct Grid {
    people: usize,
    random: SplitMix64,
}

impl Detector for Grid {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE).discovering()
    }

    fn detect(&mut self, frame: &Frame, _: &Query<'_>, _: &mut Funnel) -> Result<Vec<Detection>> {
        let side = (self.people as f64).sqrt().ceil() as usize;
        let found = (0..self.people).map(|i| {
            let row = (i / side) as f64;
            let column = (i % side) as f64 - 0.5 * (side - 1) as f64;
            let position = Point3::from(
                [2.0 + 1.1 * row, 1.1 * column, 1.6]
                    .map(|at| at + self.random.between(-0.05, 0.05)),
            );
            Detection::new("grid", position, Matrix3::identity() * 0.0025, 4.0)
                .with_image(ImageBox::upper_body(frame.camera.upper_body(&position)))
        });
        Ok(found.collect())
    }
}

fn median_us(people: usize) -> f64 {
    let mut registry = tagalong_catalog::registry();
    registry.detector("grid", "people on a grid", |settings: GridSettings, _| {
        Ok(Grid { people: settings.people, random: SplitMix64::new(1) })
    });
    let config = format!(
        "[[detectors]]\nplugin = 'grid'\nroles = ['discover']\nconfig = {{ people = {people} }}\n\
         [filter]\nplugin = 'ekf'\n[associator]\nplugin = 'associate-hungarian'\n\
         [manager]\nplugin = 'manage-sprt'\n"
    );
    let mut pipeline =
        Pipeline::builder(&registry).from_toml(&config).expect("the config is right");
    let camera =
        Arc::new(Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.5, 0.0, 0.0));
    let mut times = Vec::new();
    for index in 0..FIRST + TIMED {
        let stamp = Stamp::from_nanos(index * FRAME_NS);
        let motion = EgoMotion::at_rest(0.1);
        let images = Images::default();
        let frame = Frame::new(index, stamp, Arc::clone(&camera), motion, images);
        let start = ThreadTime::now();
        let report = pipeline.step(&frame).expect("nothing fails");
        let us = 1e6 * start.elapsed().as_secs_f64();
        if index >= FIRST {
            assert_eq!(report.tracks.len(), people, "everyone is tracked");
            times.push(us);
        }
    }
    statistic_us(&times)
}
