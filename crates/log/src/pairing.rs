//! Sorting of images by stamp, and pairing of those that belong together.

use std::collections::VecDeque;

use tagalong_core::Stamp;

use crate::msgs::{CdrError, Header, decode};
use crate::walk::Message;

/// Undecoded message of an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Payload {
    pub(crate) stamp: Stamp,
    pub(crate) frame_id: String,
    pub(crate) data: Vec<u8>,
}

impl Payload {
    /// Stores a message that begins with a header, without decoding the rest.
    ///
    /// # Errors
    /// A message without a header.
    pub(crate) fn of_headed(message: &Message<'_>) -> Result<Self, CdrError> {
        Ok(Self::new(decode(message.data)?, message.data))
    }

    /// Stores a message with this header.
    pub(crate) fn new(header: Header, data: &[u8]) -> Self {
        Self { stamp: header.stamp(), frame_id: header.frame_id, data: data.to_vec() }
    }
}

/// Maximum number of stored images of a second stream; older ones are too far from any image to
/// come.
const MAX_WAITING: usize = 64;
/// Maximum number of stored bytes of a second stream, unless a few images alone exceed it.
const MAX_WAITING_BYTES: usize = 40 << 20;
/// Number of images that are stored whatever their size.
const MIN_WAITING: usize = 4;

/// Images of a second stream (depth, right) that wait for their partners.
#[derive(Debug, Default)]
pub(crate) struct Waiting {
    images: VecDeque<Payload>,
    aside: VecDeque<Payload>,
    /// Number of images that were dropped without a partner.
    unpaired: u64,
}

impl Waiting {
    pub(crate) fn push(&mut self, payload: Payload) {
        let place = self.images.partition_point(|old| old.stamp <= payload.stamp);
        self.images.insert(place, payload);
        while self.is_overfull() {
            self.images.pop_front();
            self.unpaired += 1;
        }
    }

    fn is_overfull(&self) -> bool {
        let bytes: usize = self.images.iter().map(|image| image.data.len()).sum();
        let count = self.images.len();
        count > MAX_WAITING || count > MIN_WAITING && bytes > MAX_WAITING_BYTES
    }

    /// Returns the time difference between a waiting image and a stamp, s.
    fn off_s(&self, image: usize, stamp: Stamp) -> f64 {
        self.images[image].stamp.seconds_since(stamp).abs()
    }

    /// Takes the image nearest to `stamp` if it is within the tolerance and not nearer to the next
    /// image of the other stream. Images that are older than the tolerance allows are dropped.
    pub(crate) fn take(
        &mut self,
        stamp: Stamp,
        next: Option<Stamp>,
        tolerance_s: f64,
    ) -> Option<Payload> {
        let nearest = (0..self.images.len())
            .min_by(|a, b| self.off_s(*a, stamp).total_cmp(&self.off_s(*b, stamp)));
        let found = nearest.filter(|i| {
            let here = self.off_s(*i, stamp);
            let there = next.map_or(f64::INFINITY, |next| self.off_s(*i, next));
            here <= tolerance_s && here <= there
        });
        let taken = found.and_then(|i| self.images.remove(i));
        self.drop_before(stamp.plus_seconds(-tolerance_s));
        taken
    }

    /// Returns true if [`Waiting::take`] would find an image for the newest image of the other
    /// stream.
    pub(crate) fn has(&self, stamp: Stamp, tolerance_s: f64) -> bool {
        self.images.iter().any(|image| image.stamp.seconds_since(stamp).abs() <= tolerance_s)
    }

    fn drop_before(&mut self, stamp: Stamp) {
        while self.images.front().is_some_and(|image| image.stamp < stamp) {
            self.images.pop_front();
            self.unpaired += 1;
        }
    }

    /// Sets aside, after a jump of the clock, the images older than `stamp`, which belong to the
    /// new time, for [`Waiting::restore`].
    pub(crate) fn set_aside(&mut self, stamp: Stamp) {
        let first_old = self.images.partition_point(|image| image.stamp < stamp);
        let old = self.images.split_off(first_old);
        self.aside = std::mem::replace(&mut self.images, old);
    }

    /// Drops the remaining images of the old time and continues with those that were set aside.
    pub(crate) fn restore(&mut self) {
        if !self.aside.is_empty() {
            self.unpaired += self.images.len() as u64;
            self.images = std::mem::take(&mut self.aside);
        }
    }

    /// Removes all images at the end; returns the number of images without a partner since the last
    /// call.
    pub(crate) fn leave(&mut self) -> u64 {
        let left = self.images.len() + self.aside.len();
        self.images.clear();
        self.aside.clear();
        std::mem::take(&mut self.unpaired) + left as u64
    }
}

/// Image together with the stamp of the next one.
pub(crate) type Popped = (Payload, Option<Stamp>);

/// Result of the arrival of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arrival {
    /// The image waits for its turn.
    Queued,
    /// The image is a duplicate: it has the same stamp and the same bytes as another one.
    Duplicate,
    /// Another image has the same stamp; this one is lost.
    SameStamp,
    /// The image is older than the last one that was delivered; the next image will show whether it
    /// is late or the clock has jumped.
    Suspect,
    /// The previous image was late and is dropped; this one waits.
    LateBefore,
    /// The clock has jumped back: all images of the old time are ready now, and the queue continues
    /// with the new time.
    Jumped,
}

/// Returns a hash of the bytes of an image (FNV-1a over words of 8 bytes).
fn hash_of(data: &[u8]) -> u64 {
    let (words, rest) = data.as_chunks::<8>();
    let words = words.iter().map(|word| u64::from_le_bytes(*word));
    let all = words.chain(rest.iter().map(|byte| u64::from(*byte)));
    all.fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

/// Queue that orders a stream of images by stamp.
#[derive(Debug, Default)]
pub(crate) struct Reorder {
    window: usize,
    queue: VecDeque<Payload>,
    ready: VecDeque<Payload>,
    suspect: Option<Payload>,
    last: Option<Stamp>,
    /// Hash of the image that was delivered last.
    last_hash: u64,
}

impl Reorder {
    pub(crate) fn new(window: usize) -> Self {
        Self { window, ..Self::default() }
    }

    pub(crate) fn push(&mut self, payload: Payload) -> Arrival {
        if let Some(is_same) = self.meets_again(&payload) {
            return if is_same { Arrival::Duplicate } else { Arrival::SameStamp };
        }
        let is_old = self.last.is_some_and(|last| payload.stamp < last);
        match (self.suspect.take(), is_old) {
            (None, false) => {
                self.enqueue(payload);
                Arrival::Queued
            }
            (None, true) => {
                self.suspect = Some(payload);
                Arrival::Suspect
            }
            (Some(_), false) => {
                self.enqueue(payload);
                Arrival::LateBefore
            }
            (Some(first), true) => {
                // Two old images in a row are not late: the clock has jumped.
                self.ready.append(&mut self.queue);
                self.last = None;
                self.enqueue(first);
                self.enqueue(payload);
                Arrival::Jumped
            }
        }
    }

    /// Returns true if an image with the same stamp has the same bytes, false if it has different
    /// ones; `None` if no image has that stamp.
    fn meets_again(&self, payload: &Payload) -> Option<bool> {
        let waiting = self.queue.iter().chain(&self.suspect);
        if let Some(other) = waiting.into_iter().find(|other| other.stamp == payload.stamp) {
            return Some(other.data == payload.data);
        }
        (self.last == Some(payload.stamp)).then(|| self.last_hash == hash_of(&payload.data))
    }

    fn enqueue(&mut self, payload: Payload) {
        let place = self.queue.partition_point(|queued| queued.stamp < payload.stamp);
        self.queue.insert(place, payload);
    }

    /// Returns the next image in order, together with the stamp of the one after it, if no earlier
    /// one can follow (or the log has ended).
    pub(crate) fn pop(&mut self, ended: bool) -> Option<Popped> {
        if let Some(payload) = self.ready.pop_front() {
            return Some((payload, self.ready.front().map(|next| next.stamp)));
        }
        if self.queue.len() <= self.window && !ended {
            return None;
        }
        let payload = self.queue.pop_front()?;
        self.last = Some(payload.stamp);
        self.last_hash = hash_of(&payload.data);
        Some((payload, self.queue.front().map(|next| next.stamp)))
    }

    /// Returns the newest complete image, without waiting for earlier ones. Without a complete one
    /// it returns the image that has waited longest, once the number of waiting images exceeds the
    /// window. Also returns the number of older images that were dropped.
    pub(crate) fn pop_newest(
        &mut self,
        is_complete: impl Fn(Stamp) -> bool,
    ) -> (Option<Popped>, u64) {
        let outdated = self.ready.drain(..).count();
        let newest = self.queue.iter().rposition(|image| is_complete(image.stamp));
        let older = self.queue.drain(..newest.unwrap_or(0)).count();
        (self.pop(newest.is_some()), (outdated + older) as u64)
    }

    /// Returns true if no images from before a jump remain.
    pub(crate) fn is_flushed(&self) -> bool {
        self.ready.is_empty()
    }

    /// Returns the newest stamp that was delivered.
    pub(crate) fn last(&self) -> Option<Stamp> {
        self.last
    }

    /// Returns the newest stamp in the queue.
    pub(crate) fn newest(&self) -> Option<Stamp> {
        self.queue.back().map(|image| image.stamp)
    }

    /// Drops an image that is held back as suspect, at the end of the log; returns true if there
    /// was one.
    pub(crate) fn drop_suspect(&mut self) -> bool {
        self.suspect.take().is_some()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(millis: u64) -> Payload {
        Payload { stamp: Stamp::from_nanos(millis * 1_000_000), ..Payload::default() }
    }

    fn millis(stamp: Stamp) -> u64 {
        stamp.nanos() / 1_000_000
    }

    /// Runs the queue; returns all images delivered and the result of each arrival.
    fn run(window: usize, arrivals: &[u64]) -> (Vec<u64>, Vec<Arrival>) {
        let mut reorder = Reorder::new(window);
        let mut out = Vec::new();
        let mut what = Vec::new();
        for arrival in arrivals {
            what.push(reorder.push(at(*arrival)));
            while let Some((payload, _)) = reorder.pop(false) {
                out.push(millis(payload.stamp));
            }
        }
        while let Some((payload, _)) = reorder.pop(true) {
            out.push(millis(payload.stamp));
        }
        (out, what)
    }

    #[test]
    fn a_late_image_is_dropped_and_a_repeated_one_too() {
        let (out, what) = run(1, &[100, 200, 300, 400, 150, 500, 500]);
        assert_eq!(out, [100, 200, 300, 400, 500]);
        assert_eq!(what[4..], [Arrival::Suspect, Arrival::LateBefore, Arrival::Duplicate]);
    }

    #[test]
    fn after_a_jump_back_everything_is_delivered() {
        let (out, what) = run(2, &[1000, 1100, 1200, 1300, 1400, 10, 110, 210, 310]);
        assert_eq!(out, [1000, 1100, 1200, 1300, 1400, 10, 110, 210, 310]);
        assert_eq!(what[6], Arrival::Jumped);
    }

    #[test]
    fn depth_at_half_rate_goes_to_the_nearer_image() {
        let mut waiting = Waiting::default();
        waiting.push(at(100));
        waiting.push(at(160));
        for (t, next, depth) in [(92, 125, Some(100)), (125, 158, None), (158, 191, Some(160))] {
            let taken = waiting.take(at(t).stamp, Some(at(next).stamp), 0.03);
            assert_eq!(taken, depth.map(at), "{t}");
        }
        assert_eq!(waiting.unpaired, 0);
    }

    #[test]
    fn large_images_wait_in_bounded_memory() {
        let mut waiting = Waiting::default();
        for i in 0..20 {
            waiting.push(Payload { data: vec![0; 5 << 20], ..at(i) });
        }
        assert_eq!((waiting.images.len(), waiting.unpaired), (8, 12));
    }

    #[test]
    fn what_finds_no_partner_is_counted() {
        let mut waiting = Waiting::default();
        (0..100).for_each(|i| waiting.push(at(i)));
        assert_eq!(waiting.unpaired, 36);
        assert_eq!(waiting.take(at(500).stamp, None, 0.03), None);
        assert_eq!(waiting.unpaired, 100);
    }

    #[test]
    fn live_the_newest_complete_image_comes_at_once_and_older_ones_are_skipped() {
        let mut reorder = Reorder::new(2);
        let _ = [10, 20, 30].map(|t| reorder.push(at(t)));
        let (popped, skipped) = reorder.pop_newest(|stamp| millis(stamp) <= 20);
        assert_eq!((popped.map(|(image, _)| millis(image.stamp)), skipped), (Some(20), 1));
        assert_eq!(reorder.pop_newest(|stamp| millis(stamp) <= 20), (None, 0));
        assert_eq!(reorder.push(at(15)), Arrival::Suspect);
        let _ = [40, 50].map(|t| reorder.push(at(t)));
        let (waited, skipped) = reorder.pop_newest(|stamp| millis(stamp) <= 20);
        assert_eq!((waited, skipped), (Some((at(30), Some(at(40).stamp))), 0));
    }

    #[test]
    fn live_images_of_the_time_before_a_jump_are_skipped() {
        let mut reorder = Reorder::new(3);
        let _ = [100, 110].map(|t| reorder.push(at(t)));
        assert_eq!(reorder.pop_newest(|_| true).1, 1);
        let _ = [120, 10, 20].map(|t| reorder.push(at(t)));
        let (popped, skipped) = reorder.pop_newest(|_| true);
        assert_eq!((popped.map(|(image, _)| millis(image.stamp)), skipped), (Some(20), 2));
    }

    proptest! {
        #[test]
        fn small_disorder_is_undone(seed in any::<u64>(), window in 1..4_usize) {
            let sorted: Vec<u64> = (1..40).map(|i| i * 33).collect();
            let mut shuffled = sorted.clone();
            // Swapping neighbours within blocks delays no image by more than the window.
            for (i, block) in shuffled.chunks_mut(window + 1).enumerate() {
                let turn = (seed >> (i % 60)) as usize % block.len();
                block.rotate_left(turn);
            }
            let (out, _) = run(window + 1, &shuffled);
            prop_assert_eq!(out, sorted);
        }
    }
}
