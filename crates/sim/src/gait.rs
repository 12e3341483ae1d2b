//! Gait of people: the walking model of Boulic, Magnenat-Thalmann & Thalmann (1990), which gives
//! the pelvis and the joint angles as functions of the phase of the walking cycle and of the speed.

use std::f64::consts::TAU;

/// Leg length as a fraction of the body height (thigh and shank).
const LEG: f64 = 0.491;

/// Phases in which a foot is flat on the floor, and one between them at which the joint angles are
/// not corrected.
const FLAT: [f64; 2] = [0.06, 0.44];
const MID_STANCE: f64 = 0.25;

/// The gait of a body of this height at this speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gait {
    leg_m: f64,
    /// Speed in leg lengths per second (`RV` of the paper).
    relative_speed: f64,
}

/// Motion of the pelvis relative to smooth motion.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct PelvisMotion {
    /// Forward of the smooth motion, m.
    pub forward_m: f64,
    /// To the left, m.
    pub left_m: f64,
    /// Upwards; never positive, m.
    pub up_m: f64,
    /// Rotation about the vertical, rad; the thorax turns the other way.
    pub torsion_rad: f64,
    /// Forward bend, rad.
    pub lean_rad: f64,
}

/// The joint angles of one side, rad; flexion is positive.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct LimbAngles {
    /// Angle of the thigh to the vertical, forward positive.
    pub hip: f64,
    /// Bend of the knee.
    pub knee: f64,
    /// Angle of the foot, positive with the toes up.
    pub ankle: f64,
    /// Angle of the upper arm to the vertical, forward positive.
    pub shoulder: f64,
    /// Bend of the elbow.
    pub elbow: f64,
}

impl LimbAngles {
    /// Returns the angles at this fraction of the way from these to others.
    pub fn mix(&self, others: &Self, part: f64) -> Self {
        Self {
            hip: mixed_angle(self.hip, others.hip, part),
            knee: mixed_angle(self.knee, others.knee, part),
            ankle: mixed_angle(self.ankle, others.ankle, part),
            shoulder: mixed_angle(self.shoulder, others.shoulder, part),
            elbow: mixed_angle(self.elbow, others.elbow, part),
        }
    }
}

/// Returns the angle at this fraction of the way between two, exact at both ends.
fn mixed_angle(from: f64, to: f64, part: f64) -> f64 {
    from * (1.0 - part) + to * part
}

impl Gait {
    /// Creates the gait of a body `height_m` tall at `speed_mps`, at rest if zero. The model ends
    /// at 2.3 leg lengths per second; faster bodies move as at that speed.
    pub fn new(height_m: f64, speed_mps: f64) -> Self {
        let leg_m = LEG * height_m;
        // The model is fitted up to this speed.
        Self { leg_m, relative_speed: (speed_mps / leg_m).clamp(0.0, 2.3) }
    }

    /// Returns the duration of a cycle of two steps, s, in which the body covers 1.346 sqrt(RV) leg
    /// lengths; infinite at rest.
    pub fn cycle_s(&self) -> f64 {
        1.346 / self.relative_speed.sqrt()
    }

    /// Returns the fraction of the cycle during which a foot is on the ground.
    pub fn support_fraction(&self) -> f64 {
        let cycle = self.cycle_s();
        if cycle.is_finite() { (0.752 * cycle - 0.143) / cycle } else { 1.0 }
    }

    /// Returns the pelvis at a phase (0 to 1; 0 is the heel strike of the left foot).
    pub fn pelvis(&self, phase: f64) -> PelvisMotion {
        let rv = self.relative_speed;
        let slow = rv.min(0.5);
        let up = 0.015 * rv;
        // Both quadratics of the paper reach their constant branch at RV = 0.5.
        let left = 0.128 * (slow - slow * slow);
        let ahead = 0.084 * (slow - slow * slow);
        let offset = 0.625 - self.support_fraction();
        let lean = (8.0 * (slow - slow * slow)).to_radians();
        PelvisMotion {
            forward_m: self.leg_m * ahead * (TAU * (2.0 * phase + 2.0 * offset)).sin(),
            left_m: self.leg_m * left * (TAU * (phase - 0.1)).sin(),
            up_m: self.leg_m * up * ((TAU * (2.0 * phase - 0.35)).sin() - 1.0),
            torsion_rad: (4.0 * rv).to_radians().min(0.14) * -(TAU * phase).cos(),
            lean_rad: lean * (1.0 - (TAU * (2.0 * phase - 0.1)).sin()),
        }
    }

    /// Returns the forward shift of the left ankle, relative to the position from the joint angles,
    /// that keeps the flat foot in place on the floor, m; with the angles alone it would slide.
    /// Between the flat phases the correction is blended smoothly.
    pub fn plant_m(&self, phase: f64) -> f64 {
        let phase = phase.rem_euclid(1.0);
        let [start, end] = FLAT;
        if (start..=end).contains(&phase) {
            return self.slide_m(phase);
        }
        let part = (phase - end).rem_euclid(1.0) / (1.0 - (end - start));
        let from = self.slide_m(end);
        let to = self.slide_m(start);
        from + (to - from) * 0.5 * (1.0 - (0.5 * TAU * part).cos())
    }

    /// Returns the displacement of a planted foot, which moves back under the body at the body's
    /// speed.
    fn slide_m(&self, phase: f64) -> f64 {
        let cycle_m = 1.346 * self.relative_speed.sqrt() * self.leg_m;
        let planted = self.ankle_ahead_m(MID_STANCE) + cycle_m * (MID_STANCE - phase);
        planted - self.ankle_ahead_m(phase)
    }

    /// Returns the position of the left ankle forward of the smooth motion of the body.
    fn ankle_ahead_m(&self, phase: f64) -> f64 {
        let limb = self.limb(phase);
        let leg = 0.5 * (limb.hip.sin() + (limb.hip - limb.knee).sin());
        self.pelvis(phase).forward_m + self.leg_m * leg
    }

    /// Returns the joints of the left side at a phase; the right side is half a cycle later.
    pub fn limb(&self, phase: f64) -> LimbAngles {
        let rv = self.relative_speed;
        let slow = rv.min(0.5);
        let hip = [(-0.1, 50.0 * slow), (0.5, -30.0 * slow)];
        let (stance, swing) = if rv < 0.5 { (40.0 * rv, 140.0 * rv) } else { (20.0, 70.0) };
        let rest = 3.0 * (rv / 0.3).min(1.0);
        let knee = [(0.0, rest), (0.17, stance), (0.4, rest), (0.75, swing)];
        let ankle = [(0.0, -rest), (0.08, -6.0 * slow), (0.5, 20.0 * slow), (0.62, -30.0 * slow)];
        let bend = 3.0 + 6.0 * slow;
        let elbow = [(0.05, bend), (0.5, 3.0 + 34.0 * slow), (0.9, 3.0 + 10.0 * slow)];
        let arm = 9.88 * rv;
        LimbAngles {
            hip: through(&hip, phase).to_radians(),
            knee: through(&knee, phase).to_radians(),
            ankle: through(&ankle, phase).to_radians(),
            shoulder: (3.0 - 0.5 * arm - arm * (TAU * phase).cos()).to_radians(),
            elbow: through(&elbow, phase).to_radians(),
        }
    }
}

/// Evaluates a smooth periodic function through (phase, value) points in ascending order, with
/// slope zero at each of them: the points of the paper are the extremes.
fn through(points: &[(f64, f64)], phase: f64) -> f64 {
    let start = points[0].0;
    let at = (phase - start).rem_euclid(1.0);
    let after = points.iter().position(|p| p.0 - start > at).unwrap_or(points.len());
    let (from, low) = points[after - 1];
    let (to, high) = points.get(after).map_or((start + 1.0, points[0].1), |p| *p);
    let part = (at - (from - start)) / (to - from);
    low + (high - low) * 0.5 * (1.0 - (0.5 * TAU * part).cos())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn range(of: impl Fn(f64) -> f64) -> (f64, f64) {
        let values = (0..1000).map(|i| of(f64::from(i) / 1000.0));
        values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    }

    #[test]
    fn an_ordinary_walk_has_the_figures_of_the_paper() {
        let gait = Gait::new(1.70, 1.3);
        assert!((gait.relative_speed - 1.56).abs() < 0.01);
        assert!((gait.cycle_s() - 1.08).abs() < 0.01, "{}", gait.cycle_s());
        assert!((0.5 * 1.3 * gait.cycle_s() - 0.70).abs() < 0.01);
        let (low, high) = range(|phase| gait.pelvis(phase).up_m);
        assert!((high - low - 0.04).abs() < 0.003, "{}", high - low);
        let (right, left) = range(|phase| gait.pelvis(phase).left_m);
        assert!((left - 0.032 * gait.leg_m).abs() < 1e-4 && (right + left).abs() < 1e-6);
    }

    #[test]
    fn joints_reach_their_extremes() {
        let gait = Gait::new(1.70, 1.3);
        let joints: [fn(&LimbAngles) -> f64; 3] =
            [|limb| limb.hip, |limb| limb.knee, |limb| limb.elbow];
        let [hip, knee, elbow] = joints.map(|of| {
            let (low, high) = range(|phase| of(&gait.limb(phase)).to_degrees());
            (low.round(), high.round())
        });
        assert_eq!(hip, (-15.0, 25.0));
        assert_eq!(knee.1, 70.0);
        assert!(elbow.1 > elbow.0);
    }

    #[test]
    fn who_stands_does_not_move() {
        let gait = Gait::new(1.70, 0.0);
        assert_eq!(range(|phase| gait.pelvis(phase).up_m), (0.0, 0.0));
        assert_eq!(range(|phase| gait.limb(phase).knee), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn one_cycle_takes_its_length_at_its_speed(h in 1.4..2.0f64, v in 0.2..1.55f64) {
            let gait = Gait::new(h, v);
            let length_m = 1.346 * (v / (LEG * h)).sqrt() * LEG * h;
            prop_assert!((length_m - v * gait.cycle_s()).abs() < 1e-9);
        }

        #[test]
        fn angles_are_continuous_over_the_seam(v in 0.0..2.0f64, phase in 0.0..1.0f64) {
            let gait = Gait::new(1.7, v);
            let a = gait.limb(phase);
            let b = gait.limb((phase + 1e-6).rem_euclid(1.0));
            prop_assert!((a.hip - b.hip).abs() < 1e-3 && (a.knee - b.knee).abs() < 1e-3);
            prop_assert!((a.elbow - b.elbow).abs() < 1e-3 && (a.ankle - b.ankle).abs() < 1e-3);
        }
    }
}
