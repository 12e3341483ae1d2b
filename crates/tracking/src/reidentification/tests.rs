use std::sync::Arc;

use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
use tagalong_core::{Estimate, Images, Person, RgbImage, Stamp};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole};

use super::*;

const DT_S: f64 = 0.1;
const RED: [u8; 3] = [200, 20, 20];
const BLUE: [u8; 3] = [20, 20, 200];
/// A tenth of the way from blue to the next hue: near to it, and as far from red.
const VIOLET: [u8; 3] = [29, 20, 200];

fn camera() -> Camera {
    let lens = Pinhole { fx: 200.0, fy: 200.0, cx: 160.0, cy: 60.0, distortion: Distortion::None };
    Camera::mounted(lens, 320, 240, 1.6, 0.0, 0.0)
}

/// A confirmed track 3 m ahead; of people 0.3 m to the left and more, the left half of the image.
fn track(id: u32, y_m: f64, height_m: f64) -> Track {
    let person = Person { position: Point3::new(3.0, y_m, height_m), velocity: Vector2::zeros() };
    let region = camera().upper_body(&person.position);
    Track::new(TrackId(id), Estimate::new(person, SMatrix::identity() * 0.001, region), 5.0)
        .with_age(9)
}

/// An image whose left and right half have one colour each.
fn frame(left: [u8; 3], right: [u8; 3]) -> Frame {
    let colour = RgbImage::from_fn(320, 240, |x, _| if x < 160 { left } else { right });
    let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
    Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(DT_S), images)
}

struct Scene {
    stage: Reidentifier,
}

impl Scene {
    fn new() -> Self {
        let settings = ReidentificationSettings { remember_s: 30.0, ..Default::default() };
        Self { stage: Reidentifier::new(settings, Describer::default()) }
    }

    /// Shows some frames, and returns the numbers of the tracks in the last one.
    fn show(&mut self, frames: usize, image: &Frame, tracks: &[Track]) -> Vec<u32> {
        let mut numbers = Vec::new();
        for _ in 0..frames {
            let people = self.stage.update(image, &EgoMotion::at_rest(DT_S), tracks).unwrap();
            let ids = tracks.iter().map(|track| people.numbers.get(&track.id).unwrap_or(&track.id));
            numbers = ids.map(|id| id.0).collect();
        }
        numbers
    }

    /// Returns the numbers of a track in red and one in blue after a contact from which they come
    /// in these colours.
    fn after_a_contact(&mut self, left: [u8; 3], right: [u8; 3]) -> Vec<u32> {
        let apart = [track(1, 0.8, 1.6), track(2, -0.8, 1.6)];
        assert_eq!(self.show(30, &frame(RED, BLUE), &apart), [1, 2]);
        self.show(5, &frame(RED, BLUE), &[track(1, 0.1, 1.6), track(2, -0.1, 1.6)]);
        self.show(10, &frame(left, right), &apart)
    }
}

#[test]
fn a_person_who_returns_keeps_the_number() {
    let mut scene = Scene::new();
    let red = frame(RED, BLUE);
    assert_eq!(scene.show(30, &red, &[track(1, 0.8, 1.6)]), [1]);
    scene.show(50, &red, &[]);
    assert_eq!(scene.show(1, &red, &[track(2, 0.8, 1.6)]), [1]);
    assert_eq!(scene.show(30, &red, &[track(2, 0.8, 1.6)]), [1]);
}

#[test]
fn a_person_in_other_clothes_or_of_another_height_gets_a_new_number() {
    let mut scene = Scene::new();
    scene.show(30, &frame(RED, BLUE), &[track(1, 0.8, 1.6)]);
    scene.show(50, &frame(RED, BLUE), &[]);
    assert_eq!(scene.show(30, &frame(BLUE, RED), &[track(2, 0.8, 1.6)]), [2]);
    assert_eq!(scene.show(30, &frame(RED, RED), &[track(3, -0.8, 1.8)]), [3]);
}

/// Both were in red, so that it may be either.
#[test]
fn one_who_may_be_either_of_two_gets_a_new_number() {
    let mut scene = Scene::new();
    let red = frame(RED, RED);
    scene.show(30, &red, &[track(1, 0.8, 1.6), track(2, -0.8, 1.6)]);
    scene.show(50, &red, &[track(2, -0.8, 1.6)]);
    assert_eq!(scene.show(30, &red, &[track(2, -0.8, 1.6), track(3, 0.8, 1.6)]), [2, 3]);
}

/// The second one, in red too and taller, was seen for half a second.
#[test]
fn one_who_may_be_the_person_of_a_lost_track_gets_a_new_number() {
    for (is_seen, number) in [(true, 1), (false, 3)] {
        let mut scene = Scene::new();
        let red = frame(RED, RED);
        scene.show(30, &red, &[track(1, 0.8, 1.6)]);
        scene.show(5, &red, &[track(2, -0.8, 1.8)]);
        let second = track(2, -0.8, 1.8).with_seen(is_seen);
        assert_eq!(scene.show(1, &red, &[second, track(3, 0.8, 1.6)]), [2, number]);
    }
}

#[test]
fn a_person_who_is_long_gone_or_far_away_gets_a_new_number() {
    let red = frame(RED, RED);
    let mut scene = Scene::new();
    scene.show(30, &red, &[track(1, 0.8, 1.6)]);
    scene.show(310, &red, &[]);
    assert_eq!(scene.show(30, &red, &[track(2, 0.8, 1.6)]), [2], "gone for longer than 30 s");
    for (y_m, number) in [(0.8, 1), (-1.6, 2)] {
        let mut scene = Scene::new();
        scene.show(30, &red, &[track(1, 0.8, 1.6)]);
        scene.show(1, &red, &[]);
        let returned = track(2, y_m, 1.6);
        let region = returned.estimate.region;
        assert!(region.x > 0.0 && region.right() < 320.0, "the person is whole in the image");
        assert_eq!(scene.show(1, &red, &[returned]), [number], "to {y_m} m in a fifth of a second");
    }
}

/// Track 1 went behind track 2, and each went on with the other person.
#[test]
fn tracks_that_changed_over_change_their_numbers_back() {
    let mut scene = Scene::new();
    let apart = [track(1, 0.8, 1.6), track(2, -0.8, 1.6)];
    assert_eq!(scene.show(30, &frame(RED, BLUE), &apart), [1, 2]);
    scene.show(5, &frame(RED, BLUE), &[track(1, 0.1, 1.6), track(2, -0.1, 1.6)]);
    assert_eq!(scene.show(10, &frame(BLUE, RED), &apart), [2, 1]);
    scene.show(5, &frame(RED, BLUE), &[track(1, 0.1, 1.6), track(2, -0.1, 1.6)]);
    assert_eq!(scene.show(10, &frame(BLUE, RED), &apart), [2, 1], "and each stays");
}

/// Frames 1 to 30 are apart, 31 to 35 a contact; frames 36 and 37 show the two appearances that decide.
#[test]
fn ids_after_a_contact_are_in_doubt_until_they_are_put_right() {
    let mut scene = Scene::new();
    let apart = [track(1, 0.8, 1.6), track(2, -0.8, 1.6)];
    let near = [track(1, 0.1, 1.6), track(2, -0.1, 1.6)];
    let mut doubtful = Vec::new();
    let mut corrections = Vec::new();
    for index in 1..=40 {
        let mut image = if index < 36 { frame(RED, BLUE) } else { frame(BLUE, RED) };
        image.index = index;
        let tracks = if (31..36).contains(&index) { &near } else { &apart };
        let people = scene.stage.update(&image, &EgoMotion::at_rest(DT_S), tracks).unwrap();
        let doubts = people.doubts.iter().map(|doubt| (doubt.track.0, doubt.others.clone()));
        let doubts: Vec<_> = doubts.collect();
        if !doubts.is_empty() {
            assert_eq!(doubts, [(1, vec![TrackId(2)]), (2, vec![TrackId(1)])], "frame {index}");
            doubtful.push(index);
        }
        corrections.extend(people.corrections.into_iter().map(|correction| (index, correction)));
    }
    assert_eq!(doubtful, [31, 32, 33, 34, 35, 36]);
    let ids = [TrackId(1), TrackId(2)];
    assert_eq!(corrections, [(37, IdentityCorrection { since: 36, ids })]);
}

/// The track is reported before its appearance counts, because another person is near to it.
#[test]
fn the_id_before_a_recognition_is_put_right() {
    let mut scene = Scene::new();
    let red = frame(RED, BLUE);
    scene.show(30, &red, &[track(1, 0.8, 1.6)]);
    scene.show(50, &red, &[]);
    let beside = track(3, 0.5, 1.6);
    let mut image = red;
    image.index = 81;
    assert_eq!(scene.show(3, &image, &[track(2, 0.8, 1.6), beside]), [2, 3]);
    image.index = 84;
    let people =
        scene.stage.update(&image, &EgoMotion::at_rest(DT_S), &[track(2, 0.8, 1.6)]).unwrap();
    assert_eq!(people.given_up, [TrackId(2)]);
    let ids = [TrackId(2), TrackId(1)];
    assert_eq!(people.corrections, [IdentityCorrection { since: 81, ids }]);
}

/// After the contact both tracks look like person 2, track 1 less so: an exchange would be right for
/// one of them, and wrong for the other by more.
#[test]
fn a_track_does_not_change_over_against_the_looks_of_the_other() {
    assert_eq!(after_a_contact(VIOLET, BLUE), [1, 2]);
}

/// After the contact both tracks look like person 2, track 2 less so: it loses less than track 1 gains.
#[test]
fn a_track_changes_over_against_lesser_doubts_of_the_other() {
    assert_eq!(after_a_contact(BLUE, VIOLET), [2, 1]);
}

#[test]
fn a_track_changes_over_only_by_more_than_the_margin() {
    let mut scene = Scene::new();
    scene.stage.settings.margin = 1.0;
    assert_eq!(scene.after_a_contact(BLUE, RED), [1, 2]);
}

#[test]
fn tracks_that_come_nearer_than_the_setting_are_rivals() {
    let mut scene = Scene::new();
    let alone_m = scene.stage.settings.alone_m;
    for (apart_m, are_rivals) in [(alone_m, false), (0.98 * alone_m, true)] {
        let pair = [track(1, 0.5 * apart_m, 1.6), track(2, -0.5 * apart_m, 1.6)];
        scene.show(1, &frame(RED, BLUE), &pair);
        assert_eq!(!scene.stage.tracks[&TrackId(1)].rivals.is_empty(), are_rivals, "{apart_m} m");
    }
}

/// Returns the numbers of a track in red and one in blue after a contact from which they come in
/// these colours.
fn after_a_contact(left: [u8; 3], right: [u8; 3]) -> Vec<u32> {
    Scene::new().after_a_contact(left, right)
}

#[test]
fn several_appearances_differ_by_their_mean() {
    let mut scene = Scene::new();
    let apart = [track(1, 0.8, 1.6), track(2, -0.8, 1.6)];
    scene.show(30, &frame(RED, BLUE), &apart);
    let Scene { stage } = &scene;
    let person = &stage.tracks[&TrackId(1)].person;
    let looks = [RED, VIOLET]
        .map(|colour| stage.describer.of(&apart[0].estimate, &frame(colour, colour)).unwrap());
    let [same, other] = [0, 1].map(|k| person.difference(&looks[k..=k]).unwrap());
    let both = person.difference(&looks).unwrap();
    assert!(other > 0.3 && (both - 0.5 * (same + other)).abs() < 1e-12, "{same} {other} {both}");
    assert_eq!(person.difference(&[]), None);
}

#[test]
fn without_memory_each_track_has_its_number() {
    let mut scene = Scene {
        stage: Reidentifier::new(ReidentificationSettings::default(), Describer::default()),
    };
    let red = frame(RED, BLUE);
    scene.show(30, &red, &[track(1, 0.8, 1.6)]);
    scene.show(50, &red, &[]);
    assert_eq!(scene.show(30, &red, &[track(2, 0.8, 1.6)]), [2]);
}

/// The pause of a jump counts, the place does not.
#[test]
fn after_a_jump_of_the_clock_the_appearance_is_remembered() {
    let red = frame(RED, RED);
    let numbers = [5.0, 40.0].map(|pause_s| {
        let mut scene = Scene::new();
        scene.show(30, &red, &[track(1, 0.8, 1.6)]);
        scene.stage.reset(pause_s);
        scene.show(1, &red, &[track(2, -2.0, 1.6)])[0]
    });
    assert_eq!(numbers, [1, 2]);
}

/// A detection where a track would be seen.
fn detection(y_m: f64) -> Detection {
    let Track { estimate, .. } = track(0, y_m, 1.7);
    Detection::new("test", estimate.person.position, Matrix3::identity() * 0.01, 1.0)
        .with_image(ImageBox::upper_body(estimate.region))
}

#[test]
fn a_detection_that_looks_like_the_person_of_a_track_speaks_for_it() {
    let mut scene = Scene::new();
    let tracks = [track(1, 0.8, 1.7), track(2, -0.8, 1.7)];
    scene.show(3, &frame(RED, BLUE), &tracks);
    let detections = [detection(0.8), detection(-0.8)];
    let off = scene.stage.compare(&frame(RED, BLUE), &tracks, &detections, false).unwrap();
    assert!(off.is_empty(), "positions alone decide by default");
    scene.stage.settings.association_weight = 5.0;
    let [same, changed] = [frame(RED, BLUE), frame(BLUE, RED)]
        .map(|image| scene.stage.compare(&image, &tracks, &detections, false).unwrap());
    assert!(same[0][0] > 4.9 && same[1][1] > 4.9, "{same:?}");
    assert!(same[0][1] < 0.0 && same[1][0] < 0.0, "{same:?}");
    assert!(same.iter().flatten().all(|ratio| ratio.abs() <= 5.0), "{same:?}");
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        assert_eq!(changed[row][column], same[row][1 - column], "the colours changed places");
    }
    let stranger =
        scene.stage.compare(&frame(RED, BLUE), &[track(9, 0.8, 1.7)], &detections, false).unwrap();
    assert_eq!(stranger, [[0.0, 0.0]], "nothing is known of a new track");
    let whole = detection(0.8).with_image(None);
    let unseen = scene.stage.compare(&frame(RED, BLUE), &tracks, &[whole], false).unwrap();
    assert_eq!(unseen, [[0.0], [0.0]], "without an image box there is no appearance");
}

/// The associator's `minimum` of this and the overlap is that of BoT-SORT, whose appearance has half
/// the cosine distance.
#[test]
fn the_log_odds_of_half_the_distance_give_it_back() {
    fn distance(log_ratio: f64) -> f64 {
        1.0 / (1.0 + log_ratio.exp())
    }

    let half = AppearanceEvidence::HalfDistance;
    for difference in [0.001, 0.1, 0.24] {
        let log_ratio = half.log_ratio(difference, 0.25);
        assert!((distance(log_ratio) - 0.5 * difference).abs() < 1e-12, "{difference}");
    }
    assert_eq!(half.log_ratio(0.25, 0.25), 0.0, "no more alike than two people");
    assert!((distance(half.log_ratio(0.0, 0.25)) - 0.0005).abs() < 1e-12, "equal is not certain");
}

#[test]
fn the_evidence_of_the_appearance_is_that_of_the_settings() {
    let mut scene = Scene::new();
    let tracks = [track(1, 0.8, 1.7), track(2, -0.8, 1.7)];
    scene.show(3, &frame(RED, BLUE), &tracks);
    let detections = [detection(0.8), detection(-0.8)];
    scene.stage.settings.association_weight = 1.0;
    scene.stage.settings.association_evidence = AppearanceEvidence::HalfDistance;
    let same = scene.stage.compare(&frame(RED, BLUE), &tracks, &detections, false).unwrap();
    assert!(same[0][0] > 4.0 && same[1][1] > 4.0, "{same:?}");
    assert_eq!([same[0][1], same[1][0]], [0.0; 2], "other clothes say nothing");
}

#[test]
fn the_nearer_person_covers_the_farther_one() {
    let near = track(1, 0.0, 1.6);
    let mut far = track(2, 0.0, 1.6);
    far.estimate.person.position.x = 4.0;
    assert!(covers(&near, &far) && !covers(&far, &near));
    let same = far.clone().with_id(TrackId(1));
    assert!(!covers(&near, &same), "nobody covers themselves");
    let beside = near.clone().with_id(TrackId(3));
    assert!(!covers(&near, &beside) && !covers(&beside, &near), "neither is nearer");
    far.estimate.region.x += 2.0 * far.estimate.region.width;
    assert!(!covers(&near, &far), "beside each other in the image");
}

/// The person walks to the left at 2 m/s, and so is 2 m further on a second later.
#[test]
fn a_person_who_walked_away_is_not_back_at_once() {
    let walker = track(1, 0.8, 1.6).with_estimate(
        track(1, 0.8, 1.6)
            .estimate
            .with_person(Person { velocity: Vector2::new(0.0, 2.0), ..*track(1, 0.8, 1.6) }),
    );
    for (max_acceleration_mps2, pause, number, why) in [
        (1000.0, 10, 1, "nothing keeps it from turning"),
        (1.5, 10, 2, "it would have to turn within a second"),
        (1.5, 40, 1, "it has had the time"),
    ] {
        let mut scene = Scene::new();
        scene.stage.settings.max_acceleration_mps2 = max_acceleration_mps2;
        let image = frame(RED, BLUE);
        scene.show(30, &image, std::slice::from_ref(&walker));
        scene.show(pause, &image, &[]);
        assert_eq!(scene.show(15, &image, &[track(2, 0.8, 1.6)]), [number], "{why}");
    }
}

/// The appearance of the track shows only after a while.
#[test]
fn a_track_takes_over_a_number_soon_after_its_start_or_never() {
    fn number_after(hidden_frames: usize) -> u32 {
        let mut scene = Scene::new();
        let image = frame(RED, BLUE);
        scene.show(30, &image, &[track(1, 0.8, 1.6)]);
        scene.show(20, &image, &[]);
        let hidden = track(2, 0.8, 1.6).with_occluded(true);
        scene.show(hidden_frames, &image, &[hidden]);
        scene.show(10, &image, &[track(2, 0.8, 1.6)])[0]
    }

    assert_eq!([number_after(10), number_after(25)], [1, 2]);
}

#[test]
fn a_single_track_and_detection_are_compared_where_new_people_count() {
    let mut scene = Scene::new();
    scene.show(30, &frame(RED, BLUE), &[track(1, 0.8, 1.7)]);
    scene.stage.settings.association_weight = 1.0;
    let [without, with_births] = [false, true].map(|with_births| {
        let image = frame(RED, BLUE);
        scene.stage.compare(&image, &[track(1, 0.8, 1.7)], &[detection(0.8)], with_births).unwrap()
    });
    assert!(without.is_empty());
    assert!(with_births[0][0] > 0.5);
}
