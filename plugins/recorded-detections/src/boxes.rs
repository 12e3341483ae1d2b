//! Reader of MOTChallenge's `det.txt`.

use std::collections::BTreeMap;
use std::path::Path;

use tagalong_config::{FileLimit, read_text};
use tagalong_core::{Error, ExternalDetection, Result};
use tagalong_geometry::Rect;

/// Boxes by frame number, from 1.
pub(crate) type Boxes = BTreeMap<u64, Vec<ExternalDetection>>;

/// Last number of a frame that is plausible: a year at 30 frames a second. A stamp in place of a
/// number would match no frame, and the run would detect nobody.
const LAST_FRAME: f64 = 1e9;

/// Most characters of a word that is no number in a message.
const SHOWN_CHARACTERS: usize = 16;

/// Reads a file of boxes.
///
/// # Errors
/// A file that cannot be read, or a line that is not a detection: the message names both.
pub(crate) fn read(path: &Path) -> Result<Boxes> {
    let shown = path.display();
    let text = read_text(path, FileLimit::Table)
        .map_err(|error| Error::Other(format!("cannot read boxes `{shown}`: {error}")))?;
    let mut boxes = Boxes::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let (frame, recorded) = parse(line)
            .map_err(|why| Error::Other(format!("boxes `{shown}`, line {}: {why}", index + 1)))?;
        boxes.entry(frame).or_default().push(recorded);
    }
    Ok(boxes)
}

fn parse(line: &str) -> std::result::Result<(u64, ExternalDetection), String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let frame = number_of(&fields, 0, "frame")?;
    if !(1.0..=LAST_FRAME).contains(&frame) || frame.fract() != 0.0 {
        return Err(format!("frame {frame}; frames are numbered from 1, up to {LAST_FRAME}"));
    }
    let [x, y] = [number_of(&fields, 2, "x")?, number_of(&fields, 3, "y")?];
    let size = [number_of(&fields, 4, "width")?, number_of(&fields, 5, "height")?];
    let region = Rect::new(x, y, size[0], size[1]);
    if region.width <= 0.0 || region.height <= 0.0 {
        return Err("a box without area".into());
    }
    // A box without a score counts as certain.
    let score = if fields.len() > 6 { number_of(&fields, 6, "score")? } else { 1.0 };
    Ok((frame as u64, ExternalDetection::in_image(region, score)))
}

/// Reads a number of a line.
fn number_of(fields: &[&str], index: usize, name: &str) -> std::result::Result<f64, String> {
    let text = fields.get(index).ok_or_else(|| {
        format!("{} fields; expected frame, -1, x, y, width, height, score", fields.len())
    })?;
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    // A config may name any file, so no more than the start of a word is shown.
    let shown: String = text.chars().take(SHOWN_CHARACTERS).collect();
    value.ok_or_else(|| format!("`{name}` is `{shown}`, expected a number"))
}
