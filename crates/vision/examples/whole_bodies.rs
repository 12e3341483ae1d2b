//! Turns boxes of whole people, as a network returns them, into detections, using the depth within
//! them.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong_core::{Detection, Frame, Query};
use tagalong_geometry::Rect;
use tagalong_vision::{BoxSettings, log_odds_of};

/// Answers a query with the boxes of all people in the frame and their probabilities.
fn answer(
    boxes: &[(Rect, f64)],
    frame: &Frame,
    query: &Query<'_>,
    settings: &BoxSettings,
) -> Vec<Detection> {
    let mut found = Vec::new();
    for (region, probability) in boxes {
        let score = log_odds_of(*probability);
        found.extend(settings.detection(frame, region, score, "my-network"));
    }
    match query {
        Query::Discover { .. } => found,
        Query::Track(track) => settings.near(track, found),
    }
}

fn main() {
    let lens = tagalong_geometry::Pinhole::centred(525.0, 640, 480);
    let camera = tagalong_geometry::Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0);
    // A person 1.7 m tall at 3 m, in front of a wall at 5 m.
    let person = Rect::new(275.0, 152.0, 90.0, 297.0);
    let depth = tagalong_core::DepthImage::from_fn(640, 480, |x, y| {
        let is_person = (280..360).contains(&x) && (152..449).contains(&y);
        if is_person { 3.0 } else { 5.0 }
    });
    let images = tagalong_core::Images { depth: Some(depth.into()), ..Default::default() };
    let motion = tagalong_core::EgoMotion::at_rest(0.1);
    let frame = Frame::new(1, tagalong_core::Stamp::default(), camera.into(), motion, images);
    let query = Query::Discover { occupied: &[] };
    let found = answer(&[(person, 0.9)], &frame, &query, &BoxSettings::default());
    for one in &found {
        println!("a head at {:.2}, score {:.1}", one.position, one.score);
    }
    assert!((found[0].position.x - 3.1).abs() < 0.15, "{}", found[0].position);
    assert!((found[0].position.z - 1.6).abs() < 0.15, "{}", found[0].position);
}
