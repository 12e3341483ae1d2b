//! Steers a robot behind the person in front of it. Here the frames come from a log, `people.mcap`;
//! on a robot they come from its sensors, and a control loop calls `command_at` between them.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong::prelude::*;

fn main() -> Result<()> {
    let mut pipeline = Pipeline::builtin("follow-depth")?;
    for frame in Log::open("people.mcap")?.frames(&pipeline)? {
        let frame = frame?;
        let report = pipeline.step(&frame)?;
        let Some(target) = report.target else { continue };
        if let Some(command) = pipeline.command_at(frame.frame.stamp) {
            let Twist { linear_mps, angular_rps, .. } = command.twist;
            println!(
                "track {target}: {linear_mps:.2} m/s, {angular_rps:.2} rad/s ({})",
                command.reason
            );
        }
    }
    Ok(())
}
