//! Checks of associators.

use nalgebra::{Matrix3, Point3};
use tagalong_core::{Association, Associations, Associator, Detection, Track};
use tagalong_math::{RandomSource, SplitMix64};

use crate::samples::{GATE, track_at, with_variance};
use crate::scenes::{level, sighting};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("nothing leads to no pair", nothing_leads_to_nothing),
    ("pairs are possible", pairs_are_possible),
    ("same input, same answer", repeatable),
    ("each track gets its own detection", own_detections),
    ("far detections are left alone", far_detections),
];

fn detection(x: f64, y: f64, random: &mut SplitMix64) -> Detection {
    sighting(&Point3::new(x, y, 1.6), &level(), 0.05, random)
}

/// Returns a track at a position, with a standard deviation of 0.2 m.
fn track(id: u32, x: f64, y: f64) -> Track {
    with_variance(track_at(id, x, y), 0.04)
}

/// Returns tracks and detections at random positions, some detections with low scores.
fn crowd(random: &mut SplitMix64, tracks: u32, detections: usize) -> (Vec<Track>, Vec<Detection>) {
    let places: Vec<(f64, f64)> = (0..tracks as usize + detections)
        .map(|_| (2.0 + 4.0 * random.positive_uniform(), 3.0 * random.positive_uniform() - 1.5))
        .collect();
    let (of_tracks, of_detections) = places.split_at(tracks as usize);
    let tracks = (1..).zip(of_tracks).map(|(id, (x, y))| track(id, *x, *y)).collect();
    let found = of_detections.iter().map(|(x, y)| {
        let mut found = detection(*x, *y, random);
        found.score = 6.0 * random.positive_uniform() - 4.0;
        found.covariance = Matrix3::identity() * (0.01 + 0.2 * random.positive_uniform());
        found
    });
    (tracks, found.collect())
}

fn nothing_leads_to_nothing(subject: &Subject<'_>) -> Verdict {
    let mut associator = subject.associator(From::Nothing)?;
    let (tracks, detections) = crowd(&mut SplitMix64::new(3), 2, 2);
    for (name, tracks, detections) in [
        ("no tracks and no detections", &[][..], &[][..]),
        ("no tracks", &[], &detections[..]),
        ("no detections", &tracks[..], &[]),
    ] {
        let answer = associator.associate(tracks, detections, &GATE);
        demand(answer.pairs.is_empty(), || format!("with {name} it pairs {:?}", answer.pairs))?;
    }
    Ok(())
}

fn pairs_are_possible(subject: &Subject<'_>) -> Verdict {
    let mut associator = subject.associator(From::Nothing)?;
    let mut random = SplitMix64::new(5);
    for round in 0..40 {
        let (tracks, detections) = crowd(&mut random, round % 7, (round % 5) as usize * 2);
        let answer = associator.associate(&tracks, &detections, &GATE);
        for pair in &answer.pairs {
            check_pair(associator.as_ref(), pair, &tracks, &detections)?;
        }
        check_sums(&answer, tracks.len(), detections.len())?;
    }
    Ok(())
}

fn check_pair(
    associator: &dyn Associator,
    pair: &Association,
    tracks: &[Track],
    detections: &[Detection],
) -> Verdict {
    let known = tracks.get(pair.track).zip(detections.get(pair.detection));
    let (track, detection) = known.ok_or_else(|| format!("{pair:?} is of nothing it was given"))?;
    let fits = GATE.admits(track, detection) && associator.fits(track, detection, &GATE);
    demand(fits, || format!("{pair:?} is a pair that its own gate refuses"))?;
    demand(pair.weight > 0.0 && pair.weight <= 1.0, || format!("{pair:?} has no probability"))
}

/// Checks that the weights of a track, and of a detection, sum to at most 1.
fn check_sums(answer: &Associations, tracks: usize, detections: usize) -> Verdict {
    let of_tracks = (0..tracks).map(|at| weight_of(answer, |pair| pair.track == at));
    let of_detections = (0..detections).map(|at| weight_of(answer, |pair| pair.detection == at));
    let most = of_tracks.chain(of_detections).fold(0.0, f64::max);
    // Allows for the rounding of the sum.
    demand(most <= 1.0 + 1e-9, || format!("weights sum to {most}: {:?}", answer.pairs))
}

/// Returns the sum of the weights of some of the pairs.
fn weight_of(answer: &Associations, is_counted: impl Fn(&Association) -> bool) -> f64 {
    answer.pairs.iter().filter(|pair| is_counted(pair)).map(|pair| pair.weight).sum()
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let defaults = subject.info.defaults();
    let (tracks, detections) = crowd(&mut SplitMix64::new(8), 6, 8);
    // Built without settings, and from the printed defaults, which must have the same meaning.
    let first = subject.associator(From::Nothing)?.associate(&tracks, &detections, &GATE);
    let second = subject.associator(From::Text(&defaults))?.associate(&tracks, &detections, &GATE);
    demand(first == second, || format!("two answers differ: {first:?} and {second:?}"))
}

/// Returns the most probable detection of each track.
fn best(answer: &Associations, tracks: usize) -> Vec<Option<usize>> {
    (0..tracks)
        .map(|at| {
            let pairs = answer.pairs.iter().filter(|pair| pair.track == at);
            pairs.max_by(|a, b| a.weight.total_cmp(&b.weight)).map(|pair| pair.detection)
        })
        .collect()
}

fn own_detections(subject: &Subject<'_>) -> Verdict {
    let mut associator = subject.associator(From::Nothing)?;
    let mut random = SplitMix64::new(2);
    let places = [(3.0, -1.2), (3.0, 0.0), (4.0, 1.3)];
    let tracks: Vec<Track> = (1..).zip(places).map(|(id, (x, y))| track(id, x, y)).collect();
    let detections: Vec<Detection> =
        [2, 0, 1].map(|at: usize| detection(places[at].0, places[at].1, &mut random)).into();
    let found = best(&associator.associate(&tracks, &detections, &GATE), 3);
    demand(found == [Some(1), Some(2), Some(0)], || {
        format!("three tracks apart, each detected, got the detections {found:?}")
    })
}

fn far_detections(subject: &Subject<'_>) -> Verdict {
    let mut associator = subject.associator(From::Nothing)?;
    let mut random = SplitMix64::new(2);
    let tracks = [track(1, 3.0, 0.0)];
    let detections = [detection(6.0, 2.0, &mut random)];
    let answer = associator.associate(&tracks, &detections, &GATE);
    demand(answer.pairs.is_empty(), || {
        format!("a detection 3.6 m away was given to the track: {:?}", answer.pairs)
    })
}
