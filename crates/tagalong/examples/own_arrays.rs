//! Tracks a person in depth images that the program has in memory, with the camera that took them.

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
            println!("{stamp} s: {} at {:.2} m", track.id, track.position.coords.norm());
        }
    }
    Ok(())
}

/// Returns the depth image of a wall at 5 m with the upper body of a person before it, at 2.5 m.
fn depth_image() -> DepthImage {
    DepthImage::from_fn(640, 480, |column, row| {
        let x_px = column as f64 - 320.0;
        let y_px = row as f64 - 140.0;
        let is_head = (x_px / 19.0).hypot(y_px / 25.0) < 1.0;
        let is_neck = x_px.abs() < 11.0 && (0.0..40.0).contains(&y_px);
        let is_torso = (x_px / 48.0).powi(4) + ((y_px - 160.0) / 125.0).powi(4) < 1.0;
        if is_head || is_neck || is_torso { 2.5 } else { 5.0 }
    })
}
