//! One module for each possible problem. A check returns `None` if the log lacks the data for it,
//! for example depth.

mod damage;
mod depth;
mod exposure;
mod floor;
mod frames;
mod heads;
mod intrinsics;
mod laser;
mod missed;
mod mount;
mod needs;
mod odometry;
mod people;
mod pose;
mod preparation;
mod rate;
mod reading;
mod registration;
mod skew;
mod skipped;
mod stamps;
mod still;
mod suits;
mod topics;

use super::coverage::{Alternative, Coverage};
use super::evidence::Evidence;
use super::finding::{Finding, Severity};

/// Function of one check.
type Check = fn(&Evidence) -> Option<Finding>;

/// Runs all checks, and returns their findings, causes before their consequences.
pub fn findings(evidence: &Evidence) -> Vec<Finding> {
    let mut found: Vec<Finding> = BEFORE_LASER.iter().filter_map(|check| check(evidence)).collect();
    found.extend(laser::scanners(evidence));
    found.extend(BEHIND_LASER.iter().filter_map(|check| check(evidence)));
    found
}

/// Checks before those of the scanners, of which there are as many as scanners.
const BEFORE_LASER: &[Check] = &[
    needs::needs,
    topics::topics,
    damage::damage,
    reading::reading,
    skipped::skipped,
    intrinsics::intrinsics,
    frames::frames,
    rate::rate,
    stamps::stamps,
    skew::skew,
    exposure::exposure,
    depth::depth,
    registration::registration,
    floor::floor,
    mount::mount,
    heads::heads,
    suits::suits,
];

/// Checks behind those of the scanners.
const BEHIND_LASER: &[Check] =
    &[odometry::odometry, preparation::preparation, people::people, still::still, missed::missed];

/// Returns true if tracks disagree with shapes that come and go, so that other settings should be
/// tried.
pub fn asks_for_settings(evidence: &Evidence) -> bool {
    let asking = [still::still(evidence), missed::missed(evidence)];
    asking.iter().flatten().any(|finding| finding.severity >= Severity::Warn)
}

/// Gain of a setting below which it is not recommended.
const MIN_GAIN: f64 = 0.02;

/// Returns the best alternative that was tried on this log, if it is better than the present
/// setting and satisfies a condition.
fn better(evidence: &Evidence, fits: impl Fn(&Coverage) -> bool) -> Option<&Alternative> {
    let now = evidence.coverage.worth();
    // The best comes first.
    let mut better =
        evidence.alternatives.iter().take_while(|other| other.coverage.worth() > now + MIN_GAIN);
    better.find(|other| fits(&other.coverage))
}
