//! Warnings about arguments that are valid but probably not what the caller intended.

use tagalong::core::{DepthImage, Images, Stamp};

/// Median of a depth image, m, beyond which it is probably in other units.
const FAR_M: f32 = 50.0;
/// Approximate number of pixels from which the median is computed.
const SAMPLE: usize = 4096;
/// Time between frames, ns, below which stamps are probably in other units, because no camera is
/// that fast.
const FAST_NS: u64 = 50_000;

/// Warnings that were already given; each is given once.
#[derive(Default)]
pub struct Doubts {
    of_units: bool,
    of_holes: bool,
    of_size: bool,
    of_stamps: bool,
    size: Option<(usize, usize)>,
    stamp: Option<Stamp>,
}

impl Doubts {
    /// Returns the warnings about a frame that were not given before. `stamp` is one in integer
    /// nanoseconds.
    pub fn of(&mut self, images: &Images, stamp: Option<Stamp>) -> Vec<String> {
        let mut said = Vec::new();
        if let Some(depth) = &images.depth {
            said.extend(self.of_depth(depth));
        }
        said.extend(self.of_size(images));
        said.extend(stamp.and_then(|stamp| self.of_stamp(stamp)));
        said
    }

    fn of_depth(&mut self, depth: &DepthImage) -> Option<String> {
        let median = match median_m(depth) {
            Some(median) => median,
            None if self.of_holes => return None,
            None => {
                self.of_holes = true;
                let why = "depth has not one reading (all is 0, negative or not finite): nobody is \
                           found in it";
                return Some(why.to_owned());
            }
        };
        if median <= FAR_M || std::mem::replace(&mut self.of_units, true) {
            return None;
        }
        Some(format!(
            "the median of depth is {median:.0} m: floats are metres, and integers of uint16 \
             millimetres"
        ))
    }

    fn of_size(&mut self, images: &Images) -> Option<String> {
        let depth = images.depth.as_ref().map(|image| (image.width(), image.height()));
        let colour = images.colour.as_ref().map(|image| (image.width(), image.height()));
        let grey = images.grey.as_ref().map(|image| (image.width(), image.height()));
        let size = depth.or(colour).or(grey)?;
        let before = self.size.replace(size)?;
        if size == before || std::mem::replace(&mut self.of_size, true) {
            return None;
        }
        Some(format!(
            "the images have {} x {} pixels, and those before {} x {}: a pipeline is for one camera; \
             build another for another",
            size.0, size.1, before.0, before.1
        ))
    }

    fn of_stamp(&mut self, stamp: Stamp) -> Option<String> {
        let before = self.stamp.replace(stamp)?;
        let step_ns = stamp.nanos().abs_diff(before.nanos());
        let is_likely = step_ns == 0 || step_ns >= FAST_NS;
        if is_likely || std::mem::replace(&mut self.of_stamps, true) {
            return None;
        }
        Some(format!(
            "stamp is {step_ns} ns after that of the frame before: an int is nanoseconds; give \
             seconds as a float"
        ))
    }
}

/// Returns the median of the readings of an image, m, from some of its pixels; `None` without
/// readings.
fn median_m(depth: &DepthImage) -> Option<f32> {
    let pixels = depth.pixels();
    let every = (pixels.len() / SAMPLE).max(1);
    let some = pixels.iter().step_by(every);
    let mut readings: Vec<f32> =
        some.copied().filter(|metres| DepthImage::is_reading(*metres)).collect();
    if readings.is_empty() {
        return pixels.iter().copied().find(|metres| DepthImage::is_reading(*metres));
    }
    let middle = readings.len() / 2;
    Some(*readings.select_nth_unstable_by(middle, f32::total_cmp).1)
}
