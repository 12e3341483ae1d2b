//! Boxes of whole people and of upper bodies, told apart by their shape.

use tagalong_eval::{Region, Sequence};

/// Height of boxes, in widths, up to which they are upper bodies, and from which they are whole
/// people: squares, and boxes nearly three times as high as wide.
const UPPER_MOST: f64 = 1.3;
const WHOLE_LEAST: f64 = 1.7;
/// Recall up to which nothing matches: a box that the image border cuts may match by chance.
const NOTHING_MATCHES: f64 = 0.05;

/// Returns a note with the remedy if nothing of a sequence matches because its truth is of whole
/// people and its reports are of upper bodies, or the other way round.
pub fn extents_note(sequence: &Sequence, recall: Option<f64>) -> Option<String> {
    if recall.is_none_or(|recall| recall > NOTHING_MATCHES) {
        return None;
    }
    let truths = sequence.frames.iter().flat_map(|frame| &frame.truths);
    let reports = sequence.frames.iter().flat_map(|frame| &frame.reports);
    let truth = median_aspect(truths.filter_map(|truth| truth.region))?;
    let report = median_aspect(reports.filter_map(|report| report.region))?;
    if truth >= WHOLE_LEAST && report <= UPPER_MOST {
        return Some(format!(
            "nothing matches, and the boxes of the truth are {truth:.1} times as high as wide, those \
             of the tracks {report:.1} times: whole bodies? --upper-body compares their upper \
             bodies, and `[output] boxes = \"full\"` makes tracks of whole people"
        ));
    }
    (truth <= UPPER_MOST && report >= WHOLE_LEAST).then(|| {
        format!(
            "nothing matches, and the boxes of the tracks are {report:.1} times as high as wide, \
             those of the truth {truth:.1} times: tracks of whole bodies? `[output] boxes = \
             \"upper\"` (and `body` of a detector other than \"full-box\") makes upper bodies"
        )
    })
}

/// Returns the median of the heights of boxes in their widths.
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

    fn note(truth_height: f64, report_height: f64, recall: Option<f64>) -> Option<String> {
        fn region(height: f64) -> Option<Region> {
            Some(Region { x: 0.0, y: 0.0, width: 60.0, height })
        }

        let frame = Frame {
            truths: vec![Truth { region: region(truth_height), ..Truth::default() }],
            reports: vec![Report { region: region(report_height), ..Report::default() }],
            ..Frame::default()
        };
        extents_note(&Sequence { name: "one".into(), frames: vec![frame] }, recall)
    }

    #[test]
    fn boxes_of_other_parts_are_named_where_nothing_matches() {
        let whole = note(170.0, 60.0, Some(0.0)).unwrap();
        assert!(whole.contains("whole bodies? --upper-body"), "{whole}");
        let upper = note(60.0, 170.0, Some(0.01)).unwrap();
        assert!(upper.contains("boxes = \"upper\""), "{upper}");
        for (truth, report, recall) in
            [(170.0, 60.0, Some(0.5)), (170.0, 160.0, Some(0.0)), (60.0, 60.0, Some(0.0))]
        {
            assert_eq!(note(truth, report, recall), None, "{truth} {report}");
        }
        assert_eq!(note(170.0, 60.0, None), None);
    }
}
