//! When tracks start, count as confirmed, and end.

use std::collections::BTreeMap;

use tagalong_core::{Estimate, Track, TrackId};

use crate::LifecycleSettings;

/// What one frame says of one track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sight {
    /// Supported by evidence: score and detector of the detection, if that was it.
    Seen(Option<(f64, usize)>),
    /// It should have been seen and was not.
    Missed,
    /// The detector that sees it did not work on this frame.
    NotAsked,
    /// Hidden behind a nearer person.
    Hidden,
    /// Outside the image.
    Outside,
}

/// What is kept of a track beside the filter's belief.
#[derive(Clone, Debug)]
pub(crate) struct Life {
    pub(crate) score: f64,
    pub(crate) confirmed: bool,
    /// The detector that saw it last.
    pub(crate) detector: Option<usize>,
    sight: Sight,
    age: u32,
    unseen_s: f64,
    /// Time since the frame before.
    step_s: f64,
    /// For how long, and how often in a row, it should have been seen and was
    /// not.
    missed_s: f64,
    misses: u32,
    /// Hits (1) and misses (0) of the last frames, newest in the lowest bit.
    recent: u32,
}

/// All tracks of a pipeline.
pub(crate) struct Lifecycle {
    settings: LifecycleSettings,
    lives: BTreeMap<TrackId, Life>,
    started: u32,
    /// For pairs that were near each other: in which of the last five frames.
    near: BTreeMap<(TrackId, TrackId), u8>,
}

impl Lifecycle {
    pub(crate) fn new(settings: LifecycleSettings) -> Self {
        Self { settings, lives: BTreeMap::new(), started: 0, near: BTreeMap::new() }
    }

    pub(crate) fn settings(&self) -> &LifecycleSettings {
        &self.settings
    }

    pub(crate) fn ids(&self) -> Vec<TrackId> {
        self.lives.keys().copied().collect()
    }

    pub(crate) fn get(&self, id: TrackId) -> Option<&Life> {
        self.lives.get(&id)
    }

    pub(crate) fn tentative_ids(&self) -> Vec<TrackId> {
        self.lives.iter().filter(|(_, life)| !life.confirmed).map(|(id, _)| *id).collect()
    }

    /// A new track; `None` when all numbers are used up.
    pub(crate) fn start(&mut self, score: f64, detector: usize) -> Option<TrackId> {
        self.started = self.started.checked_add(1)?;
        let id = TrackId(self.started);
        let life = Life {
            score,
            confirmed: score >= self.settings.confirm_score || self.settings.confirm_hits <= 1,
            detector: Some(detector),
            sight: Sight::Seen(Some((score, detector))),
            age: 0,
            unseen_s: 0.0,
            step_s: 0.0,
            missed_s: 0.0,
            misses: 0,
            recent: 1,
        };
        self.lives.insert(id, life);
        Some(id)
    }

    pub(crate) fn end(&mut self, id: TrackId) {
        self.lives.remove(&id);
        self.near.retain(|(a, b), _| *a != id && *b != id);
    }

    /// Time passes for everybody.
    pub(crate) fn grow_older(&mut self, dt_s: f64) {
        for life in self.lives.values_mut() {
            life.age = life.age.saturating_add(1);
            life.unseen_s += dt_s;
            life.step_s = dt_s;
        }
    }

    /// Takes in what a frame says of a track; returns the test by which it
    /// ends, if it does.
    pub(crate) fn advance(&mut self, id: TrackId, sight: Sight) -> Option<&'static str> {
        let life = self.lives.get_mut(&id)?;
        life.sight = sight;
        match sight {
            Sight::Seen(detection) => life.see(detection, &self.settings),
            Sight::Missed => life.miss(&self.settings),
            Sight::NotAsked => life.missed_s += life.step_s,
            Sight::Hidden => life.excuse(),
            Sight::Outside => {}
        }
        life.is_over(&self.settings)
    }

    /// Tracks that are of the same person as an older one (SPENCER's rule: too
    /// near in 3 of 5 frames). The older one takes over the confirmation.
    pub(crate) fn duplicates(&mut self, estimates: &BTreeMap<TrackId, Estimate>) -> Vec<TrackId> {
        let mut near = BTreeMap::new();
        let mut doubles: Vec<TrackId> = Vec::new();
        for (older, a) in estimates {
            for (younger, b) in
                estimates.range((std::ops::Bound::Excluded(*older), std::ops::Bound::Unbounded))
            {
                let apart = (a.person.position.xy() - b.person.position.xy()).norm();
                let before = self.near.get(&(*older, *younger)).copied().unwrap_or_default();
                let is_near =
                    apart < self.settings.duplicate_m && self.may_be_same(*older, *younger);
                let now = before << 1 & 0b11111 | u8::from(is_near);
                if now > 0 {
                    near.insert((*older, *younger), now);
                }
                if now.count_ones() >= 3 && !doubles.contains(older) && !doubles.contains(younger) {
                    self.hand_over(*younger, *older);
                    doubles.push(*younger);
                }
            }
        }
        self.near = near;
        doubles
    }

    /// A hidden person may be believed to be where somebody else is seen.
    fn may_be_same(&self, a: TrackId, b: TrackId) -> bool {
        let is_hidden = |id| self.lives.get(&id).is_some_and(|life| life.sight == Sight::Hidden);
        !is_hidden(a) && !is_hidden(b)
    }

    fn hand_over(&mut self, younger: TrackId, older: TrackId) {
        let confirmed = self.lives.get(&younger).is_some_and(|life| life.confirmed);
        if let Some(life) = self.lives.get_mut(&older) {
            life.confirmed |= confirmed;
        }
    }

    /// The tracks that are too many, lowest scores first.
    pub(crate) fn too_many(&self) -> Vec<TrackId> {
        let mut all: Vec<_> = self.lives.iter().map(|(id, life)| (life.score, *id)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let excess = all.len().saturating_sub(self.settings.max_tracks);
        all.into_iter().take(excess).map(|(_, id)| id).collect()
    }

    /// The track in the common words.
    pub(crate) fn track(&self, id: TrackId, estimate: Estimate) -> Option<Track> {
        let life = self.lives.get(&id)?;
        Some(Track {
            id,
            estimate,
            seen: matches!(life.sight, Sight::Seen(_)),
            occluded: life.sight == Sight::Hidden,
            confirmed: life.confirmed,
            age: life.age,
            unseen_s: life.unseen_s,
            score: life.score,
        })
    }
}

impl Life {
    fn see(&mut self, detection: Option<(f64, usize)>, settings: &LifecycleSettings) {
        self.unseen_s = 0.0;
        self.excuse();
        self.remember(true, settings);
        if let Some((score, detector)) = detection {
            self.detector = Some(detector);
            self.score += settings.score_weight * (score - self.score);
            self.confirmed |= score >= settings.confirm_score;
        }
        let is_likely = self.score >= settings.start_score;
        self.confirmed |= is_likely && self.recent.count_ones() >= settings.confirm_hits;
    }

    /// A good reason forgives the misses before it.
    fn excuse(&mut self) {
        self.missed_s = 0.0;
        self.misses = 0;
    }

    fn miss(&mut self, settings: &LifecycleSettings) {
        self.missed_s += self.step_s;
        self.misses = self.misses.saturating_add(1);
        self.remember(false, settings);
        if self.score > settings.miss_score {
            self.score += settings.score_weight * (settings.miss_score - self.score);
        }
    }

    fn remember(&mut self, hit: bool, settings: &LifecycleSettings) {
        let window = u32::MAX >> (32 - settings.confirm_within.clamp(1, 32));
        self.recent = (self.recent << 1 | u32::from(hit)) & window;
    }

    fn is_over(&self, settings: &LifecycleSettings) -> Option<&'static str> {
        let longer_than = |limit_s: f64| self.unseen_s > limit_s;
        if self.score < settings.drop_score {
            return Some("track: score");
        }
        if !self.confirmed && self.misses >= settings.tentative_misses {
            return Some("track: not confirmed");
        }
        let (over, test) = match self.sight {
            Sight::Seen(_) => (false, ""),
            Sight::Hidden => {
                (longer_than(settings.occluded_drop_after_s), "track: hidden too long")
            }
            Sight::Outside => (longer_than(settings.left_drop_after_s), "track: left the image"),
            Sight::Missed | Sight::NotAsked => {
                let long = self.missed_s > settings.drop_after_s
                    || longer_than(settings.occluded_drop_after_s);
                (long && self.misses >= settings.drop_after_misses, "track: not seen")
            }
        };
        over.then_some(test)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, SMatrix, Vector2};
    use tagalong_core::{Person, Rect};

    use super::*;

    fn two_at_one_place() -> (Lifecycle, BTreeMap<TrackId, Estimate>) {
        let mut lifecycle = Lifecycle::new(LifecycleSettings::default());
        let person = Person { position: Point3::new(3.0, 0.0, 1.6), velocity: Vector2::zeros() };
        let estimate =
            Estimate { person, covariance: SMatrix::identity(), region: Rect::default() };
        let ids = [lifecycle.start(1.0, 0).unwrap(), lifecycle.start(4.5, 0).unwrap()];
        (lifecycle, ids.map(|id| (id, estimate.clone())).into())
    }

    #[test]
    fn the_older_of_two_at_one_place_takes_over_in_the_third_frame() {
        let (mut lifecycle, estimates) = two_at_one_place();
        assert_eq!(lifecycle.duplicates(&estimates), []);
        assert_eq!(lifecycle.duplicates(&estimates), []);
        assert_eq!(lifecycle.duplicates(&estimates), [TrackId(2)]);
        assert!(lifecycle.get(TrackId(1)).unwrap().confirmed, "taken over from the younger one");
    }

    #[test]
    fn a_hidden_person_is_no_duplicate_of_the_one_in_front() {
        let (mut lifecycle, estimates) = two_at_one_place();
        for _ in 0..10 {
            lifecycle.grow_older(0.1);
            assert_eq!(lifecycle.advance(TrackId(1), Sight::Hidden), None);
            assert_eq!(lifecycle.duplicates(&estimates), []);
        }
    }

    /// One track of a score, and what becomes of it in frames an eighth of a second apart.
    fn live(
        settings: LifecycleSettings,
        score: f64,
        sights: &[Sight],
    ) -> (Life, Vec<&'static str>) {
        let mut lifecycle = Lifecycle::new(settings);
        let id = lifecycle.start(score, 0).unwrap();
        let mut ends = Vec::new();
        for sight in sights {
            lifecycle.grow_older(0.125);
            ends.extend(lifecycle.advance(id, *sight));
        }
        (lifecycle.get(id).unwrap().clone(), ends)
    }

    const SEEN: Sight = Sight::Seen(Some((1.0, 0)));

    fn confirmed(settings: LifecycleSettings, score: f64, sights: &[Sight]) -> bool {
        live(settings, score, sights).0.confirmed
    }

    #[test]
    fn hits_confirm_only_if_they_are_close_to_each_other() {
        let settings = || LifecycleSettings { tentative_misses: 9, ..LifecycleSettings::default() };
        let hits = |sights: &[Sight]| confirmed(settings(), 1.0, sights);
        assert!(!hits(&[SEEN]) && hits(&[SEEN, SEEN]), "the first sighting counts");
        assert!(hits(&[Sight::Missed, SEEN, Sight::Missed, SEEN]), "three of five");
        assert!(!hits(&[Sight::Missed, Sight::Missed, SEEN, Sight::Missed, SEEN]), "of six");
        let hidden = [Sight::Hidden, Sight::Outside, Sight::NotAsked, Sight::Hidden];
        assert!(hits(&[&hidden[..], &[SEEN, SEEN]].concat()), "what could not be seen is no miss");
        let once = LifecycleSettings { confirm_hits: 1, ..settings() };
        assert!(confirmed(once, 1.0, &[]));
    }

    #[test]
    fn hits_that_are_probably_no_person_confirm_nobody() {
        let doubtful = Sight::Seen(Some((-0.5, 0)));
        let settings = LifecycleSettings { drop_score: -9.0, ..LifecycleSettings::default() };
        assert!(!confirmed(settings.clone(), 0.1, &[doubtful; 6]));
        assert!(confirmed(settings.clone(), 0.1, &[Sight::Seen(None); 2]), "no score, no doubt");
        let sure = Sight::Seen(Some((4.0, 0)));
        assert!(confirmed(settings.clone(), 0.1, &[sure]), "at once");
        assert!(confirmed(settings, 4.0, &[]), "at once");
    }

    #[test]
    fn scores_are_smoothed_and_misses_speak_against_a_person() {
        let score = |sights: &[Sight]| live(LifecycleSettings::default(), 1.0, sights).0.score;
        assert!((score(&[Sight::Seen(Some((3.0, 0)))]) - 1.6).abs() < 1e-12, "0.3 of the way");
        assert!((score(&[Sight::Missed]) - 0.4).abs() < 1e-12, "0.3 of the way to -1");
        assert_eq!(
            score(&[Sight::Seen(None), Sight::Hidden, Sight::Outside, Sight::NotAsked]),
            1.0
        );
        let settings = LifecycleSettings { tentative_misses: 99, ..LifecycleSettings::default() };
        let low = live(settings, -1.5, &[Sight::Missed]).0.score;
        assert_eq!(low, -1.5, "a miss never speaks for a person");
    }

    #[test]
    fn a_track_ends_by_its_score_only_below_the_limit() {
        let ends = |score: f64| {
            let settings = LifecycleSettings { score_weight: 1.0, ..LifecycleSettings::default() };
            live(settings, 5.0, &[Sight::Seen(Some((score, 0)))]).1
        };
        assert_eq!((ends(-2.0), ends(-2.1)), (vec![], vec!["track: score"]));
    }

    #[test]
    fn who_is_hidden_is_kept_longer_than_who_should_be_seen() {
        let after = |sight: Sight, frames: usize| {
            live(LifecycleSettings::default(), 5.0, &vec![sight; frames]).1
        };
        assert_eq!(after(Sight::Missed, 8), Vec::<&str>::new());
        assert_eq!(after(Sight::Missed, 9), ["track: not seen"]);
        assert_eq!(after(Sight::Outside, 16), Vec::<&str>::new());
        assert_eq!(after(Sight::Outside, 17), ["track: left the image"]);
        assert_eq!(after(Sight::Hidden, 24), Vec::<&str>::new());
        assert_eq!(after(Sight::Hidden, 25), ["track: hidden too long"]);
        assert_eq!(after(Sight::NotAsked, 99), Vec::<&str>::new(), "nobody missed them");
    }

    #[test]
    fn misses_before_an_occlusion_are_forgiven() {
        let mut sights = vec![Sight::Missed; 8];
        sights.push(Sight::Hidden);
        sights.extend([Sight::Missed; 8]);
        let (life, ends) = live(LifecycleSettings::default(), 5.0, &sights);
        assert_eq!(ends, Vec::<&str>::new());
        assert_eq!((life.unseen_s, life.missed_s, life.misses), (2.125, 1.0, 8));
        let (life, _) = live(LifecycleSettings::default(), 5.0, &[Sight::Missed, SEEN]);
        assert_eq!((life.unseen_s, life.missed_s, life.misses, life.age), (0.0, 0.0, 0, 2));
    }

    #[test]
    fn time_without_a_look_counts_once_there_are_misses() {
        let settings = LifecycleSettings::default;
        let few = [&[Sight::Missed; 2][..], &[Sight::NotAsked; 20]].concat();
        assert_eq!(live(settings(), 5.0, &few).1, Vec::<&str>::new(), "three are needed");
        let enough = [&[Sight::Missed; 2][..], &[Sight::NotAsked; 9], &[Sight::Missed]].concat();
        assert_eq!(live(settings(), 5.0, &enough).1, ["track: not seen"]);
    }

    #[test]
    fn the_lowest_scores_are_too_many_and_of_equals_the_youngest() {
        let mut lifecycle =
            Lifecycle::new(LifecycleSettings { max_tracks: 2, ..LifecycleSettings::default() });
        for score in [1.0, 3.0, 1.0, 2.0] {
            lifecycle.start(score, 0).unwrap();
        }
        assert_eq!(lifecycle.too_many(), [TrackId(3), TrackId(1)]);
        lifecycle.end(TrackId(2));
        lifecycle.end(TrackId(4));
        assert_eq!(lifecycle.too_many(), []);
        assert_eq!(lifecycle.ids(), [TrackId(1), TrackId(3)]);
        assert_eq!(lifecycle.start(1.0, 0), Some(TrackId(5)), "no number twice");
    }

    #[test]
    fn only_tracks_that_are_not_confirmed_are_tentative() {
        let mut lifecycle = Lifecycle::new(LifecycleSettings::default());
        lifecycle.start(5.0, 0).unwrap();
        lifecycle.start(1.0, 0).unwrap();
        assert_eq!(lifecycle.tentative_ids(), [TrackId(2)]);
    }

    /// Near in every third frame only, then in three of five.
    #[test]
    fn two_people_who_pass_each_other_are_not_one() {
        let (mut lifecycle, together) = two_at_one_place();
        let mut apart = together.clone();
        apart.entry(TrackId(2)).and_modify(|e| e.person.position.y += 0.21);
        for _ in 0..4 {
            assert_eq!(lifecycle.duplicates(&together), []);
            assert_eq!(lifecycle.duplicates(&apart), []);
            assert_eq!(lifecycle.duplicates(&apart), []);
        }
        assert_eq!(lifecycle.duplicates(&together), []);
        assert_eq!(lifecycle.duplicates(&apart), []);
        assert_eq!(lifecycle.duplicates(&together), []);
        assert_eq!(lifecycle.duplicates(&together), [TrackId(2)], "three of four");
    }

    #[test]
    fn who_came_just_now_is_no_duplicate_yet() {
        let (mut lifecycle, estimates) = two_at_one_place();
        lifecycle.duplicates(&estimates);
        lifecycle.duplicates(&estimates);
        let third = lifecycle.start(1.0, 0).unwrap();
        let mut estimates = estimates;
        let place = estimates[&TrackId(1)].clone();
        estimates.insert(third, place);
        assert_eq!(lifecycle.duplicates(&estimates), [TrackId(2)], "the third came just now");
    }

    #[test]
    fn a_track_tells_what_its_last_frame_said() {
        let mut lifecycle = Lifecycle::new(LifecycleSettings::default());
        let estimate = two_at_one_place().1.remove(&TrackId(1)).unwrap();
        let id = lifecycle.start(5.0, 3).unwrap();
        let mut after = |sight| {
            lifecycle.grow_older(0.1);
            lifecycle.advance(id, sight);
            let track = lifecycle.track(id, estimate.clone()).unwrap();
            (track.seen, track.occluded, track.age, (track.unseen_s * 10.0).round())
        };
        assert_eq!(after(Sight::Hidden), (false, true, 1, 1.0));
        assert_eq!(after(Sight::Outside), (false, false, 2, 2.0));
        assert_eq!(after(Sight::Seen(Some((1.0, 7)))), (true, false, 3, 0.0));
        assert_eq!(lifecycle.get(id).unwrap().detector, Some(7));
        assert!(lifecycle.track(TrackId(9), estimate).is_none());
    }
}
