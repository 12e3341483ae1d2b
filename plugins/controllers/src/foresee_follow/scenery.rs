//! Surroundings of a plan: obstacles, and forecasts of all people at each of its steps.

use nalgebra::{Matrix2, Point2, Vector2};

use crate::Forecast;

/// Steps of a plan.
pub(super) const STEPS: usize = 20;

/// Expected place of another person at a step, blurred by the distance at which a robot minds people.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blob {
    at: Point2<f64>,
    inverse: Matrix2<f64>,
    peak: f64,
}

impl Blob {
    /// Returns the expected nearness of a place to the person, from 1 for the same place and a
    /// certain forecast down to 0. It is the mean of a Gaussian hill around the person over all
    /// places that the forecast thinks possible: the less is known, the lower and wider it is.
    fn new(forecast: &Forecast, seconds: f64, people_m: f64) -> Self {
        let hill = Matrix2::identity() * (people_m * people_m);
        let wide = forecast.covariance(seconds) + hill;
        let peak = people_m * people_m / wide.determinant().max(f64::MIN_POSITIVE).sqrt();
        // A sum with a hill always has an inverse; without one the person would count nowhere.
        let inverse = wide.try_inverse().unwrap_or_else(|| Matrix2::identity() / people_m.powi(2));
        Self { at: forecast.place(seconds), inverse, peak }
    }

    pub(super) fn nearness(&self, at: &Point2<f64>) -> f64 {
        let off = at - self.at;
        self.peak * (-0.5 * off.dot(&(self.inverse * off))).exp()
    }

    pub(super) fn place(&self) -> Point2<f64> {
        self.at
    }
}

/// The followed person at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    pub(super) at: Point2<f64>,
    pub(super) velocity: Vector2<f64>,
}

/// People and things around the robot, in its axes at the beginning of the plan. It keeps its
/// memory from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Scenery {
    pub(super) person: [Expected; STEPS + 1],
    /// Direction in which the person walks, a unit vector; `None` while it is unknown.
    pub(super) heading: Option<Vector2<f64>>,
    pub(super) others: Vec<[Blob; STEPS]>,
    pub(super) things: Vec<Point2<f64>>,
    pub(super) step_s: f64,
}

impl Scenery {
    pub(super) fn new(horizon_s: f64) -> Self {
        let nobody = Expected { at: Point2::origin(), velocity: Vector2::zeros() };
        Self {
            person: [nobody; STEPS + 1],
            heading: None,
            others: Vec::new(),
            things: Vec::new(),
            step_s: horizon_s / STEPS as f64,
        }
    }

    /// Removes all others and all things.
    pub(super) fn clear(&mut self) {
        self.others.clear();
        self.things.clear();
    }

    /// Sets the forecast of the followed person.
    pub(super) fn set_person(&mut self, forecast: &Forecast) {
        for (step, person) in self.person.iter_mut().enumerate() {
            let seconds = step as f64 * self.step_s;
            *person = Expected {
                at: forecast.place(seconds),
                velocity: forecast.velocity_after(seconds),
            };
        }
    }

    /// Adds the forecast of another person.
    pub(super) fn add_other(&mut self, forecast: &Forecast, people_m: f64) {
        let step_s = self.step_s;
        self.others.push(std::array::from_fn(|step| {
            Blob::new(forecast, (step + 1) as f64 * step_s, people_m)
        }));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;
    use crate::ForecastSettings;

    fn stands(x: f64, sigma_m: f64) -> Forecast {
        let settings = ForecastSettings {
            damping_per_s: 0.0,
            unrest: 0.0,
            unrest_by_speed: 0.0,
            filter_part: 1.0,
            ..ForecastSettings::default()
        };
        let variance = sigma_m * sigma_m;
        let covariance = Matrix4::from_diagonal(&[variance, variance, 0.0, 0.0].into());
        Forecast::new(&settings, Point2::new(x, 0.0), Vector2::zeros(), covariance).unwrap()
    }

    /// The slow way: the mean of the hill over normal places.
    #[test]
    fn nearness_is_the_mean_of_a_hill_over_the_forecast() {
        use tagalong_math::{ChaCha, RandomSource};

        let mut random = ChaCha::new(3, 1);
        for (sigma_m, x) in [(0.2, 0.5), (0.9, 0.5), (0.9, 2.0)] {
            let blob = Blob::new(&stands(x, sigma_m), 1.0, 0.6);
            let mut sum = 0.0;
            for _ in 0..40_000 {
                let off = Vector2::new(x + sigma_m * random.normal(), sigma_m * random.normal());
                sum += (-0.5 * off.norm_squared() / 0.36).exp();
            }
            let found = blob.nearness(&Point2::origin());
            assert!((found - sum / 40_000.0).abs() < 0.01, "{sigma_m} {x}: {found}");
        }
    }

    #[test]
    fn who_is_less_certain_counts_less_here_and_more_far_away() {
        let [certain, vague] =
            [0.05, 1.0].map(|sigma_m| Blob::new(&stands(1.0, sigma_m), 1.0, 0.6));
        let [near, far] = [Point2::new(1.0, 0.0), Point2::new(3.0, 0.0)];
        assert!(certain.nearness(&near) > 0.95 && vague.nearness(&near) < 0.3);
        assert!(certain.nearness(&far) < vague.nearness(&far));
    }
}
