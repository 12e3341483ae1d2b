//! The sightings of one frame: what the detectors said, and what became of it.

use tagalong_core::{Detection, Funnel, Track, TrackId};

use crate::association::{Fit, associate, fit, is_same_person};
use crate::{AssociationSettings, Candidate, Fate};

/// A detection on its way through the pipeline.
#[derive(Clone, Debug)]
pub(crate) struct Sighting {
    pub(crate) detection: Detection,
    /// Which detector made it.
    pub(crate) detector: usize,
    /// Its score before the verifiers.
    pub(crate) raw_score: f64,
    /// Found by a search everywhere. A search near a track proves nothing about
    /// somebody new: it passes tests that are meant for known people.
    pub(crate) is_discovery: bool,
    /// `None` while nothing is decided.
    pub(crate) fate: Option<Fate>,
}

impl Sighting {
    pub(crate) fn new(detection: Detection, detector: usize, is_discovery: bool) -> Self {
        Self { raw_score: detection.score, detection, detector, is_discovery, fate: None }
    }

    /// The test that a score below `start_score` fails.
    pub(crate) fn score_test(&self, start_score: f64) -> &'static str {
        if self.raw_score >= start_score { "verifier" } else { "score" }
    }
}

/// Rules of one frame for what may belong together.
pub(crate) struct Rules<'a> {
    pub(crate) association: &'a AssociationSettings,
    pub(crate) start_score: f64,
    pub(crate) dt_s: f64,
}

impl Rules<'_> {
    /// How well a sighting and a track fit. A sighting that is probably no
    /// person still supports a track that probably is one: log-odds add up.
    pub(crate) fn fit(&self, track: &Track, detection: &Detection) -> Option<Fit> {
        if self.is_doubtful(track, detection) {
            return None;
        }
        fit(track, detection, self.dt_s, self.association)
    }

    /// Why a sighting does not fit a track, if it does not.
    pub(crate) fn misfit(&self, track: &Track, sighting: &Sighting) -> Option<&'static str> {
        if self.is_doubtful(track, &sighting.detection) {
            return Some(sighting.score_test(self.start_score));
        }
        self.fit(track, &sighting.detection).is_none().then_some("gate")
    }

    fn is_doubtful(&self, track: &Track, detection: &Detection) -> bool {
        detection.score < self.start_score && track.score + detection.score < 0.0
    }
}

/// All sightings of one frame.
#[derive(Default)]
pub(crate) struct Sightings {
    all: Vec<Sighting>,
}

impl Sightings {
    pub(crate) fn add(&mut self, sighting: Sighting) {
        self.all.push(sighting);
    }

    /// Sightings that were given to a track.
    pub(crate) fn matched(&self) -> impl Iterator<Item = (TrackId, &Sighting)> {
        self.all.iter().filter_map(|s| match s.fate {
            Some(Fate::Matched(id)) => Some((id, s)),
            _ => None,
        })
    }

    /// The sighting of a track.
    pub(crate) fn of_track(&self, id: TrackId) -> Option<&Sighting> {
        self.matched().find(|(track, _)| *track == id).map(|(_, s)| s)
    }

    /// The detection of a track, to be changed.
    pub(crate) fn of_track_mut(&mut self, id: TrackId) -> Option<&mut Detection> {
        let of_track = self.all.iter_mut().find(|s| s.fate == Some(Fate::Matched(id)));
        of_track.map(|sighting| &mut sighting.detection)
    }

    /// Sightings about which nothing is decided.
    pub(crate) fn undecided(&self) -> Vec<usize> {
        (0..self.all.len()).filter(|i| self.all[*i].fate.is_none()).collect()
    }

    /// The detections about which nothing is decided.
    pub(crate) fn undecided_detections(&self) -> Vec<Detection> {
        self.undecided().into_iter().map(|i| self.all[i].detection.clone()).collect()
    }

    pub(crate) fn get(&self, index: usize) -> &Sighting {
        &self.all[index]
    }

    pub(crate) fn settle(&mut self, index: usize, fate: Fate) {
        self.all[index].fate = Some(fate);
    }

    /// Keeps one sighting a person, the one with the best score: two detectors
    /// may have seen the same one, and so may the searches for two tracks.
    pub(crate) fn merge(&mut self, settings: &AssociationSettings) {
        let mut order = self.undecided();
        order.sort_by(|a, b| self.score(*b).total_cmp(&self.score(*a)));
        let mut kept: Vec<usize> = Vec::new();
        for index in order {
            let is_same = |other: &&usize| {
                is_same_person(&self.all[index].detection, &self.all[**other].detection, settings)
            };
            match kept.iter().find(is_same).copied() {
                Some(better) => {
                    self.all[better].is_discovery |= self.all[index].is_discovery;
                    self.settle(index, Fate::Dropped("same person"));
                }
                None => kept.push(index),
            }
        }
    }

    /// Gives sightings to tracks, all at once: a search near one track that
    /// found another person must not steal that person's sighting.
    pub(crate) fn associate(&mut self, expected: &[Track], rules: &Rules<'_>) {
        let tracks: Vec<&Track> = expected.iter().collect();
        let open = self.undecided();
        let detections: Vec<&Detection> = open.iter().map(|i| &self.all[*i].detection).collect();
        let columns = associate(&tracks, &detections, |t, d| rules.fit(t, d), rules.association);
        for (track, column) in tracks.iter().zip(columns) {
            if let Some(column) = column {
                self.settle(open[column], Fate::Matched(track.id));
            }
        }
    }

    /// Drops the lowest scores where there are too many.
    pub(crate) fn limit(&mut self, most: usize) {
        let mut open = self.undecided();
        let excess = self.all.len().saturating_sub(most).min(open.len());
        open.sort_by(|a, b| self.score(*a).total_cmp(&self.score(*b)));
        for index in open.into_iter().take(excess) {
            self.settle(index, Fate::Dropped("too many detections"));
        }
    }

    /// Drops what was given to a track that it does not support after all.
    pub(crate) fn reject(&mut self, is_supported: impl Fn(TrackId) -> bool, test: &'static str) {
        for sighting in &mut self.all {
            if let Some(Fate::Matched(id)) = sighting.fate
                && !is_supported(id)
            {
                sighting.fate = Some(Fate::Dropped(test));
            }
        }
    }

    /// The candidates of the report; what was dropped is counted.
    pub(crate) fn into_candidates(self, funnel: &mut Funnel) -> Vec<Candidate> {
        self.all
            .into_iter()
            .map(|sighting| {
                let fate = sighting.fate.unwrap_or(Fate::Dropped("score"));
                if let Fate::Dropped(test) = fate {
                    funnel.drop_at(test, sighting.detection.region);
                }
                Candidate { detection: sighting.detection, fate }
            })
            .collect()
    }

    fn score(&self, index: usize) -> f64 {
        self.all[index].detection.score
    }
}
