//! Prints the time of reading and scoring a sequence in the format of MOT17 with CLEAR, Identity and
//! HOTA: the median of some calls, in milliseconds. `benches/peers/kernels.py` compares it with
//! TrackEval's.
//!
//! ```text
//! cargo run --release -p tagalong-benches --example time_metrics -- gt.txt tracks.txt FRAMES
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::error::Error;
use std::fs::read_to_string;

use tagalong_benches::timing::median_us;
use tagalong_eval::formats::{Timeline, mot};
use tagalong_eval::{Clear, Comparison, Hota, HotaLevel, Identity, PairTable, Prepared};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [truth, tracks, frames] = &arguments[..] else {
        return Err("expected: TRUTH TRACKS FRAMES".into());
    };
    let frames = frames.parse()?;
    score(truth, tracks, frames)?;
    let us = median_us(|| score(truth, tracks, frames).is_ok());
    println!("{:.3}", 1e-3 * us);
    Ok(())
}

fn score(truth: &str, tracks: &str, frames: u32) -> Result<f64, Box<dyn Error>> {
    let rules = mot::Rules::Mot17;
    let truth = mot::parse_truth(&read_to_string(truth)?, truth, rules)?;
    let tracks = mot::parse_tracks(&read_to_string(tracks)?, tracks)?;
    let mut timeline = Timeline::new();
    timeline.add_truths(truth.iter().map(|row| row.truth(rules)));
    timeline.add_reports(tracks.iter().map(mot::Row::report));
    let (sequence, _) = timeline.into_sequence("timed", 1, frames, 30.0);
    let prepared = Prepared::new(&sequence, &Comparison::default())?;
    let table = PairTable::new(&prepared);
    let (clear, _) = Clear::measure(&prepared);
    let identity = Identity::measure(&prepared, &table);
    let hota = Hota::measure(&prepared, &table);
    Ok(clear.mota() + identity.idf1() + hota.mean(HotaLevel::hota))
}
