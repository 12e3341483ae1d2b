//! Tracks whose numbers probably have another meaning than the one assumed: frames that begin with
//! 0, and boxes given by two corners.

use tagalong_eval::{Comparison, Frame, Hota, HotaLevel, PairTable, Prepared, Region, Sequence};

/// Minimum gain in HOTA for another reading to be suggested.
const LEAST_GAIN: f64 = 0.05;

/// Returns suggestions for tracks that fit much better if their frames are numbered from another
/// start, or if their boxes are two corners.
pub fn misread_notes(sequence: &Sequence, comparison: &Comparison) -> Vec<String> {
    let Some(as_read) = hota(sequence, comparison) else { return Vec::new() };
    let readings = [
        (
            moved(sequence, 1),
            "all frame numbers one higher: are the frames of the tracks counted from 0?",
        ),
        (
            moved(sequence, -1),
            "all frame numbers one lower: are those of the truth counted from 0?",
        ),
        (
            by_corners(sequence),
            "the last two numbers of a box as its right and lower edge: are they x2, y2 instead of width \
             and height?",
        ),
    ];
    let mut notes = Vec::new();
    for (reading, words) in readings {
        let Some(other) = reading.and_then(|reading| hota(&reading, comparison)) else { continue };
        if other >= as_read + LEAST_GAIN {
            notes.push(format!("HOTA is {as_read:.3}, and would be {other:.3} with {words}"));
        }
    }
    notes
}

/// Returns HOTA; `None` for a sequence that cannot be scored.
fn hota(sequence: &Sequence, comparison: &Comparison) -> Option<f64> {
    let prepared = Prepared::new(sequence, comparison).ok()?;
    let table = PairTable::new(&prepared);
    Some(Hota::measure(&prepared, &table).mean(HotaLevel::hota))
}

/// Returns the sequence with the reports of each frame moved to the next one, or to the previous
/// one.
fn moved(sequence: &Sequence, by: i64) -> Option<Sequence> {
    let mut frames: Vec<Frame> = sequence.frames.clone();
    for (at, frame) in (0_i64..).zip(&mut frames) {
        let from = usize::try_from(at - by).ok().and_then(|from| sequence.frames.get(from));
        frame.reports = from.map_or_else(Vec::new, |from| from.reports.clone());
    }
    Some(Sequence { name: sequence.name.clone(), frames })
}

/// Returns the sequence with the sizes of boxes interpreted as their lower right corners; `None` if
/// that is impossible for some box.
fn by_corners(sequence: &Sequence) -> Option<Sequence> {
    let mut read = sequence.clone();
    let reports = read.frames.iter_mut().flat_map(|frame| &mut frame.reports);
    for report in reports {
        let Some(Region { x, y, width, height }) = report.region else { continue };
        let corners = Region { x, y, width: width - x, height: height - y };
        if !corners.has_area() {
            return None;
        }
        report.region = Some(corners);
    }
    Some(read)
}

#[cfg(test)]
mod tests {
    use tagalong_eval::{Report, Similarity, Truth};

    use super::*;

    /// Returns a person with 40 pixels a frame, and tracks that are so many frames late; `corners`
    /// gives their boxes by two corners.
    fn walk(late: i64, corners: bool) -> Sequence {
        let mut frames = Vec::new();
        for at in 0..20_i64 {
            let region = Region { x: 40.0 * at as f64 + 90.0, y: 50.0, width: 60.0, height: 60.0 };
            let seen = Region { x: region.x - 40.0 * late as f64, ..region };
            let Region { x, y, width, height } = seen;
            let edges = Region { x, y, width: x + width, height: y + height };
            let written = if corners { edges } else { seen };
            frames.push(Frame {
                stamp_ns: at * 100_000_000,
                truths: vec![Truth { id: 1, region: Some(region), ..Truth::default() }],
                reports: vec![Report { id: 7, region: Some(written), ..Report::default() }],
                ..Frame::default()
            });
        }
        Sequence { name: "walk".into(), frames }
    }

    fn notes(late: i64, corners: bool) -> Vec<String> {
        misread_notes(&walk(late, corners), &Similarity::Iou.into())
    }

    #[test]
    fn tracks_that_fit_are_not_asked_about() {
        assert_eq!(notes(0, false), [""; 0]);
    }

    #[test]
    fn frames_from_0_and_boxes_by_corners_are_suggested() {
        // Boxes of frame 2 are written as those of frame 1.
        for (late, corners, part) in [
            (-1, false, "one higher: are the frames of the tracks counted from 0?"),
            (1, false, "one lower: are those of the truth counted from 0?"),
            (0, true, "are they x2, y2 instead of width and height?"),
        ] {
            let told = notes(late, corners);
            assert_eq!(told.len(), 1, "{told:?}");
            assert!(told[0].contains(part) && told[0].contains("would be "), "{told:?}");
        }
    }
}
