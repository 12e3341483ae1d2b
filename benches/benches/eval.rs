//! Scoring MOT17 train: CLEAR, Identity and HOTA over the four sequences in
//! `../shared/data/mot`. Without them it says that it skips.
//! `benches/peers/mot17_trackeval.py` times TrackEval on the same files.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a broken bench may stop loudly"
)]

use std::fs::read_to_string;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_eval::formats::{Timeline, mot};
use tagalong_eval::{
    Clear, Comparison, Hota, Identity, PairTable, Prepared, Sequence, SetDistance, Tally,
};

const NAMES: [&str; 4] = ["MOT17-02-FRCNN", "MOT17-04-FRCNN", "MOT17-05-FRCNN", "MOT17-10-FRCNN"];

fn sequence(mot: &Path, name: &str) -> Sequence {
    let [info, truth, tracks] = [
        format!("gt/MOT17-train/{name}/seqinfo.ini"),
        format!("gt/MOT17-train/{name}/gt/gt.txt"),
        format!("tracker-output/MOT17-train/{name}.txt"),
    ]
    .map(|path| read_to_string(mot.join(path)).expect("a file of the data set"));
    let info = mot::parse_info(&info, "seqinfo.ini");
    let truth = mot::parse_truth(&truth, "gt", mot::Rules::Mot17);
    let tracks = mot::parse_tracks(&tracks, "tracks");
    let mut timeline = Timeline::new();
    let rules = mot::Rules::Mot17;
    timeline.add_truths(truth.expect("truth").iter().map(|row| row.truth(rules)));
    timeline.add_reports(tracks.expect("tracks").iter().map(mot::Row::report));
    timeline.into_sequence(name, 1, info.expect("info").length, 30.0).0
}

/// The three families that TrackEval computes by default.
fn families(sequence: &Sequence) -> f64 {
    let prepared = Prepared::new(sequence, &Comparison::default()).expect("sane boxes");
    let table = PairTable::new(&prepared);
    let (clear, _) = Clear::measure(&prepared);
    let identity = Identity::measure(&prepared, &table);
    let hota = Hota::measure(&prepared, &table);
    clear.mota() + identity.idf1() + hota.mean(tagalong_eval::HotaLevel::hota)
}

fn scoring(c: &mut Criterion) {
    let Some(mot) = tagalong_conformance::testdata::find("mot") else { return };
    let sequences = all_sequences(&mot);
    c.bench_function("MOT17 train: read", |b| b.iter(|| all_sequences(&mot)));
    c.bench_function("MOT17 train: CLEAR, Identity, HOTA", |b| {
        b.iter(|| sequences.iter().map(families).sum::<f64>());
    });
    c.bench_function("MOT17 train: everything", |b| {
        let comparison = Comparison::default();
        let distance = SetDistance::default();
        b.iter(|| {
            let tallies = sequences.iter().map(|s| Tally::measure(s, &comparison, &distance));
            let tallies: Result<Vec<Tally>, _> = tallies.collect();
            Tally::combine(&tallies.expect("sane boxes")).scores()
        });
    });
}

/// Reads all sequences with their tracks.
fn all_sequences(mot: &Path) -> Vec<Sequence> {
    NAMES.iter().map(|name| sequence(mot, name)).collect()
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = scoring
}
criterion_main!(benches);
