//! Prints the people of a log: `people.mcap` in the current folder.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong::prelude::*;

fn main() -> Result<()> {
    let mut pipeline = Pipeline::builtin("depth-verified")?; // or from_toml_file
    for frame in Log::open("people.mcap")?.frames(&pipeline)? {
        let tracks = pipeline.step(&frame?)?.tracks;
        for track in tracks.iter().filter(|track| track.confirmed && track.seen) {
            println!("{} at {:.2} m", track.id, track.position.xy().coords.norm());
        }
    }
    Ok(())
}
