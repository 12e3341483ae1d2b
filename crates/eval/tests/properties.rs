//! Properties that hold for any input: bounds, symmetries, and agreement with slow and obvious
//! references.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use proptest::prelude::*;
use tagalong_eval::{
    Comparison, DetectionTally, Edge, Frame, Hota, HotaLevel, Matcher, PairTable, Prepared, Region,
    Report, Role, Scores, Sequence, SetDistance, Similarity, Tally, Truth, alpha,
};

const SIMILARITIES: [Similarity; 2] = [Similarity::Iou, Similarity::Metres];

/// The best total weight by trying every partner for every row.
fn best_total(row: u32, rows: u32, edges: &[Edge], used: &mut Vec<u32>) -> f64 {
    if row == rows {
        return 0.0;
    }
    let mut best = best_total(row + 1, rows, edges, used);
    for edge in edges.iter().filter(|edge| edge.row == row && edge.weight > 0.0) {
        if !used.contains(&edge.col) {
            used.push(edge.col);
            best = best.max(edge.weight + best_total(row + 1, rows, edges, used));
            used.pop();
        }
    }
    best
}

fn some_edges() -> impl Strategy<Value = (u32, u32, Vec<Edge>)> {
    (0_u32..6, 0_u32..7).prop_flat_map(|(rows, cols)| {
        let weights = prop::collection::vec(
            prop_oneof![2 => Just(0.0), 2 => 0.0..1.0_f64, 1 => Just(0.5), 1 => 1000.0..1001.0_f64],
            (rows * cols) as usize,
        );
        weights.prop_map(move |weights| {
            let mut edges = Vec::new();
            for (i, weight) in (0..).zip(weights) {
                if weight > 0.0 {
                    edges.push(Edge { row: i / cols, col: i % cols, weight });
                }
            }
            (rows, cols, edges)
        })
    })
}

/// Places of a person: a lattice, so that people meet, hide and coincide.
fn somewhere() -> impl Strategy<Value = (Region, [f64; 2])> {
    (0..12_i32, 0..4_i32, 0.0..1.0_f64).prop_map(|(x, y, jitter)| {
        let x = f64::from(x) + 0.3 * jitter;
        let y = f64::from(y);
        (Region::new(4.0 * x, 8.0 * y, 12.0, 24.0), [0.25 * x, 0.4 * y])
    })
}

fn a_truth() -> impl Strategy<Value = Truth> {
    let role =
        prop_oneof![6 => Just(Role::Counts), 1 => Just(Role::Ignored), 1 => Just(Role::Bystander)];
    (somewhere(), role).prop_map(|((region, floor), role)| Truth {
        id: 0,
        region: Some(region),
        floor_m: Some(floor),
        role,
        view: None,
    })
}

fn a_report() -> impl Strategy<Value = Report> {
    (somewhere(), 0..5_i32).prop_map(|((region, floor), score)| Report {
        id: 0,
        region: Some(region),
        floor_m: Some(floor),
        score: f64::from(score),
    })
}

fn a_frame() -> impl Strategy<Value = Frame> {
    let ids = prop::sample::subsequence(vec![1_i64, 2, 3, 4, 5, 6], 0..=6).prop_shuffle();
    let truths = ids.clone().prop_flat_map(|ids| {
        let count = ids.len();
        (Just(ids), prop::collection::vec(a_truth(), count))
    });
    let reports = ids.prop_flat_map(|ids| {
        let count = ids.len();
        (Just(ids), prop::collection::vec(a_report(), count))
    });
    (truths, reports).prop_map(|((truth_ids, truths), (report_ids, reports))| Frame {
        truths: truth_ids.into_iter().zip(truths).map(|(id, t)| Truth { id, ..t }).collect(),
        reports: report_ids.into_iter().zip(reports).map(|(id, r)| Report { id, ..r }).collect(),
        ..Frame::default()
    })
}

fn a_sequence() -> impl Strategy<Value = Sequence> {
    prop::collection::vec(a_frame(), 0..12).prop_map(|mut frames| {
        for (index, frame) in frames.iter_mut().enumerate() {
            frame.stamp_ns = index as i64 * 250_000_000;
        }
        Sequence { name: "random".into(), frames }
    })
}

fn tally(sequence: &Sequence, similarity: Similarity) -> Tally {
    Tally::measure(sequence, &similarity.into(), &SetDistance::default()).unwrap()
}

/// Returns the sequence with a tracker that reports exactly the truth that counts. People are moved
/// apart: two in one place cannot be told apart.
fn with_perfect_tracker(mut sequence: Sequence) -> Sequence {
    for frame in &mut sequence.frames {
        for truth in &mut frame.truths {
            let apart = truth.id as f64;
            truth.region = truth.region.map(|r| Region { y: r.y + 100.0 * apart, ..r });
            truth.floor_m = truth.floor_m.map(|[x, y]| [x, y + 10.0 * apart]);
        }
        let counts = frame.truths.iter().filter(|t| t.role == Role::Counts);
        frame.reports = counts
            .map(|t| Report { id: 100 - t.id, region: t.region, floor_m: t.floor_m, score: 1.0 })
            .collect();
    }
    sequence
}

/// HOTA at one threshold from the definition: a matching per threshold is made
/// from the given per-frame assignment, counts are kept in full matrices.
fn slow_hota(prepared: &Prepared, level: usize) -> HotaLevel {
    let truths = prepared.truth_ids.len();
    let tracks = prepared.track_ids.len();
    let mut soft = vec![vec![0.0; tracks]; truths];
    for frame in &prepared.frames {
        for pair in &frame.pairs {
            let rivals: f64 = frame
                .pairs
                .iter()
                .filter(|other| (other.row == pair.row) || (other.col == pair.col))
                .map(|other| other.weight)
                .sum();
            soft[frame.truths[pair.row as usize] as usize]
                [frame.tracks[pair.col as usize] as usize] += pair.weight / rivals;
        }
    }
    let mut counts = vec![vec![0.0; tracks]; truths];
    let mut result = HotaLevel::default();
    for frame in &prepared.frames {
        let mut scored = frame.pairs.clone();
        for pair in &mut scored {
            let i = frame.truths[pair.row as usize] as usize;
            let j = frame.tracks[pair.col as usize] as usize;
            let both = soft[i][j];
            let frames = prepared.truth_frames[i] + prepared.track_frames[j];
            pair.weight *= both / (f64::from(frames) - both);
        }
        let mut matched = Vec::new();
        Matcher::new().best(frame.truths.len(), frame.tracks.len(), &scored, &mut matched);
        for e in matched {
            let pair = frame.pairs[e as usize];
            if pair.weight < alpha(level) - f64::EPSILON {
                continue;
            }
            result.tp += 1;
            result.similarity_sum += pair.weight;
            counts[frame.truths[pair.row as usize] as usize]
                [frame.tracks[pair.col as usize] as usize] += 1.0;
        }
    }
    for (i, row) in counts.iter().enumerate() {
        for (j, &n) in row.iter().enumerate() {
            let of_truth = f64::from(prepared.truth_frames[i]);
            let of_track = f64::from(prepared.track_frames[j]);
            result.association_sum += n * n / (of_truth + of_track - n);
            result.association_recall_sum += n * n / of_truth;
            result.association_precision_sum += n * n / of_track;
        }
    }
    result.fn_ = prepared.truth_count() - result.tp;
    result.fp = prepared.report_count() - result.tp;
    result
}

proptest! {
    #[test]
    fn the_matcher_is_exact((rows, cols, edges) in some_edges()) {
        let mut matched = Vec::new();
        Matcher::new().best(rows as usize, cols as usize, &edges, &mut matched);
        let chosen: Vec<Edge> = matched.iter().map(|&e| edges[e as usize]).collect();
        for (i, a) in chosen.iter().enumerate() {
            prop_assert!(chosen[..i].iter().all(|b| a.row != b.row && a.col != b.col));
        }
        let total: f64 = chosen.iter().map(|e| e.weight).sum();
        let best = best_total(0, rows, &edges, &mut Vec::new());
        prop_assert!((total - best).abs() < 1e-9, "{total} instead of {best}");
    }

    #[test]
    fn a_matcher_used_before_answers_like_a_new_one(
        (rows, cols, edges) in some_edges(), (r, c, before) in some_edges(),
    ) {
        let mut old = Matcher::new();
        let mut fresh = Vec::new();
        let mut used = Vec::new();
        old.best(r as usize, c as usize, &before, &mut used);
        old.best(rows as usize, cols as usize, &edges, &mut used);
        Matcher::new().best(rows as usize, cols as usize, &edges, &mut fresh);
        prop_assert_eq!(used, fresh);
    }

    #[test]
    fn the_shared_thresholds_equal_one_at_a_time(sequence in a_sequence()) {
        for similarity in SIMILARITIES {
            let prepared = Prepared::new(&sequence, &similarity.into()).unwrap();
            let fast = Hota::measure(&prepared, &PairTable::new(&prepared));
            for (level, fast) in fast.levels.iter().enumerate() {
                let slow = slow_hota(&prepared, level);
                prop_assert_eq!((fast.tp, fast.fn_, fast.fp), (slow.tp, slow.fn_, slow.fp));
                for (a, b) in [
                    (fast.hota(), slow.hota()), (fast.ass_re(), slow.ass_re()),
                    (fast.ass_pr(), slow.ass_pr()), (fast.loc_a(), slow.loc_a()),
                ] {
                    prop_assert!((a - b).abs() < 1e-9, "level {level}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_perfect_tracker_scores_one(sequence in a_sequence()) {
        for similarity in SIMILARITIES {
            let sequence = with_perfect_tracker(sequence.clone());
            let scores = tally(&sequence, similarity).scores();
            if scores.truths == 0 {
                prop_assert_eq!((scores.hota, scores.mota, scores.idf1), (None, None, None));
                continue;
            }
            let ones = [
                scores.hota, scores.det_a, scores.ass_a, scores.loc_a, scores.mota, scores.motp,
                scores.idf1, scores.idp, scores.idr, scores.recall, scores.precision,
                scores.average_precision,
            ];
            for one in ones {
                prop_assert!((one.unwrap() - 1.0).abs() < 1e-9, "{scores:?}");
            }
            prop_assert!(scores.ospa.unwrap() < 1e-9 && scores.gospa.unwrap() < 1e-9);
            prop_assert!(scores.lamr.unwrap() < 1e-9);
            // A person that leaves and comes back is a fragment even so, as in TrackEval.
            prop_assert_eq!((scores.fp, scores.fn_, scores.idsw), (0, 0, 0));
            prop_assert_eq!(scores.mt, scores.truth_ids);
            prop_assert_eq!((scores.wrong_person_s, scores.never_confirmed), (0.0, 0));
            prop_assert_eq!(scores.time_to_confirm_mean_s, Some(0.0));
        }
    }

    #[test]
    fn new_names_change_nothing_and_mixed_ids_no_detection(
        sequence in a_sequence(), shift in 1..6_i64,
    ) {
        for similarity in SIMILARITIES {
            let before = tally(&sequence, similarity);
            let mut renamed = sequence.clone();
            let mut mixed = sequence.clone();
            for frame in &mut renamed.frames {
                frame.reports.iter_mut().for_each(|r| r.id *= -7);
            }
            for (index, frame) in mixed.frames.iter_mut().enumerate() {
                let turn = shift * index as i64;
                frame.reports.iter_mut().for_each(|r| r.id = (r.id + turn).rem_euclid(6) + 1);
            }
            let renamed = tally(&renamed, similarity);
            prop_assert_eq!(before.clear, renamed.clear);
            prop_assert_eq!(before.identity, renamed.identity);
            let mixed = tally(&mixed, similarity);
            prop_assert_eq!((before.truths, before.reports), (mixed.truths, mixed.reports));
            prop_assert_eq!(&before.detections, &mixed.detections);
            prop_assert_eq!(before.sets, mixed.sets);
        }
    }

    #[test]
    fn every_figure_keeps_its_bounds(sequence in a_sequence()) {
        for similarity in SIMILARITIES {
            let tally = tally(&sequence, similarity);
            let scores = tally.scores();
            let rates = [
                scores.hota, scores.det_a, scores.ass_a, scores.loc_a, scores.det_re,
                scores.det_pr, scores.ass_re, scores.ass_pr, scores.motp, scores.idf1, scores.idp,
                scores.idr, scores.recall, scores.precision, scores.lamr,
                scores.average_precision, scores.ospa,
            ];
            for rate in rates.into_iter().flatten() {
                prop_assert!((0.0..=1.0 + 1e-12).contains(&rate), "{scores:?}");
            }
            prop_assert!(scores.mota.unwrap_or(0.0) <= 1.0);
            prop_assert_eq!(scores.tp + scores.fn_, scores.truths);
            prop_assert_eq!(scores.tp + scores.fp, scores.reports);
            prop_assert_eq!(scores.idtp + scores.idfn, scores.truths);
            prop_assert_eq!(scores.idtp + scores.idfp, scores.reports);
            prop_assert_eq!(scores.mt + scores.pt + scores.ml, scores.truth_ids);
            let found = tally.times.confirm_s.len() as u64;
            prop_assert_eq!(found + tally.times.never_confirmed, scores.truth_ids);
            prop_assert!(scores.wrong_person_s <= 6.0 * tally.times.duration_s);
        }
    }

    #[test]
    fn a_sequence_twice_doubles_counts_and_keeps_rates(sequence in a_sequence()) {
        let one = tally(&sequence, Similarity::Iou);
        let two = Tally::combine([&one, &one]);
        let a = one.scores();
        let b = two.scores();
        prop_assert_eq!(2 * a.tp, b.tp);
        prop_assert_eq!(2 * a.truth_ids, b.truth_ids);
        let pairs = [
            (a.hota, b.hota), (a.loc_a, b.loc_a), (a.mota, b.mota), (a.idf1, b.idf1),
            (a.lamr, b.lamr), (a.ospa, b.ospa), (a.gospa, b.gospa),
            (a.position_error_rms_m, b.position_error_rms_m),
        ];
        for (a, b) in pairs {
            prop_assert_eq!(a.is_some(), b.is_some());
            prop_assert!((a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_order_within_a_frame_changes_no_detection(sequence in a_sequence()) {
        // Distinct scores, since among equal ones the first comes first.
        let mut sequence = sequence;
        for frame in &mut sequence.frames {
            frame.reports.iter_mut().for_each(|r| r.score = r.id as f64);
        }
        let before = DetectionTally::measure(&sequence, Similarity::Iou, 0.5).curve();
        sequence.frames.iter_mut().for_each(|f| f.reports.reverse());
        prop_assert_eq!(before, DetectionTally::measure(&sequence, Similarity::Iou, 0.5).curve());
    }

    #[test]
    fn set_distances_equal_all_permutations(
        truths in prop::collection::vec(-1.5..1.5_f64, 0..5),
        reports in prop::collection::vec(-1.5..1.5_f64, 0..5),
        cutoff in 0.2..3.0_f64, order in 1.0..3.0_f64,
    ) {
        let near: Vec<Edge> = (0..truths.len() * reports.len())
            .map(|i| {
                let row = i / reports.len();
                let col = i % reports.len();
                let weight = (truths[row] - reports[col]).abs();
                Edge { row: row as u32, col: col as u32, weight }
            })
            .filter(|edge| edge.weight < cutoff)
            .collect();
        let got = SetDistance { cutoff, order }.between(truths.len(), reports.len(), &near);
        let (few, many) = if truths.len() < reports.len() { (&truths, &reports) } else { (&reports, &truths) };
        let pairs = cheapest(few, many, &mut vec![false; many.len()], &|a, b| (a - b).abs().min(cutoff).powf(order));
        let spare = (many.len() - few.len()) as f64 * cutoff.powf(order);
        let ospa = ((pairs + spare) / many.len().max(1) as f64).powf(order.recip());
        let gospa = (pairs + 0.5 * spare).powf(order.recip());
        prop_assert!((got.ospa - ospa).abs() < 1e-7, "{} {ospa}", got.ospa);
        prop_assert!((got.gospa - gospa).abs() < 1e-7, "{} {gospa}", got.gospa);
    }
}

/// The least total distance that gives each of the few a partner among the many.
fn cheapest(
    few: &[f64],
    many: &[f64],
    used: &mut Vec<bool>,
    distance: &impl Fn(f64, f64) -> f64,
) -> f64 {
    let Some((&first, rest)) = few.split_first() else { return 0.0 };
    let mut best = f64::INFINITY;
    for index in 0..many.len() {
        if !used[index] {
            used[index] = true;
            let total = distance(first, many[index]) + cheapest(rest, many, used, distance);
            best = best.min(total);
            used[index] = false;
        }
    }
    best
}

#[test]
fn nothing_at_all_is_no_error() {
    let scores = Scores::measure(&Sequence::default(), Similarity::Iou).unwrap();
    assert_eq!(scores, Scores::default());
    let empty = Sequence { name: "empty".into(), frames: vec![Frame::default(); 3] };
    let scores = Scores::measure(&empty, Comparison::default()).unwrap();
    assert_eq!((scores.frames, scores.hota, scores.ospa), (3, None, Some(0.0)));
}
