//! Tracks a person in depth images that the program has in memory, with the camera that took them.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong::prelude::*;

fn main() -> Result<()> {
    let lens = Pinhole::centred(525.0, 640, 480);
    let camera = Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0); // 1.2 m high, level
    let mut pipeline = Pipeline::builtin("depth-ekf")?;
    let mut frames = FrameMaker::new(camera);
    for count in 0..20 {
        let stamp = Stamp::default().plus_seconds(0.1 * f64::from(count));
        let report = pipeline.step(frames.at(stamp).depth(depth_image()).frame()?)?;
        for track in report.tracks {
            println!("{stamp} s: {} at {:.2} m", track.id, track.position.xy().coords.norm());
        }
    }
    Ok(())
}

/// Parts of a person as ellipses: centre below that of the head, half width, half height, m.
const PARTS: [[f64; 3]; 5] = [
    [0.0, 0.08, 0.115],
    [0.15, 0.065, 0.13],
    [0.4, 0.24, 0.21],
    [0.62, 0.19, 0.38],
    [1.2, 0.17, 0.45],
];

/// Returns the depth image of a floor, a wall at 5 m, and a person 1.7 m tall at 2.5 m.
fn depth_image() -> DepthImage {
    DepthImage::from_fn(640, 480, |column, row| {
        // Pixels per metre at the person's distance, and pixels below the horizon.
        let scale = 525.0 / 2.5;
        let below_px = row as f64 - 239.5;
        let across_m = (column as f64 - 319.5) / scale;
        let below_m = below_px / scale + 0.4;
        for [centre, half_width, half_height] in PARTS {
            if (across_m / half_width).hypot((below_m - centre) / half_height) < 1.0 {
                return 2.5;
            }
        }
        let floor_m = 1.2 * 525.0 / below_px;
        if below_px > 0.0 { floor_m.min(5.0) as f32 } else { 5.0 }
    })
}
