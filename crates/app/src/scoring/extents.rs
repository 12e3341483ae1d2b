//! Distinction of boxes of whole people and of upper bodies by their shape.

use tagalong_eval::{MATCH_SIMILARITY, Region, Sequence};
use tagalong_geometry::Rect;

use super::region;
use super::truth::STANDING_HEIGHT_M;

/// Ratios of height to width: up to the first, boxes are those of upper bodies, and from the second
/// on, those of whole people. Squares compare with boxes nearly three times as high as wide.
const UPPER_MOST: f64 = 1.3;
const WHOLE_LEAST: f64 = 1.7;
/// Recall up to which nothing counts as matched: a box that the image border cuts may match by
/// chance.
const NOTHING_MATCHES: f64 = 0.05;

/// Returns the sequence with the upper bodies of its reports, and a note, if nothing matches
/// because the truth has upper bodies and the reports are of whole people.
pub fn as_upper_bodies(sequence: &Sequence) -> Option<(Sequence, String)> {
    let [truth, report] = aspects(sequence)?;
    if truth > UPPER_MOST || report < WHOLE_LEAST || !matches_nothing(sequence) {
        return None;
    }
    let mut cut = sequence.clone();
    let reports = cut.frames.iter_mut().flat_map(|frame| &mut frame.reports);
    for report in reports {
        report.region = report.region.map(|whole| {
            let whole = Rect::new(whole.x, whole.y, whole.width, whole.height);
            region(&whole.upper_body_of_standing(STANDING_HEIGHT_M))
        });
    }
    let note = format!(
        "nothing matches, and the boxes of the tracks are {report:.1} times as high as wide, those \
         of the truth {truth:.1} times: the upper bodies of the tracks are compared, on the \
         assumption of standing people of {STANDING_HEIGHT_M} m; tracks of upper bodies need no \
         assumption (`[output] boxes = \"upper\"`, and `body` of a detector other than \
         \"full-box\")"
    );
    Some((cut, note))
}

/// Returns a note if nothing matches because the truth has whole people and the reports are of
/// upper bodies: then the upper bodies of the truth should be compared.
pub fn whole_bodies_in_truth(sequence: &Sequence) -> Option<String> {
    let [truth, report] = aspects(sequence)?;
    if truth < WHOLE_LEAST || report > UPPER_MOST || !matches_nothing(sequence) {
        return None;
    }
    Some(format!(
        "nothing matches, and the boxes of the truth are {truth:.1} times as high as wide, those \
         of the tracks {report:.1} times: the upper bodies of the truth are compared, as with \
         --upper-body; `[output] boxes = \"full\"` makes tracks of whole people"
    ))
}

/// Returns the typical aspect ratios of the boxes in truth and reports; `None` if either has no
/// box.
fn aspects(sequence: &Sequence) -> Option<[f64; 2]> {
    let truths = sequence.frames.iter().flat_map(|frame| &frame.truths);
    let reports = sequence.frames.iter().flat_map(|frame| &frame.reports);
    let truth = median_aspect(truths.filter_map(|truth| truth.region))?;
    let report = median_aspect(reports.filter_map(|report| report.region))?;
    Some([truth, report])
}

/// Returns true if almost no person of the truth has a matching report.
fn matches_nothing(sequence: &Sequence) -> bool {
    let mut people = 0;
    let mut found = 0;
    for frame in &sequence.frames {
        for truth in frame.truths.iter().filter_map(|truth| truth.region) {
            people += 1;
            let reports = frame.reports.iter().filter_map(|report| report.region);
            let best = reports.map(|report| truth.iou(&report)).fold(0.0, f64::max);
            found += usize::from(best >= MATCH_SIMILARITY);
        }
    }
    found as f64 <= NOTHING_MATCHES * people as f64
}

/// Returns the median ratio of height to width of boxes.
fn median_aspect(regions: impl Iterator<Item = Region>) -> Option<f64> {
    let mut aspects: Vec<f64> =
        regions.filter(Region::has_area).map(|region| region.height / region.width).collect();
    aspects.sort_by(f64::total_cmp);
    aspects.get(aspects.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use tagalong_eval::{Frame, Report, Truth};

    use super::*;

    /// Returns a sequence of one person, in the same place in truth and report, with these heights of the
    /// boxes of 60 pixels width; the report is so far to the right.
    fn sequence(truth_height: f64, report_height: f64, off: f64) -> Sequence {
        let truth = Region { x: 0.0, y: 0.0, width: 60.0, height: truth_height };
        let report = Region { x: off, y: 2.5, width: 60.0, height: report_height };
        let frame = Frame {
            truths: vec![Truth { region: Some(truth), ..Truth::default() }],
            reports: vec![Report { region: Some(report), ..Report::default() }],
            ..Frame::default()
        };
        Sequence { name: "one".into(), frames: vec![frame] }
    }

    #[test]
    fn whole_bodies_are_cut_to_upper_bodies_where_nothing_matches() {
        let whole = sequence(60.0, 170.0, 0.0);
        let (cut, note) = as_upper_bodies(&whole).expect("another extent");
        assert!(note.contains("boxes = \"upper\""), "{note}");
        let [truth, report] = [cut.frames[0].truths[0].region, cut.frames[0].reports[0].region];
        let overlap = truth.expect("a box").iou(&report.expect("a box"));
        assert!(overlap > 0.85, "{overlap}");
        let told = whole_bodies_in_truth(&sequence(170.0, 60.0, 0.0)).expect("another extent");
        assert!(told.contains("as with --upper-body"), "{told}");
    }

    #[test]
    fn boxes_of_one_kind_stay_as_they_are() {
        for (truth, report, off) in [(170.0, 160.0, 0.0), (60.0, 60.0, 0.0), (170.0, 160.0, 900.0)]
        {
            let sequence = sequence(truth, report, off);
            assert!(as_upper_bodies(&sequence).is_none(), "{truth} {report}");
            assert!(whole_bodies_in_truth(&sequence).is_none(), "{truth} {report}");
        }
        // Half bodies that match are no mistake.
        assert!(as_upper_bodies(&sequence(60.0, 104.0, 0.0)).is_none());
    }
}
