use nalgebra::{Matrix2, Point2, Vector2};

use crate::Station;
use crate::station::wrapped;

/// A hat in the image of one camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Number of the camera.
    pub station: usize,
    /// Where it is seen, pixels.
    pub pixel: Point2<f64>,
}

/// A place in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The place, m.
    pub place: Point2<f64>,
    /// Its covariance, m².
    pub covariance: Matrix2<f64>,
    /// Root of the mean square of the directions' misfits, rad.
    pub misfit_rad: f64,
}

/// Steps of Gauss and Newton; three or four are enough.
const STEPS: usize = 12;

/// The place that fits all directions best, with a standard deviation of
/// `sigma_rad` each. A direction counts with the inverse square of its camera's
/// distance; a pair of cameras thereby counts with the square of the sine of
/// their crossing angle, as it should. Nothing of less than two cameras, or where
/// the directions are all but parallel.
pub fn triangulate(stations: &[Station], sights: &[Sight], sigma_rad: f64) -> Option<Fix> {
    let seen: Vec<(&Station, f64)> = sights
        .iter()
        .filter_map(|s| stations.get(s.station).map(|from| (from, from.bearing(&s.pixel))))
        .collect();
    let mut place = meeting(&seen)?;
    for _ in 0..STEPS {
        let (normal, right) = equations(&seen, &place);
        place += normal.cholesky()?.solve(&right);
    }
    let (normal, _) = equations(&seen, &place);
    let covariance = normal.try_inverse()? * (sigma_rad * sigma_rad);
    let misfit =
        |(from, bearing): &(&Station, f64)| wrapped(bearing - from.towards(&place)).powi(2);
    let squares: f64 = seen.iter().map(misfit).sum();
    let ahead = |(from, bearing): &(&Station, f64)| {
        wrapped(bearing - from.towards(&place)).abs() < std::f64::consts::FRAC_PI_2
    };
    let finite = place.iter().chain(covariance.iter()).all(|v| v.is_finite());
    let misfit_rad = (squares / seen.len() as f64).sqrt();
    (finite && seen.iter().all(ahead)).then_some(Fix { place, covariance, misfit_rad })
}

/// Where the lines of all directions come nearest to each other.
fn meeting(seen: &[(&Station, f64)]) -> Option<Point2<f64>> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (from, bearing) in seen {
        let across = Vector2::new(-bearing.sin(), bearing.cos());
        normal += across * across.transpose();
        right += across * across.dot(&from.at.coords);
    }
    // The determinant is the sum of the squared sines of all crossing angles.
    (normal.determinant() > 1e-4).then(|| normal.try_inverse())?.map(|i| Point2::from(i * right))
}

/// Normal equations of the bearings about a place.
fn equations(seen: &[(&Station, f64)], place: &Point2<f64>) -> (Matrix2<f64>, Vector2<f64>) {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (from, bearing) in seen {
        let way = place - from.at;
        let square = way.norm_squared().max(1e-6);
        let gradient = Vector2::new(-way.y, way.x) / square;
        normal += gradient * gradient.transpose();
        right += gradient * wrapped(bearing - from.towards(place));
    }
    (normal, right)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stations() -> Vec<Station> {
        [(0.1, 0.1, 45.0), (9.9, 0.1, 135.0), (9.9, 4.9, 225.0), (0.1, 4.9, 315.0_f64)]
            .map(|(x, y, heading)| Station {
                at: Point2::new(x, y),
                heading_rad: heading.to_radians(),
                pitch_down_rad: 0.26,
                focal_px: 190.0,
                centre_px: Point2::new(159.5, 119.5),
            })
            .to_vec()
    }

    /// The pixel in row 110 that has this bearing, by bisection.
    fn pixel(station: &Station, bearing: f64) -> Point2<f64> {
        let (mut left, mut right) = (-400.0, 700.0);
        for _ in 0..60 {
            let middle = Point2::new(0.5 * (left + right), 110.0);
            if wrapped(station.bearing(&middle) - bearing) > 0.0 {
                left = middle.x;
            } else {
                right = middle.x;
            }
        }
        Point2::new(0.5 * (left + right), 110.0)
    }

    proptest! {
        #[test]
        fn directions_without_errors_meet_where_they_come_from(
            x in 1.0..9.0f64, y in 1.0..4.0f64, left_out in 0..4usize,
        ) {
            let (stations, place) = (stations(), Point2::new(x, y));
            let sights: Vec<Sight> = (0..4)
                .filter(|station| *station != left_out)
                .map(|station| {
                    let bearing = stations[station].towards(&place);
                    Sight { station, pixel: pixel(&stations[station], bearing) }
                })
                .collect();
            let fix = triangulate(&stations, &sights, 0.003).unwrap();
            prop_assert!((fix.place - place).norm() < 1e-6, "{fix:?}");
            prop_assert!(fix.misfit_rad < 1e-6 && fix.covariance.cholesky().is_some());
        }

        #[test]
        fn no_other_place_fits_better(
            x in 1.0..9.0f64, y in 1.0..4.0f64, noise in prop::array::uniform4(-0.01..0.01f64),
        ) {
            let (stations, place) = (stations(), Point2::new(x, y));
            let sights: Vec<Sight> = (0..4)
                .map(|station| {
                    let bearing = stations[station].towards(&place) + noise[station];
                    Sight { station, pixel: pixel(&stations[station], bearing) }
                })
                .collect();
            let fix = triangulate(&stations, &sights, 0.01).unwrap();
            let cost = |at: Point2<f64>| -> f64 {
                let off = |s: &Sight| stations[s.station].bearing(&s.pixel) - stations[s.station].towards(&at);
                sights.iter().map(|s| wrapped(off(s)).powi(2)).sum()
            };
            for step in [[1e-3, 0.0], [-1e-3, 0.0], [0.0, 1e-3], [0.0, -1e-3]] {
                prop_assert!(cost(fix.place + Vector2::from(step)) >= cost(fix.place) - 1e-12);
            }
        }
    }

    #[test]
    fn one_camera_or_parallel_directions_are_no_place() {
        let stations = stations();
        let sight = |station| Sight { station, pixel: Point2::new(159.5, 110.0) };
        assert_eq!(triangulate(&stations, &[sight(0)], 0.01), None);
        assert_eq!(triangulate(&stations, &[sight(0), sight(0)], 0.01), None);
        assert_eq!(triangulate(&stations, &[sight(0), sight(9)], 0.01), None);
        assert_eq!(triangulate(&stations, &[], 0.01), None);
    }
}
