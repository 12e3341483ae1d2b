use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Joints, Track, TrackId};

use super::settings::TargetSettings;

/// Speed below which a person stands before the robot, m/s.
const STANDS_MPS: f64 = 0.3;
/// Distance by which a person taken instead of the chosen one is nearer, m.
const NEARER_M: f64 = 0.3;
/// Distance beyond which a person's head is in the image of a camera as low as 0.3 m, so that nobody
/// there was overlooked, m.
const OVERLOOKED_M: f64 = 3.0;
/// Time without joints after which a raised hand is forgotten, s.
const HAND_UNSEEN_S: f64 = 1.0;
/// Speed across the line of sight from which a person walks past, m/s.
const CROSSES_MPS: f64 = 0.4;

/// Rule by which a target is chosen while there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ChoiceRule {
    /// The nearest person in front.
    #[default]
    Nearest,
    /// The person that walks up to the robot and stops in front of it.
    Approach,
    /// The nearest person that raises a hand above the head; needs a detector that finds joints.
    #[serde(rename = "raised-hand")]
    RaisedHand,
    /// No person: the robot waits for an enrollment.
    None,
}

/// Choice of the target among the tracks, by the settings of the lock.
#[derive(Clone, Debug, Default)]
pub(super) struct Chooser {
    /// Time for which there has been a track to choose, s.
    waited_s: f64,
    /// Time since one was chosen, s.
    chosen_s: f64,
    /// Confirmed tracks that may be walking up to the robot.
    approaches: BTreeMap<TrackId, Approach>,
    /// Tracks with a raised hand.
    raised: BTreeMap<TrackId, RaisedHand>,
}

/// Raised hand of a track.
#[derive(Clone, Copy, Debug, Default)]
struct RaisedHand {
    /// Time since it was first seen, s.
    held_s: f64,
    /// Time since joints were last found, s.
    unseen_s: f64,
}

/// Way of a track towards the robot.
#[derive(Clone, Copy, Debug)]
struct Approach {
    /// Largest distance at which the track was seen, m.
    farthest_m: f64,
    /// Time for which it has stood near the robot, s.
    stands_s: f64,
}

/// Returns the distance of a track from the middle of the robot, m.
pub(crate) fn distance_m(track: &Track) -> f64 {
    track.estimate.person.position.xy().coords.norm()
}

/// Returns the direction of a track, degrees to the left.
pub(crate) fn bearing_deg(track: &Track) -> f64 {
    let place = track.estimate.person.position.xy();
    place.y.atan2(place.x).to_degrees()
}

/// Returns the speed of a track across the line of sight, m/s.
fn across_mps(track: &Track) -> f64 {
    let person = &track.estimate.person;
    person.velocity.perp(&person.position.xy().coords.normalize()).abs()
}

/// Returns the nearest confirmed track in front, within the bearing and the distance of the settings.
pub(crate) fn nearest_in_front<'a>(
    settings: &TargetSettings,
    tracks: &'a [Track],
) -> Option<&'a Track> {
    nearest(tracks.iter().filter(|track| {
        track.confirmed
            && bearing_deg(track).abs() <= settings.choose_within_deg
            && distance_m(track) <= settings.choose_within_m
    }))
}

fn nearest<'a>(tracks: impl Iterator<Item = &'a Track>) -> Option<&'a Track> {
    tracks.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))
}

impl Chooser {
    /// Returns the track to follow from now on, if there is one; `joints` are those of tracks in this
    /// frame, `dt_s` is the time since the last call.
    pub(super) fn choose<'a>(
        &mut self,
        settings: &TargetSettings,
        tracks: &'a [Track],
        joints: &[(TrackId, Arc<Joints>)],
        dt_s: f64,
    ) -> Option<&'a Track> {
        if let Some(number) = settings.track {
            return tracks.iter().find(|track| track.confirmed && track.id.0 == number);
        }
        match settings.choose {
            ChoiceRule::Nearest => self.wait_for_nearest(settings, tracks, dt_s),
            ChoiceRule::Approach => self.wait_for_approach(settings, tracks, dt_s),
            ChoiceRule::RaisedHand => self.wait_for_hand(settings, tracks, joints, dt_s),
            ChoiceRule::None => None,
        }
    }

    /// Returns the nearest track within `choose_within_m` that held a hand above the head for
    /// `raised_hand_s`. Frames in which a slower network finds no joints neither count nor begin anew.
    fn wait_for_hand<'a>(
        &mut self,
        settings: &TargetSettings,
        tracks: &'a [Track],
        joints: &[(TrackId, Arc<Joints>)],
        dt_s: f64,
    ) -> Option<&'a Track> {
        for hand in self.raised.values_mut() {
            hand.held_s += dt_s;
            hand.unseen_s += dt_s;
        }
        for (track, joints) in joints {
            if joints.has_raised_hand() {
                self.raised.entry(*track).or_default().unseen_s = 0.0;
            } else {
                self.raised.remove(track);
            }
        }
        self.raised.retain(|_, hand| hand.unseen_s < HAND_UNSEEN_S);
        let raised = &self.raised;
        nearest(tracks.iter().filter(|track| {
            let held = raised
                .get(&track.id)
                .is_some_and(|hand| hand.unseen_s == 0.0 && hand.held_s >= settings.raised_hand_s);
            held && track.confirmed && distance_m(track) <= settings.choose_within_m
        }))
    }

    fn wait_for_nearest<'a>(
        &mut self,
        settings: &TargetSettings,
        tracks: &'a [Track],
        dt_s: f64,
    ) -> Option<&'a Track> {
        let track = nearest_in_front(settings, tracks);
        let is_due = self.waited_s >= settings.choose_after_s;
        self.waited_s = if track.is_some() { self.waited_s + dt_s } else { 0.0 };
        track.filter(|_| is_due)
    }

    /// Returns the track to follow instead of the one that was just chosen, if there is one: where only
    /// the legs of a near person are in the image, somebody farther away may have been seen first.
    pub(super) fn reconsider<'a>(
        &mut self,
        settings: &TargetSettings,
        chosen: &Track,
        tracks: &'a [Track],
        dt_s: f64,
    ) -> Option<&'a Track> {
        self.chosen_s += dt_s;
        let by_rule = settings.track.is_none() && settings.choose == ChoiceRule::Nearest;
        if !by_rule || self.chosen_s > settings.reconsider_s {
            return None;
        }
        let nearer = nearest_in_front(settings, tracks)
            .filter(|track| distance_m(track) < distance_m(chosen) - NEARER_M)?;
        // A person walking past between the robot and the chosen one is nearer, too.
        let walks_past = across_mps(nearer) >= CROSSES_MPS;
        let was_overlooked = nearer.seen && distance_m(nearer) <= OVERLOOKED_M;
        (was_overlooked && !walks_past).then_some(nearer)
    }

    /// Returns the nearest track that came nearer by `approach_by_m` and has stood within
    /// `approach_within_m` for `approach_stands_s`. A person that stood there from the start, passes
    /// by, or is a coat stand, did not ask to be followed.
    fn wait_for_approach<'a>(
        &mut self,
        settings: &TargetSettings,
        tracks: &'a [Track],
        dt_s: f64,
    ) -> Option<&'a Track> {
        // Tracks that ended are forgotten: their numbers do not come back.
        self.approaches.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        let seen = tracks.iter().filter(|track| track.confirmed && track.seen);
        let arrived = seen.filter(|track| self.has_arrived(settings, track, dt_s));
        // Collected first, so that the time of every track goes on.
        let arrived: Vec<&Track> = arrived.collect();
        nearest(arrived.into_iter())
    }

    fn has_arrived(&mut self, settings: &TargetSettings, track: &Track, dt_s: f64) -> bool {
        let far_m = distance_m(track);
        let new = Approach { farthest_m: far_m, stands_s: 0.0 };
        let approach = self.approaches.entry(track.id).or_insert(new);
        approach.farthest_m = approach.farthest_m.max(far_m);
        let stands = track.estimate.person.velocity.norm() < STANDS_MPS
            && far_m <= settings.approach_within_m
            && bearing_deg(track).abs() <= settings.choose_within_deg;
        approach.stands_s = if stands { approach.stands_s + dt_s } else { 0.0 };
        approach.farthest_m - far_m >= settings.approach_by_m
            && approach.stands_s >= settings.approach_stands_s
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, Vector2};
    use tagalong_conformance::target;
    use tagalong_core::{Joint, JointName};

    use super::*;

    /// Time between two frames, s.
    const DT_S: f64 = 0.1;

    fn approaching() -> TargetSettings {
        TargetSettings { choose: ChoiceRule::Approach, ..TargetSettings::default() }
    }

    fn track(id: u32, x: f64, y: f64, speed_mps: f64) -> Track {
        let track = target(x, y, Vector2::new(-speed_mps, 0.0));
        track.with_id(TrackId(id)).with_seen(true).with_confirmed(true).with_occluded(false)
    }

    /// Returns the index of the frame in which a track is chosen, and its number.
    fn chosen(frames: impl IntoIterator<Item = Vec<Track>>) -> Option<(usize, u32)> {
        let settings = approaching();
        let mut chooser = Chooser::default();
        let mut at = frames.into_iter().enumerate().map(|(index, tracks)| {
            let found = chooser.choose(&settings, &tracks, &[], DT_S);
            found.map(|track| (index, track.id.0))
        });
        at.find_map(|found| found)
    }

    /// Returns a person that walks up to a distance within twenty frames and then stands.
    fn walk_up(id: u32, to_m: f64, y: f64) -> impl Iterator<Item = Track> {
        (0..60).map(move |i| match i {
            0..20 => track(id, to_m + 0.1 * f64::from(20 - i), y, 1.0),
            _ => track(id, to_m, y, 0.0),
        })
    }

    #[test]
    fn a_person_that_walks_up_and_stands_for_a_second_is_chosen() {
        let (index, id) = chosen(walk_up(4, 1.5, 0.2).map(|track| vec![track])).unwrap();
        assert_eq!(id, 4);
        assert!((29..=31).contains(&index), "ten frames after it stopped: {index}");
        assert_eq!(chosen(walk_up(4, 2.1, 0.0).map(|track| vec![track])), None, "too far away");
        assert_eq!(chosen(walk_up(4, 1.0, 1.5).map(|track| vec![track])), None, "too far aside");
    }

    #[test]
    fn standing_from_the_start_passing_and_noise_are_no_approach() {
        let stands = (0..80).map(|_| vec![track(1, 1.5, 0.0, 0.0)]);
        assert_eq!(chosen(stands), None, "stood there from the start");
        let passes = (0..60).map(|i| vec![track(1, 4.0 - 0.1 * f64::from(i), 0.6, 1.0)]);
        assert_eq!(chosen(passes), None, "walks past the robot");
        let unseen = walk_up(1, 1.5, 0.0).map(|track| vec![track.with_seen(false)]);
        assert_eq!(chosen(unseen), None, "predicted only");
        let noise = walk_up(1, 1.5, 0.0).map(|track| vec![track.with_confirmed(false)]);
        assert_eq!(chosen(noise), None, "not confirmed");
    }

    #[test]
    fn of_a_bystander_and_a_person_that_walks_up_the_latter_is_chosen() {
        let frames = walk_up(7, 1.6, -0.3).map(|track| vec![bystander(), track]);
        assert_eq!(chosen(frames).map(|(_, id)| id), Some(7));
        // A step back begins the second anew.
        let swaying = (0..60).map(|i| match i {
            0..20 => vec![track(1, 3.5 - 0.1 * f64::from(i), 0.0, 1.0)],
            _ => vec![track(1, 1.5, 0.0, if i % 8 == 0 { 0.5 } else { 0.0 })],
        });
        assert_eq!(chosen(swaying), None);
    }

    /// Returns the joints of a track whose left wrist is above or below the head.
    fn joints(id: u32, is_raised: bool) -> (TrackId, Arc<Joints>) {
        let mut all = [Joint { at: Point2::new(50.0, 40.0), score: 0.9 }; 17];
        all[JointName::LeftWrist as usize].at.y = if is_raised { 20.0 } else { 90.0 };
        all[JointName::RightWrist as usize].at.y = 90.0;
        (TrackId(id), Arc::new(Joints::new(all)))
    }

    /// Returns the frame in which the person of track 2 is chosen, raising a hand where `raised` says
    /// so; `None`: no joints are found in that frame.
    fn chosen_by_hand(raised: &[Option<bool>]) -> Option<usize> {
        let settings = TargetSettings { choose: ChoiceRule::RaisedHand, ..approaching() };
        let mut chooser = Chooser::default();
        let tracks = [track(1, 1.0, 0.0, 0.0), track(2, 2.0, 1.0, 0.0)];
        let mut frames = raised.iter().map(|raised| {
            let found: Vec<_> = raised.map(|raised| joints(2, raised)).into_iter().collect();
            chooser.choose(&settings, &tracks, &found, DT_S).map(|track| track.id.0)
        });
        frames.position(|chosen| chosen == Some(2))
    }

    #[test]
    fn whoever_holds_a_hand_above_the_head_is_chosen() {
        let raised = Some(true);
        assert_eq!(chosen_by_hand(&[raised; 20]), Some(6), "after 0.6 s");
        assert_eq!(chosen_by_hand(&[Some(false); 20]), None);
        // A network that runs on every third frame says nothing in between.
        let slow: Vec<_> = (0..20).map(|frame| raised.filter(|_| frame % 3 == 0)).collect();
        assert_eq!(chosen_by_hand(&slow), Some(6));
        let waving: Vec<_> = (0..40).map(|frame| Some(frame % 5 != 0)).collect();
        assert_eq!(chosen_by_hand(&waving), None, "it was never up for long enough");
        let mut gone = vec![raised; 3];
        gone.extend([None; 12]);
        gone.extend([raised; 5]);
        assert_eq!(chosen_by_hand(&gone), None, "it begins anew after a second without joints");
    }

    fn bystander() -> Track {
        track(2, 1.2, 0.5, 0.0)
    }

    #[test]
    fn without_a_rule_no_person_is_chosen_but_the_one_by_number() {
        for track in [None, Some(2)] {
            let choose = ChoiceRule::None;
            let settings = TargetSettings { choose, track, ..TargetSettings::default() };
            let tracks = [bystander()];
            let chosen = Chooser::default().choose(&settings, &tracks, &[], DT_S);
            assert_eq!(chosen.map(|track| track.id.0), track);
        }
    }

    #[test]
    fn only_a_nearer_person_in_sight_is_taken_instead_of_the_chosen_one() {
        let settings = TargetSettings { reconsider_s: 5.0, ..TargetSettings::default() };
        let chosen = track(1, 2.5, 0.0, 0.0);
        for (seen, instead, why) in [(true, Some(2), "in sight"), (false, None, "predicted only")] {
            let tracks = [chosen.clone(), track(2, 1.5, 0.0, 0.0).with_seen(seen)];
            let nearer = Chooser::default().reconsider(&settings, &chosen, &tracks, DT_S);
            assert_eq!(nearer.map(|track| track.id.0), instead, "{why}");
        }
    }
}
