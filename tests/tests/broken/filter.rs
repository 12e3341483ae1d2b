use std::collections::BTreeMap;

use nalgebra::{SMatrix, SVector, Vector2};
use tagalong_config::Registry;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Matched, PerPerson, Person, PersonFilter,
    Result, TrackId, Update,
};
use tagalong_geometry::Camera;

use super::{mood, register_with_fault};

pub fn register(registry: &mut Registry, name: &'static str) {
    let plugin = move || {
        let kalman = Kalman { fault: name, mood: mood() };
        Faulty { fault: name, inner: PerPerson::new(kalman) }
    };
    register_with_fault!(registry, filter, name, plugin);
}

/// A Kalman filter of (x, y, z, vx, vy) in the robot frame.
struct Kalman {
    fault: &'static str,
    mood: f64,
}

type Mean = SVector<f64, 5>;
type Covariance = SMatrix<f64, 5, 5>;

impl PersonFilter for Kalman {
    type State = (Mean, Covariance);

    fn start(&self, detection: &Detection) -> Self::State {
        let p = detection.position;
        let speed = if self.fault == "moody" { 0.01 * self.mood } else { 0.0 };
        let mut covariance = Covariance::identity() * 2.0;
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&detection.covariance);
        (Mean::new(p.x, p.y, p.z, speed, 0.0), covariance)
    }

    fn predict(&self, (mean, covariance): &mut Self::State, motion: &EgoMotion) {
        let ignores = matches!(self.fault, "forgets-the-robot" | "never-moves");
        let motion = if ignores { &EgoMotion::at_rest(motion.dt) } else { motion };
        let mut f = Covariance::identity();
        f[(0, 3)] = motion.dt;
        f[(1, 4)] = motion.dt;
        let back = motion.isometry().rotation.inverse().to_rotation_matrix();
        let mut turn = Covariance::identity();
        turn.fixed_view_mut::<2, 2>(0, 0).copy_from(back.matrix());
        turn.fixed_view_mut::<2, 2>(3, 3).copy_from(back.matrix());
        let moved = Mean::new(motion.forward, motion.left, 0.0, 0.0, 0.0);
        *mean = turn * (f * *mean - moved);
        let noise = SVector::from([0.01, 0.01, 0.01, 0.5, 0.5]) * motion.dt;
        let step = turn * f;
        *covariance = step * *covariance * step.transpose() + Covariance::from_diagonal(&noise);
    }

    fn correct(&self, state: &mut Self::State, seen: &Detection, _: &Camera) -> Update {
        if self.fault == "never-moves" {
            return Update::default();
        }
        let (mean, covariance) = state;
        let h = SMatrix::<f64, 3, 5>::identity();
        let s = h * *covariance * h.transpose() + seen.covariance;
        let gain = *covariance * h.transpose() * s.try_inverse().unwrap_or_default();
        *mean += gain * (seen.position.coords - h * *mean);
        let kept = Covariance::identity() - gain * h;
        // Joseph's form stays positive definite under rounding.
        let updated =
            kept * *covariance * kept.transpose() + gain * seen.covariance * gain.transpose();
        *covariance = 0.5 * (updated + updated.transpose());
        Update::default()
    }

    fn estimate(&self, (mean, covariance): &Self::State, camera: &Camera) -> Estimate {
        let position = mean.fixed_rows::<3>(0).into_owned().into();
        let mut covariance = *covariance;
        match self.fault {
            "lopsided" => covariance[(0, 1)] += 1.0,
            "sure" => covariance = Covariance::identity(),
            _ => {}
        }
        let person = Person { position, velocity: Vector2::new(mean[3], mean[4]) };
        Estimate::new(person, covariance, camera.upper_body(&position))
    }
}

/// Filter with the faults that concern more than one person.
struct Faulty {
    fault: &'static str,
    inner: PerPerson<Kalman>,
}

impl Filter for Faulty {
    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera) {
        self.inner.start(id, detection, camera);
    }

    fn predict(&mut self, motion: &EgoMotion, camera: &Camera) {
        self.inner.predict(motion, camera);
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        assert!(self.fault != "panics" || evidence.frame.camera.width > 1, "cannot see");
        if self.fault != "swaps" {
            return self.inner.update(evidence);
        }
        let in_order = (1..).zip(evidence.matched);
        let matched: Vec<_> =
            in_order.map(|(id, m)| Matched::weighted(TrackId(id), m.detection, m.weight)).collect();
        let swapped = Evidence::new(evidence.frame, &matched)
            .with_unmatched(evidence.unmatched)
            .with_likelihood(evidence.likelihood);
        self.inner.update(&swapped)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.inner.estimates(camera)
    }

    fn stop(&mut self, id: TrackId) {
        if self.fault != "never-stops" {
            self.inner.stop(id);
        }
    }
}
