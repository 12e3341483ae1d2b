use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};
use serde::Serialize;
use tagalong_core::{Reason, Track};
use tagalong_pipeline::{FrameReport, Likeness, LockState};
use tagalong_sim::{Clearance, Truth};

use super::{CrowdMeasures, Ride, Tick};
use crate::Moment;

/// ID of the person to follow: the first of the scene.
const WHOM: u16 = 1;
/// Maximum duration of a pause between frames; a longer one counts as this, s.
const LONGEST_PAUSE_S: f64 = 0.5;
/// Speed below which the robot does not touch people: they touch it, m/s.
const MOVES_MPS: f64 = 0.05;
/// Time over which the change of acceleration gives the jerk, s.
const JERK_S: f64 = 0.1;
/// Approximate time over which a person's speed is measured, s.
const SPEED_S: f64 = 0.6;

/// Criteria for good following.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RideJudge {
    /// Maximum distance between a track and the head of its person, m.
    pub same_m: f64,
    /// Visible fraction of the upper body from which on a person is in view ...
    pub min_visible: f64,
    /// ... and maximum range for that, m.
    pub max_range_m: f64,
    /// Time within which a person that comes back into view must be found again, s.
    pub refind_s: f64,
    /// Maximum time for which a wrong person may be followed without interruption, s.
    pub most_wrong_s: f64,
    /// Tolerance of the distance about the stand-off, m ...
    pub off_m: f64,
    /// ... which applies while the person is slower than this, m/s.
    pub slow_mps: f64,
}

impl Default for RideJudge {
    fn default() -> Self {
        Self {
            same_m: 0.6,
            min_visible: 0.5,
            max_range_m: 5.0,
            refind_s: 3.0,
            most_wrong_s: 2.0,
            off_m: 0.5,
            slow_mps: 0.8,
        }
    }
}

/// A period in which the person was not followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Episode {
    /// Time when the person was lost, s since the start.
    pub lost_s: f64,
    /// Time since which the person was in view at the end of the episode, s.
    pub in_view_s: Option<f64>,
    /// Time when the person was followed again, s.
    pub found_s: Option<f64>,
}

/// Fraction of the commands in a ride that had the same reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReasonShare {
    /// Name of the reason; `no command` while the enable does not permit any motion.
    pub reason: &'static str,
    /// Effect on the robot: `drives`, `slower` or `stands`.
    pub effect: &'static str,
    /// Fraction of the time of the ride, 0 to 1.
    pub share: f64,
}

/// Result of a ride.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Ridden {
    /// Seed of the scene.
    pub seed: u64,
    /// True if the person was followed, or rightly given up, and no other person was followed for
    /// long; and if the robot drove when the person went away.
    pub kept: bool,
    /// Most frequent reason of the commands in a ride in which the robot never moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub never_moved: Option<&'static str>,
    /// Reasons of the commands, the most frequent first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<ReasonShare>,
    /// Length of the ride, s.
    pub time_s: f64,
    /// Time during which the person was in view, s.
    pub in_view_s: f64,
    /// Time during which the right person was followed, s.
    pub right_s: f64,
    /// Time during which another person or an object was followed, s.
    pub wrong_s: f64,
    /// Longest such time without interruption, s.
    pub longest_wrong_s: f64,
    /// Time during which the person was followed and walked slowly, s ...
    pub slow_s: f64,
    /// ... and the part of it during which the distance was kept, s.
    pub distance_kept_s: f64,
    /// Mean of the person's distance beyond the stand-off during that time, m.
    pub farther_m: Option<f64>,
    /// Periods without the person after the first time that the person was followed.
    pub episodes: Vec<Episode>,
    /// Minimum free distance to people while the robot moved, m; `None` without people.
    pub clearance_people_m: Option<f64>,
    /// Minimum free distance to furniture and walls while the robot moved, m.
    pub clearance_things_m: Option<f64>,
    /// Time of the smaller of these two, s since the first frame.
    pub nearest_s: Option<f64>,
    /// Root mean square of the forward jerk, m/s³.
    pub jerk_mps3: f64,
    /// Measures of Follow-Bench, in a scene whose people react.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crowd: Option<CrowdMeasures>,
    /// Score of the lock for each detection, and true if it was the person.
    #[serde(skip)]
    pub likeness: Vec<(Likeness, bool)>,
}

/// Followed person in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whom {
    Nobody,
    Right,
    Wrong,
}

/// Scored frame.
#[derive(Clone, Copy, Debug)]
struct JudgedFrame {
    at_s: f64,
    dt_s: f64,
    whom: Whom,
    in_view: bool,
    range_m: Option<f64>,
    speed_mps: Option<f64>,
}

impl RideJudge {
    /// Scores a ride in which the first person of the scene is to be followed.
    pub fn judge(&self, ride: &Ride) -> Ridden {
        let looks = self.looks(ride);
        // The distance to the person counts only while they are slow enough to keep up with.
        let slow: Vec<&JudgedFrame> = looks.iter().filter(|look| self.is_slow(look)).collect();
        let slow_s = seconds_of(slow.iter().copied());
        let kept = slow.iter().copied().filter(|look| match (look.range_m, ride.stand_off_m) {
            (Some(range_m), Some(stand_off_m)) => (range_m - stand_off_m).abs() <= self.off_m,
            _ => false,
        });
        let farther = slow.iter().filter_map(|l| Some(l.dt_s * (l.range_m? - ride.stand_off_m?)));
        let farther_ms: f64 = farther.sum();
        let moving: Vec<&Tick> =
            ride.ticks.iter().filter(|tick| tick.speed_mps.abs() > MOVES_MPS).collect();
        let episodes = episodes(&looks);
        let first_s = looks.first().map_or(0.0, |look| look.at_s);
        let longest_wrong_s = longest(&looks, |look| look.whom == Whom::Wrong);
        let never_moved = never_moved(&ride.ticks);
        // Tracking alone is not following: a robot that is switched off loses no person that it sees.
        let stays_behind = never_moved.is_some() && self.goes_away(&looks, ride.stand_off_m);
        let keeps_track = longest_wrong_s <= self.most_wrong_s && self.ends_well(&looks, &episodes);
        Ridden {
            seed: ride.seed,
            kept: keeps_track && !stays_behind,
            never_moved,
            reasons: reasons(&ride.ticks),
            time_s: seconds_of(&looks),
            in_view_s: seconds_of(looks.iter().filter(|look| look.in_view)),
            right_s: seconds_of(looks.iter().filter(|look| look.whom == Whom::Right)),
            wrong_s: seconds_of(looks.iter().filter(|look| look.whom == Whom::Wrong)),
            longest_wrong_s,
            slow_s,
            distance_kept_s: seconds_of(kept),
            farther_m: (slow_s > 0.0).then(|| farther_ms / slow_s),
            episodes,
            clearance_people_m: least(moving.iter().map(|tick| tick.clearance.people_m)),
            clearance_things_m: least(moving.iter().map(|tick| tick.clearance.things_m)),
            nearest_s: nearest_s(moving.into_iter()).map(|at_s| (at_s - first_s).max(0.0)),
            jerk_mps3: jerk(&ride.ticks),
            crowd: CrowdMeasures::of(&ride.ticks),
            likeness: self.likeness(ride),
        }
    }

    /// Returns true if the right person is followed, and is slow enough to keep up with.
    fn is_slow(&self, look: &JudgedFrame) -> bool {
        look.whom == Whom::Right && look.speed_mps.is_some_and(|mps| mps < self.slow_mps)
    }

    /// Returns true if a person that came back into view was found in time; `None` if the person
    /// never came back, or only shortly before the end.
    pub fn refound(&self, episode: &Episode, end_s: f64) -> Option<bool> {
        let in_view_s = episode.in_view_s?;
        match episode.found_s {
            Some(found_s) => Some(found_s - in_view_s <= self.refind_s),
            None => (end_s - in_view_s > self.refind_s).then_some(false),
        }
    }

    fn ends_well(&self, looks: &[JudgedFrame], episodes: &[Episode]) -> bool {
        let found = looks.iter().any(|look| look.whom == Whom::Right);
        let end_s = looks.last().map_or(0.0, |look| look.at_s);
        let last = episodes.last().filter(|episode| episode.found_s.is_none());
        // A loss at the very end, without time to find the person again, is not a failure.
        found && last.and_then(|episode| self.refound(episode, end_s)).unwrap_or(true)
    }

    /// Returns true if the person was ever farther away than the distance to keep; without such a
    /// distance, if the person was ever out of view because of the distance.
    fn goes_away(&self, looks: &[JudgedFrame], stand_off_m: Option<f64>) -> bool {
        let near_m = stand_off_m.map_or(self.max_range_m, |stand_off_m| stand_off_m + self.off_m);
        looks.iter().any(|look| look.range_m.is_some_and(|range_m| range_m > near_m))
    }

    fn looks(&self, ride: &Ride) -> Vec<JudgedFrame> {
        let mut before = Whom::Nobody;
        let places: Vec<_> = ride.moments.iter().map(place).collect();
        let seconds: Vec<f64> =
            ride.moments.iter().map(|m| m.stamp.nanos() as f64 * 1e-9).collect();
        let seen = ride.moments.iter().zip(&ride.reports).enumerate();
        let looks = seen.map(|(at, (moment, report))| {
            before = self.whom(moment, report, before);
            let truth = person(moment);
            let next_s = seconds.get(at + 1).copied().unwrap_or(seconds[at]);
            JudgedFrame {
                at_s: seconds[at],
                // A gap in the frames must not count as following for its whole length.
                dt_s: (next_s - seconds[at]).clamp(0.0, LONGEST_PAUSE_S),
                whom: known(before, report.lock.as_ref().map(|lock| lock.state)),
                in_view: truth.is_some_and(|truth| self.is_in_view(truth)),
                range_m: truth.map(|truth| truth.head_in_robot.xy().coords.norm()),
                speed_mps: speed(&places, &seconds, at),
            }
        });
        looks.collect()
    }

    fn is_in_view(&self, truth: &Truth) -> bool {
        let range_m = truth.head_in_robot.xy().coords.norm();
        truth.visible_fraction >= self.min_visible && range_m <= self.max_range_m
    }

    /// Returns the followed person; a track that is not observed is assumed to be on the same
    /// person as before.
    fn whom(&self, moment: &Moment, report: &FrameReport, before: Whom) -> Whom {
        if !report.outcome.is_processed() {
            return before;
        }
        let target = report.tracks.iter().find(|track| Some(track.id) == report.target);
        match target {
            None => Whom::Nobody,
            Some(track) if track.seen => {
                if self.is_of(track, moment) {
                    Whom::Right
                } else {
                    Whom::Wrong
                }
            }
            // A target that was never observed cannot be the person.
            Some(_) if before == Whom::Nobody => Whom::Wrong,
            Some(_) => before,
        }
    }

    /// Returns true if a track is on the person to follow.
    fn is_of(&self, track: &Track, moment: &Moment) -> bool {
        let place = track.estimate.person.position.xy();
        let off = moment.truth.iter().map(|of| (of.id, (of.head_in_robot.xy() - place).norm()));
        let nearest = off.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.is_some_and(|(id, off_m)| id == WHOM && off_m <= self.same_m)
    }

    fn likeness(&self, ride: &Ride) -> Vec<(Likeness, bool)> {
        let frames = ride.moments.iter().zip(&ride.reports);
        frames
            .flat_map(|(moment, report): (&Moment, &FrameReport)| -> Vec<(Likeness, bool)> {
                let likeness = report.lock.iter().flat_map(|lock| &lock.likeness);
                let judged = likeness.filter_map(|like| {
                    let track = report.tracks.iter().find(|track| track.id == like.track)?;
                    Some((*like, self.is_of(track, moment)))
                });
                judged.collect()
            })
            .collect()
    }
}

/// Returns the followed person of a frame whose target is on `whom`, according to the state of the
/// lock. The tracks of a frozen image are at positions where people were: the report says that
/// their present positions are not known, and the robot stops.
fn known(whom: Whom, state: Option<LockState>) -> Whom {
    match (whom, state) {
        (Whom::Wrong, Some(LockState::NotKnown)) => Whom::Nobody,
        (whom, _) => whom,
    }
}

fn person(moment: &Moment) -> Option<&Truth> {
    moment.truth.iter().find(|truth| truth.id == WHOM)
}

/// Returns the position of the person in the world, m.
fn place(moment: &Moment) -> Option<Point2<f64>> {
    person(moment).map(|truth| moment.world_from_robot * truth.head_in_robot.xy())
}

/// Returns the speed over ground around a frame, m/s.
fn speed(places: &[Option<Point2<f64>>], seconds: &[f64], at: usize) -> Option<f64> {
    let first = (0..=at).rev().take_while(|other| is_near(seconds, at, *other)).last()?;
    let last = (at..seconds.len()).take_while(|other| is_near(seconds, at, *other)).last()?;
    let way: Vector2<f64> = places[last]? - places[first]?;
    let time_s = seconds[last] - seconds[first];
    (time_s > 0.0).then(|| way.norm() / time_s)
}

/// Returns true if the speed around a frame is measured with another one.
fn is_near(seconds: &[f64], at: usize, other: usize) -> bool {
    (seconds[other] - seconds[at]).abs() <= 0.5 * SPEED_S
}

/// Returns the duration of some of the frames, s.
fn seconds_of<'f>(looks: impl IntoIterator<Item = &'f JudgedFrame>) -> f64 {
    looks.into_iter().fold(0.0, |sum, look| sum + look.dt_s)
}

/// Returns the periods without the person, starting with the first time that the person was
/// followed.
fn episodes(looks: &[JudgedFrame]) -> Vec<Episode> {
    let mut all: Vec<Episode> = Vec::new();
    let mut followed = None;
    for look in looks {
        let right = look.whom == Whom::Right;
        match (followed, right) {
            (Some(true), false) => {
                all.push(Episode { lost_s: look.at_s, ..Episode::default() });
            }
            (Some(false), true) => {
                if let Some(open) = all.last_mut() {
                    open.found_s = Some(look.at_s);
                    open.in_view_s.get_or_insert(look.at_s);
                }
            }
            _ => {}
        }
        // A person that leaves the view again restarts the waiting time.
        if let Some(open) = all.last_mut().filter(|_| !right) {
            open.in_view_s = look.in_view.then(|| open.in_view_s.unwrap_or(look.at_s));
        }
        if right || followed.is_some() {
            followed = Some(right);
        }
    }
    all
}

/// Returns the longest uninterrupted time, s.
fn longest(looks: &[JudgedFrame], counts: impl Fn(&JudgedFrame) -> bool) -> f64 {
    let mut now = 0.0_f64;
    let mut most = 0.0_f64;
    for look in looks {
        now = if counts(look) { now + look.dt_s } else { 0.0 };
        most = most.max(now);
    }
    most
}

/// Returns the most frequent reason of the commands if the robot neither drove nor turned.
fn never_moved(ticks: &[Tick]) -> Option<&'static str> {
    if ticks.iter().any(|tick| tick.body_mps() > MOVES_MPS) {
        return None;
    }
    reasons(ticks).first().map(|commonest| commonest.reason)
}

/// Returns the reasons of the commands with their fractions, the most frequent first.
fn reasons(ticks: &[Tick]) -> Vec<ReasonShare> {
    let mut counts: BTreeMap<(&'static str, &'static str), usize> = BTreeMap::new();
    for tick in ticks {
        let name = tick.reason.map_or("no command", Reason::name);
        *counts.entry((name, tick.effect)).or_default() += 1;
    }
    let mut shares = Vec::new();
    for ((reason, effect), count) in counts {
        shares.push(ReasonShare { reason, effect, share: count as f64 / ticks.len() as f64 });
    }
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    shares
}

/// Returns the time at which the moving robot had the least free distance, s since the start.
fn nearest_s<'a>(moving: impl Iterator<Item = &'a Tick>) -> Option<f64> {
    let rooms = moving.map(|tick| {
        let Clearance { people_m, things_m } = tick.clearance;
        (people_m.min(things_m), tick.at_s)
    });
    let least = rooms.min_by(|a, b| a.0.total_cmp(&b.0));
    least.filter(|(room_m, _)| room_m.is_finite()).map(|(_, at_s)| at_s)
}

fn least(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.filter(|value| value.is_finite()).min_by(f64::total_cmp)
}

/// Returns the root mean square jerk from speeds a tenth of a second apart, m/s³.
fn jerk(ticks: &[Tick]) -> f64 {
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for tick in ticks {
        // Ticks are more frequent than the interval for which the jerk is defined; rounding must
        // not skip one.
        if samples.last().is_none_or(|(at_s, _)| tick.at_s - at_s >= JERK_S - 1e-6) {
            samples.push((tick.at_s, tick.speed_mps));
        }
    }
    let squares: Vec<f64> = samples
        .windows(3)
        .map(|w| ((w[2].1 - 2.0 * w[1].1 + w[0].1) / (JERK_S * JERK_S)).powi(2))
        .collect();
    if squares.is_empty() {
        0.0
    } else {
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::{Reason, TrackId};

    use super::*;
    use crate::testing::trial;

    fn looks(whom: &[(Whom, bool)]) -> Vec<JudgedFrame> {
        whom.iter()
            .enumerate()
            .map(|(at, (whom, in_view))| JudgedFrame {
                at_s: at as f64 * 0.5,
                dt_s: 0.5,
                whom: *whom,
                in_view: *in_view,
                range_m: Some(1.8),
                speed_mps: Some(0.0),
            })
            .collect()
    }

    #[test]
    fn an_episode_counts_from_when_the_person_is_in_view_again() {
        use Whom::{Nobody, Right, Wrong};
        let all = episodes(&looks(&[
            (Nobody, true),
            (Right, true),
            (Wrong, true),
            (Nobody, false),
            (Nobody, true),
            (Nobody, true),
            (Right, true),
            (Nobody, false),
        ]));
        let first = Episode { lost_s: 1.0, in_view_s: Some(2.0), found_s: Some(3.0) };
        let second = Episode { lost_s: 3.5, in_view_s: None, found_s: None };
        assert_eq!(all, [first, second]);
        let judge = RideJudge::default();
        assert_eq!(judge.refound(&first, 9.0), Some(true));
        assert_eq!(judge.refound(&second, 9.0), None);
        let late = Episode { in_view_s: Some(4.0), ..second };
        assert_eq!((judge.refound(&late, 6.0), judge.refound(&late, 8.0)), (None, Some(false)));
    }

    fn tick(speed_mps: f64, turn_rate: f64, reason: Option<Reason>) -> Tick {
        let clearance = Clearance { people_m: 1.0, things_m: 1.0 };
        Tick {
            at_s: 0.0,
            speed_mps,
            turn_rate,
            clearance,
            approach: None,
            reason,
            effect: reason.map_or("stands", Reason::effect),
            crowd: None,
        }
    }

    #[test]
    fn a_robot_that_is_slowed_down_to_zero_stands() {
        let ticks = [(0.2, "slower"), (0.0, "stands"), (0.0, "stands"), (0.0, "stands")]
            .map(|(mps, effect)| Tick { effect, ..tick(mps, 0.0, Some(Reason::Near)) });
        let shares: Vec<_> =
            reasons(&ticks).iter().map(|it| (it.reason, it.effect, it.share)).collect();
        assert_eq!(shares, [("near", "stands", 0.75), ("near", "slower", 0.25)]);
    }

    #[test]
    fn a_robot_that_never_moves_names_the_reason_and_keeps_no_person_that_goes_away() {
        fn kept(range_m: f64, speed_mps: f64) -> bool {
            let heads = [(range_m, 0.0, 1.0); 10];
            let places = [Some((range_m, 0.0)); 10];
            let mut trial = trial(&[&heads], &[(7, &places)]);
            let mut reports = trial.runs.remove(0).reports;
            for report in &mut reports {
                report.target = Some(TrackId(7));
            }
            let ride = Ride {
                seed: 1,
                stand_off_m: Some(1.5),
                moments: trial.moments,
                reports,
                took_ms: Vec::new(),
                ticks: vec![tick(speed_mps, 0.0, Some(Reason::Silent))],
                in_view: Vec::new(),
                faults: Vec::new(),
            };
            RideJudge::default().judge(&ride).kept
        }

        let silent = Some(Reason::Silent);
        let ticks = [tick(0.0, 0.0, None), tick(0.0, 0.0, silent), tick(0.01, 0.0, silent)];
        assert_eq!(never_moved(&ticks), Some("silent"));
        let shares = reasons(&[ticks.as_slice(), &[tick(0.2, 0.0, Some(Reason::Near))]].concat());
        let shares: Vec<_> = shares.iter().map(|it| (it.reason, it.effect, it.share)).collect();
        let expected =
            [("silent", "stands", 0.5), ("near", "slower", 0.25), ("no command", "stands", 0.25)];
        assert_eq!(shares, expected);
        assert_eq!(never_moved(&[ticks[0], tick(0.2, 0.0, silent)]), None, "it drives");
        assert_eq!(never_moved(&[ticks[0], tick(0.0, 0.9, silent)]), None, "it turns");
        assert!(kept(1.5, 0.0), "a person at the distance to keep is no reason to move");
        assert!(!kept(3.0, 0.0), "the robot stayed behind");
        assert!(kept(3.0, 0.3), "it drove");
    }

    #[test]
    fn a_target_of_which_the_lock_knows_nothing_is_no_wrong_person() {
        for state in [None, Some(LockState::Locked), Some(LockState::Suspect)] {
            assert_eq!(known(Whom::Wrong, state), Whom::Wrong, "{state:?}");
        }
        for (whom, judged) in
            [(Whom::Wrong, Whom::Nobody), (Whom::Right, Whom::Right), (Whom::Nobody, Whom::Nobody)]
        {
            assert_eq!(known(whom, Some(LockState::NotKnown)), judged);
        }
    }

    #[test]
    fn the_longest_time_is_in_one_go() {
        use Whom::{Right, Wrong};
        let all = looks(&[(Wrong, true), (Right, true), (Wrong, true), (Wrong, true)]);
        assert_eq!(longest(&all, |look| look.whom == Wrong), 1.0);
    }

    #[test]
    fn the_nearest_time_is_that_of_the_least_room_to_anything() {
        fn near(at_s: f64, people_m: f64, things_m: f64) -> Tick {
            Tick { at_s, clearance: Clearance { people_m, things_m }, ..tick(0.5, 0.0, None) }
        }

        let ticks = [near(0.1, 1.0, 2.0), near(0.2, f64::INFINITY, 0.4), near(0.3, 0.5, 2.0)];
        assert_eq!(nearest_s(ticks.iter()), Some(0.2));
        let alone = [near(0.1, f64::INFINITY, f64::INFINITY)];
        assert_eq!(nearest_s(alone.iter()), None);
    }

    #[test]
    fn a_steady_speed_has_no_jerk_and_a_sudden_stop_has() {
        fn ride(speed: impl Fn(u32) -> f64) -> Vec<Tick> {
            let ticks = (0..200).map(|i| (0.02 * f64::from(i), speed(i)));
            ticks.map(|(at_s, speed_mps)| Tick { at_s, ..tick(speed_mps, 0.0, None) }).collect()
        }

        assert!(jerk(&ride(|_| 0.5)) < 1e-9);
        assert!(jerk(&ride(|i| 0.002 * f64::from(i))) < 1e-6);
        assert!(jerk(&ride(|i| if i < 100 { 0.5 } else { 0.0 })) > 5.0);
    }
}
