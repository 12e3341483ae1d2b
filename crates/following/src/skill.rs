//! Following as a skill that a program calls: enroll a person, query the status, clear the target.

use std::fmt;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use tagalong_core::{Stamp, Track, TrackId};
use tagalong_geometry::{Camera, HALF_HEAD_M, Rect};

use crate::target_lock::{bearing_deg, distance_m, nearest_in_front};
use crate::{ChoiceRule, LockReport, LockState, TargetSettings};

/// Person to follow, in a request.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Choice {
    /// The person of this track.
    Track(TrackId),
    /// The nearest visible person at this point of the image, pixels to the right and down.
    Point([f64; 2]),
    /// The nearest person in front, within the angle and distance of `[target]`.
    Nearest,
    /// The next person that walks up to the robot and stands still before it.
    Approach,
    /// The next person that holds a hand above the head, where a detector finds joints.
    #[serde(rename = "raised-hand")]
    RaisedHand,
}

/// In words that follow a verb: "enroll the nearest person in front".
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Track(id) => write!(f, "track {id}"),
            Self::Point([x, y]) => write!(f, "the person at ({x}, {y})"),
            Self::Nearest => f.write_str("the nearest person in front"),
            Self::Approach => f.write_str("the person that walks up"),
            Self::RaisedHand => f.write_str("the person that raises a hand"),
        }
    }
}

/// Request to follow a person, with the patience of the pursuit. What is left out is that of the
/// config, whatever an earlier request said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enrollment {
    /// The person.
    pub person: Choice,
    /// Time out of sight after which the person is lost, s; `[target] lose_after_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lose_after_s: Option<f64>,
    /// Search for the person once lost; `[target.search] enabled`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<bool>,
    /// Time after which that search is given up, s; `[target.search] give_up_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub give_up_s: Option<f64>,
}

/// Refusal of an enrollment. The robot goes on as before.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnrollmentError {
    /// The config has no controller.
    #[error("the config has no [controller]: nothing follows")]
    NoController,
    /// No frame was processed yet.
    #[error("no image was processed yet: try again once images arrive")]
    NoFrame,
    /// No confirmed track has this number.
    #[error("there is no track {number}: {}", there_are(.known))]
    NoTrack {
        /// The number.
        number: u32,
        /// The confirmed tracks.
        known: Vec<u32>,
    },
    /// The point is not in the image.
    #[error("the point ({x}, {y}) is outside of the image, which has {width} x {height} pixels")]
    OutsideImage {
        /// Column of the point, pixels.
        x: f64,
        /// Row of the point, pixels.
        y: f64,
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
    },
    /// No visible person is at the point.
    #[error("no person is seen at the point ({x}, {y}): {}", there_are(.known))]
    NoPersonAt {
        /// Column of the point, pixels.
        x: f64,
        /// Row of the point, pixels.
        y: f64,
        /// The confirmed tracks.
        known: Vec<u32>,
    },
    /// No person is in front of the robot.
    #[error(
        "no person is in front, within {within_deg} degrees to either side and {within_m} m: {}",
        there_are(.known)
    )]
    NoneInFront {
        /// Largest bearing, degrees.
        within_deg: f64,
        /// Largest distance, m.
        within_m: f64,
        /// The confirmed tracks.
        known: Vec<u32>,
    },
    /// A time of the request is beyond its bounds.
    #[error("`{key}` must be between {least} and {most} s, not {value}")]
    Bounds {
        /// Name of the time.
        key: &'static str,
        /// Its value, s.
        value: f64,
        /// Least value, s.
        least: f64,
        /// Largest value, s.
        most: f64,
    },
}

/// Returns the confirmed tracks in words.
fn there_are(known: &[u32]) -> String {
    match known {
        [] => "no person is tracked".to_owned(),
        _ => {
            let numbers: Vec<String> = known.iter().map(u32::to_string).collect();
            format!("tracks are {}", numbers.join(", "))
        }
    }
}

/// State of the pursuit after a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FollowStatus {
    /// State of the target lock, by its name.
    pub state: &'static str,
    /// Cause of the last change of the state.
    pub reason: &'static str,
    /// Time since that change, s.
    pub since_s: f64,
    /// True if a person is followed.
    pub follows: bool,
    /// Number of the track that is followed.
    pub track: Option<TrackId>,
    /// Probability that it is the enrolled person.
    pub confidence: Option<f64>,
    /// Distance of the person from the middle of the robot, m.
    pub distance_m: Option<f64>,
    /// Reason of the last command, by its name.
    pub command: &'static str,
    /// Fault that holds the robot until a reset.
    pub fault: Option<&'static str>,
    /// Time of the frame, s.
    pub stamp_s: f64,
    /// Confirmed people, near to far: a caller chooses among them.
    pub people: Vec<PersonStatus>,
}

/// Confirmed person, for a caller that chooses one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PersonStatus {
    /// Number of the track.
    pub track: TrackId,
    /// Distance from the middle of the robot, m.
    pub distance_m: f64,
    /// Direction, degrees to the left.
    pub bearing_deg: f64,
    /// Box of the standing person in the image: left, top, width, height, pixels.
    #[serde(rename = "box")]
    pub region: [f64; 4],
    /// True if the person is seen in this frame.
    pub seen: bool,
}

/// Last frame, in which a request finds its person.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    pub(crate) tracks: Vec<Track>,
    pub(crate) size: (usize, usize),
    pub(crate) stamp: Stamp,
}

impl View {
    pub(crate) fn new(tracks: &[Track], camera: &Camera, stamp: Stamp) -> Self {
        let tracks = tracks.iter().filter(|track| track.confirmed).cloned().collect();
        Self { tracks, size: (camera.width, camera.height), stamp }
    }

    fn known(&self) -> Vec<u32> {
        self.tracks.iter().map(|track| track.id.0).collect()
    }

    /// Returns the settings by which the lock chooses the person of a request.
    pub(crate) fn settings(
        &self,
        enrollment: &Enrollment,
        configured: &TargetSettings,
    ) -> Result<TargetSettings, EnrollmentError> {
        let mut settings = with_patience(enrollment, configured)?;
        settings.track = None;
        match enrollment.person {
            Choice::Approach => settings.choose = ChoiceRule::Approach,
            Choice::RaisedHand => settings.choose = ChoiceRule::RaisedHand,
            Choice::Track(id) => settings.track = Some(self.numbered(id)?.id.0),
            Choice::Point(at) => settings.track = Some(self.at(at)?.id.0),
            Choice::Nearest => settings.track = Some(self.in_front(&settings)?.id.0),
        }
        Ok(settings)
    }

    fn numbered(&self, id: TrackId) -> Result<&Track, EnrollmentError> {
        let found = self.tracks.iter().find(|track| track.id == id);
        found.ok_or_else(|| EnrollmentError::NoTrack { number: id.0, known: self.known() })
    }

    /// Returns the nearest person that is seen at a point: one behind it does not show there.
    fn at(&self, [x, y]: [f64; 2]) -> Result<&Track, EnrollmentError> {
        let (width, height) = self.size;
        let image = Rect::new(0.0, 0.0, width as f64, height as f64);
        let point = Point2::new(x, y);
        if !image.contains(point) {
            return Err(EnrollmentError::OutsideImage { x, y, width, height });
        }
        let there =
            self.tracks.iter().filter(|track| track.seen && standing(track).contains(point));
        let nearest = there.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        nearest.ok_or_else(|| EnrollmentError::NoPersonAt { x, y, known: self.known() })
    }

    fn in_front(&self, settings: &TargetSettings) -> Result<&Track, EnrollmentError> {
        nearest_in_front(settings, &self.tracks).ok_or_else(|| EnrollmentError::NoneInFront {
            within_deg: settings.choose_within_deg,
            within_m: settings.choose_within_m,
            known: self.known(),
        })
    }

    /// Returns the status after this frame.
    pub(crate) fn status(
        &self,
        lock: &LockReport,
        target: Option<TrackId>,
        command: &'static str,
        fault: Option<&'static str>,
    ) -> FollowStatus {
        let followed = self.tracks.iter().find(|track| Some(track.id) == target);
        FollowStatus {
            state: lock.state.name(),
            reason: lock.why,
            since_s: lock.since_s,
            follows: lock.state.follows(),
            track: target,
            confidence: lock.belief,
            distance_m: followed.map(distance_m),
            command,
            fault,
            stamp_s: self.stamp.nanos() as f64 * 1e-9,
            people: self.tracks.iter().map(PersonStatus::of).collect(),
        }
    }
}

impl PersonStatus {
    fn of(track: &Track) -> Self {
        let Rect { x, y, width, height } = standing(track);
        Self {
            track: track.id,
            distance_m: distance_m(track),
            bearing_deg: bearing_deg(track),
            region: [x, y, width, height],
            seen: track.seen,
        }
    }
}

/// Returns the box of the whole person, as if standing.
fn standing(track: &Track) -> Rect {
    // A head that is believed below the floor would turn the box upside down.
    let head_m = track.estimate.person.position.z.clamp(0.8, 2.2);
    track.estimate.region.standing_of_upper_body(head_m + HALF_HEAD_M)
}

/// Returns the settings with the patience of a request.
fn with_patience(
    enrollment: &Enrollment,
    configured: &TargetSettings,
) -> Result<TargetSettings, EnrollmentError> {
    let mut settings = configured.clone();
    if let Some(value) = enrollment.lose_after_s {
        // A target that was out of sight for long is followed by prediction alone.
        settings.lose_after_s = bounded("lose_after_s", value, settings.doubt_after_s, 10.0)?;
    }
    if let Some(search) = enrollment.search {
        settings.search.enabled = search;
    }
    if let Some(value) = enrollment.give_up_s {
        settings.search.give_up_s = bounded("give_up_s", value, 0.0, 600.0)?;
    }
    Ok(settings)
}

fn bounded(key: &'static str, value: f64, least: f64, most: f64) -> Result<f64, EnrollmentError> {
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(EnrollmentError::Bounds { key, value, least, most })
    }
}

/// Returns the report of a lock before its first frame.
pub(crate) fn before_any_frame(why: &'static str) -> LockReport {
    LockReport { state: LockState::Initial, why, since_s: 0.0, belief: None, likeness: Vec::new() }
}

impl Enrollment {
    /// Creates a request with the patience of the config.
    pub fn of(person: Choice) -> Self {
        Self { person, lose_after_s: None, search: None, give_up_s: None }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use tagalong_conformance::target;
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
    }

    fn track(id: u32, x: f64, y: f64) -> Track {
        let mut track = target(x, y, Vector2::zeros());
        track.estimate.person.position.z = 1.6;
        track.estimate.region = camera().upper_body(&track.estimate.person.position);
        track.with_id(TrackId(id)).with_seen(true).with_confirmed(true).with_occluded(false)
    }

    /// Two people behind each other, one to the left, one that is not confirmed, one not seen.
    fn view() -> View {
        let tracks = [
            track(1, 2.0, 0.0),
            track(2, 4.0, 0.0),
            track(3, 3.0, 1.0),
            track(4, 3.0, -1.0).with_confirmed(false),
            track(5, 4.0, -1.8).with_seen(false),
        ];
        View::new(&tracks, &camera(), Stamp::from_nanos(1_500_000_000))
    }

    fn chosen(person: Choice) -> Result<Option<u32>, String> {
        let settings = view().settings(&Enrollment::of(person), &TargetSettings::default());
        settings.map(|settings| settings.track).map_err(|error| error.to_string())
    }

    /// Returns the point of the image at which a place is seen.
    fn pixel(x: f64, y: f64, z: f64) -> Choice {
        let at = camera().project(&nalgebra::Point3::new(x, y, z)).unwrap();
        Choice::Point([at.x, at.y])
    }

    #[test]
    fn a_track_is_enrolled_by_number_and_an_unknown_or_unconfirmed_one_is_refused() {
        assert_eq!(chosen(Choice::Track(TrackId(2))), Ok(Some(2)));
        for number in [4, 9] {
            let refusal = chosen(Choice::Track(TrackId(number))).unwrap_err();
            assert_eq!(refusal, format!("there is no track {number}: tracks are 1, 2, 3, 5"));
        }
    }

    #[test]
    fn a_point_enrolls_the_nearest_person_that_is_seen_there() {
        assert_eq!(chosen(pixel(2.0, 0.0, 1.3)), Ok(Some(1)), "not the one behind");
        assert_eq!(chosen(pixel(3.0, 1.0, 0.9)), Ok(Some(3)), "at the hips");
        // The far one's head is above the near one's, from a camera below both.
        assert_eq!(chosen(pixel(3.0, 1.0, 1.68)), Ok(Some(3)), "at the top of the head");
        let refusal = chosen(pixel(3.0, -1.0, 1.3)).unwrap_err();
        assert!(refusal.starts_with("no person is seen at the point ("), "{refusal}");
        assert!(refusal.ends_with("tracks are 1, 2, 3, 5"), "{refusal}");
        assert!(chosen(pixel(4.0, -1.8, 1.3)).is_err(), "is not seen in this frame");
    }

    #[test]
    fn a_point_outside_of_the_image_is_refused() {
        for at in [[-1.0, 10.0], [640.0, 10.0], [10.0, 480.0], [f64::NAN, 10.0]] {
            let refusal = chosen(Choice::Point(at)).unwrap_err();
            assert!(refusal.contains("outside of the image, which has 640 x 480"), "{refusal}");
        }
    }

    #[test]
    fn the_nearest_in_front_is_enrolled_and_nearer_ones_aside_are_not() {
        assert_eq!(chosen(Choice::Nearest), Ok(Some(1)));
        let view = View { tracks: vec![track(6, 0.5, 1.0)], ..view() };
        let refusal = view
            .settings(&Enrollment::of(Choice::Nearest), &TargetSettings::default())
            .unwrap_err()
            .to_string();
        assert!(refusal.contains("within 45 degrees to either side and 5 m"), "{refusal}");
    }

    #[test]
    fn an_approach_is_waited_for_whoever_is_there() {
        let enrollment = Enrollment::of(Choice::Approach);
        let configured = TargetSettings { track: Some(7), ..TargetSettings::default() };
        let settings = view().settings(&enrollment, &configured).unwrap();
        assert_eq!((settings.choose, settings.track), (ChoiceRule::Approach, None));
        let enrollment = Enrollment::of(Choice::RaisedHand);
        let settings = view().settings(&enrollment, &configured).unwrap();
        assert_eq!((settings.choose, settings.track), (ChoiceRule::RaisedHand, None));
    }

    #[test]
    fn patience_holds_for_its_request_within_bounds() {
        let configured = TargetSettings::default();
        let enrollment = Enrollment {
            lose_after_s: Some(4.0),
            search: Some(true),
            give_up_s: Some(60.0),
            ..Enrollment::of(Choice::Nearest)
        };
        let settings = view().settings(&enrollment, &configured).unwrap();
        assert_eq!((settings.lose_after_s, settings.search.enabled), (4.0, true));
        assert_eq!(settings.search.give_up_s, 60.0);
        for (lose_after_s, give_up_s) in
            [(Some(0.4), None), (Some(10.1), None), (Some(f64::NAN), None), (None, Some(601.0))]
        {
            let request = Enrollment { lose_after_s, give_up_s, ..enrollment };
            let refusal = view().settings(&request, &configured).unwrap_err();
            assert!(matches!(refusal, EnrollmentError::Bounds { .. }), "{refusal}");
        }
    }
}
