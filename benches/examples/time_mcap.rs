//! Prints the time of reading all messages of an MCAP file, without compression and with each: ours,
//! that of the `mcap` crate, which reads the whole file into memory first, and that of the crate with
//! the file in memory already: the median of calls that take turns, in milliseconds. The file has a
//! hundred depth images of 640x480. `benches/peers/kernels.py` shows the ratios.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_mcap
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use cpu_time::ThreadTime;
use mcap::records::MessageHeader;
use mcap::{Compression, MessageStream, WriteOptions};
use tagalong_benches::timing::statistic_us;
use tagalong_log::{Limits, LogWalker};
use tagalong_math::{RandomSource, SplitMix64};

/// Calls, of which the median counts.
const CALLS: usize = 9;
const IMAGES: u32 = 100;
const FORMS: [(&str, Option<Compression>); 3] =
    [("none", None), ("lz4", Some(Compression::Lz4)), ("zstd", Some(Compression::Zstd))];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    for (name, compression) in FORMS {
        let path = folder.path().join(name).with_extension("mcap");
        write(&path, compression)?;
        let bytes = std::fs::read(&path)?;
        let mut times = [const { Vec::new() }; 3];
        for _ in 0..CALLS {
            let (ours, ours_ms) = timed(|| sum_of_ours(&path))?;
            let (read, read_ms) = timed(|| sum_of_theirs(&std::fs::read(&path)?))?;
            let (held, held_ms) = timed(|| sum_of_theirs(&bytes))?;
            if ours != read || ours != held {
                return Err(format!("{name}: {ours:?} instead of {held:?}").into());
            }
            for (times, ms) in times.iter_mut().zip([ours_ms, read_ms, held_ms]) {
                times.push(ms);
            }
        }
        let [ours_ms, read_ms, held_ms] = times.map(|times| statistic_us(&times));
        println!("{name} {ours_ms:.3} {read_ms:.3} {held_ms:.3}");
    }
    Ok(())
}

fn timed<T>(call: impl Fn() -> Result<T, Box<dyn Error>>) -> Result<(T, f64), Box<dyn Error>> {
    let start = ThreadTime::now();
    let answer = call()?;
    Ok((answer, 1e3 * start.elapsed().as_secs_f64()))
}

/// Messages, their bytes, and the sum of the last byte of each.
type Sum = (usize, usize, u64);

fn add(sum: Sum, data: &[u8]) -> Sum {
    (sum.0 + 1, sum.1 + data.len(), sum.2 + u64::from(data.last().copied().unwrap_or_default()))
}

fn sum_of_ours(path: &Path) -> Result<Sum, Box<dyn Error>> {
    let mut walker = LogWalker::open(path, &Limits::default())?;
    let mut sum = Sum::default();
    while let Some(message) = walker.next() {
        sum = add(sum, message.data);
    }
    Ok(sum)
}

fn sum_of_theirs(bytes: &[u8]) -> Result<Sum, Box<dyn Error>> {
    MessageStream::new(bytes)?.try_fold(Sum::default(), |sum, message| Ok(add(sum, &message?.data)))
}

/// Writes images of a slope with noise in the lowest bits.
fn write(path: &Path, compression: Option<Compression>) -> Result<(), Box<dyn Error>> {
    let options = WriteOptions::new().compression(compression).compression_threads(1);
    let mut writer = options.create(std::fs::File::create(path)?)?;
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"")?;
    let channel_id = writer.add_channel(schema, "depth", "cdr", &BTreeMap::new())?;
    let mut random = SplitMix64::new(1);
    for sequence in 0..IMAGES {
        let data: Vec<u8> = (0..640 * 480)
            .map(|i| (1000 + i / 300) as u16 + random.between(0.0, 4.0) as u16)
            .flat_map(u16::to_le_bytes)
            .collect();
        let time = 100_000_000 * u64::from(sequence);
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &data)?;
    }
    writer.finish()?;
    Ok(())
}
