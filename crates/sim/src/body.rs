//! Bodies: the sizes of their parts and the positions of their joints while walking.
//!
//! Segment lengths are fractions of the body height (Drillis & Contini 1966, as
//! in Winter, "Biomechanics and Motor Control of Human Movement").

use nalgebra::{Point2, Point3, Rotation3, Vector3};

use crate::gait::{Gait, LimbAngles};
use crate::posture::Posture;
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
/// Distance from the middle to the shoulder joint: half the shoulder width, 0.1295, minus the
/// thickness of the arm.
const SHOULDER: f64 = 0.106;
/// Distance from the middle to the hip joint.
const HIP: f64 = 0.052;
/// Angle between the hanging arms and the body, rad.
const ARMS_OUT_RAD: f64 = 0.11;

/// Joints of a seated person: thighs forward, hands on them.
const SEATED: LimbAngles =
    LimbAngles { hip: 1.45, knee: 1.45, ankle: 0.0, shoulder: 0.25, elbow: 0.9 };
/// Joint angles of an arm that holds a phone in front of the chest.
const PHONE_ARM: (f64, f64) = (0.45, 1.9);
/// Angle by which the head is bowed over a phone, rad.
const PHONE_NOD_RAD: f64 = 0.4;

/// The size of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build {
    /// Height from the floor to the top of the head, m.
    pub height_m: f64,
    /// Widths as a multiple of the average ones.
    pub breadth: f64,
}

impl Build {
    /// Creates a body of the population: height N(1.70, 0.09) m, breadth within 12 %.
    pub fn random(random: &mut Random) -> Self {
        // Clamped to sizes for which the proportions still hold.
        let height_m = (1.70 + 0.09 * random.normal()).clamp(1.45, 2.0);
        Self { height_m, breadth: random.between(0.88, 1.12) }
    }
}

/// Position and pose of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// Position on the floor, m.
    pub place: Point2<f64>,
    /// Direction of the face, rad from X towards Y.
    pub heading_rad: f64,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// Phase of the walking cycle, 0 to 1.
    pub phase: f64,
    /// Posture of the body.
    pub posture: Posture,
    /// Fraction of the way down to a seat: 0 for standing, 1 for sitting.
    pub seated: f64,
    /// Forward bend of the trunk in addition to that of walking, rad.
    pub bend_rad: f64,
}

impl Stance {
    /// Creates the stance of an upright person.
    pub fn standing(place: Point2<f64>, heading_rad: f64) -> Self {
        let posture = Posture::Upright;
        Self { place, heading_rad, speed_mps: 0.0, phase: 0.0, posture, seated: 0.0, bend_rad: 0.0 }
    }
}

/// The joints of a body in the world, m. Pairs are ordered left, right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skeleton {
    /// Posture of the body.
    pub posture: Posture,
    /// Fraction of the way down to a seat.
    pub seated: f64,
    /// Middle between the hip joints.
    pub pelvis: Point3<f64>,
    /// Middle between the shoulder joints.
    pub chest: Point3<f64>,
    /// Centre of the head.
    pub head: Point3<f64>,
    /// Axes of pelvis, thorax and head: X forward, Y left, Z up.
    pub world_from_pelvis: Rotation3<f64>,
    /// Axes of the thorax.
    pub world_from_thorax: Rotation3<f64>,
    /// Axes of the head.
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
    /// Returns the joints that pose networks detect, by their names in the keypoints of COCO.
    pub fn joints(&self) -> [(&'static str, Point3<f64>); 12] {
        [
            ("left_shoulder", self.shoulders[0]),
            ("right_shoulder", self.shoulders[1]),
            ("left_elbow", self.elbows[0]),
            ("right_elbow", self.elbows[1]),
            ("left_wrist", self.wrists[0]),
            ("right_wrist", self.wrists[1]),
            ("left_hip", self.hips[0]),
            ("right_hip", self.hips[1]),
            ("left_knee", self.knees[0]),
            ("right_knee", self.knees[1]),
            ("left_ankle", self.ankles[0]),
            ("right_ankle", self.ankles[1]),
        ]
    }

    /// Returns the same body on a floor that is higher by `by_m`, m.
    pub fn raised(mut self, by_m: f64) -> Self {
        let pairs = [
            &mut self.shoulders,
            &mut self.elbows,
            &mut self.wrists,
            &mut self.hips,
            &mut self.knees,
            &mut self.ankles,
            &mut self.heels,
            &mut self.toes,
        ];
        let trunk = [&mut self.pelvis, &mut self.chest, &mut self.head];
        pairs.into_iter().flatten().chain(trunk).for_each(|joint| joint.z += by_m);
        self
    }

    /// Computes the joints of a body in a stance.
    pub fn new(build: &Build, stance: &Stance) -> Self {
        let h = build.height_m;
        let gait = Gait::new(h, stance.speed_mps);
        let motion = gait.pelvis(stance.phase);
        let bend = stance.bend_rad;
        let yaw = about_z(stance.heading_rad);
        let pelvis_turn = yaw * about_z(motion.torsion_rad);
        let thorax_turn =
            // The thorax turns against the pelvis while walking.
            yaw * about_z(-0.6 * motion.torsion_rad) * about_y(motion.lean_rad + bend);
        let head_turn = yaw * about_y(nod_rad(stance));
        let ground = Point3::new(stance.place.x, stance.place.y, 0.0);
        // A bending person pushes the hips back to keep the balance.
        let back = 0.12 * h * bend.sin();
        let height = hip_height(stance.seated) * h + motion.up_m;
        let pelvis = ground + yaw * Vector3::new(motion.forward_m - back, motion.left_m, height);
        let chest = pelvis + thorax_turn * Vector3::new(0.0, 0.0, TORSO * h);
        let neck = yaw * about_y(0.8 * bend + 0.3 * nod_rad(stance));
        let head = chest + neck * Vector3::new(0.01 * h, 0.0, (NECK + 0.5 * HEAD) * h);
        let mut skeleton = Self {
            posture: stance.posture,
            seated: stance.seated,
            pelvis,
            chest,
            head,
            world_from_pelvis: pelvis_turn,
            world_from_thorax: thorax_turn,
            world_from_head: head_turn,
            shoulders: [chest; 2],
            elbows: [chest; 2],
            wrists: [chest; 2],
            hips: [pelvis; 2],
            knees: [pelvis; 2],
            ankles: [pelvis; 2],
            heels: [pelvis; 2],
            toes: [pelvis; 2],
        };
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            // The other side is half a cycle later.
            let phase = stance.phase + 0.5 * side as f64;
            let limb = held(gait.limb(phase), side, stance);
            skeleton.place_arm(side, sign, build, &limb);
            skeleton.place_leg(side, sign, h, &limb, &yaw, gait.plant_m(phase));
        }
        skeleton
    }

    fn place_arm(&mut self, side: usize, sign: f64, build: &Build, limb: &LimbAngles) {
        let h = build.height_m;
        let turn = self.world_from_thorax * about_x(sign * ARMS_OUT_RAD);
        let [upper, lower] = [limb.shoulder, limb.shoulder + limb.elbow]
            .map(|angle| turn * Vector3::new(angle.sin(), 0.0, -angle.cos()));
        let out = Vector3::new(0.0, sign * SHOULDER * h * build.breadth, 0.0);
        self.shoulders[side] = self.chest + self.world_from_thorax * out;
        self.elbows[side] = self.shoulders[side] + upper * (UPPER_ARM * h);
        self.wrists[side] = self.elbows[side] + lower * (FOREARM * h);
    }

    /// Places a leg according to its joint angles, with its ankle moved forward by `plant_m`.
    fn place_leg(
        &mut self,
        side: usize,
        sign: f64,
        h: f64,
        limb: &LimbAngles,
        yaw: &Rotation3<f64>,
        plant_m: f64,
    ) {
        let shank = limb.hip - limb.knee;
        let out = Vector3::new(0.0, sign * HIP * h, 0.0);
        let hip = self.pelvis + self.world_from_pelvis * out;
        let ahead = (THIGH * limb.hip.sin() + SHANK * shank.sin()) * h + plant_m;
        let below = (THIGH * limb.hip.cos() + SHANK * shank.cos()) * h;
        // The angles of the model do not reach the floor exactly.
        let (knee, ankle) = leg(ahead, below.min(hip.z - ANKLE * h), h);
        let [knee, ankle] = [knee, ankle].map(|(x, down)| hip + yaw * Vector3::new(x, 0.0, -down));
        // A foot near the floor lies flat on it.
        let lifted = ((ankle.z - ANKLE * h) / (0.08 * h)).clamp(0.0, 1.0);
        let pitch = lifted * (shank + limb.ankle);
        let along = yaw * Vector3::new(pitch.cos(), 0.0, pitch.sin());
        let sole = ankle - yaw * Vector3::new(0.0, 0.0, 0.018 * h);
        self.hips[side] = hip;
        self.knees[side] = knee;
        self.ankles[side] = ankle;
        self.heels[side] = sole - along * (0.2 * FOOT * h);
        self.toes[side] = sole + along * (0.65 * FOOT * h);
        // Toes never sink into the floor.
        self.toes[side].z = self.toes[side].z.max(0.018 * h);
    }
}

/// Returns the height of the hips as a fraction of the body height; the shanks stay upright.
fn hip_height(seated: f64) -> f64 {
    ANKLE + SHANK + THIGH * (seated * SEATED.hip).cos()
}

/// Returns the distance of the feet in front of the hips, m.
pub fn feet_ahead_m(build: &Build, seated: f64) -> f64 {
    THIGH * build.height_m * (seated * SEATED.hip).sin()
}

/// Returns the angle by which the face is turned down, rad.
fn nod_rad(stance: &Stance) -> f64 {
    let phone = if stance.posture == Posture::Phone { PHONE_NOD_RAD } else { 0.0 };
    0.9 * stance.bend_rad + phone
}

/// Returns the joint angles of one side in a posture.
fn held(walking: LimbAngles, side: usize, stance: &Stance) -> LimbAngles {
    // The arms of a bent trunk hang down.
    let hanging = LimbAngles { shoulder: walking.shoulder + 1.2 * stance.bend_rad, ..walking };
    let upright = match stance.posture {
        Posture::Phone if side == 1 => {
            LimbAngles { shoulder: PHONE_ARM.0, elbow: PHONE_ARM.1, ..hanging }
        }
        _ => hanging,
    };
    upright.mix(&SEATED, stance.seated)
}

/// Returns knee and ankle (forward of the hip, below it) of a leg whose ankle should be at this
/// position. An ankle out of reach is lifted, and knees bend forward.
fn leg(ahead: f64, below: f64, h: f64) -> ((f64, f64), (f64, f64)) {
    let thigh = THIGH * h;
    let shank = SHANK * h;
    let reach = thigh + shank;
    // Some of the length is needed for the height of the hip.
    let ahead = ahead.clamp(-0.9 * reach, 0.9 * reach);
    let below = below.min((reach * reach - ahead * ahead).sqrt());
    let distance = ahead.hypot(below).max(1.0001 * (thigh - shank).abs());
    let cosine = (thigh * thigh + distance * distance - shank * shank) / (2.0 * thigh * distance);
    let at_hip = ahead.atan2(below) + cosine.clamp(-1.0, 1.0).acos();
    ((thigh * at_hip.sin(), thigh * at_hip.cos()), (ahead, below))
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
        Stance { speed_mps, phase, ..Stance::standing(Point2::new(2.0, 1.0), 0.5) }
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

    #[test]
    fn a_flat_foot_does_not_slide() {
        let build = Build { height_m: 1.70, breadth: 1.0 };
        for v in [0.5, 0.9, 1.3] {
            let cycle_s = Gait::new(1.70, v).cycle_s();
            let mut path = Vec::new();
            for i in 0..=20 {
                let phase = 0.08 + 0.34 * f64::from(i) / 20.0;
                let place = Point2::new(v * cycle_s * phase, 0.0);
                let stance = Stance { speed_mps: v, phase, ..Stance::standing(place, 0.0) };
                path.push(Skeleton::new(&build, &stance).ankles[0].x);
            }
            let spread = path.iter().copied().fold(f64::MIN, f64::max)
                - path.iter().copied().fold(f64::MAX, f64::min);
            assert!(spread < 0.03, "{v} m/s: {spread}");
        }
    }

    #[test]
    fn who_sits_or_bends_has_a_low_head() {
        let build = Build { height_m: 1.70, breadth: 1.0 };
        let sits = Stance { seated: 1.0, ..stance(0.0, 0.0) };
        let s = Skeleton::new(&build, &sits);
        assert!((1.05..1.30).contains(&s.head.z), "{}", s.head.z);
        assert!((0.40..0.55).contains(&s.knees[0].z) && s.ankles[0].z > 0.05);
        let bends = Stance { posture: Posture::Bending, bend_rad: 1.2, ..stance(0.0, 0.0) };
        let s = Skeleton::new(&build, &bends);
        assert!((1.0..1.4).contains(&s.head.z), "{}", s.head.z);
        assert!(s.wrists[0].z < 0.8, "hands reach down: {}", s.wrists[0].z);
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
                prop_assert!((shank - 1.0).abs() < 1e-6, "{shank}");
                prop_assert!(s.toes[side].z > 0.0 && s.heels[side].z > 0.0);
            }
        }
    }
}
