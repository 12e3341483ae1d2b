//! Log-odds, bounds and limits, against values worked out by hand.

use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_core::{
    EgoMotion, Estimate, Initiation, Observation, ObservedTrack, Person, Track, TrackId,
    TrackManager, Unassociated,
};
use tagalong_geometry::Rect;

use super::detection;
use crate::sprt::{Config, Sprt};

const ID: TrackId = TrackId(1);

/// Returns settings under which looks alone count: nothing fades, standing still says nothing, and
/// no bound is in reach.
fn looks_only() -> Config {
    Config {
        confirm_log_odds: 90.0,
        end_log_odds: -90.0,
        max_log_odds: 100.0,
        max_look: 50.0,
        look_s: 1e6,
        still_log_odds: 0.0,
        undecided_s: 1e3,
        clutter_s: 1e6,
        tentative_misses: 1000,
        drop_after_s: 1e3,
        left_drop_after_s: 1e3,
        occluded_drop_after_s: 1e3,
        ..Config::default()
    }
}

/// A track ahead of a robot that does not move.
struct Bench {
    manager: Sprt,
    track: Track,
}

impl Bench {
    /// Starts the track at a place by a first look.
    fn new(config: Config, x: f64, log_odds: f64) -> Self {
        let mut bench = Self::without_track(config);
        bench.start(x, log_odds);
        bench
    }

    fn without_track(config: Config) -> Self {
        let person = Person { position: Point3::origin(), velocity: Vector2::zeros() };
        let covariance = SMatrix::identity() * 1e-4;
        let track =
            Track::new(ID, Estimate::new(person, covariance, Rect::new(0.0, 0.0, 9.0, 9.0)), 0.0)
                .with_confirmed(false);
        Self { manager: Sprt::new(config).unwrap(), track }
    }

    fn offer(&mut self, x: f64, log_odds: f64) -> Initiation {
        let seen = detection(x, log_odds);
        let new = Unassociated::new(&seen, log_odds, true);
        self.manager.initiate(ID, &new)
    }

    fn start(&mut self, x: f64, log_odds: f64) {
        let Initiation::Start(health) = self.offer(x, log_odds) else { panic!("it was dropped") };
        self.track.estimate.person.position.x = x;
        (self.track.score, self.track.confirmed) = (health.log_odds, health.confirmed);
    }

    fn is_clutter(&mut self, x: f64, log_odds: f64) -> bool {
        match self.offer(x, log_odds) {
            Initiation::Drop("clutter") => true,
            Initiation::Drop(test) => panic!("dropped by {test}"),
            Initiation::Start(_) => {
                self.manager.stop(ID);
                false
            }
        }
    }

    /// Advances by `dt_s`; returns the test by which the track ends, if it does.
    fn observe(&mut self, dt_s: f64, observation: Observation) -> Option<&'static str> {
        self.manager.predict(&EgoMotion::at_rest(dt_s));
        self.track.seen = observation.is_supported();
        self.track.unseen_s = if self.track.seen { 0.0 } else { self.track.unseen_s + dt_s };
        let changes = self.manager.manage(&[ObservedTrack::new(&self.track, observation)]);
        let [(_, health)] = changes.health[..] else { panic!("one track: {changes:?}") };
        (self.track.score, self.track.confirmed) = (health.log_odds, health.confirmed);
        changes.ends.first().map(|(_, test)| *test)
    }

    /// Sees the track at a place; returns its log-odds.
    fn look(&mut self, dt_s: f64, x: f64, log_odds: f64) -> f64 {
        self.track.estimate.person.position.x = x;
        self.observe(dt_s, Observation::Detected { log_odds });
        self.track.score
    }

    /// Makes clutter of a thing that shows `log_odds` at `x`, and does not move.
    fn clutter(config: Config, x: f64, log_odds: f64) -> Self {
        let mut bench = Self::new(config, x, log_odds);
        bench.end_unmoved();
        bench
    }

    fn end_unmoved(&mut self) {
        self.manager.predict(&EgoMotion::at_rest(0.0));
        let test = self.observe(2e3, Observation::NotSearched);
        assert_eq!(test, Some("track: never moved"));
        self.manager.stop(ID);
    }
}

#[track_caller]
fn assert_near(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-3, "{value}, expected {expected}");
}

/// The mean counts, and a tenth of it more for each repetition.
#[test]
fn repetitions_of_a_look_count_a_tenth() {
    let mut bench = Bench::new(looks_only(), 3.0, 1.0);
    assert_near(bench.track.score, 1.0);
    assert_near(bench.look(0.1, 3.0, 2.0), 1.1 * 1.5);
    assert_near(bench.look(0.1, 3.0, 3.0), 1.2 * 2.0);
    let mut bench = Bench::new(Config { repeated: 1.1, ..looks_only() }, 3.0, 2.0);
    bench.look(0.1, 3.0, 2.0);
    assert_near(bench.look(0.1, 3.0, 2.0), 2.2);
}

#[test]
fn one_look_says_no_more_than_its_bound() {
    let bench = Bench::new(Config { max_look: 4.0, ..looks_only() }, 3.0, 30.0);
    assert_near(bench.track.score, 4.0);
}

/// From 0.25 m on, a place is a new one.
#[test]
fn looks_at_new_places_add_up() {
    let mut bench = Bench::new(looks_only(), 3.0, 2.0);
    assert_near(bench.look(0.1, 3.25, 3.0), 5.0);
    let mut bench = Bench::new(looks_only(), 3.0, 2.0);
    assert_near(bench.look(0.1, 3.24, 3.0), 1.1 * 2.5);
}

/// The track goes back to where it was: the second look there repeats the first.
#[test]
fn a_look_at_an_earlier_place_is_a_repetition() {
    let mut bench = Bench::new(looks_only(), 3.0, 2.0);
    bench.look(0.1, 3.4, 3.0);
    assert_near(bench.look(0.1, 3.0, 4.0), 1.1 * 3.0 + 3.0);
}

#[test]
fn looks_fade_with_their_time_constant() {
    let mut bench = Bench::new(Config { look_s: 2.0, ..looks_only() }, 3.0, 2.0);
    bench.look(0.0, 3.4, 3.0);
    for _ in 0..10 {
        bench.observe(0.1, Observation::Occluded);
    }
    assert_near(bench.track.score, 5.0 * (-0.5_f64).exp());
}

/// A second after the first look its part has faded; seen again, it counts in full, once.
#[test]
fn a_repeated_look_renews_the_faded_one() {
    let mut bench = Bench::new(Config { look_s: 2.0, repeated: 1.0, ..looks_only() }, 3.0, 2.0);
    bench.look(0.0, 3.4, 3.0);
    for _ in 0..10 {
        bench.look(0.1, 3.4, 3.0);
    }
    assert_near(bench.track.score, 2.0 * (-0.5_f64).exp() + 3.0);
    assert_near(bench.look(0.0, 3.0, 2.0), 5.0);
}

/// The part that faded during a pause does not come back with a look at another place.
#[test]
fn a_look_from_before_a_pause_stays_faded_beside_the_next_one_elsewhere() {
    let mut bench = Bench::new(Config { look_s: 2.0, repeated: 1.0, ..looks_only() }, 3.0, 2.0);
    for _ in 0..10 {
        bench.observe(0.1, Observation::Occluded);
    }
    assert_near(bench.track.score, 2.0 * (-0.5_f64).exp());
    assert_near(bench.look(0.0, 3.4, 3.0), 2.0 * (-0.5_f64).exp() + 3.0);
    // It goes on fading beside the new one.
    for _ in 0..10 {
        bench.look(0.1, 3.4, 3.0);
    }
    assert_near(bench.track.score, 2.0 * (-1.0_f64).exp() + 3.0);
}

#[test]
fn misses_count_until_the_track_is_supported_again() {
    let mut bench = Bench::new(looks_only(), 3.0, 3.0);
    for (observation, expected) in [
        (Observation::Missed, 2.5),
        (Observation::Missed, 2.0),
        (Observation::NotSearched, 2.0),
        (Observation::Occluded, 3.0),
    ] {
        bench.observe(0.1, observation);
        assert_near(bench.track.score, expected);
    }
    bench.observe(0.1, Observation::Missed);
    // The filter alone supports it: 1 per second.
    for expected in [2.9, 2.8] {
        bench.observe(0.1, Observation::Updated);
        assert_near(bench.track.score, expected);
    }
    assert_near(bench.look(0.1, 3.0, 3.0), 3.3);
}

/// However sure the looks were, a miss lowers the log-odds at once.
#[test]
fn misses_count_below_the_bound() {
    let config = Config { confirm_log_odds: 5.0, max_log_odds: 6.0, ..looks_only() };
    let mut bench = Bench::new(config, 3.0, 20.0);
    assert_near(bench.track.score, 6.0);
    bench.observe(0.1, Observation::Missed);
    assert_near(bench.track.score, 5.5);
}

#[test]
fn each_still_second_speaks_against_a_person_up_to_a_bound() {
    fn after(frames: u32, bench: &mut Bench) -> f64 {
        (0..frames).for_each(|_| _ = bench.look(0.1, 3.0, 3.0));
        bench.track.score
    }

    let config = Config { still_log_odds: -0.75, repeated: 1.0, ..looks_only() };
    let mut bench = Bench::new(config, 3.0, 3.0);
    assert_near(after(10, &mut bench), 3.0 - 0.75);
    assert_near(after(20, &mut bench), 3.0 - 1.5);
    // Time in which it is not seen says nothing of its motion.
    let mut bench = Bench::new(Config { still_log_odds: -0.75, ..looks_only() }, 3.0, 3.0);
    bench.observe(1.0, Observation::Occluded);
    assert_near(bench.track.score, 3.0);
}

/// Four looks of 2.0 at four places, 0.3 m apart: moved at the second one beyond 0.5 m.
fn walked(config: Config) -> Bench {
    let mut bench = Bench::new(config, 3.0, 2.0);
    bench.look(0.1, 3.3, 2.0);
    assert_near(bench.look(0.1, 3.6, 2.0), 6.0);
    assert_near(bench.look(0.1, 3.9, 2.0), 11.0);
    bench
}

#[test]
fn motion_counts_once_and_staying_takes_a_part_of_the_usual_look() {
    let mut bench = walked(Config { repeated: 1.0, undecided_s: 2.0, ..looks_only() });
    for _ in 0..10 {
        bench.look(0.1, 3.9, 2.0);
    }
    // Half of `undecided_s`, half of the usual 2.0.
    assert_near(bench.track.score, 11.0 - 0.5 * 0.5 * 2.0);
    for _ in 0..30 {
        bench.look(0.1, 3.9, 2.0);
    }
    assert_near(bench.track.score, 11.0 - 0.5 * 2.0);
}

/// Where the track was during the pause is not known.
#[test]
fn a_pause_is_no_stay() {
    let mut bench = walked(Config { repeated: 1.0, undecided_s: 2.0, ..looks_only() });
    for _ in 0..3 {
        bench.observe(0.5, Observation::NotSearched);
    }
    assert_near(bench.look(0.1, 3.9, 2.0), 11.0);
}

#[test]
fn a_track_within_its_uncertainty_or_the_bound_has_not_moved() {
    fn score(x: f64, variance: f64) -> f64 {
        let mut bench = Bench::new(Config { repeated: 1.0, ..looks_only() }, 3.0, 2.0);
        bench.track.estimate.covariance *= variance / 1e-4;
        bench.look(0.1, 3.25, 2.0);
        for _ in 0..3 {
            bench.look(0.1, x, 2.0);
        }
        bench.track.score
    }

    assert_near(score(3.5, 0.0), 6.0);
    assert_near(score(3.55, 0.0), 9.0);
    // Three standard deviations of 0.2 m on the floor are 0.6 m.
    assert_near(score(3.55, 0.02), 6.0);
    assert_near(score(3.65, 0.02), 9.0);
}

/// A person is lost beside a blanket, which is found 0.9 m away with log-odds below zero.
#[test]
fn what_is_rather_a_thing_is_no_motion() {
    fn score(there: f64) -> f64 {
        let mut bench = Bench::new(Config { repeated: 1.0, ..looks_only() }, 3.0, 2.0);
        bench.look(0.1, 3.3, 2.0);
        for _ in 0..3 {
            bench.look(0.1, 3.9, there);
        }
        bench.track.score
    }

    // Two looks of 2.0 and the one there; 3.0 more for motion.
    assert_near(score(0.5), 2.0 + 2.0 + 0.5 + 3.0);
    assert_near(score(0.0), 2.0 + 2.0);
    assert_near(score(-0.5), 2.0 + 2.0 - 0.5);
}

#[test]
fn a_track_is_confirmed_at_its_bound() {
    let config = Config { confirm_log_odds: 4.0, repeated: 1.0, ..looks_only() };
    assert!(Bench::new(config.clone(), 3.0, 4.0).track.confirmed);
    let mut bench = Bench::new(config, 3.0, 3.9);
    assert!(!bench.track.confirmed);
    bench.look(0.1, 3.3, 0.2);
    assert!(bench.track.confirmed);
}

/// Observes the same until the track ends; returns after how long, s, and why.
fn ends_after(bench: &mut Bench, dt_s: f64, observation: Observation) -> (f64, &'static str) {
    let mut ended = (1..100).filter_map(|i| {
        let test = bench.observe(dt_s, observation);
        test.map(|test| (f64::from(i) * dt_s, test))
    });
    ended.next().unwrap()
}

/// Each limit of the defaults, met exactly, keeps the track.
#[test]
fn confirmed_tracks_end_by_the_reason_for_which_they_are_not_seen() {
    let limits = Config::default();
    let config = Config {
        confirm_log_odds: 4.0,
        tentative_misses: 2,
        drop_after_s: limits.drop_after_s,
        left_drop_after_s: limits.left_drop_after_s,
        occluded_drop_after_s: limits.occluded_drop_after_s,
        ..looks_only()
    };
    for (observation, end) in [
        (Observation::Occluded, (3.5, "track: hidden too long")),
        (Observation::OutOfView, (2.5, "track: left the image")),
        (Observation::Missed, (1.5, "track: not seen")),
        (Observation::NotSearched, (3.5, "track: not seen")),
    ] {
        let mut bench = Bench::new(config.clone(), 3.0, 5.0);
        assert_eq!(ends_after(&mut bench, 0.5, observation), end, "{observation:?}");
    }
    // Frames in which it was not searched count as long as the misses themselves.
    let mut bench = Bench::new(config.clone(), 3.0, 5.0);
    assert_eq!(bench.observe(1.0, Observation::NotSearched), None);
    assert_eq!(bench.observe(0.5, Observation::Missed), Some("track: not seen"));
    let mut bench = Bench::new(config, 3.0, 5.0);
    assert_eq!(bench.observe(50.0, Observation::Updated), None);
}

#[test]
fn tracks_that_are_not_confirmed_end_by_misses_by_time_or_by_evidence() {
    let config = Config { tentative_misses: 2, undecided_s: 2.0, ..looks_only() };
    let end = ends_after(&mut Bench::new(config.clone(), 3.0, 3.0), 0.5, Observation::Missed);
    assert_eq!(end, (1.0, "track: not confirmed"));
    let end = ends_after(&mut Bench::new(config, 3.0, 3.0), 0.5, Observation::Occluded);
    assert_eq!(end, (2.5, "track: never moved"));
    let config = Config { end_log_odds: -2.0, ..looks_only() };
    let end = ends_after(&mut Bench::new(config, 3.0, 0.0), 0.1, Observation::Missed);
    assert_eq!(end, (0.5, "track: never moved"), "at -2.0 it goes on");
}

#[test]
fn candidates_are_dropped_by_the_test_that_speaks_against_them() {
    let mut manager = Sprt::new(Config { start_log_odds: 0.5, ..looks_only() }).unwrap();
    assert_eq!(manager.start_log_odds(), 0.5);
    for (score, detector_log_odds, discovered, expected) in [
        (0.4, 0.4, true, Some("score")),
        (0.4, 0.5, true, Some("verifier")),
        (0.4, 0.6, true, Some("verifier")),
        (0.6, 0.6, false, Some("no track fits")),
        (0.5, 0.5, true, None),
    ] {
        let seen = detection(3.0, score);
        let new = Unassociated::new(&seen, detector_log_odds, discovered);
        let initiation = manager.initiate(ID, &new);
        match expected {
            Some(test) => assert_eq!(initiation, Initiation::Drop(test)),
            None => assert!(matches!(initiation, Initiation::Start(_))),
        }
    }
}

/// The search near a lost track found somebody whom no track takes.
#[test]
fn a_refused_detection_starts_a_track_that_is_confirmed_at_once() {
    fn offer_refused(manager: &mut Sprt, log_odds: f64) -> Initiation {
        let seen = detection(4.0, log_odds);
        manager.initiate(ID, &Unassociated::new(&seen, log_odds, false))
    }

    let config = Config { confirm_log_odds: 4.0, ..looks_only() };
    let mut manager = Sprt::new(config.clone()).unwrap();
    assert_eq!(offer_refused(&mut manager, 3.9), Initiation::Drop("no track fits"));
    let started = offer_refused(&mut manager, 4.0);
    assert!(matches!(started, Initiation::Start(health) if health.confirmed), "{started:?}");
    // A thing there that showed 1.0 counts 4.0 against it.
    let mut manager = Bench::clutter(config, 4.0, 1.0).manager;
    assert_eq!(offer_refused(&mut manager, 7.9), Initiation::Drop("no track fits"));
    assert!(matches!(offer_refused(&mut manager, 8.0), Initiation::Start(_)));
}

/// The looks of the thing, 1.0, and 3.0 more.
#[test]
fn clutter_outweighs_the_thing_that_left_it() {
    let mut bench = Bench::clutter(looks_only(), 4.0, 1.0);
    assert!(bench.is_clutter(4.0, 3.99) && !bench.is_clutter(4.0, 4.0));
    bench.start(4.0, 6.0);
    assert_near(bench.track.score, 2.0);
    // Two looks of 6.0, the second less 4.0, are a mean of 4.0 and its repetition.
    assert_near(bench.look(0.1, 4.0, 6.0), 1.1 * 4.0 - 4.0);
}

#[test]
fn clutter_fades_is_renewed_where_it_is_seen_and_is_forgotten() {
    fn faded(by: f64) -> Bench {
        let mut bench = Bench::clutter(Config { clutter_s: 60.0, ..looks_only() }, 4.0, 1.0);
        bench.manager.predict(&EgoMotion::at_rest(60.0 * by.ln()));
        bench
    }

    let mut bench = faded(2.0);
    assert!(!bench.is_clutter(4.0, 2.1) && bench.is_clutter(4.0, 1.9));
    assert!(bench.is_clutter(4.0, 3.9), "seen, it is back");
    // 4.0 / 50 counts, and 4.0 / 100 does not.
    assert!(faded(50.0).is_clutter(4.0, 0.07));
    assert!(!faded(100.0).is_clutter(4.0, 0.03));
}

/// Less evidence against the same place leaves the evidence that was there, as far as it faded.
#[test]
fn clutter_at_one_place_is_the_most_that_was_gathered_there() {
    let config = Config { clutter_s: 1e4, min_clutter: 0.5, undecided_s: 1e3, ..looks_only() };
    let mut bench = Bench::clutter(config, 4.0, 12.0);
    assert!(bench.is_clutter(4.0, 9.9) && !bench.is_clutter(4.0, 10.1));
    bench.manager.predict(&EgoMotion::at_rest(1e4 * 2.0_f64.ln()));
    bench.start(4.0, 6.0);
    bench.look(0.1, 4.0, 0.0);
    // Its mean is 0.5: evidence of 1.0 against the place. Meanwhile 5.0 fades to 4.1.
    bench.end_unmoved();
    assert!(bench.is_clutter(4.0, 4.0) && !bench.is_clutter(4.0, 4.2));
}

#[test]
fn the_older_of_two_merged_tracks_takes_over_motion_and_confirmation() {
    let config = Config { confirm_log_odds: 10.0, repeated: 1.0, ..looks_only() };
    let mut bench = walked(config);
    let seen = detection(5.0, 2.0);
    let new = Unassociated::new(&seen, 2.0, true);
    bench.manager.initiate(TrackId(2), &new);
    assert_eq!(bench.manager.merge(TrackId(2), TrackId(3)), None);
    let health = bench.manager.merge(TrackId(2), ID).unwrap();
    assert!(health.confirmed);
    assert_near(health.log_odds, 2.0 + 3.0);
    // And loses nothing to a younger one that has neither.
    bench.manager.initiate(TrackId(3), &new);
    let health = bench.manager.merge(TrackId(2), TrackId(3)).unwrap();
    assert!(health.confirmed);
    assert_near(health.log_odds, 2.0 + 3.0);
}

#[test]
fn a_stopped_track_is_judged_no_longer() {
    let mut bench = Bench::new(looks_only(), 3.0, 2.0);
    bench.manager.stop(ID);
    let observation = Observation::Missed;
    let changes = bench.manager.manage(&[ObservedTrack::new(&bench.track, observation)]);
    assert!(changes.health.is_empty() && changes.ends.is_empty());
}
