use nalgebra::{Point2, Vector2};

/// Joint of a person, in the order of the keypoints of the COCO data set. Left and right are those
/// of the person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum JointName {
    /// Tip of the nose.
    Nose,
    /// Left eye.
    LeftEye,
    /// Right eye.
    RightEye,
    /// Left ear.
    LeftEar,
    /// Right ear.
    RightEar,
    /// Left shoulder.
    LeftShoulder,
    /// Right shoulder.
    RightShoulder,
    /// Left elbow.
    LeftElbow,
    /// Right elbow.
    RightElbow,
    /// Left wrist.
    LeftWrist,
    /// Right wrist.
    RightWrist,
    /// Left hip.
    LeftHip,
    /// Right hip.
    RightHip,
    /// Left knee.
    LeftKnee,
    /// Right knee.
    RightKnee,
    /// Left ankle.
    LeftAnkle,
    /// Right ankle.
    RightAnkle,
}

impl JointName {
    /// All joints, in the order of COCO.
    pub const ALL: [Self; 17] = [
        Self::Nose,
        Self::LeftEye,
        Self::RightEye,
        Self::LeftEar,
        Self::RightEar,
        Self::LeftShoulder,
        Self::RightShoulder,
        Self::LeftElbow,
        Self::RightElbow,
        Self::LeftWrist,
        Self::RightWrist,
        Self::LeftHip,
        Self::RightHip,
        Self::LeftKnee,
        Self::RightKnee,
        Self::LeftAnkle,
        Self::RightAnkle,
    ];

    /// Returns its name in COCO and in files, like `left_shoulder`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nose => "nose",
            Self::LeftEye => "left_eye",
            Self::RightEye => "right_eye",
            Self::LeftEar => "left_ear",
            Self::RightEar => "right_ear",
            Self::LeftShoulder => "left_shoulder",
            Self::RightShoulder => "right_shoulder",
            Self::LeftElbow => "left_elbow",
            Self::RightElbow => "right_elbow",
            Self::LeftWrist => "left_wrist",
            Self::RightWrist => "right_wrist",
            Self::LeftHip => "left_hip",
            Self::RightHip => "right_hip",
            Self::LeftKnee => "left_knee",
            Self::RightKnee => "right_knee",
            Self::LeftAnkle => "left_ankle",
            Self::RightAnkle => "right_ankle",
        }
    }
}

/// One joint in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Place in the image, pixels.
    pub at: Point2<f64>,
    /// Probability that the joint is there and in sight, 0 to 1.
    pub score: f64,
}

/// Joints of a person in the image, as a pose network finds them.
///
/// ```
/// # use nalgebra::Point2;
/// # use tagalong_core::{Joint, JointName, Joints};
/// let mut all = [Joint { at: Point2::new(40.0, 60.0), score: 0.9 }; 17];
/// all[JointName::Nose as usize].at.y = 30.0;
/// all[JointName::LeftWrist as usize].at.y = 10.0;
/// let joints = Joints::new(all);
/// assert_eq!(joints.sure(JointName::Nose), Some(Point2::new(40.0, 30.0)));
/// assert!(joints.has_raised_hand());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Joints([Joint; 17]);

impl Joints {
    /// Score from which on a joint is drawn and used.
    pub const SURE: f64 = 0.3;
    /// Pairs of joints between which the body is drawn as a line.
    pub const BONES: [(JointName, JointName); 12] = [
        (JointName::LeftShoulder, JointName::RightShoulder),
        (JointName::LeftShoulder, JointName::LeftElbow),
        (JointName::LeftElbow, JointName::LeftWrist),
        (JointName::RightShoulder, JointName::RightElbow),
        (JointName::RightElbow, JointName::RightWrist),
        (JointName::LeftShoulder, JointName::LeftHip),
        (JointName::RightShoulder, JointName::RightHip),
        (JointName::LeftHip, JointName::RightHip),
        (JointName::LeftHip, JointName::LeftKnee),
        (JointName::LeftKnee, JointName::LeftAnkle),
        (JointName::RightHip, JointName::RightKnee),
        (JointName::RightKnee, JointName::RightAnkle),
    ];
    const HEAD: [JointName; 5] = [
        JointName::Nose,
        JointName::LeftEye,
        JointName::RightEye,
        JointName::LeftEar,
        JointName::RightEar,
    ];
    /// Distance of the shoulders of a person facing the camera, in heights of the trunk from the
    /// hips to the shoulders: means of grown-ups are 0.36 m and 0.50 m between these joints.
    const SHOULDERS_OF_TRUNK: f64 = 0.72;
    /// Cosine of the turn from which on its side does not matter: within 25 degrees.
    const FRONTAL: f64 = 0.9;

    /// Creates the joints of a person, in the order of [`JointName::ALL`].
    pub fn new(joints: [Joint; 17]) -> Self {
        Self(joints)
    }

    /// Returns a joint, however unsure it is.
    pub fn get(&self, name: JointName) -> &Joint {
        &self.0[name as usize]
    }

    /// Returns the place of a joint in the image, pixels, if its score is at least
    /// [`Joints::SURE`].
    pub fn sure(&self, name: JointName) -> Option<Point2<f64>> {
        let joint = self.get(name);
        (joint.score >= Self::SURE).then_some(joint.at)
    }

    /// Yields all joints with their names.
    pub fn iter(&self) -> impl Iterator<Item = (JointName, &Joint)> {
        JointName::ALL.into_iter().zip(&self.0)
    }

    /// Returns the middle of the sure joints of head and shoulders, pixels.
    pub fn upper_body_middle(&self) -> Option<Point2<f64>> {
        let shoulders = [JointName::LeftShoulder, JointName::RightShoulder];
        let names = Self::HEAD.iter().chain(&shoulders);
        let mut sum = Vector2::zeros();
        let mut count = 0;
        for at in names.filter_map(|name| self.sure(*name)) {
            sum += at.coords;
            count += 1;
        }
        (count > 0).then(|| Point2::from(sum / f64::from(count)))
    }

    /// Returns the joints in other places, each moved by `place`.
    pub fn moved(&self, place: impl Fn(Point2<f64>) -> Point2<f64>) -> Self {
        Self(self.0.map(|joint| Joint { at: place(joint.at), ..joint }))
    }

    /// Returns the ends of the lines of the body of which both are sure, pixels.
    pub fn bones(&self) -> Vec<[Point2<f64>; 2]> {
        let mut bones = Vec::new();
        for (from, to) in Self::BONES {
            if let (Some(from), Some(to)) = (self.sure(from), self.sure(to)) {
                bones.push([from, to]);
            }
        }
        bones
    }

    /// Returns true if every number is finite.
    pub fn is_sane(&self) -> bool {
        self.0.iter().all(|Joint { at, score }| {
            at.iter().all(|place| place.is_finite()) && score.is_finite()
        })
    }

    /// Returns true if a wrist is above the head: above the highest sure one of nose, eyes and ears.
    /// Without a sure wrist or a part of the head no hand is raised.
    pub fn has_raised_hand(&self) -> bool {
        let head = self.highest(&Self::HEAD);
        let hand = self.highest(&[JointName::LeftWrist, JointName::RightWrist]);
        match (hand, head) {
            (Some(hand), Some(head)) => hand < head,
            _ => false,
        }
    }

    /// Returns the row of the highest sure joint of some, pixels.
    fn highest(&self, names: &[JointName]) -> Option<f64> {
        let rows = names.iter().filter_map(|name| self.sure(*name)).map(|at| at.y);
        rows.min_by(f64::total_cmp)
    }

    /// Returns the direction in which the body is turned, rad from the x axis of the robot frame to the
    /// left, of an upright person at the bearing, rad. It is a coarse measure: the distance of the
    /// shoulders in the image tells how far the body is turned away from the camera, and the nose to
    /// which side. `None` where shoulders or hips are not sure, and where the side is not.
    pub fn body_direction_rad(&self, bearing_rad: f64) -> Option<f64> {
        let left = self.sure(JointName::LeftShoulder)?;
        let right = self.sure(JointName::RightShoulder)?;
        let hips = [JointName::LeftHip, JointName::RightHip].map(|hip| self.sure(hip));
        let [Some(left_hip), Some(right_hip)] = hips else { return None };
        let shoulders = nalgebra::center(&left, &right);
        let trunk = nalgebra::distance(&shoulders, &nalgebra::center(&left_hip, &right_hip));
        if trunk < 1.0 {
            return None;
        }
        // The left shoulder of a person facing the camera is on the right of the image.
        let cosine = ((left.x - right.x) / (Self::SHOULDERS_OF_TRUNK * trunk)).clamp(-1.0, 1.0);
        let side = if cosine.abs() >= Self::FRONTAL {
            1.0
        } else {
            (self.head_column()? - shoulders.x).signum()
        };
        // Facing the camera is the opposite of the bearing; a nose on the right of the image means that
        // the body is turned to its own left.
        let turned = bearing_rad + std::f64::consts::PI + side * cosine.acos();
        Some(turned.sin().atan2(turned.cos()))
    }

    /// Returns the column of the foremost part of the head that is sure: the nose, or the eyes.
    fn head_column(&self) -> Option<f64> {
        let eyes = [JointName::LeftEye, JointName::RightEye];
        let eye = eyes.into_iter().find_map(|eye| self.sure(eye));
        self.sure(JointName::Nose).or(eye).map(|at| at.x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A person 100 pixels wide and with a trunk of 100 pixels, facing the camera.
    fn person() -> [Joint; 17] {
        let mut all = [Joint { at: Point2::new(100.0, 300.0), score: 0.9 }; 17];
        for name in Joints::HEAD {
            all[name as usize].at = Point2::new(100.0, 60.0);
        }
        for (name, x, y) in [
            (JointName::LeftShoulder, 136.0, 100.0),
            (JointName::RightShoulder, 64.0, 100.0),
            (JointName::LeftHip, 120.0, 200.0),
            (JointName::RightHip, 80.0, 200.0),
        ] {
            all[name as usize].at = Point2::new(x, y);
        }
        all
    }

    fn moved(mut all: [Joint; 17], name: JointName, x: f64, y: f64) -> [Joint; 17] {
        all[name as usize].at = Point2::new(x, y);
        all
    }

    #[test]
    fn a_wrist_above_the_head_is_a_raised_hand() {
        assert!(!Joints::new(person()).has_raised_hand());
        let raised = moved(person(), JointName::RightWrist, 60.0, 59.0);
        assert!(Joints::new(raised).has_raised_hand());
        let at_shoulder = moved(person(), JointName::RightWrist, 60.0, 61.0);
        assert!(!Joints::new(at_shoulder).has_raised_hand());
        let mut unsure = raised;
        unsure[JointName::RightWrist as usize].score = 0.29;
        assert!(!Joints::new(unsure).has_raised_hand());
        let mut headless = raised;
        for name in Joints::HEAD {
            headless[name as usize].score = 0.0;
        }
        assert!(!Joints::new(headless).has_raised_hand());
    }

    fn degrees(all: [Joint; 17], bearing_deg: f64) -> Option<f64> {
        let direction = Joints::new(all).body_direction_rad(bearing_deg.to_radians());
        direction.map(|rad| rad.to_degrees())
    }

    #[test]
    fn shoulders_and_nose_tell_the_direction_of_the_body() {
        fn near(found: Option<f64>, wanted: f64) {
            let off = (found.expect("a direction") - wanted).rem_euclid(360.0);
            assert!(off.min(360.0 - off) < 1.0, "{found:?} {wanted}");
        }

        near(degrees(person(), 0.0), 180.0);
        near(degrees(person(), 30.0), -150.0);
        let away = moved(person(), JointName::LeftShoulder, 64.0, 100.0);
        let away = moved(away, JointName::RightShoulder, 136.0, 100.0);
        near(degrees(away, 0.0), 0.0);
        // Both shoulders in one line of sight: the nose is on the right of the image, and the right of
        // the image is the right of the robot.
        let aside = moved(person(), JointName::LeftShoulder, 100.0, 100.0);
        let aside = moved(aside, JointName::RightShoulder, 100.0, 100.0);
        near(degrees(moved(aside, JointName::Nose, 120.0, 60.0), 0.0), -90.0);
        near(degrees(moved(aside, JointName::Nose, 80.0, 60.0), 0.0), 90.0);
    }

    #[test]
    fn without_sure_joints_there_is_no_direction() {
        for name in [JointName::LeftShoulder, JointName::RightShoulder, JointName::LeftHip] {
            let mut unsure = person();
            unsure[name as usize].score = 0.1;
            assert_eq!(degrees(unsure, 0.0), None, "{name:?}");
        }
        let mut aside = moved(person(), JointName::LeftShoulder, 80.0, 100.0);
        for name in Joints::HEAD {
            aside[name as usize].score = 0.1;
        }
        assert_eq!(degrees(aside, 0.0), None, "the side is not known");
    }

    #[test]
    fn lines_of_the_body_need_both_ends() {
        let bones = Joints::new(person()).bones();
        assert_eq!(bones.len(), Joints::BONES.len());
        let mut unsure = person();
        unsure[JointName::LeftShoulder as usize].score = 0.0;
        assert_eq!(Joints::new(unsure).bones().len(), Joints::BONES.len() - 3);
    }

    #[test]
    fn names_are_in_the_order_of_coco() {
        let names = JointName::ALL.map(JointName::name);
        assert_eq!((names[0], names[5], names[16]), ("nose", "left_shoulder", "right_ankle"));
        for (place, name) in JointName::ALL.into_iter().enumerate() {
            assert_eq!(name as usize, place);
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_found() {
        assert!(Joints::new(person()).is_sane());
        assert!(!Joints::new(moved(person(), JointName::Nose, f64::NAN, 0.0)).is_sane());
        let mut odd = person();
        odd[3].score = f64::INFINITY;
        assert!(!Joints::new(odd).is_sane());
    }
}
