//! Bodies: how large the parts are and where the joints are while walking.
//!
//! Segment lengths are fractions of the body height (Drillis & Contini 1966, as
//! in Winter, "Biomechanics and Motor Control of Human Movement").

use nalgebra::{Point2, Point3, Rotation3, Vector3};

use crate::gait::{Gait, LimbAngles};
use crate::random::Random;

/// Length of the head, chin to top, as a fraction of the height.
const HEAD: f64 = 0.130;
const NECK: f64 = 0.052;
const TORSO: f64 = 0.288;
const THIGH: f64 = 0.245;
const SHANK: f64 = 0.246;
const ANKLE: f64 = 0.039;
const FOOT: f64 = 0.143;
const UPPER_ARM: f64 = 0.188;
const FOREARM: f64 = 0.152;
/// From the middle to the shoulder joint: the half width of 0.1295 less the
/// thickness of the arm.
const SHOULDER: f64 = 0.106;
/// From the middle to the hip joint.
const HIP: f64 = 0.052;
/// Arms hang this far away from the body, rad.
const ARMS_OUT_RAD: f64 = 0.11;

/// The size of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build {
    /// From the floor to the top of the head, m.
    pub height_m: f64,
    /// Widths as a multiple of the ordinary ones.
    pub breadth: f64,
}

impl Build {
    /// A body of the population: height N(1.70, 0.09) m, breadth within 12 %.
    pub fn random(random: &mut Random) -> Self {
        let height_m = (1.70 + 0.09 * random.normal()).clamp(1.45, 2.0);
        Self { height_m, breadth: random.between(0.88, 1.12) }
    }
}

/// Where a body is and what it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// On the floor, m.
    pub place: Point2<f64>,
    /// Direction of the face, rad from X towards Y.
    pub heading_rad: f64,
    /// Over ground, m/s.
    pub speed_mps: f64,
    /// Phase of the walking cycle, 0 to 1.
    pub phase: f64,
}

/// The joints of a body in the world, m. Pairs are left, right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skeleton {
    /// Middle between the hip joints.
    pub pelvis: Point3<f64>,
    /// Middle between the shoulder joints.
    pub chest: Point3<f64>,
    /// Centre of the head.
    pub head: Point3<f64>,
    /// Axes of pelvis, thorax and head: X forward, Y left, Z up.
    pub world_from_pelvis: Rotation3<f64>,
    /// As above.
    pub world_from_thorax: Rotation3<f64>,
    /// As above.
    pub world_from_head: Rotation3<f64>,
    /// Shoulder joints.
    pub shoulders: [Point3<f64>; 2],
    /// Elbows.
    pub elbows: [Point3<f64>; 2],
    /// Wrists.
    pub wrists: [Point3<f64>; 2],
    /// Hip joints.
    pub hips: [Point3<f64>; 2],
    /// Knees.
    pub knees: [Point3<f64>; 2],
    /// Ankles.
    pub ankles: [Point3<f64>; 2],
    /// Heels.
    pub heels: [Point3<f64>; 2],
    /// Tips of the feet.
    pub toes: [Point3<f64>; 2],
}

impl Skeleton {
    /// The joints of a body in a stance.
    pub fn new(build: &Build, stance: &Stance) -> Self {
        let h = build.height_m;
        let gait = Gait::new(h, stance.speed_mps);
        let motion = gait.pelvis(stance.phase);
        let yaw = about_z(stance.heading_rad);
        let pelvis_turn = yaw * about_z(motion.torsion_rad);
        let thorax_turn = yaw * about_z(-0.6 * motion.torsion_rad) * about_y(motion.lean_rad);
        let ground = Point3::new(stance.place.x, stance.place.y, 0.0);
        let height = (ANKLE + SHANK + THIGH) * h + motion.up_m;
        let pelvis = ground + yaw * Vector3::new(motion.forward_m, motion.left_m, height);
        let chest = pelvis + thorax_turn * Vector3::new(0.0, 0.0, TORSO * h);
        let head = chest + yaw * Vector3::new(0.01 * h, 0.0, (NECK + 0.5 * HEAD) * h);
        let limbs = [gait.limb(stance.phase), gait.limb(stance.phase + 0.5)];
        let mut skeleton = Self {
            pelvis,
            chest,
            head,
            world_from_pelvis: pelvis_turn,
            world_from_thorax: thorax_turn,
            world_from_head: yaw,
            shoulders: [chest; 2],
            elbows: [chest; 2],
            wrists: [chest; 2],
            hips: [pelvis; 2],
            knees: [pelvis; 2],
            ankles: [pelvis; 2],
            heels: [pelvis; 2],
            toes: [pelvis; 2],
        };
        for (side, limb) in limbs.iter().enumerate() {
            let sign = if side == 0 { 1.0 } else { -1.0 };
            skeleton.place_arm(side, sign, build, limb);
            skeleton.place_leg(side, sign, h, limb, &yaw);
        }
        skeleton
    }

    fn place_arm(&mut self, side: usize, sign: f64, build: &Build, limb: &LimbAngles) {
        let h = build.height_m;
        let turn = self.world_from_thorax * about_x(sign * ARMS_OUT_RAD);
        let down = |angle: f64| turn * Vector3::new(angle.sin(), 0.0, -angle.cos());
        let out = Vector3::new(0.0, sign * SHOULDER * h * build.breadth, 0.0);
        self.shoulders[side] = self.chest + self.world_from_thorax * out;
        self.elbows[side] = self.shoulders[side] + down(limb.shoulder) * (UPPER_ARM * h);
        self.wrists[side] = self.elbows[side] + down(limb.shoulder + limb.elbow) * (FOREARM * h);
    }

    fn place_leg(
        &mut self,
        side: usize,
        sign: f64,
        h: f64,
        limb: &LimbAngles,
        yaw: &Rotation3<f64>,
    ) {
        let down = |angle: f64| yaw * Vector3::new(angle.sin(), 0.0, -angle.cos());
        let shank = limb.hip - limb.knee;
        let out = Vector3::new(0.0, sign * HIP * h, 0.0);
        self.hips[side] = self.pelvis + self.world_from_pelvis * out;
        self.knees[side] = self.hips[side] + down(limb.hip) * (THIGH * h);
        let mut ankle = self.knees[side] + down(shank) * (SHANK * h);
        // The angles of the model do not know the floor exactly.
        ankle.z = ankle.z.max(ANKLE * h);
        // A foot near the floor lies flat on it.
        let lifted = ((ankle.z - ANKLE * h) / (0.08 * h)).min(1.0);
        let pitch = lifted * (shank + limb.ankle);
        let along = yaw * Vector3::new(pitch.cos(), 0.0, pitch.sin());
        let sole = ankle - yaw * Vector3::new(0.0, 0.0, 0.018 * h);
        self.ankles[side] = ankle;
        self.heels[side] = sole - along * (0.2 * FOOT * h);
        self.toes[side] = sole + along * (0.65 * FOOT * h);
        self.toes[side].z = self.toes[side].z.max(0.018 * h);
    }
}

fn about_x(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::x_axis(), angle)
}

fn about_y(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), angle)
}

fn about_z(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stance(speed_mps: f64, phase: f64) -> Stance {
        Stance { place: Point2::new(2.0, 1.0), heading_rad: 0.5, speed_mps, phase }
    }

    #[test]
    fn who_stands_is_as_tall_as_said_and_symmetric() {
        let build = Build { height_m: 1.70, breadth: 1.0 };
        let s = Skeleton::new(&build, &stance(0.0, 0.3));
        assert!((s.head.z + 0.5 * HEAD * 1.70 - 1.70).abs() < 0.005, "{}", s.head.z);
        assert!((s.wrists[0].z - s.wrists[1].z).abs() < 1e-9);
        assert!((s.shoulders[0] - s.shoulders[1]).norm() > 0.34);
        assert!((s.ankles[0].z - ANKLE * 1.70).abs() < 1e-9);
    }

    #[test]
    fn a_head_bobs_by_four_centimetres() {
        let build = Build { height_m: 1.70, breadth: 1.0 };
        let heights: Vec<f64> = (0..200)
            .map(|i| Skeleton::new(&build, &stance(1.3, f64::from(i) / 200.0)).head.z)
            .collect();
        let spread = heights.iter().copied().fold(f64::MIN, f64::max)
            - heights.iter().copied().fold(f64::MAX, f64::min);
        assert!((spread - 0.04).abs() < 0.006, "{spread}");
    }

    #[test]
    fn the_population_has_its_mean_and_spread() {
        let mut random = Random::new(4, 0);
        let heights: Vec<f64> = (0..5000).map(|_| Build::random(&mut random).height_m).collect();
        let mean = heights.iter().sum::<f64>() / 5000.0;
        let variance = heights.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / 5000.0;
        assert!((mean - 1.70).abs() < 0.01 && (variance.sqrt() - 0.09).abs() < 0.005);
    }

    proptest! {
        #[test]
        fn segments_keep_their_lengths_and_feet_stay_above_the_floor(
            h in 1.5..1.95f64, v in 0.0..1.8f64, phase in 0.0..1.0f64,
        ) {
            let s = Skeleton::new(&Build { height_m: h, breadth: 1.0 }, &stance(v, phase));
            for side in 0..2 {
                prop_assert!(((s.hips[side] - s.knees[side]).norm() - THIGH * h).abs() < 1e-9);
                prop_assert!(((s.elbows[side] - s.wrists[side]).norm() - FOREARM * h).abs() < 1e-9);
                let shank = (s.knees[side] - s.ankles[side]).norm() / (SHANK * h);
                prop_assert!((0.85..=1.0 + 1e-9).contains(&shank), "{shank}");
                prop_assert!(s.toes[side].z > 0.0 && s.heels[side].z > 0.0);
            }
        }
    }
}
