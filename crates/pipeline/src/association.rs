//! Which detection belongs to which track (`algorithms`, section 4.3).

use tagalong_core::{Detection, Rect, Track};

use crate::{AssociationSettings, Cost, Overlap, assign};

/// How well a detection and a track fit: the cost, and the logarithm of the
/// volume in which the detection could have been.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fit {
    cost: f64,
    log_volume: f64,
}

/// How well they fit; `None` outside the gate.
pub(crate) fn fit(
    track: &Track,
    detection: &Detection,
    dt_s: f64,
    settings: &AssociationSettings,
) -> Option<Fit> {
    match settings.cost {
        Cost::Mahalanobis => mahalanobis(track, detection, dt_s, settings),
        Cost::Overlap => {
            let overlap = overlap(&track.estimate.region, &detection.region, settings.overlap);
            let cost = match overlap >= settings.min_overlap {
                true => Some(-overlap.ln()),
                false => settings.compat_printed_cost.then_some(0.0),
            };
            cost.map(|cost| Fit { cost, log_volume: 0.0 })
        }
    }
}

/// d² = ν' S⁻¹ ν with S = P + R.
fn mahalanobis(
    track: &Track,
    detection: &Detection,
    dt_s: f64,
    settings: &AssociationSettings,
) -> Option<Fit> {
    let innovation = detection.position - track.estimate.person.position;
    if innovation.xy().norm() > settings.gate_m + settings.gate_speed_mps * dt_s {
        return None;
    }
    let position = track.estimate.covariance.fixed_view::<3, 3>(0, 0);
    let spread = (position + detection.covariance).cholesky()?;
    let cost = innovation.dot(&spread.solve(&innovation));
    let log_volume = 2.0 * spread.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
    let is_near = cost <= settings.gate && log_volume.is_finite();
    is_near.then_some(Fit { cost, log_volume })
}

/// The detection of each track. A nearly certain track must not lose its
/// detection to one that could be anywhere, so the costs are negative
/// log-likelihoods: d² + ln |S|.
pub(crate) fn associate(
    tracks: &[&Track],
    detections: &[&Detection],
    fit: impl Fn(&Track, &Detection) -> Option<Fit>,
    settings: &AssociationSettings,
) -> Vec<Option<usize>> {
    let fits: Vec<Vec<Option<Fit>>> =
        tracks.iter().map(|t| detections.iter().map(|d| fit(t, d)).collect()).collect();
    let volumes = || fits.iter().flatten().flatten().map(|f| f.log_volume);
    let least = volumes().fold(f64::INFINITY, f64::min);
    let most = volumes().fold(f64::NEG_INFINITY, f64::max);
    let range = if most > least { most - least } else { 0.0 };
    let miss = settings.miss_factor * cost_at_gate(settings) + range;
    assign(detections.len(), &vec![miss; tracks.len()], |row, column| {
        fits[row][column].map(|f| f.cost + f.log_volume - least)
    })
}

fn cost_at_gate(settings: &AssociationSettings) -> f64 {
    match settings.cost {
        Cost::Mahalanobis => settings.gate,
        Cost::Overlap => -settings.min_overlap.ln(),
    }
}

/// True if two sightings are of one person.
pub(crate) fn is_same_person(a: &Detection, b: &Detection, settings: &AssociationSettings) -> bool {
    let apart = (a.position - b.position).xy();
    if apart.norm() < settings.same_person_m {
        return true;
    }
    let spread = (a.covariance + b.covariance).fixed_view::<2, 2>(0, 0).into_owned();
    let contradicts =
        spread.cholesky().is_none_or(|s| apart.dot(&s.solve(&apart)) > CHI_SQUARED_2_99);
    !contradicts && a.region.iou(&b.region) > settings.same_person_iou
}

/// The 99 % point of chi-squared with two degrees of freedom.
const CHI_SQUARED_2_99: f64 = 9.21;

fn overlap(a: &Rect, b: &Rect, kind: Overlap) -> f64 {
    match kind {
        Overlap::Iou => a.iou(b),
        Overlap::Dice => {
            let sum = a.area() + b.area();
            if sum > 0.0 { 2.0 * a.intersection(b).area() / sum } else { 0.0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
    use proptest::prelude::*;
    use tagalong_core::{Estimate, Person, TrackId};

    use super::*;
    use crate::tests::doubles::person;

    fn track(position: Point3<f64>, covariance: SMatrix<f64, 5, 5>) -> Track {
        let person = Person { position, velocity: Vector2::zeros() };
        let estimate = Estimate { person, covariance, region: Rect::new(0.0, 0.0, 10.0, 10.0) };
        Track {
            id: TrackId(1),
            estimate,
            seen: false,
            occluded: false,
            confirmed: true,
            age: 0,
            unseen_s: 0.0,
            score: 1.0,
        }
    }

    proptest! {
        #[test]
        fn the_distance_is_that_of_the_inverted_matrix(
            off in prop::array::uniform3(-0.6..0.6f64), spread in prop::array::uniform9(-0.3..0.3f64),
        ) {
            let settings = AssociationSettings { gate: 1e9, ..AssociationSettings::default() };
            let root = Matrix3::from_iterator(spread);
            let covariance = root * root.transpose() + Matrix3::identity() * 0.01;
            let detection = Detection { covariance, ..person(3.0, 0.0) };
            let prior = SMatrix::<f64, 5, 5>::identity() * 0.04;
            let track = track(detection.position - nalgebra::Vector3::from(off), prior);
            let found = fit(&track, &detection, 0.1, &settings).unwrap();
            let s = covariance + Matrix3::identity() * 0.04;
            let nu = nalgebra::Vector3::from(off);
            let expected = (nu.transpose() * s.try_inverse().unwrap() * nu).x;
            prop_assert!((found.cost - expected).abs() < 1e-6 * (1.0 + expected));
            prop_assert!((found.log_volume - s.determinant().ln()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_vague_track_does_not_take_the_detection_of_a_certain_one() {
        let settings = AssociationSettings::default();
        let detection = person(3.0, 0.0);
        let near = detection.position + nalgebra::Vector3::new(0.25, 0.0, 0.0);
        let certain = track(near, SMatrix::identity() * 0.01);
        let vague = track(near, SMatrix::identity() * 1.0);
        let fit = |t: &Track, d: &Detection| fit(t, d, 0.1, &settings);
        let given = associate(&[&vague, &certain], &[&detection], fit, &settings);
        assert_eq!(given, [None, Some(0)]);
    }

    /// P2, eq. 10, gives pairs that overlap too little a cost of 0, and minimises.
    #[test]
    fn who_overlaps_is_given_what_overlaps_but_in_print_whatever_does_not() {
        let boxed = |x: f64| Rect::new(x, 0.0, 10.0, 10.0);
        let at = |x: f64| {
            let mut track = track(Point3::new(3.0, 0.0, 1.5), SMatrix::identity());
            track.estimate.region = boxed(x);
            track
        };
        let tracks = [at(0.0), at(50.0)];
        let seen = [2.0, 51.0].map(|x| Detection { region: boxed(x), ..person(3.0, 0.0) });
        let given = |compat_printed_cost: bool| {
            let settings = AssociationSettings {
                cost: Cost::Overlap,
                compat_printed_cost,
                ..AssociationSettings::default()
            };
            let fit = |t: &Track, d: &Detection| fit(t, d, 0.1, &settings);
            let (tracks, seen) = ([&tracks[0], &tracks[1]], [&seen[0], &seen[1]]);
            associate(&tracks, &seen, fit, &settings)
        };
        assert_eq!(given(false), [Some(0), Some(1)]);
        assert_eq!(given(true), [Some(1), Some(0)]);
    }

    #[test]
    fn both_measures_of_overlap() {
        let (a, b) = (Rect::new(0.0, 0.0, 2.0, 1.0), Rect::new(1.0, 0.0, 2.0, 1.0));
        assert_eq!(overlap(&a, &b, Overlap::Iou), 1.0 / 3.0);
        assert_eq!(overlap(&a, &b, Overlap::Dice), 0.5);
        assert_eq!(overlap(&Rect::default(), &Rect::default(), Overlap::Dice), 0.0);
    }

    #[test]
    fn two_people_one_behind_the_other_are_two_unless_their_range_is_unknown() {
        let settings = AssociationSettings::default();
        let (near, far) = (person(3.0, 0.0), person(3.6, 0.0));
        assert!(near.region.iou(&far.region) > settings.same_person_iou);
        assert!(!is_same_person(&near, &far, &settings));
        let vague = |d: Detection| Detection { covariance: Matrix3::identity() * 4.0, ..d };
        assert!(is_same_person(&vague(near), &vague(far), &settings));
    }

    #[test]
    fn nobody_is_found_outside_the_gate_or_farther_than_they_can_have_walked() {
        let settings = AssociationSettings { gate: 4.0, ..AssociationSettings::default() };
        let fits = |off_m: f64, variance: f64, dt_s: f64| {
            let detection = Detection { covariance: Matrix3::zeros(), ..person(3.0, 0.0) };
            let at = detection.position - nalgebra::Vector3::new(off_m, 0.0, 0.0);
            let track = track(at, SMatrix::identity() * variance);
            fit(&track, &detection, dt_s, &settings).is_some()
        };
        assert!(fits(0.19, 0.01, 0.1) && !fits(0.21, 0.01, 0.1), "two standard deviations");
        // One metre, and 1.5 m for each second.
        assert!(fits(1.14, 1.0, 0.1) && !fits(1.16, 1.0, 0.1));
        assert!(fits(1.74, 1.0, 0.5) && !fits(1.76, 1.0, 0.5));
        assert!(!fits(0.0, 0.0, 0.1), "a place without any uncertainty can be held against none");
    }

    /// Two people far apart; one was not seen for long and may be anywhere.
    #[test]
    fn a_vague_track_takes_its_own_detection_as_well_as_a_certain_one_does() {
        let settings = AssociationSettings::default();
        let detections = [person(3.0, 0.0), person(5.0, 2.0)];
        let certain = track(detections[0].position, SMatrix::identity() * 1e-4);
        let off = detections[1].position + nalgebra::Vector3::new(0.9, 0.0, 0.0);
        let vague = track(off, SMatrix::identity() * 0.5);
        let fit = |t: &Track, d: &Detection| fit(t, d, 0.1, &settings);
        let seen = [&detections[0], &detections[1]];
        let given = associate(&[&certain, &vague], &seen, fit, &settings);
        assert_eq!(given, [Some(0), Some(1)]);
        let alone = associate(&[&vague], &seen[1..], fit, &settings);
        assert_eq!(alone, [Some(0)]);
    }

    /// The price of leaving a track alone decides whether a poor pair is better than none.
    #[test]
    fn a_track_is_rather_left_alone_where_a_miss_is_cheap() {
        let detection = person(3.0, 0.0);
        let off = detection.position + nalgebra::Vector3::new(0.42, 0.0, 0.0);
        let track = track(off, SMatrix::identity() * 0.01);
        let given = |miss_factor: f64| {
            let settings = AssociationSettings { miss_factor, ..AssociationSettings::default() };
            let fit = |t: &Track, d: &Detection| fit(t, d, 0.1, &settings);
            associate(&[&track], &[&detection], fit, &settings)
        };
        // The squared distance is 0.42² / 0.02 = 8.8, the gate 11.34.
        assert_eq!((given(1.0), given(0.5)), (vec![Some(0)], vec![None]));
    }

    #[test]
    fn regions_that_overlap_enough_fit_the_better_the_more_they_overlap() {
        let settings =
            AssociationSettings { cost: Cost::Overlap, ..AssociationSettings::default() };
        let mut track = track(Point3::new(3.0, 0.0, 1.5), SMatrix::identity());
        track.estimate.region = Rect::new(0.0, 0.0, 10.0, 10.0);
        let cost = |x: f64| {
            let region = Rect::new(x, 0.0, 10.0, 10.0);
            fit(&track, &Detection { region, ..person(9.0, 9.0) }, 0.1, &settings).map(|f| f.cost)
        };
        assert_eq!(cost(0.0), Some(0.0));
        assert!((cost(5.0).unwrap() - 3.0_f64.ln()).abs() < 1e-12, "a third");
        assert_eq!(cost(5.5), None, "less than 0.3");
        let fit = |t: &Track, d: &Detection| fit(t, d, 0.1, &settings);
        let detection = Detection { region: Rect::new(5.0, 0.0, 10.0, 10.0), ..person(3.0, 0.0) };
        let cheap = AssociationSettings { miss_factor: 0.9, ..settings.clone() };
        let given = |s: &AssociationSettings| associate(&[&track], &[&detection], fit, s);
        assert_eq!((given(&settings), given(&cheap)), (vec![Some(0)], vec![None]));
    }

    #[test]
    fn sightings_at_one_place_are_of_one_person_whatever_the_image_says() {
        let settings = AssociationSettings::default();
        let at = |x: f64, y: f64, region_x: f64| {
            let region = Rect::new(region_x, 0.0, 100.0, 100.0);
            Detection { region, covariance: Matrix3::identity() * 0.02, ..person(x, y) }
        };
        let first = at(3.0, 0.0, 0.0);
        assert!(is_same_person(&first, &at(3.0, 0.24, 500.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.26, 500.0), &settings));
        // 0.6 m are three standard deviations of the difference: squared 9, of 9.21.
        assert!(is_same_person(&first, &at(3.0, 0.6, 30.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.61, 30.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.6, 34.0), &settings), "they overlap by less");
    }
}
