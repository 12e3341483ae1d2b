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
            (overlap >= settings.min_overlap).then(|| Fit { cost: -overlap.ln(), log_volume: 0.0 })
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
