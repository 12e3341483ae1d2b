use nalgebra::{Matrix2, Point2, Vector2};

use super::station::wrapped;
use super::{Known, Station};

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
    /// Cameras whose directions it fits.
    pub cameras: usize,
}

impl Fix {
    /// Standard deviation of a coordinate, m: the mean of both.
    pub fn sigma_m(&self) -> f64 {
        (0.5 * self.covariance.trace()).sqrt()
    }
}

/// Cameras at known places, and the assumed errors of their bearings.
#[derive(Clone, Debug, PartialEq)]
pub struct Cameras {
    /// The cameras.
    pub stations: Vec<Station>,
    /// Standard deviation of a bearing, rad.
    pub sigma_rad: f64,
    /// A place is none if the directions to it do not fit, on average, to within
    /// so many of these.
    pub most_misfit: f64,
    /// Nor if it is not known better than to within this, m: on the line through two
    /// cameras they tell nothing of how far away it is.
    pub most_sigma_m: f64,
}

impl Cameras {
    /// Cameras with ordinary images.
    pub fn new(stations: Vec<Station>) -> Self {
        Self { stations, sigma_rad: 0.004, most_misfit: 3.0, most_sigma_m: 0.3 }
    }

    /// Where the hat is that was seen. Of three cameras or more, those that
    /// contradict the others are left out: something else has its colour.
    pub fn fix(&self, sights: &[Sight]) -> Option<Fix> {
        let most_misfit_rad = self.most_misfit * self.sigma_rad;
        let mut sights = sights.to_vec();
        let mut best = triangulate(&self.stations, &sights, self.sigma_rad);
        while !best.as_ref().is_some_and(|fix| fix.misfit_rad <= most_misfit_rad)
            && sights.len() > 2
        {
            let ways = (0..sights.len()).map(|left_out| {
                let mut kept = sights.clone();
                kept.remove(left_out);
                let fix = triangulate(&self.stations, &kept, self.sigma_rad);
                (fix.as_ref().map_or(f64::INFINITY, |fix| fix.misfit_rad), kept, fix)
            });
            let (_, kept, fix) = ways.min_by(|a, b| a.0.total_cmp(&b.0))?;
            sights = kept;
            best = fix;
        }
        best.filter(|fix| fix.misfit_rad <= most_misfit_rad && fix.sigma_m() <= self.most_sigma_m)
    }

    /// Distances of measured places from known ones, m, where there are any.
    pub fn distances_m(&self, known: &[Known]) -> Vec<f64> {
        known.iter().filter_map(|k| Some((self.fix(&k.sights)?.place - k.place).norm())).collect()
    }
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
    let squares: f64 =
        seen.iter().map(|(from, bearing)| wrapped(bearing - from.towards(&place)).powi(2)).sum();
    let finite = place.iter().chain(covariance.iter()).all(|v| v.is_finite());
    let misfit_rad = (squares / seen.len() as f64).sqrt();
    (finite
        && seen.iter().all(|(from, bearing)| {
            wrapped(bearing - from.towards(&place)).abs() < std::f64::consts::FRAC_PI_2
        }))
    .then_some(Fix { place, covariance, misfit_rad, cameras: seen.len() })
}

/// Where the lines of all directions come nearest to each other.
fn meeting(seen: &[(&Station, f64)]) -> Option<Point2<f64>> {
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
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
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
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
        let mut left = -400.0;
        let mut right = 700.0;
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
            let stations = stations();
            let place = Point2::new(x, y);
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
            let stations = stations();
            let place = Point2::new(x, y);
            let sights: Vec<Sight> = (0..4)
                .map(|station| {
                    let bearing = stations[station].towards(&place) + noise[station];
                    Sight { station, pixel: pixel(&stations[station], bearing) }
                })
                .collect();
            let fix = triangulate(&stations, &sights, 0.01).unwrap();
            let steps = [[0.0, 0.0], [1e-3, 0.0], [-1e-3, 0.0], [0.0, 1e-3], [0.0, -1e-3]];
            let costs = steps.map(|step| -> f64 {
                let at = fix.place + Vector2::from(step);
                let seen = sights.iter().map(|s| (&stations[s.station], s.pixel));
                let off = seen.map(|(from, pixel)| from.bearing(&pixel) - from.towards(&at));
                off.map(|off| wrapped(off).powi(2)).sum()
            });
            for cost in costs {
                prop_assert!(cost >= costs[0] - 1e-12, "{:?}", costs);
            }
        }
    }

    /// Returns the cameras that see a place, some of them with an error of the bearing, rad.
    fn sights(place: Point2<f64>, errors: &[(usize, f64)]) -> Vec<Sight> {
        let stations = stations();
        errors
            .iter()
            .map(|(station, error)| {
                let bearing = stations[*station].towards(&place) + error;
                Sight { station: *station, pixel: pixel(&stations[*station], bearing) }
            })
            .collect()
    }

    #[test]
    fn who_contradicts_the_others_is_left_out() {
        let cameras = Cameras::new(stations());
        let place = Point2::new(3.0, 2.0);
        let fix = cameras.fix(&sights(place, &[(0, 0.0), (1, 0.3), (2, 0.0), (3, 0.0)])).unwrap();
        assert!((fix.place - place).norm() < 1e-6 && fix.cameras == 3, "{fix:?}");
        // Of three bearings, two of which must be wrong, the right one is unknown.
        assert_eq!(cameras.fix(&sights(place, &[(0, 0.0), (0, 0.5), (0, -0.5)])), None);
    }

    #[test]
    fn on_the_line_between_two_cameras_there_is_no_place() {
        let cameras = Cameras::new(stations());
        let between = Point2::from(0.5 * (stations()[0].at.coords + stations()[2].at.coords));
        let two = [(0, 0.002), (2, -0.001)];
        assert_eq!(cameras.fix(&sights(between + Vector2::new(0.0, 0.05), &two)), None);
        let third = [(0, 0.0), (2, 0.0), (1, 0.0)];
        assert!(cameras.fix(&sights(between, &third)).is_some());
    }

    #[test]
    fn one_camera_or_parallel_directions_are_no_place() {
        fn sight(station: usize) -> Sight {
            Sight { station, pixel: Point2::new(159.5, 110.0) }
        }

        let stations = stations();
        assert_eq!(triangulate(&stations, &[sight(0)], 0.01), None);
        assert_eq!(triangulate(&stations, &[sight(0), sight(0)], 0.01), None);
        assert_eq!(triangulate(&stations, &[sight(0), sight(9)], 0.01), None);
        assert_eq!(triangulate(&stations, &[], 0.01), None);
    }
}
