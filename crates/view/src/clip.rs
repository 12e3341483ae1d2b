//! Animation of the pictures of a run.

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_app::outcome::{Ended, Failure, Outcome, make_room_for, print, spare};
use tagalong_app::progress::Progress;
use tagalong_math::counted;
use tagalong_render::Animation;

use crate::ViewArgs;
use crate::assemble::{stamps, times};
use crate::recording::{Recording, no_frames};

/// Writes the animation of a run.
///
/// # Errors
/// A run without pictures, a span without frames, or a file that exists.
pub fn write(args: &ViewArgs, file: &Path) -> Outcome {
    let run = [Recording::read(&args.run, &args.window()?)?];
    spare(file, args.overwrite)?;
    let shown = stamps(&run);
    if shown.is_empty() {
        return Err(no_frames(&run));
    }
    let chosen = paced(&times(&shown), args.fps);
    let wanted: Vec<u64> = chosen.into_iter().map(|at| shown[at]).collect();
    let moments = run[0].moments.iter().filter(|m| wanted.contains(&m.notes.stamp_ns));
    let overlay = args.run.join("overlay");
    let pictures: Vec<PathBuf> =
        moments.map(|m| overlay.join(format!("{:06}.png", m.notes.frame))).collect();
    if !pictures.iter().any(|path| path.is_file()) {
        return Err(Failure::usage(format!(
            "{} has no pictures: repeat the run with --overlay",
            args.run.display()
        )));
    }
    make_room_for(file)?;
    let animation = Animation { width: args.width, delay_ms: 1000 / args.fps };
    Progress::waiting("encoding", || animation.write(&pictures, file)).map_err(Failure::failed)?;
    let bytes = fs::metadata(file).map_or(0, |facts| facts.len());
    let shown = file.display();
    let pictures = counted(pictures.len(), "picture");
    print(&format!("{shown}: {pictures}, {:.1} MB\n", bytes as f64 / 1e6))?;
    Ok(Ended::Well)
}

/// Returns the positions of the frames to show, at most `fps` of them a second.
fn paced(times_s: &[f64], fps: u32) -> Vec<usize> {
    let mut due_s = f64::NEG_INFINITY;
    let mut out = Vec::new();
    for (at, time_s) in times_s.iter().enumerate() {
        // Times are rounded to a millisecond.
        if *time_s + 1e-3 >= due_s {
            out.push(at);
            // Counted from the due time, so that the mean rate is kept if one rate is not a
            // multiple of the other.
            due_s = if due_s.is_finite() { due_s } else { *time_s };
            due_s = (due_s + 1.0 / f64::from(fps)).max(*time_s);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_left_out_evenly() {
        let times: Vec<f64> = (0..30).map(|i| f64::from(i) / 30.0).collect();
        assert_eq!(paced(&times, 10), [0, 3, 6, 9, 12, 15, 18, 21, 24, 27]);
        assert_eq!(paced(&times[..4], 50), [0, 1, 2, 3]);
        let slow: Vec<f64> = (0..40).map(|i| f64::from(i) / 10.0).collect();
        assert_eq!(paced(&slow, 8).len(), 32, "eight a second of ten");
        assert_eq!(paced(&[0.0, 5.0, 5.1], 10), [0, 1, 2], "after a gap");
    }
}
