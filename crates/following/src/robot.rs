//! Settings of the robot: footprint, speed limit, kind of base.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{DiffDrive, Error, Result, settings};

use crate::collision_monitor::Footprint;

/// Largest coordinate of a corner of the footprint, m.
const MOST_M: f64 = 2.0;

/// Kind of a robot's base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Base {
    /// Two driven wheels with a speed each.
    #[default]
    Differential,
    /// Speed and turn rate are independent.
    Holonomic,
    /// Steered wheels: the turn rate is at most the speed divided by the minimum turning radius.
    Ackermann,
}

/// Odometry that a controller requires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OdometrySource {
    /// The robot does not move without odometry.
    #[default]
    Required,
    /// The robot moves without odometry.
    None,
}

settings! {
    /// Base of the robot: its drive, its outline and its odometry.
    pub struct RobotSettings {
        /// Half the distance between the driven wheels, m.
        #[schemars(range(min = 0.05, max = 1.0))]
        pub wheel_half_separation_m: f64 = 0.167,
        /// Standard deviation of a wheel's travel, as a fraction of it.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub wheel_slip: f64 = 0.02,
        /// Speed limit of a wheel, m/s; of the centre of the base if it is holonomic.
        #[schemars(range(min = 0.05, max = 0.9))]
        pub max_speed_mps: f64 = 0.9,
        /// Kind of the base: "differential"; "holonomic", whose speed and turn rate are independent
        /// (it is not driven sideways); or "ackermann", which steers like a car and does not turn
        /// in place.
        pub base: Base = Base::Differential,
        /// Minimum turning radius of an "ackermann" base, at the middle of its driven axle, m.
        #[schemars(range(min = 0.1, max = 20.0))]
        pub min_turn_radius_m: f64 = 0.5,
        /// Outline of the robot on the floor (Nav2's `footprint`): corners in order around it, x
        /// forward and y left of the point midway between its wheels, m. Include protruding parts
        /// and the payload.
        // An octagon around a disc of a radius of 0.25 m, somewhat more than the robot of P1.
        pub footprint: Vec<[f64; 2]> = vec![
            [0.25, 0.1],
            [0.25, -0.1],
            [0.1, -0.25],
            [-0.1, -0.25],
            [-0.25, -0.1],
            [-0.25, 0.1],
            [-0.1, 0.25],
            [0.1, 0.25],
        ],
        /// Height of the robot including its payload, m.
        #[schemars(range(min = 0.05, max = 3.0))]
        pub height_m: f64 = 1.4,
        /// Odometry: "required", or "none" for a controller that may drive without odometry, as if
        /// the robot were always at rest.
        pub odometry: OdometrySource = OdometrySource::Required,
    }
}

impl RobotSettings {
    /// Refuses a footprint that is none.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub fn check(&self) -> Result<()> {
        fn refuse(why: String) -> Result<()> {
            Err(Error::setting("footprint", why))
        }

        fn is_near(value: &f64) -> bool {
            (-MOST_M..=MOST_M).contains(value)
        }

        if !(3..=64).contains(&self.footprint.len()) {
            let count = self.footprint.len();
            return refuse(format!("must have 3 to 64 corners [x, y], not {count}"));
        }
        if let Some(far) = self.footprint.iter().find(|corner| !corner.iter().all(is_near)) {
            return refuse(format!("has a corner at {far:?}: they must be within {MOST_M} m"));
        }
        let width_m = self.footprint.iter().map(|[_, y]| y.abs()).fold(0.0, f64::max);
        if width_m < self.wheel_half_separation_m {
            let wheels_m = self.wheel_half_separation_m;
            return refuse(format!(
                "must be at least {wheels_m} m wide on each side, as `wheel_half_separation_m`, not {width_m}"
            ));
        }
        let footprint = Footprint::new(&self.footprint);
        if footprint.distance_m(&Point2::origin()) > 0.0 {
            return refuse("must hold the point between the wheels, [0, 0]".to_owned());
        }
        Ok(())
    }

    /// Returns the drive as the type of the core crate.
    pub fn wheels(&self) -> DiffDrive {
        DiffDrive { half_separation_m: self.wheel_half_separation_m, slip: self.wheel_slip }
    }

    /// Returns the largest amount of the turn rate at a speed, rad/s, by the geometry of the base:
    /// the speed that the outer wheel has left, or the least radius.
    pub(crate) fn turn_at(&self, speed_mps: f64) -> f64 {
        let rim = (self.max_speed_mps - speed_mps.abs()).max(0.0) / self.wheel_half_separation_m;
        match self.base {
            Base::Differential => rim,
            Base::Holonomic => f64::INFINITY,
            Base::Ackermann => rim.min(speed_mps.abs() / self.min_turn_radius_m),
        }
    }
}
