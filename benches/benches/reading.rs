//! Reading speed: a real log through the frame source, beside the mere decoding of its images.
//! Without `../shared/data/logs` it prints that it skips.
#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a broken test or bench may stop loudly"
)]

use std::fs::File;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_log::LogWalker;
use tagalong_log::images::{decode_compressed, decode_raw};
use tagalong_log::msgs::{CompressedImage, Image, decode};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};

/// Walks the file; `images` decodes its pictures, too. Returns the messages.
fn walk(path: &Path, images: bool) -> usize {
    let limits = Limits::default();
    let mut walker =
        LogWalker::new(File::open(path).expect("the log"), &limits).expect("an MCAP file");
    let mut messages = 0;
    while let Some(message) = walker.next() {
        messages += 1;
        if !images {
            continue;
        }
        match message.channel.schema_name.as_str() {
            "sensor_msgs/msg/Image" => {
                let image = decode::<Image<'_>>(message.data).expect("an image");
                decode_raw(&image, None, &limits).expect("pixels");
            }
            "sensor_msgs/msg/CompressedImage" => {
                let image = decode::<CompressedImage<'_>>(message.data).expect("an image");
                decode_compressed(&image, None, &limits).expect("pixels");
            }
            _ => {}
        }
    }
    messages
}

fn reading(c: &mut Criterion) {
    for name in ["um", "lab2-camera2"] {
        let Some(path) = tagalong_conformance::testdata::find(&format!("logs/{name}.mcap")) else {
            continue;
        };
        let input = InputSettings::default();
        let limits = Limits::default();
        let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
        c.bench_function(&format!("{name}: messages alone"), |b| b.iter(|| walk(&path, false)));
        c.bench_function(&format!("{name}: messages and pictures"), |b| {
            b.iter(|| walk(&path, true))
        });
        c.bench_function(&format!("{name}: all frames, ready for a pipeline"), |b| {
            b.iter(|| {
                let mut source =
                    FrameSource::open(&path, &input, &limits, inputs).expect("a healthy log");
                let mut frames = 0;
                while let Some(frame) = source.next_frame() {
                    frames += frame.frame.index;
                }
                frames
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = reading
}
criterion_main!(benches);
