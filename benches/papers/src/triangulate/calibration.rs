use nalgebra::{Matrix4, Point2, Vector4};

use super::station::wrapped;
use super::{Sight, Station};

/// Known place, and the cameras that saw the hat there.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// The place, m.
    pub place: Point2<f64>,
    /// Bearings of the cameras.
    pub sights: Vec<Sight>,
}

/// Cameras as calibrated.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The cameras, in the order of the first guess.
    pub stations: Vec<Station>,
    /// Root of the mean square of the bearings' misfits of each, rad.
    pub misfit_rad: Vec<f64>,
    /// Known places that each saw.
    pub places: Vec<usize>,
}

/// Misfits far beyond this hardly count (Cauchy's loss), rad.
const FORGIVEN_RAD: f64 = 0.01;
/// A camera with fewer known places is left as it was guessed: it has four unknowns.
const FEWEST: usize = 6;
/// Most steps of Levenberg and Marquardt.
const STEPS: usize = 200;

/// Place, heading and focal length of each camera, by least squares over
/// its bearings to known places, with Cauchy's loss. The places are known, so
/// each camera stands for itself.
pub fn calibrate(guess: &[Station], known: &[Known]) -> Calibrated {
    let mut calibrated =
        Calibrated { stations: Vec::new(), misfit_rad: Vec::new(), places: Vec::new() };
    for (number, station) in guess.iter().enumerate() {
        let seen: Vec<(Point2<f64>, Point2<f64>)> = known
            .iter()
            .flat_map(|known| known.sights.iter().map(move |sight| (known.place, sight)))
            .filter(|(_, sight)| sight.station == number)
            .map(|(place, sight)| (place, sight.pixel))
            .collect();
        let fitted = if seen.len() < FEWEST { *station } else { fit(station, &seen) };
        let square: f64 = seen.iter().map(|s| misfit(&fitted, s).powi(2)).sum();
        calibrated.stations.push(fitted);
        calibrated.misfit_rad.push((square / seen.len().max(1) as f64).sqrt());
        calibrated.places.push(seen.len());
    }
    calibrated
}

fn misfit(station: &Station, (place, pixel): &(Point2<f64>, Point2<f64>)) -> f64 {
    wrapped(station.bearing(pixel) - station.towards(place))
}

/// Cauchy's loss of all bearings.
fn loss(station: &Station, seen: &[(Point2<f64>, Point2<f64>)]) -> f64 {
    seen.iter().map(|s| (misfit(station, s) / FORGIVEN_RAD).powi(2).ln_1p()).sum()
}

fn fit(guess: &Station, seen: &[(Point2<f64>, Point2<f64>)]) -> Station {
    let unit = guess.focal_px;
    let mut best = *guess;
    let mut damping = 1e-3_f64;
    let mut lowest = loss(&best, seen);
    for _ in 0..STEPS {
        let (normal, gradient) = equations(&best, seen, unit);
        let damped =
            normal + Matrix4::from_diagonal(&(normal.diagonal() * damping).add_scalar(1e-12));
        let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) else { break };
        let next = best.with(&(best.parameters(unit) - step), unit);
        let cost = loss(&next, seen);
        if cost < lowest {
            let done = lowest - cost < 1e-12;
            (best, lowest, damping) = (next, cost, (0.3 * damping).max(1e-9));
            if done {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e9 {
                break;
            }
        }
    }
    best
}

/// Normal equations with the weights that Cauchy's loss gives.
fn equations(
    station: &Station,
    seen: &[(Point2<f64>, Point2<f64>)],
    unit: f64,
) -> (Matrix4<f64>, Vector4<f64>) {
    let mut normal = Matrix4::zeros();
    let mut gradient = Vector4::zeros();
    for s in seen {
        let off = misfit(station, s);
        let slope = derivative(station, s, unit);
        let weight = 1.0 / (1.0 + (off / FORGIVEN_RAD).powi(2));
        normal += slope * slope.transpose() * weight;
        gradient += slope * (weight * off);
    }
    (normal, gradient)
}

/// Of a misfit by the parameters, by central differences.
fn derivative(station: &Station, s: &(Point2<f64>, Point2<f64>), unit: f64) -> Vector4<f64> {
    const STEP: f64 = 1e-6;
    let parameters = station.parameters(unit);
    Vector4::from_fn(|i, _| {
        let [after, before] = [STEP, -STEP].map(|step| {
            let mut moved = parameters;
            moved[i] += step;
            misfit(&station.with(&moved, unit), s)
        });
        wrapped(after - before) / (2.0 * STEP)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn station() -> Station {
        Station {
            at: Point2::new(0.1, 0.1),
            heading_rad: 0.79,
            pitch_down_rad: 0.26,
            focal_px: 190.0,
            centre_px: Point2::new(159.5, 119.5),
        }
    }

    /// Pixels of a hat 1.8 m high as a camera 2.2 m high sees it.
    fn seen() -> Vec<Known> {
        let station = station();
        let mut known = Vec::new();
        for i in 0..24 {
            let place = Point2::new(1.5 + 0.33 * f64::from(i), 0.8 + 0.8 * f64::from(i % 5));
            let (way, (sine, cosine)) = (place - station.at, station.heading_rad.sin_cos());
            let ahead = way.x * cosine + way.y * sine;
            let left = way.y * cosine - way.x * sine;
            let (s, c) = station.pitch_down_rad.sin_cos();
            let depth = ahead * c + 0.4 * s;
            let down = 0.4 * c - ahead * s;
            let pixel = Point2::new(159.5 - 190.0 * left / depth, 119.5 + 190.0 * down / depth);
            known.push(Known { place, sights: vec![Sight { station: 0, pixel }] });
        }
        known
    }

    fn guess() -> Station {
        let at = Point2::new(0.5, -0.2);
        let heading_rad = 0.65;
        Station { at, heading_rad, focal_px: 210.0, ..station() }
    }

    #[test]
    fn a_rough_guess_becomes_the_camera() {
        let calibrated = calibrate(&[guess()], &seen());
        let found = calibrated.stations[0];
        let truth = station();
        assert!((found.at - truth.at).norm() < 1e-3, "{found:?}");
        assert!((found.heading_rad - truth.heading_rad).abs() < 1e-3, "{found:?}");
        assert!((found.focal_px - truth.focal_px).abs() < 0.5, "{found:?}");
        assert!(calibrated.misfit_rad[0] < 1e-5, "{calibrated:?}");
    }

    #[test]
    fn two_mistakes_are_forgiven() {
        let mut known = seen();
        known[3].sights[0].pixel.x += 60.0;
        known[15].sights[0].pixel.x -= 80.0;
        let found = calibrate(&[guess()], &known).stations[0];
        assert!((found.at - station().at).norm() < 0.02, "{found:?}");
    }

    #[test]
    fn who_saw_too_little_stays_as_guessed() {
        let calibrated = calibrate(&[guess(), guess()], &seen()[..4]);
        assert_eq!(calibrated.stations, [guess(), guess()]);
        assert_eq!(calibrated.places, [4, 0]);
    }
}
