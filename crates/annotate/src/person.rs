//! One annotated person: boxes set by hand, and boxes between them.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use tagalong_eval::Region;

/// Box of a person that was set by hand or proposed, with the notes on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Upper body, pixels; it may reach beyond the image.
    pub region: Region,
    /// Visible fraction of the upper body.
    pub visible: f64,
    /// True if the person counts neither as a miss nor as a false positive.
    pub ignore: bool,
    /// Occluder: `0` for none, the ID of a person, `border` or `static`.
    pub occluder: String,
    /// Visible part of the whole body, pixels.
    pub visible_body: Option<Region>,
    /// Surface of the head in the camera frame from the file, m; it is measured again once the box
    /// moves.
    pub head_in_camera_m: Option<[f64; 3]>,
    /// Origin of that position in the file.
    pub interpolated: u8,
    /// Pipeline that proposed the box; empty once it is reviewed, and for boxes set by hand.
    pub proposed: String,
}

impl Key {
    /// Returns a fully visible person in a box.
    pub fn new(region: Region) -> Self {
        Self {
            region: tenths(region),
            visible: 1.0,
            ignore: false,
            occluder: "0".into(),
            visible_body: None,
            head_in_camera_m: None,
            interpolated: 0,
            proposed: String::new(),
        }
    }

    /// Moves the box and discards the measurements in the old one.
    pub fn move_to(&mut self, region: Region) {
        self.region = tenths(region);
        self.visible_body = None;
        self.head_in_camera_m = None;
        self.interpolated = 0;
        self.proposed.clear();
    }
}

/// Returns a box rounded to tenths of a pixel, which is finer than manual precision, so that the
/// keys in the file equal those on the page and give the same interpolated boxes.
pub fn tenths(region: Region) -> Region {
    let [x, y, width, height] = [region.x, region.y, region.width, region.height]
        // Adding 0 removes the sign of -0.
        .map(|v| (v * 10.0).round() / 10.0 + 0.0);
    Region { x, y, width, height }
}

/// Boxes of one person over time.
///
/// Between two keys the box is interpolated, except in the `holes`, which are frames without the
/// person.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Person {
    keys: BTreeMap<u32, Key>,
    holes: BTreeSet<u32>,
}

impl Person {
    /// Returns the person with these keys; frames between two keys that are not in `shown` are
    /// holes.
    pub fn of(keys: BTreeMap<u32, Key>, shown: &BTreeSet<u32>) -> Self {
        let mut person = Self { keys, holes: BTreeSet::new() };
        let span = person.span();
        person.holes = span
            .filter(|frame| !shown.contains(frame) && !person.keys.contains_key(frame))
            .collect();
        person
    }

    /// Returns true if there is no box.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Returns the frames from the first key to the last; `None` without a key.
    fn span(&self) -> RangeInclusive<u32> {
        match (self.keys.first_key_value(), self.keys.last_key_value()) {
            (Some((first, _)), Some((last, _))) => *first..=*last,
            // An empty range.
            _ => RangeInclusive::new(1, 0),
        }
    }

    /// Returns the frames with a box, in their order.
    pub fn frames(&self) -> impl Iterator<Item = u32> {
        self.span().filter(|frame| !self.holes.contains(frame))
    }

    /// Returns the key of a frame.
    pub fn key(&self, frame: u32) -> Option<&Key> {
        self.keys.get(&frame)
    }

    /// Returns the person in a frame: the key, or the interpolation between two keys.
    pub fn at(&self, frame: u32) -> Option<Key> {
        if let Some(key) = self.keys.get(&frame) {
            return Some(key.clone());
        }
        if self.holes.contains(&frame) {
            return None;
        }
        let (before, old) = self.keys.range(..frame).next_back()?;
        let (after, new) = self.keys.range(frame..).next()?;
        let share = f64::from(frame - before) / f64::from(after - before);
        let region = between(&old.region, &new.region, share);
        // The attributes are valid until the next key changes them.
        let mut notes = Key { visible_body: None, head_in_camera_m: None, ..old.clone() };
        // The frames between two keys are reviewed if both of them are.
        if notes.proposed.is_empty() {
            notes.proposed.clone_from(&new.proposed);
        }
        Some(Key { region, interpolated: 1, ..notes })
    }

    /// Sets the key of a frame.
    pub fn set(&mut self, frame: u32, key: Key) {
        // A key beyond the ends does not fill frames without the person.
        let old = self.span();
        self.holes.remove(&frame);
        self.keys.insert(frame, key);
        if old.is_empty() || old.contains(&frame) {
            return;
        }
        let gap = if frame > *old.end() { *old.end() + 1..frame } else { frame + 1..*old.start() };
        // Keys a few frames apart are meant to be joined; that is the use of interpolation.
        if gap.len() as u32 > JOINED_FRAMES {
            self.holes.extend(gap);
        }
    }

    /// Turns an interpolated box into a key; returns false if the frame has no box.
    pub fn pin(&mut self, frame: u32) -> bool {
        let Some(mut key) = self.at(frame) else { return false };
        if let Entry::Vacant(place) = self.keys.entry(frame) {
            key.interpolated = 0;
            place.insert(key);
        }
        true
    }

    /// Turns the box of a frame into a reviewed key.
    pub fn review(&mut self, frame: u32) {
        if self.pin(frame)
            && let Some(key) = self.keys.get_mut(&frame)
        {
            key.proposed.clear();
        }
    }

    /// Removes a key, so that the box is interpolated; at an end, the person then begins later or
    /// ends earlier.
    pub fn unpin(&mut self, frame: u32) {
        self.keys.remove(&frame);
        self.trim();
    }

    /// Removes the person from frames; the boxes in all other frames do not change.
    pub fn remove(&mut self, frames: RangeInclusive<u32>) {
        for edge in [frames.start().checked_sub(1), frames.end().checked_add(1)] {
            edge.map(|edge| self.pin(edge));
        }
        let span = self.span();
        let first = (*frames.start()).max(*span.start());
        let last = (*frames.end()).min(*span.end());
        self.keys.retain(|frame, _| !frames.contains(frame));
        self.holes.extend(first..=last);
        self.trim();
    }

    /// Makes the person present in all frames between the keys around a frame.
    pub fn fill(&mut self, frame: u32) {
        let before = self.keys.range(..frame).next_back().map(|(frame, _)| *frame);
        let after = self.keys.range(frame..).next().map(|(frame, _)| *frame);
        if let (Some(before), Some(after)) = (before, after) {
            self.holes.retain(|hole| !(before..=after).contains(hole));
        }
    }

    /// Splits off the frames from `frame` on; boxes do not change.
    #[must_use]
    pub fn split_off(&mut self, frame: u32) -> Self {
        self.pin_edges();
        if let Some(before) = frame.checked_sub(1) {
            self.pin(before);
        }
        self.pin(frame);
        let mut late =
            Self { keys: self.keys.split_off(&frame), holes: self.holes.split_off(&frame) };
        self.trim();
        late.trim();
        late
    }

    /// Returns true if both are in the same frame somewhere.
    pub fn meets(&self, other: &Self) -> bool {
        let frames: BTreeSet<u32> = self.frames().collect();
        other.frames().any(|frame| frames.contains(&frame))
    }

    /// Adds the boxes of another person with no frame in common; boxes do not change.
    pub fn join(&mut self, mut other: Self) {
        self.pin_edges();
        other.pin_edges();
        let shown: BTreeSet<u32> = self.frames().chain(other.frames()).collect();
        let mut keys = std::mem::take(&mut self.keys);
        keys.append(&mut other.keys);
        *self = Self::of(keys, &shown);
    }

    /// Turns all boxes next to a frame without one into keys, so that new neighbours do not move
    /// them.
    fn pin_edges(&mut self) {
        let beside = self.holes.iter().flat_map(|hole| [hole.saturating_sub(1), hole + 1]);
        let edges: Vec<u32> = beside.filter(|frame| !self.holes.contains(frame)).collect();
        for frame in edges {
            self.pin(frame);
        }
    }

    /// Forgets frames without the person before the first key and after the last.
    fn trim(&mut self) {
        let span = self.span();
        self.holes.retain(|hole| span.contains(hole));
    }
}

/// Longest gap between two keys over which the person is assumed to be present, frames.
const JOINED_FRAMES: u32 = 30;

/// Returns the region at a fraction of the way from one to another.
fn between(from: &Region, to: &Region, share: f64) -> Region {
    Region {
        x: from.x + (to.x - from.x) * share,
        y: from.y + (to.y - from.y) * share,
        width: from.width + (to.width - from.width) * share,
        height: from.height + (to.height - from.height) * share,
    }
}

/// Largest deviation of an interpolated box from a proposed one, as a fraction of its width.
const TOLERANCE: f64 = 0.04;

/// Returns as few keys as possible with which interpolation reproduces all boxes to within a
/// twenty-fifth of their width.
pub fn sparse(boxes: &[(u32, Region)]) -> BTreeMap<u32, Key> {
    let mut keys = BTreeMap::new();
    let (Some(first), Some(last)) = (boxes.first(), boxes.last()) else { return keys };
    for (frame, region) in [first, last] {
        keys.insert(*frame, Key::new(*region));
    }
    let mut parts = vec![boxes];
    while let Some(part) = parts.pop() {
        let worst = (0..part.len()).map(|i| (off(part, i), i)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, at)) = worst.filter(|(off, _)| *off > TOLERANCE) else { continue };
        keys.insert(part[at].0, Key::new(part[at].1));
        parts.extend([&part[..=at], &part[at..]]);
    }
    keys
}

/// Returns the deviation of a box from the interpolation between the ends of its part, as a
/// fraction of its width.
fn off(part: &[(u32, Region)], at: usize) -> f64 {
    let ((first, from), (last, to), (frame, region)) = (part[0], part[part.len() - 1], part[at]);
    let share = f64::from(frame - first) / f64::from((last - first).max(1));
    let guess = between(&from, &to, share);
    let parts = [region.x - guess.x, region.y - guess.y, region.width - guess.width];
    parts.iter().fold(0.0, |most: f64, part| most.max(part.abs())) / region.width.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64) -> Region {
        Region { x, y: 10.0, width: 50.0, height: 50.0 }
    }

    fn person(keys: &[(u32, f64)]) -> Person {
        let mut person = Person::default();
        for (frame, x) in keys {
            person.set(*frame, Key::new(square(*x)));
        }
        person
    }

    fn columns(person: &Person) -> Vec<(u32, f64)> {
        person.frames().map(|frame| (frame, person.at(frame).unwrap().region.x)).collect()
    }

    #[test]
    fn boxes_between_keys_are_interpolated() {
        let person = person(&[(2, 100.0), (6, 140.0)]);
        let wanted = [(2, 100.0), (3, 110.0), (4, 120.0), (5, 130.0), (6, 140.0)];
        assert_eq!(columns(&person), wanted);
        assert_eq!(person.at(4).unwrap().interpolated, 1);
        assert_eq!((person.at(1), person.at(7)), (None, None));
        assert!(person.key(4).is_none() && person.key(2).is_some());
    }

    #[test]
    fn a_proposed_box_is_reviewed_alone_and_what_lies_between_with_both_ends() {
        fn proposed(person: &Person) -> Vec<u32> {
            let frames = person.frames();
            frames.filter(|f| person.at(*f).is_some_and(|key| !key.proposed.is_empty())).collect()
        }

        let mut person = Person::default();
        for (frame, x) in [(1, 0.0), (5, 40.0)] {
            person.set(frame, Key { proposed: "net".into(), ..Key::new(square(x)) });
        }
        assert_eq!(proposed(&person), [1, 2, 3, 4, 5]);
        person.review(3);
        assert_eq!(proposed(&person), [1, 2, 4, 5]);
        person.review(1);
        assert_eq!(proposed(&person), [4, 5], "both ends of frame 2 are reviewed");
        let mut moved = person.key(5).expect("a key").clone();
        moved.move_to(square(41.0));
        person.set(5, moved);
        assert!(proposed(&person).is_empty());
    }

    #[test]
    fn notes_hold_until_the_next_key() {
        let mut person = person(&[(2, 100.0), (6, 140.0)]);
        let ignored = Key { ignore: true, visible: 0.5, ..Key::new(square(100.0)) };
        person.set(2, ignored);
        let between = person.at(5).unwrap();
        assert_eq!((between.ignore, between.visible), (true, 0.5));
        assert!(!person.at(6).unwrap().ignore);
    }

    #[test]
    fn a_person_taken_out_of_a_frame_stays_put_in_the_others() {
        let mut person = person(&[(1, 0.0), (5, 40.0)]);
        person.remove(3..=3);
        assert_eq!(columns(&person), [(1, 0.0), (2, 10.0), (4, 30.0), (5, 40.0)]);
        person.fill(3);
        assert_eq!(columns(&person).len(), 5);
        person.remove(4..=u32::MAX);
        assert_eq!(columns(&person), [(1, 0.0), (2, 10.0), (3, 20.0)]);
        person.remove(0..=1);
        assert_eq!(columns(&person), [(2, 10.0), (3, 20.0)]);
        person.remove(1..=9);
        assert!(person.is_empty() && person.frames().count() == 0);
    }

    #[test]
    fn a_key_taken_back_is_interpolated_again() {
        let mut person = person(&[(1, 0.0), (3, 99.0), (5, 40.0)]);
        person.unpin(3);
        assert_eq!(columns(&person)[2], (3, 20.0));
        person.unpin(5);
        assert_eq!(columns(&person), [(1, 0.0)]);
    }

    #[test]
    fn a_key_far_beyond_the_end_does_not_fill_the_pause() {
        let mut near = person(&[(1, 0.0), (31, 30.0)]);
        assert_eq!(near.frames().count(), 31);
        near.set(63, Key::new(square(62.0)));
        assert_eq!(near.frames().count(), 32);
        assert_eq!(near.at(40), None);
        near.fill(40);
        assert_eq!(near.at(40).unwrap().region.x, 39.0);
    }

    #[test]
    fn splitting_and_joining_moves_no_box() {
        let whole = person(&[(1, 0.0), (9, 80.0)]);
        let mut early = whole.clone();
        let late = early.split_off(4);
        assert_eq!(columns(&early), columns(&whole)[..3]);
        assert_eq!(columns(&late), columns(&whole)[3..]);
        assert!(!early.meets(&late) && early.meets(&whole));
        early.join(late);
        assert_eq!(columns(&early), columns(&whole));
        // Another person in a pause of the first.
        let mut torn = whole.clone();
        torn.remove(4..=6);
        let wanted = columns(&torn);
        torn.join(person(&[(5, 7.0)]));
        assert_eq!(columns(&torn).len(), wanted.len() + 1);
        assert!(wanted.iter().all(|one| columns(&torn).contains(one)), "{torn:?}");
    }

    #[test]
    fn few_keys_bring_all_boxes_back() {
        let boxes: Vec<_> = (1..60).map(|frame| (frame, square(f64::from(frame)))).collect();
        assert_eq!(sparse(&boxes).into_keys().collect::<Vec<_>>(), [1, 59]);
        let bent = (1_u32..60).map(|frame| (frame, square(f64::from(frame.abs_diff(30)) * 5.0)));
        let boxes: Vec<_> = bent.collect();
        let keys = sparse(&boxes);
        assert_eq!(keys.keys().copied().collect::<Vec<_>>(), [1, 30, 59]);
        let person = Person::of(keys, &(1..60).collect());
        for (frame, region) in boxes {
            let at = person.at(frame).unwrap().region;
            assert!((at.x - region.x).abs() <= TOLERANCE * 50.0, "{frame}");
        }
        assert!(sparse(&[]).is_empty());
    }
}
