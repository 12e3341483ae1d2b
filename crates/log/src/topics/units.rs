//! Depth units that cameras publish, and the depth images to which they apply.

use super::calibration::{common_folders, folders};
use super::name::TopicName;
use crate::images::Content;
use crate::scan::Scan;

/// Returns the unit that the camera of a depth topic publishes, m, with the topic of the unit: the
/// one that shares the most namespaces with it. `None` if only other cameras publish their unit, or
/// if several that differ could be meant.
pub(crate) fn told_unit<'a>(scan: &'a Scan, depth: &str) -> Option<(&'a str, f64)> {
    let mut best: Option<(usize, &str, f64)> = None;
    let mut is_open = false;
    for (topic, unit_m) in &scan.depth_units {
        if !is_unit_of(scan, topic, depth) {
            continue;
        }
        let common = common_folders(topic, depth);
        match best {
            Some((most, ..)) if most > common => {}
            Some((most, _, other_m)) if most == common => is_open |= other_m != *unit_m,
            _ => {
                best = Some((common, topic.as_str(), *unit_m));
                is_open = false;
            }
        }
    }
    best.filter(|_| !is_open).map(|(_, topic, unit_m)| (topic, unit_m))
}

/// Returns true if the topic of a unit may belong to the device of a depth topic: it is in the root
/// or shares a namespace, and no other device with depth is nearer to it.
fn is_unit_of(scan: &Scan, unit: &str, depth: &str) -> bool {
    let common = common_folders(unit, depth);
    let has_folder = folders(unit).next().is_some();
    let name = TopicName::of(depth);
    if common == 0 && has_folder || name.contradicts(&TopicName::of(unit)) {
        return false;
    }
    let mut others = scan.topics.iter().filter(|(other, topic)| {
        topic.content == Content::Depth && TopicName::of(other).device != name.device
    });
    others.all(|(other, _)| common_folders(unit, other) <= common)
}
