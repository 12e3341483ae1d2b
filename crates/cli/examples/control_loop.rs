//! A control loop around a pipeline, as on a robot: frames come irregularly, the wheels receive a
//! command fifty times a second.
//!
//! Here both belong to a simulated scene. On a robot `next` is the driver of the camera and the
//! odometry, and `drive` is the one of the wheels.
//!
//! ```sh
//! cargo run --release -p tagalong-cli --example control_loop
//! ```
#![allow(clippy::print_stdout, reason = "an example tells what it does")]

use std::error::Error;
use std::time::Duration;

use tagalong_core::{Command, Stamp};
use tagalong_pipeline::Pipeline;
use tagalong_sim::{Event, Scene, Variant};
use tagalong_trials::Draw;

/// Duration of the ride, s.
const SECONDS: f64 = 8.0;

fn main() -> Result<(), Box<dyn Error>> {
    let registry = tagalong_catalog::registry();
    let builder = Pipeline::builder(&registry);
    let mut pipeline = builder.from_toml_file("configs/follow-depth.toml")?;

    let scene = std::fs::read_to_string("configs/scenes/follow-passing.toml")?;
    let scene = Scene::parse_with(&scene, &Variant::default())
        .map_err(|error| error.render("configs/scenes/follow-passing.toml", &scene))?;
    let mut robot = Draw::live(&scene, 1);

    // The base executes the commands from now on: they are compared with its odometry.
    pipeline.set_driving(true);
    let mut now = Stamp::default();
    let mut framed = now;
    loop {
        // Until the next frame comes, the last command is requested again and again. It expires by
        // itself: if the camera stops, so does the robot.
        let next = robot.next_frame_while(|_, event| {
            let Event::Odometry(reading) = event else { return None };
            now = Stamp::from_nanos(reading.at_ns);
            // In simulated time; on a robot `command_at`, which asks the clock of the machine.
            let since_frame = Duration::from_secs_f64(now.seconds_since(framed));
            pipeline.command_after(now, since_frame).map(|command| command.wheels)
        });
        let Some(drawn) = next else { break };
        let frame = drawn.frame;
        if frame.stamp.seconds_since(Stamp::default()) > SECONDS {
            break;
        }
        // A pipeline that fails has stopped the robot already: `command_at` is zero from now on.
        let report = pipeline.step(&frame)?;
        framed = now;
        if let (Some(command), Some(lock), 1) = (report.command, report.lock, frame.index % 10) {
            tell(&frame.stamp, &command, lock.state.name(), lock.why);
        }
    }
    Ok(())
}

fn tell(stamp: &Stamp, command: &Command, state: &str, why: &str) {
    let Command { wheels, reason, .. } = command;
    println!("{stamp} {:+.2} {:+.2} m/s: {reason}; {state}: {why}", wheels.left, wheels.right);
}
