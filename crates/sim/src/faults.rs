//! Faults during a ride: sensors, odometry, clock and wheels that fail at a given time.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::nearest;

use crate::camera_settings::CameraKind;
use crate::random::Random;
use crate::scene::Scene;

/// First stream of random numbers for the faults; each fault has its own.
const FIRST_STREAM: u64 = 64;
/// Fractions of the scene between which a random fault begins.
const DRAWN_BETWEEN: [f64; 2] = [0.2, 0.6];

/// Kind of an injected fault.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// The depth image is repeated with new stamps, while colour continues.
    FreezeDepth,
    /// All images of the camera are repeated with new stamps.
    FreezeAll,
    /// The scan of the laser scanner is repeated with new stamps.
    FreezeLaser,
    /// The depth image has no reading at all.
    BlankDepth,
    /// Each pixel of the depth image has the largest value, 65.535 m.
    SaturateDepth,
    /// Only `share` of the columns of the depth image have readings.
    DarkColumns,
    /// Noise with the standard deviation `size`, m, is added to the depth image.
    NoiseDepth,
    /// Rays of the laser scanner ahead are NaN, 0 or infinite: `share` of the circle.
    LaserInvalid,
    /// Rays of the laser scanner ahead are below its minimum range: `share` of the circle.
    LaserNear,
    /// Images arrive `size` seconds late.
    Delay,
    /// The last image arrives again and again with its old stamp.
    Resend,
    /// No image arrives.
    Drop,
    /// The laser scanner delivers no scan.
    DropLaser,
    /// The further obstacle sensors (`lasers`, `ranges`, `bumpers`) repeat their readings.
    FreezeSensors,
    /// The further obstacle sensors are silent.
    DropSensors,
    /// The poses of the odometry are not finite.
    NanOdometry,
    /// The odometry is silent.
    OdometrySilent,
    /// The values of the odometry do not change, but its stamps do.
    OdometryFrozen,
    /// The odometry measures `size` times the motion.
    OdometryWrong,
    /// The stamps of the odometry are `size` seconds ahead.
    OdometryLateStamps,
    /// The calibration of the camera changes to `size` times the focal length.
    CalibrationChanged,
    /// The camera turns `size` degrees to the left, and the static transforms change with it.
    MountMoved,
    /// The camera turns `size` degrees to the left, and the static transforms stay the same.
    MountKnocked,
    /// The wheels do not turn, whatever is commanded.
    WheelsStuck,
    /// The wheels turn as commanded, but `share` of their travel is lost on the ground.
    WheelsSlip,
    /// The base keeps executing its last command.
    WheelsRunaway,
    /// Commands reach the wheels `size` seconds late.
    WheelLatency,
    /// The clock of the robot is set back by `size` seconds.
    ClockBack,
    /// The clock of the robot is set forward by `size` seconds.
    ClockForward,
    /// The robot is switched off and reset while the enable button is stuck.
    EnableStuck,
}

/// Part of the robot that a fault concerns.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Any,
    Depth,
    Laser,
    Sensors,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [Self; 30] = [
        Self::FreezeDepth,
        Self::FreezeAll,
        Self::FreezeLaser,
        Self::BlankDepth,
        Self::SaturateDepth,
        Self::DarkColumns,
        Self::NoiseDepth,
        Self::LaserInvalid,
        Self::LaserNear,
        Self::Delay,
        Self::Resend,
        Self::Drop,
        Self::DropLaser,
        Self::FreezeSensors,
        Self::DropSensors,
        Self::NanOdometry,
        Self::OdometrySilent,
        Self::OdometryFrozen,
        Self::OdometryWrong,
        Self::OdometryLateStamps,
        Self::CalibrationChanged,
        Self::MountMoved,
        Self::MountKnocked,
        Self::WheelsStuck,
        Self::WheelsSlip,
        Self::WheelsRunaway,
        Self::WheelLatency,
        Self::ClockBack,
        Self::ClockForward,
        Self::EnableStuck,
    ];

    /// Returns the name in scenes and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::FreezeDepth => "freeze-depth",
            Self::FreezeAll => "freeze-all",
            Self::FreezeLaser => "freeze-laser",
            Self::BlankDepth => "blank-depth",
            Self::SaturateDepth => "saturate-depth",
            Self::DarkColumns => "dark-columns",
            Self::NoiseDepth => "noise-depth",
            Self::LaserInvalid => "laser-invalid",
            Self::LaserNear => "laser-near",
            Self::Delay => "delay",
            Self::Resend => "resend",
            Self::Drop => "drop",
            Self::DropLaser => "drop-laser",
            Self::FreezeSensors => "freeze-sensors",
            Self::DropSensors => "drop-sensors",
            Self::NanOdometry => "nan-odometry",
            Self::OdometrySilent => "odometry-silent",
            Self::OdometryFrozen => "odometry-frozen",
            Self::OdometryWrong => "odometry-wrong",
            Self::OdometryLateStamps => "odometry-late-stamps",
            Self::CalibrationChanged => "calibration-changed",
            Self::MountMoved => "mount-moved",
            Self::MountKnocked => "mount-knocked",
            Self::WheelsStuck => "wheels-stuck",
            Self::WheelsSlip => "wheels-slip",
            Self::WheelsRunaway => "wheels-runaway",
            Self::WheelLatency => "wheel-latency",
            Self::ClockBack => "clock-back",
            Self::ClockForward => "clock-forward",
            Self::EnableStuck => "enable-stuck",
        }
    }

    /// Returns true if the robot of a scene has the part that the fault concerns.
    pub fn applies_to(self, scene: &Scene) -> bool {
        match self.part() {
            Part::Any => true,
            Part::Depth => scene.camera.kind == CameraKind::Rgbd,
            Part::Laser => scene.laser.is_some(),
            Part::Sensors => scene.has_obstacle_sensors(),
        }
    }

    /// Returns true for a fault that may be drawn at random: a ride in which the robot is switched
    /// off shows nothing about its other faults.
    fn is_drawn(self) -> bool {
        self != Self::EnableStuck
    }

    fn part(self) -> Part {
        match self {
            Self::FreezeDepth
            | Self::BlankDepth
            | Self::SaturateDepth
            | Self::DarkColumns
            | Self::NoiseDepth => Part::Depth,
            Self::FreezeLaser | Self::LaserInvalid | Self::LaserNear | Self::DropLaser => {
                Part::Laser
            }
            Self::FreezeSensors | Self::DropSensors => Part::Sensors,
            _ => Part::Any,
        }
    }

    /// Returns the share if none is given; 0 for kinds without one.
    fn usual_share(self) -> f64 {
        match self {
            Self::DarkColumns => 0.12,
            Self::LaserInvalid | Self::LaserNear => 0.25,
            Self::WheelsSlip => 0.8,
            _ => 0.0,
        }
    }

    /// Returns the size if none is given; 0 for kinds without one.
    fn usual_size(self) -> f64 {
        match self {
            Self::NoiseDepth | Self::OdometryWrong => 0.5,
            Self::Delay => 1.5,
            Self::OdometryLateStamps => 3600.0,
            Self::CalibrationChanged => 1.1,
            Self::MountMoved | Self::MountKnocked => 10.0,
            Self::WheelLatency => 1.0,
            Self::ClockBack | Self::ClockForward => 5.0,
            _ => 0.0,
        }
    }

    /// Returns the minimum and the maximum plausible size; `None` for kinds without one.
    fn sizes(self) -> Option<[f64; 2]> {
        match self {
            Self::NoiseDepth => Some([0.0, 10.0]),
            Self::Delay | Self::WheelLatency => Some([0.0, 60.0]),
            Self::OdometryWrong => Some([-10.0, 10.0]),
            Self::OdometryLateStamps | Self::ClockBack | Self::ClockForward => Some([0.0, 1e6]),
            Self::CalibrationChanged => Some([0.1, 10.0]),
            Self::MountMoved | Self::MountKnocked => Some([-180.0, 180.0]),
            _ => None,
        }
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FaultKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(kind) = Self::ALL.into_iter().find(|kind| kind.name() == text) {
            return Ok(kind);
        }
        let names = Self::ALL.map(Self::name);
        let hint = nearest(text, names).map(|name| format!("; did you mean `{name}`?"));
        let hint = hint.unwrap_or_default();
        Err(format!("unknown fault `{text}`{hint} available: {}", names.join(", ")))
    }
}

/// Fault that is injected into a scene: a `[[faults.inject]]` section. Values that are left out are
/// drawn at random by the seed.
///
/// ```
/// use tagalong_sim::{FaultKind, InjectedFault, Scene};
/// let mut scene = Scene::default();
/// scene.faults.inject.push(InjectedFault::new(FaultKind::FreezeDepth).at(3.0).lasting(2.0));
/// let faults = scene.scheduled_faults();
/// assert_eq!(faults[0].to_string(), "freeze-depth from 3.0 s to 5.0 s");
/// assert_eq!("freeze-depth@3+2".parse(), Ok(scene.faults.inject[0].clone()));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct InjectedFault {
    /// Kind of the fault; if left out, the seed draws one that the robot can have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<FaultKind>,
    /// Time at which it begins, s; if left out, the seed draws one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// Duration, s; if left out, to the end of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lasts_s: Option<f64>,
    /// Share as used by the kind, 0 to 1; if left out, the default of the kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Size in the unit of the kind; if left out, the default of the kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
}

impl InjectedFault {
    /// Creates a fault of this kind, at a time that the seed draws.
    pub fn new(kind: FaultKind) -> Self {
        Self { kind: Some(kind), ..Self::default() }
    }

    /// Creates a fault whose kind and time the seed draws.
    pub fn random() -> Self {
        Self::default()
    }

    /// Returns the fault with the time at which it begins, s.
    #[must_use]
    pub fn at(self, at_s: f64) -> Self {
        Self { at_s: Some(at_s), ..self }
    }

    /// Returns the fault with its duration, s.
    #[must_use]
    pub fn lasting(self, lasts_s: f64) -> Self {
        Self { lasts_s: Some(lasts_s), ..self }
    }

    /// Returns the fault with another share.
    #[must_use]
    pub fn with_share(self, share: f64) -> Self {
        Self { share: Some(share), ..self }
    }

    /// Returns the fault with another size.
    #[must_use]
    pub fn with_size(self, size: f64) -> Self {
        Self { size: Some(size), ..self }
    }

    /// Returns the reason why the fault cannot be injected into a scene, if there is one.
    fn problem(&self, scene: &Scene) -> Option<String> {
        fn is_within(value: Option<f64>, least: f64, most: f64) -> bool {
            value.is_none_or(|value| (least..=most).contains(&value))
        }

        let shown = self.kind.map_or("random", FaultKind::name);
        if !is_within(self.at_s, 0.0, 86_400.0) {
            return Some(format!("faults.inject: at_s of {shown} must be in 0 to 86400"));
        }
        if !is_within(self.lasts_s, 0.0, 86_400.0) {
            return Some(format!("faults.inject: lasts_s of {shown} must be in 0 to 86400"));
        }
        if !is_within(self.share, 0.0, 1.0) {
            return Some(format!("faults.inject: share of {shown} must be in 0 to 1"));
        }
        let Some(kind) = self.kind else {
            let has_sizes = self.share.is_some() || self.size.is_some();
            return has_sizes
                .then(|| "faults.inject: share and size need a kind: name one".to_owned());
        };
        if self.share.is_some() && kind.usual_share() == 0.0 {
            return Some(format!("faults.inject: {kind} has no share: leave it out"));
        }
        match (self.size, kind.sizes()) {
            (Some(_), None) => {
                return Some(format!("faults.inject: {kind} has no size: leave it out"));
            }
            (Some(_), Some([least, most])) if !is_within(self.size, least, most) => {
                return Some(format!("faults.inject: size of {kind} must be in {least} to {most}"));
            }
            _ => {}
        }
        if kind.applies_to(scene) {
            return None;
        }
        let part = match kind.part() {
            Part::Laser => "a laser scanner: add a table [laser]",
            Part::Sensors => "a further sensor: add one of [[lasers]], [[ranges]], [[bumpers]]",
            Part::Depth | Part::Any => "a depth camera: set camera.kind = \"rgbd\"",
        };
        Some(format!("faults.inject: {kind} needs {part}"))
    }

    /// Returns the fault with all values that the seed draws.
    fn scheduled(&self, scene: &Scene, mut random: Random) -> ScheduledFault {
        // Always drawn, so that giving a time does not change the drawn kind.
        let able =
            FaultKind::ALL.into_iter().filter(|kind| kind.is_drawn() && kind.applies_to(scene));
        let able: Vec<FaultKind> = able.collect();
        let drawn_kind = random.pick(&able);
        let [first, last] = DRAWN_BETWEEN;
        let drawn_s = scene.duration_s * random.between(first, last);
        let kind = self.kind.unwrap_or(drawn_kind);
        let from_s = self.at_s.unwrap_or(drawn_s);
        ScheduledFault {
            kind,
            from_s,
            to_s: self.lasts_s.map_or(f64::INFINITY, |lasts_s| from_s + lasts_s),
            share: self.share.unwrap_or_else(|| kind.usual_share()),
            size: self.size.unwrap_or_else(|| kind.usual_size()),
        }
    }
}

/// Reads `KIND[@AT[+LASTS]]`, where the kind may be `random`.
impl FromStr for InjectedFault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        fn seconds(text: &str) -> Result<f64, String> {
            let value: f64 = text.parse().map_err(|_| format!("`{text}` is no time in seconds"))?;
            if (0.0..=86_400.0).contains(&value) {
                Ok(value)
            } else {
                Err(format!("{text} s must be in 0 to 86400"))
            }
        }

        let parts = text.split_once('@');
        let kind = parts.map_or(text, |(kind, _)| kind);
        let mut fault = match kind {
            "random" => Self::random(),
            kind => Self::new(kind.parse()?),
        };
        let Some((_, times)) = parts else { return Ok(fault) };
        let times = times.split_once('+').map_or((times, None), |(at, lasts)| (at, Some(lasts)));
        fault.at_s = Some(seconds(times.0)?);
        fault.lasts_s = times.1.map(seconds).transpose()?;
        Ok(fault)
    }
}

/// Injected fault with its times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScheduledFault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Time at which it begins, s since the start.
    pub from_s: f64,
    /// Time at which it ends, s; infinite for the end of the scene.
    #[serde(serialize_with = "finite")]
    pub to_s: f64,
    /// Share as used by the kind.
    pub share: f64,
    /// Size in the unit of the kind.
    pub size: f64,
}

impl ScheduledFault {
    /// Returns true while the fault is present.
    pub fn is_active(&self, at_s: f64) -> bool {
        self.from_s <= at_s && at_s < self.to_s
    }
}

impl fmt::Display for ScheduledFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} from {:.1} s ", self.kind, self.from_s)?;
        if self.to_s.is_finite() { write!(f, "to {:.1} s", self.to_s) } else { f.write_str("on") }
    }
}

/// Serialises a time; an infinite one becomes none, because JSON has no number for it.
fn finite<S: serde::Serializer>(seconds: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    seconds.is_finite().then_some(*seconds).serialize(serializer)
}

impl Scene {
    /// Returns true if the robot has further obstacle sensors.
    fn has_obstacle_sensors(&self) -> bool {
        !(self.lasers.is_empty() && self.ranges.is_empty() && self.bumpers.is_empty())
    }

    /// Returns the injected faults with their times, in the order of the scene.
    pub fn scheduled_faults(&self) -> Vec<ScheduledFault> {
        let faults = (FIRST_STREAM..).zip(&self.faults.inject);
        faults
            .map(|(stream, fault)| fault.scheduled(self, Random::new(self.seed, stream)))
            .collect()
    }

    /// Rejects faults that cannot be injected into this scene.
    ///
    /// # Errors
    /// A message with the wrong value and the remedy.
    pub fn check_faults(&self) -> Result<(), String> {
        let problem = self.faults.inject.iter().find_map(|fault| fault.problem(self));
        problem.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(text: &str) -> Result<Scene, String> {
        Scene::parse(text).map_err(|error| error.render("s.toml", text))
    }

    #[test]
    fn names_are_those_of_toml() {
        for kind in FaultKind::ALL {
            let text = format!(
                "[laser]\n[[bumpers]]\nname = \"b\"\n[[faults.inject]]\nkind = \"{kind}\"\n"
            );
            let read = scene(&text).unwrap();
            assert_eq!(read.faults.inject, [InjectedFault::new(kind)]);
            assert_eq!(kind.name().parse(), Ok(kind));
        }
    }

    #[test]
    fn arguments_have_a_kind_and_times() {
        fn read(text: &str) -> Result<InjectedFault, String> {
            text.parse::<InjectedFault>()
        }

        let delay = InjectedFault::new(FaultKind::Delay);
        assert_eq!(read("delay"), Ok(delay.clone()));
        assert_eq!(read("delay@4.5"), Ok(delay.clone().at(4.5)));
        assert_eq!(read("delay@4.5+2"), Ok(delay.at(4.5).lasting(2.0)));
        assert_eq!(read("random@3"), Ok(InjectedFault::random().at(3.0)));
        assert!(read("freeze-dept").unwrap_err().contains("did you mean `freeze-depth`?"));
        assert!(read("delay@soon").unwrap_err().contains("no time in seconds"));
        assert!(read("delay@-1").is_err() && read("delay@1+NaN").is_err());
    }

    #[test]
    fn the_seed_draws_what_is_left_out() {
        fn drawn(seed: u64) -> ScheduledFault {
            let mut scene = Scene { seed, ..Scene::default() };
            scene.faults.inject.push(InjectedFault::random());
            scene.scheduled_faults()[0]
        }

        assert_eq!(drawn(1), drawn(1));
        let kinds: std::collections::BTreeSet<FaultKind> =
            (0..300).map(|seed| drawn(seed).kind).collect();
        // The default robot has a depth camera, but no laser scanner and no further sensors; the
        // enable that sticks is not drawn.
        assert_eq!(kinds.len(), FaultKind::ALL.len() - 7);
        assert!((0..300).all(|seed| (2.0..=6.0).contains(&drawn(seed).from_s)));
        assert!(drawn(1).to_s.is_infinite());
    }

    #[test]
    fn faults_that_the_robot_cannot_have_are_refused_with_a_remedy() {
        for (fault, said) in [
            ("kind = \"freeze-laser\"", "add a table [laser]"),
            ("kind = \"drop\"\nshare = 0.5", "drop has no share"),
            ("kind = \"drop\"\nsize = 0.5", "drop has no size"),
            ("kind = \"delay\"\nsize = -1.0", "must be in 0 to 60"),
            ("kind = \"delay\"\nat_s = nan", "at_s` must be a finite number"),
            ("share = 0.5", "name one"),
            ("kind = \"dark-columns\"\nshare = 1.5", "must be in 0 to 1"),
        ] {
            let error = scene(&format!("[[faults.inject]]\n{fault}\n")).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        let error = scene("[camera]\nkind = \"stereo\"\n[[faults.inject]]\nkind = \"blank-depth\"");
        assert!(error.unwrap_err().contains("needs a depth camera"));
    }
}
