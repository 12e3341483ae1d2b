//! Small pictures of tracking errors.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use tagalong_core::Images;
use tagalong_eval::Frame;
use tagalong_geometry::Rect;
use tagalong_render::{background, jpeg};
use tagalong_report::EventRow;

use super::misses::moments;
use super::store::Stored;
use super::watch::importance;

/// Maximum number of pictures of one task.
const MOST: usize = 40;

/// Longer side of a picture, pixels.
const SIDE: usize = 96;

/// Width of the images of moments, pixels, and their quality: people are recognisable, and an image
/// takes some 25 kB.
const MOMENT_WIDTH: usize = 480;
const MOMENT_QUALITY: u8 = 60;

/// Requested pictures: the frame, the event and the part of the image.
#[derive(Default)]
pub struct Wanted {
    by_frame: BTreeMap<u64, Vec<Order>>,
    /// Tasks that request a whole image of a moment, by frame.
    moments: BTreeMap<u64, Vec<usize>>,
}

struct Order {
    task: usize,
    event: usize,
    part: Rect,
}

impl Wanted {
    /// Requests the most important events of all tasks.
    pub fn of(stored: &[Stored]) -> Self {
        let mut wanted = Self::default();
        for (task, stored) in stored.iter().enumerate() {
            let Some(recording) = &stored.recording else { continue };
            for frame in moments(&stored.result.missed) {
                wanted.moments.entry(frame).or_default().push(task);
            }
            for event in chosen(&stored.result.events) {
                let row = &stored.result.events[event];
                let frame = recording.sequence.frames.get(row.frame as usize - 1);
                if let Some(part) = frame.and_then(|frame| part(row, frame)) {
                    let orders = wanted.by_frame.entry(row.frame).or_default();
                    orders.push(Order { task, event, part });
                }
            }
        }
        wanted
    }

    /// Returns the last requested frame.
    pub fn last(&self) -> Option<u64> {
        let parts = self.by_frame.last_key_value().map(|(frame, _)| *frame);
        parts.max(self.moments.last_key_value().map(|(frame, _)| *frame))
    }

    /// Cuts the pictures out of a frame.
    pub fn cut(&self, frame: u64, images: &Images, stored: &mut [Stored]) {
        for order in self.by_frame.get(&frame).into_iter().flatten() {
            let event = &mut stored[order.task].result.events[order.event];
            event.picture_png_base64 = picture(images, &order.part);
        }
        let Some(tasks) = self.moments.get(&frame) else { return };
        let Some(image) = background(images) else { return };
        let text = STANDARD.encode(jpeg(&image, MOMENT_WIDTH, MOMENT_QUALITY));
        for task in tasks {
            stored[*task].images.insert(frame, text.clone());
        }
    }
}

/// Returns the indices of the events to show, in order.
fn chosen(events: &[EventRow]) -> BTreeSet<usize> {
    let mut all: Vec<usize> = (0..events.len()).collect();
    // The last rank contains the ordinary events, which need no picture.
    all.retain(|index| importance(&events[*index].kind) < 3);
    all.sort_by_key(|index| (importance(&events[*index].kind), *index));
    all.into_iter().take(MOST).collect()
}

/// Returns the region around the person, or otherwise around the track.
fn part(event: &EventRow, frame: &Frame) -> Option<Rect> {
    let person = frame.truths.iter().find(|truth| Some(truth.id) == event.person);
    let track = frame.reports.iter().find(|report| Some(report.id) == event.track);
    let region = person.and_then(|p| p.region).or_else(|| track.and_then(|t| t.region))?;
    Some(Rect::new(region.x, region.y, region.width, region.height).inflated(1.0))
}

/// Returns the pixels of one of `count` cells between `from` and `from + length`, at least one.
fn cell(index: usize, from: f64, length: f64, count: usize) -> Range<usize> {
    let [start, end] =
        [index, index + 1].map(|edge| (from + length * edge as f64 / count as f64) as usize);
    start..end.max(start + 1)
}

/// Returns a part of the colour (or grey) image as PNG in base64.
fn picture(images: &Images, part: &Rect) -> Option<String> {
    let (width, height) = match (&images.colour, &images.grey) {
        (Some(colour), _) => (colour.width(), colour.height()),
        (None, Some(grey)) => (grey.width(), grey.height()),
        (None, None) => return None,
    };
    let part = part.clipped(width, height);
    if part.width < 1.0 || part.height < 1.0 {
        return None;
    }
    // Only shrinks: enlarged pixels would add bytes but no detail.
    let shrink = (part.width.max(part.height) / SIDE as f64).max(1.0);
    let columns = ((part.width / shrink) as usize).max(1);
    let rows = ((part.height / shrink) as usize).max(1);
    let mut pixels = Vec::with_capacity(columns * rows * 3);
    for row in 0..rows {
        for column in 0..columns {
            let xs = cell(column, part.x, part.width, columns);
            let ys = cell(row, part.y, part.height, rows);
            pixels.extend(mean(images, xs, ys));
        }
    }
    encode(&pixels, columns, rows)
}

/// Returns the mean colour of a block of pixels.
fn mean(images: &Images, xs: Range<usize>, ys: Range<usize>) -> [u8; 3] {
    let mut sum = [0u32; 3];
    let mut count = 0u32;
    for (x, y) in ys.flat_map(|y| xs.clone().map(move |x| (x, y))) {
        let x = x as i64;
        let y = y as i64;
        let pixel = match (&images.colour, &images.grey) {
            (Some(colour), _) => colour.get(x, y),
            (None, Some(grey)) => grey.get(x, y).map(|value| [value; 3]),
            (None, None) => None,
        };
        if let Some(pixel) = pixel {
            (0..3).for_each(|channel| sum[channel] += u32::from(pixel[channel]));
            count += 1;
        }
    }
    sum.map(|value| (value / count.max(1)) as u8)
}

fn encode(pixels: &[u8], columns: usize, rows: usize) -> Option<String> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns as u32, rows as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(pixels).ok()?;
    writer.finish().ok()?;
    Some(STANDARD.encode(bytes))
}
