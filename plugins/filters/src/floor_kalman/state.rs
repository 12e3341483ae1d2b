use nalgebra::{Matrix2, Matrix4, Matrix4x2, Vector2, Vector4};

use crate::floor_kalman::{Config, Form};

/// Gaussian state of a person, in the room. The forms without velocity use the position's part of
/// mean and covariance only.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    /// (x, y, vx, vy): m, m/s.
    pub(crate) mean: Vector4<f64>,
    /// Its covariance.
    pub(crate) covariance: Matrix4<f64>,
    /// Height of the head, m, and its variance, m².
    pub(crate) height: (f64, f64),
    before: Option<Before>,
}

/// The posterior before the last one.
#[derive(Clone, Debug, PartialEq)]
struct Before {
    position: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// Covariance of its error with that of the posterior after it.
    cross: Matrix2<f64>,
}

impl State {
    /// After the first sighting at `position` with covariance `r`.
    pub(crate) fn new(
        position: Vector2<f64>,
        r: &Matrix2<f64>,
        height: (f64, f64),
        config: &Config,
    ) -> Self {
        let speed = config.initial_speed_mps.powi(2);
        let mut covariance = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, speed, speed));
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(r);
        let mean = Vector4::new(position.x, position.y, 0.0, 0.0);
        Self { mean, covariance, height, before: None }
    }

    pub(crate) fn position(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(0).into_owned()
    }

    pub(crate) fn position_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into_owned()
    }

    /// Applies equations 5 and 6, or their counterpart with velocity. `ego` is the noise of the
    /// robot's uncertain motion.
    pub(crate) fn predict(&mut self, dt: f64, ego: &Matrix2<f64>, config: &Config) {
        match config.form {
            Form::Still => self.grow(&config.process(dt)),
            Form::LastDifference => self.step_on(dt, config),
            Form::ConstantVelocity => self.move_on(dt, config.acceleration_noise),
        }
        self.grow(ego);
        self.height.1 += config.height_noise.powi(2) * dt;
    }

    /// More uncertainty about the position.
    fn grow(&mut self, by: &Matrix2<f64>) {
        let mut position = self.covariance.fixed_view_mut::<2, 2>(0, 0);
        position += by;
    }

    /// The prediction 2 x1 - x2 of the last two posteriors. Its error has the
    /// covariance 4 P1 + P2 - 2 (C + C') + Q, where C is theirs with each other;
    /// equation 6 has P1 + Q.
    fn step_on(&mut self, dt: f64, config: &Config) {
        let here = self.position();
        let p1 = self.position_covariance();
        let mut cross = p1;
        if let Some(before) = &self.before {
            let u = here - before.position;
            self.mean.fixed_rows_mut::<2>(0).copy_from(&(here + u));
            if dt > 0.0 {
                self.mean.fixed_rows_mut::<2>(2).copy_from(&(u / dt));
            }
            let p2 = before.covariance;
            let c = before.cross;
            self.grow(&(3.0 * p1 + p2 - 2.0 * (c + c.transpose())));
            cross = 2.0 * p1 - c.transpose();
        }
        self.grow(&config.process(dt));
        self.before = Some(Before { position: here, covariance: p1, cross });
    }

    /// White acceleration of spectral density `q` over a time `dt`.
    fn move_on(&mut self, dt: f64, q: f64) {
        let mut f = Matrix4::identity();
        let mut noise = Matrix4::zeros();
        for axis in 0..2 {
            f[(axis, axis + 2)] = dt;
            noise[(axis, axis)] = q * dt.powi(3) / 3.0;
            noise[(axis, axis + 2)] = q * dt.powi(2) / 2.0;
            noise[(axis + 2, axis)] = q * dt.powi(2) / 2.0;
            noise[(axis + 2, axis + 2)] = q * dt;
        }
        self.mean = f * self.mean;
        self.covariance = f * self.covariance * f.transpose() + noise;
    }

    /// Equations 7 to 9, in Joseph form; returns the normalised innovation
    /// squared. Where rounding has spoilt the covariance, nothing changes.
    pub(crate) fn correct(
        &mut self,
        z: &Vector2<f64>,
        r: &Matrix2<f64>,
        form: Form,
    ) -> Option<f64> {
        let innovation = z - self.position();
        let s = (self.position_covariance() + r).cholesky()?;
        let nis = innovation.dot(&s.solve(&innovation));
        let mut gain: Matrix4x2<f64> =
            s.solve(&self.covariance.fixed_rows::<2>(0).into_owned()).transpose();
        if form != Form::ConstantVelocity {
            gain.fixed_rows_mut::<2>(2).fill(0.0);
        }
        let mut kept = Matrix4::identity();
        let mut seen = kept.fixed_columns_mut::<2>(0);
        seen -= gain;
        self.mean += gain * innovation;
        let p = kept * self.covariance * kept.transpose() + gain * r * gain.transpose();
        self.covariance = 0.5 * (p + p.transpose());
        let kept = kept.fixed_view::<2, 2>(0, 0).into_owned();
        if let Some(before) = &mut self.before {
            before.cross = kept * before.cross;
        }
        Some(nis)
    }

    /// The same for the height alone.
    pub(crate) fn correct_height(&mut self, z: f64, variance: f64) {
        let (height, p) = self.height;
        let gain = p / (p + variance);
        if gain.is_finite() {
            self.height = (height + gain * (z - height), (1.0 - gain) * p);
        }
    }

    /// Velocity in the room, m/s, and its covariance.
    pub(crate) fn velocity(&self) -> (Vector2<f64>, Matrix2<f64>) {
        let covariance = self.covariance.fixed_view::<2, 2>(2, 2).into_owned();
        (self.mean.fixed_rows::<2>(2).into_owned(), covariance)
    }
}
