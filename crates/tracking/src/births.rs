//! New people near a lost track: an association is kept only if the detection is more likely to be
//! of the track's person than of a newcomer.
//!
//! The uncertainty of a track without detections grows until its gate covers half a room, and the
//! next person to enter would inherit its ID. New people are rare in the middle of the image, and
//! less rare at its borders.

use std::f64::consts::TAU;

use tagalong_core::{Associations, Detection, Estimate, Track};
use tagalong_geometry::Camera;

use crate::BirthSettings;

/// Log-likelihood ratio with which an associator forms no pair.
const NEVER: f64 = -1e6;

/// Makes pairs that are less likely than a new person impossible for the associator, in `appearance`,
/// which has the log-likelihood ratios of the appearances by track and detection, or is empty. Where such
/// a pair is removed afterwards alone, another track has already lost its own detection to it.
pub(crate) fn veto_births(
    appearance: &mut Vec<Vec<f64>>,
    tracks: &[Track],
    detections: &[Detection],
    camera: &Camera,
    settings: &BirthSettings,
) {
    if settings.are_off() {
        return;
    }
    if appearance.is_empty() {
        *appearance = vec![vec![0.0; detections.len()]; tracks.len()];
    }
    for (row, track) in appearance.iter_mut().zip(tracks) {
        for (log_ratio, detection) in row.iter_mut().zip(detections) {
            if !is_likelier(track, detection, *log_ratio, camera, settings) {
                *log_ratio = NEVER;
            }
        }
    }
}

/// Removes the pairs that are less likely than a new person, and returns their number: an associator may
/// not go by appearance. `appearance` is that of [`veto_births`].
pub(crate) fn remove_births(
    answer: &mut Associations,
    tracks: &[Track],
    detections: &[Detection],
    appearance: &[Vec<f64>],
    camera: &Camera,
    settings: &BirthSettings,
) -> u64 {
    if settings.are_off() {
        return 0;
    }
    let before = answer.pairs.len();
    answer.pairs.retain(|pair| {
        let Some(track) = tracks.get(pair.track) else { return true };
        let Some(detection) = detections.get(pair.detection) else { return true };
        let row = appearance.get(pair.track);
        let log_ratio = row.and_then(|row| row.get(pair.detection)).copied().unwrap_or(0.0);
        is_likelier(track, detection, log_ratio, camera, settings)
    });
    (before - answer.pairs.len()) as u64
}

/// Returns true if a detection is rather of the track's person than of a new one.
fn is_likelier(
    track: &Track,
    detection: &Detection,
    log_ratio: f64,
    camera: &Camera,
    settings: &BirthSettings,
) -> bool {
    let births = births_per_m2(detection, camera, settings);
    log_density(&track.estimate, detection) + settings.appearance * log_ratio >= births.ln()
}

/// Returns true if a detection is at the place of a track's person rather than at that of a newcomer,
/// whatever its height and appearance.
pub(crate) fn is_at_place(
    estimate: &Estimate,
    detection: &Detection,
    camera: &Camera,
    settings: &BirthSettings,
) -> bool {
    let births = births_per_m2(detection, camera, settings);
    !settings.are_off() && log_density(estimate, detection) >= births.ln()
}

/// Returns the logarithm of the density of an estimated person at the place of a detection on the
/// floor, per m²; infinite where the covariance has no inverse.
fn log_density(estimate: &Estimate, detection: &Detection) -> f64 {
    let innovation = (detection.position - estimate.person.position).xy();
    let prior = estimate.covariance.fixed_view::<2, 2>(0, 0);
    let spread = prior + detection.covariance.fixed_view::<2, 2>(0, 0);
    let Some(root) = spread.cholesky() else { return f64::INFINITY };
    let squared_distance = innovation.dot(&root.solve(&innovation));
    -0.5 * (squared_distance + root.determinant().ln()) - TAU.ln()
}

/// Returns the density of new people at the place of a detection. The upper border does not
/// count, because people do not enter there.
fn births_per_m2(detection: &Detection, camera: &Camera, settings: &BirthSettings) -> f64 {
    if camera.is_blind() {
        return settings.inside_per_m2;
    }
    let rect = detection.rect_in(camera);
    let margin = settings.border_widths * rect.width;
    let is_at_border = rect.x < margin
        || rect.right() > camera.width as f64 - margin
        || rect.bottom() > camera.height as f64 - margin;
    if is_at_border { settings.border_per_m2 } else { settings.inside_per_m2 }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3, SMatrix, Vector2, Vector3};
    use tagalong_core::{Person, TrackId};
    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use super::*;

    const SETTINGS: BirthSettings = BirthSettings {
        inside_per_m2: 0.05,
        border_per_m2: 0.2,
        border_widths: 0.1,
        appearance: 0.5,
    };

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
    }

    /// Detection 3 m ahead, with a box at this place in the image.
    fn detection(x: f64, y: f64) -> Detection {
        Detection::new("test", Point3::new(3.0, 0.0, 1.6), Matrix3::zeros(), 1.0)
            .with_image(ImageBox::upper_body(Rect::new(x, y, 100.0, 100.0)))
    }

    /// Track so far beside the detection, m, with this variance, m².
    fn track(off_m: f64, variance_m2: f64) -> Track {
        let position = Point3::new(3.0, 0.0, 1.6) + Vector3::y() * off_m;
        let person = Person { position, velocity: Vector2::zeros() };
        let covariance = SMatrix::identity() * variance_m2;
        Track::new(TrackId(1), Estimate::new(person, covariance, Rect::default()), 5.0)
            .with_seen(false)
            .with_age(9)
            .with_unseen_s(1.0)
    }

    fn is_kept(x: f64, track: Track, log_ratio: f64, settings: &BirthSettings) -> bool {
        let mut answer = Associations::one_to_one([Some(0)]);
        let appearance = [vec![log_ratio]];
        let found = [detection(x, 100.0)];
        let removed =
            remove_births(&mut answer, &[track], &found, &appearance, &camera(), settings);
        assert_eq!(removed as usize + answer.pairs.len(), 1);
        removed == 0
    }

    /// The density of a normal distribution with 1 m² is 0.159 per m² in the middle, and 0.0965 at
    /// one standard deviation.
    #[test]
    fn a_vague_track_does_not_take_who_comes_in_at_the_border() {
        assert!(is_kept(270.0, track(0.0, 1.0), 0.0, &SETTINGS), "in the middle of the image");
        assert!(!is_kept(5.0, track(0.0, 1.0), 0.0, &SETTINGS), "left border");
        assert!(!is_kept(535.0, track(0.0, 1.0), 0.0, &SETTINGS), "right border");
        assert!(is_kept(5.0, track(0.0, 0.1), 0.0, &SETTINGS), "a track that was seen just now");
    }

    #[test]
    fn place_and_appearance_count_together() {
        assert!(is_kept(270.0, track(1.0, 1.0), 0.0, &SETTINGS), "0.0965 per m²");
        assert!(!is_kept(270.0, track(1.6, 1.0), 0.0, &SETTINGS), "0.044 per m²");
        assert!(is_kept(270.0, track(1.6, 1.0), 1.0, &SETTINGS), "it looks like the person");
        assert!(!is_kept(270.0, track(0.0, 1.0), -3.0, &SETTINGS), "it looks different");
    }

    #[test]
    fn without_densities_all_pairs_are_kept() {
        assert!(is_kept(5.0, track(9.0, 1.0), -9.0, &BirthSettings::default()));
    }

    #[test]
    fn one_density_alone_counts_where_it_is_set() {
        let at_border = BirthSettings { inside_per_m2: 0.0, ..SETTINGS };
        assert!(!is_kept(5.0, track(0.0, 1.0), 0.0, &at_border));
        assert!(is_kept(270.0, track(9.0, 1.0), -9.0, &at_border), "nobody enters inside");
        let inside = BirthSettings { border_per_m2: 0.0, ..SETTINGS };
        assert!(!is_kept(270.0, track(1.6, 1.0), 0.0, &inside));
        assert!(is_kept(5.0, track(9.0, 1.0), -9.0, &inside), "nor at the border");
    }

    #[test]
    fn people_enter_at_the_lower_border_and_not_at_the_upper_one() {
        fn of(y: f64) -> f64 {
            births_per_m2(&detection(270.0, y), &camera(), &SETTINGS)
        }

        assert_eq!([of(0.0), of(100.0), of(375.0)], [0.05, 0.05, 0.2]);
    }

    /// The second track would take the detection of the first one if its own could be an older person's.
    #[test]
    fn the_associator_is_told_which_pairs_are_rather_new_people() {
        let tracks = [track(0.0, 0.01), track(1.6, 1.0)];
        let found = [detection(270.0, 100.0)];
        let mut appearance = Vec::new();
        veto_births(&mut appearance, &tracks, &found, &camera(), &SETTINGS);
        assert_eq!(appearance, [[0.0], [NEVER]]);
        let mut appearance = vec![vec![-1.0], vec![1.0]];
        veto_births(&mut appearance, &tracks, &found, &camera(), &SETTINGS);
        assert_eq!(appearance, [[-1.0], [1.0]], "it looks like the second one");
        let mut appearance = Vec::new();
        veto_births(&mut appearance, &tracks, &found, &camera(), &BirthSettings::default());
        assert!(appearance.is_empty(), "without densities");
    }

    #[test]
    fn a_track_without_uncertainty_keeps_its_detection() {
        let found = detection(270.0, 100.0);
        assert_eq!(log_density(&track(0.0, 0.0).estimate, &found), f64::INFINITY);
    }

    #[test]
    fn a_place_is_that_of_a_track_until_the_track_is_vague() {
        fn is_taken(off_m: f64, variance_m2: f64, settings: &BirthSettings) -> bool {
            let track = track(off_m, variance_m2);
            is_at_place(&track.estimate, &detection(270.0, 100.0), &camera(), settings)
        }

        assert!(is_taken(0.2, 0.05, &SETTINGS));
        assert!(!is_taken(1.0, 0.05, &SETTINGS), "beside it");
        assert!(!is_taken(0.2, 4.0, &SETTINGS), "0.04 per m²");
        assert!(!is_taken(0.2, 0.05, &BirthSettings::default()), "without densities");
    }
}
