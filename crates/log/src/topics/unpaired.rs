//! Frames that are lost because they have no image of another topic.

use tagalong_core::Stamp;
use tagalong_math::median;

use super::problems::{
    Problem, RECORDING, TOGETHER, WHOLE_SECONDS, at_capture, near_s, pairing_problem,
    wider_tolerance,
};
use crate::scan::{Scan, Topic};
use crate::tally::is_unusual;
use crate::timing::{Skew, Timing, nearest};

/// Ratio of the periods of two topics from which on one counts as slower.
const SLOWER: f64 = 1.5;
/// Minimum step of a topic that is slower by itself, in periods.
const EVEN: f64 = 0.75;
/// Maximum gap of a topic that is slower but complete, in periods.
const LONGEST_GAP: f64 = 3.0;
/// Fraction of the images of a slower topic that must belong to a frame.
const MOST_PAIRED: f64 = 0.9;
/// Part of the time that a topic lacks by its stamps which it has to lack by the recording times, too.
const RECORDED_PART: f64 = 0.5;
/// Time between a frame and its partner in the log from which on it is too long to wait, s.
const LONG_S: f64 = 1.0;

/// Returns the reason why many frames of a topic have no image of a second one; `None` if that one
/// is slower by itself, so that nothing is lost.
pub(crate) fn unpaired(
    scan: &Scan,
    first: &str,
    second: &str,
    tolerance_s: f64,
) -> Option<Problem> {
    let frames = scan.topics.get(first)?;
    let partners = scan.topics.get(second)?;
    if let Some(problem) = pairing_problem(scan, frames, partners, tolerance_s) {
        return Some(problem);
    }
    if has_whole_seconds(partners) && !has_whole_seconds(frames) {
        return Problem::new(WHOLE_SECONDS, RECORDING);
    }
    for (topic, stamps) in [(first, &frames.stamps), (second, &partners.stamps)] {
        let back = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
        if is_unusual(back as u64, stamps.len() as u64) && !scan.has_recording_times {
            let why = format!("the stamps of {topic} go back {back} times");
            return Some(Problem { why, remedy: RECORDING.to_owned() });
        }
    }
    if let Some(why) = is_short(frames, partners, tolerance_s) {
        return Some(Problem { why, remedy: TOGETHER.to_owned() });
    }
    if is_slower(frames, partners, tolerance_s) {
        return None;
    }
    recorded_apart(frames, partners, tolerance_s)
        .or_else(|| Some(missing_or_apart(scan, frames, partners, tolerance_s)))
}

/// Returns true for stamps that are rounded to whole seconds.
fn has_whole_seconds(topic: &Topic) -> bool {
    topic.times().is_some_and(|times| times.are_whole_seconds())
}

/// Returns the problem of partners that have the stamps of most frames but were recorded at other
/// positions in the log, too far away for the frames to wait.
fn recorded_apart(frames: &Topic, partners: &Topic, tolerance_s: f64) -> Option<Problem> {
    let mut known: Vec<(Stamp, Stamp)> =
        partners.stamps.iter().copied().zip(partners.recorded.iter().copied()).collect();
    known.sort();
    let mut delays_s = Vec::new();
    for (at, recorded) in frames.stamps.iter().zip(&frames.recorded) {
        let earliest = at.plus_seconds(-tolerance_s);
        let first = known.partition_point(|(stamp, _)| *stamp < earliest);
        if let Some((stamp, then)) = known.get(first)
            && stamp.seconds_since(*at) <= tolerance_s
        {
            delays_s.push(then.seconds_since(*recorded));
        }
    }
    let are_paired = delays_s.len() as f64 >= MOST_PAIRED * frames.stamps.len() as f64;
    let delay_s = median(delays_s).filter(|delay_s| are_paired && delay_s.abs() > LONG_S)?;
    let side = if delay_s > 0.0 { "after" } else { "before" };
    let why = format!(
        "those with the stamps of the frames stand {:.1} s {side} them in the log, and no frame waits so \
         long",
        delay_s.abs()
    );
    Problem::new(why, TOGETHER)
}

/// Returns a message about partners that begin late or end early, if most frames without a partner
/// are there.
fn is_short(frames: &Topic, partners: &Topic, tolerance_s: f64) -> Option<String> {
    let times = partners.times()?;
    let of_frames = frames.times()?;
    let period_s = Timing::of(&partners.stamps).map_or(0.0, |timing| timing.median_period_s);
    let margin_s = period_s.max(tolerance_s);
    let mut sorted = partners.stamps.clone();
    sorted.sort();
    let without = frames
        .stamps
        .iter()
        .filter(|at| nearest(&sorted, **at).is_none_or(|offset_s| offset_s.abs() > tolerance_s));
    let without: Vec<Stamp> = without.copied().collect();
    let early = without.iter().filter(|at| times.first.seconds_since(**at) > margin_s).count();
    let late = without.iter().filter(|at| at.seconds_since(times.last) > margin_s).count();
    if 2 * (early + late) <= without.len() {
        return None;
    }
    let is_late = early > late;
    let missing_s = if is_late {
        times.first.seconds_since(of_frames.first)
    } else {
        of_frames.last.seconds_since(times.last)
    };
    let recorded_s = if is_late {
        times.first_recorded.seconds_since(of_frames.first_recorded)
    } else {
        of_frames.last_recorded.seconds_since(times.last_recorded)
    };
    // Stamps alone may be those of another clock.
    if recorded_s < RECORDED_PART * missing_s {
        return None;
    }
    Some(if is_late {
        format!("it begins {missing_s:.1} s after the first frame")
    } else {
        format!("it ends {missing_s:.1} s before the last frame")
    })
}

/// Returns a message about partners that are slower than the frames by themselves, with both rates.
pub(crate) fn slower_words(scan: &Scan, first: &str, second: &str) -> Option<String> {
    let fast = Timing::of(&scan.topics.get(first)?.stamps)?;
    let slow = Timing::of(&scan.topics.get(second)?.stamps)?;
    Some(format!(
        "it has {:.1} images a second, and {first} {:.1}",
        1.0 / slow.median_period_s,
        1.0 / fast.median_period_s
    ))
}

/// Returns true if the partners have a lower but regular rate, and each of them belongs to a frame.
fn is_slower(frames: &Topic, partners: &Topic, tolerance_s: f64) -> bool {
    let (Some(fast), Some(slow)) = (Timing::of(&frames.stamps), Timing::of(&partners.stamps))
    else {
        return false;
    };
    let paired = Skew::between(&partners.stamps, &frames.stamps, tolerance_s);
    // If images were dropped, the remaining ones have the rate of the frames.
    let steps = partners.stamps.windows(2).map(|pair| pair[1].seconds_since(pair[0]));
    let short = steps.filter(|step_s| *step_s < EVEN * slow.median_period_s).count();
    !is_unusual(short as u64, partners.stamps.len() as u64)
        && slow.median_period_s >= SLOWER * fast.median_period_s
        && slow.longest_gap_s <= LONGEST_GAP * slow.median_period_s
        && paired.is_some_and(|skew| skew.paired >= MOST_PAIRED)
}

/// Returns the problem of partners that are missing, or of stamps that are too far apart.
fn missing_or_apart(scan: &Scan, frames: &Topic, partners: &Topic, tolerance_s: f64) -> Problem {
    let mut sorted = partners.stamps.clone();
    sorted.sort();
    let offsets = frames.stamps.iter().filter_map(|at| nearest(&sorted, *at)).map(f64::abs);
    let apart_s = median(offsets.filter(|offset_s| *offset_s > tolerance_s)).unwrap_or(0.0);
    if partners.count as f64 >= MOST_PAIRED * frames.count as f64 {
        let why = format!("the stamps of half of them are {:.0} ms or more apart", 1e3 * apart_s);
        let remedy = if apart_s < near_s(frames, partners) {
            wider_tolerance(apart_s)
        } else {
            at_capture(scan, frames, partners, tolerance_s)
        };
        return Problem { why, remedy };
    }
    let why = format!("it has {} images, and there are {} frames", partners.count, frames.count);
    let remedy = "record fewer or compressed topics, so that none of its images is dropped";
    Problem { why, remedy: remedy.to_owned() }
}
