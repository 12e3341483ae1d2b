//! Injected faults on the way from the sensors to the robot's computer.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, UnitQuaternion, Vector2, Vector3};
use tagalong_core::{DepthImage, Images};
use tagalong_geometry::{Camera, Lens};
use tagalong_math::number_at;

use super::{Event, OdometryReading, Shot};
use crate::faults::{FaultKind, ScheduledFault};
use crate::obstacle_sensors::{SensorData, SensorReading};
use crate::random::{normal_at, uniform_at};
use crate::robot::{Encoder, WheelFaults};

/// Depth of a saturated pixel, m: the maximum of 16 bits in millimetres.
const SATURATED_M: f32 = 65.535;
/// Minimum distance after noise is added, m.
const NEAREST_NOISY_M: f32 = 0.001;

/// Injected faults of a scene, with the data that they repeat.
#[derive(Clone, Debug, Default)]
pub(super) struct Injector {
    faults: Vec<ScheduledFault>,
    seed: u64,
    /// Images before a freeze.
    held: Images,
    /// Scan before a freeze, m.
    held_scan: Option<Vec<f32>>,
    /// Readings of further sensors before a freeze, by the name of the sensor.
    held_readings: BTreeMap<Arc<str>, SensorData>,
    /// The last shot that arrived.
    last: Option<Box<Shot>>,
    /// Odometry before a freeze.
    reading: Option<OdometryReading>,
    /// Unchanged odometry of the previous step.
    whole: Option<OdometryReading>,
    odometer: Option<Odometer>,
}

/// Odometry that has measured another motion than the robot's for some time.
#[derive(Clone, Copy, Debug)]
struct Odometer {
    /// Pose that was reported instead.
    told: Isometry2<f64>,
    /// Angles of the wheels that were reported instead, rad.
    angles_rad: [f64; 2],
}

impl Injector {
    pub(super) fn new(faults: Vec<ScheduledFault>, seed: u64) -> Self {
        Self { faults, seed, ..Self::default() }
    }

    /// Returns the faults.
    pub(super) fn faults(&self) -> &[ScheduledFault] {
        &self.faults
    }

    /// Returns the fault of a kind that is active at a time.
    fn active(&self, kind: FaultKind, at_ns: u64) -> Option<&ScheduledFault> {
        let at_s = at_ns as f64 * 1e-9;
        self.faults.iter().find(|fault| fault.kind == kind && fault.is_active(at_s))
    }

    fn is_active(&self, kind: FaultKind, at_ns: u64) -> bool {
        self.active(kind, at_ns).is_some()
    }

    /// Returns the size of a fault that is active at a time; 0 without one.
    fn size(&self, kind: FaultKind, at_ns: u64) -> f64 {
        self.active(kind, at_ns).map_or(0.0, |fault| fault.size)
    }

    /// Returns true if the images at this time never arrive.
    pub(super) fn drops(&self, at_ns: u64) -> bool {
        self.is_active(FaultKind::Drop, at_ns)
    }

    /// Returns the time on the robot's clock, ns.
    pub(super) fn robot_clock_ns(&self, at_ns: u64) -> u64 {
        let ahead_s = self.size(FaultKind::ClockForward, at_ns);
        // No stamp may be before the start.
        let back_s = self
            .active(FaultKind::ClockBack, at_ns)
            .map_or(0.0, |fault| fault.size.min(fault.from_s));
        at_ns.saturating_add((ahead_s * 1e9) as u64).saturating_sub((back_s * 1e9) as u64)
    }

    /// Returns the state of the wheels.
    pub(super) fn wheels(&self, at_ns: u64) -> WheelFaults {
        WheelFaults {
            stuck: self.is_active(FaultKind::WheelsStuck, at_ns),
            runaway: self.is_active(FaultKind::WheelsRunaway, at_ns),
            grip: 1.0 - self.active(FaultKind::WheelsSlip, at_ns).map_or(0.0, |fault| fault.share),
            latency_s: self.active(FaultKind::WheelLatency, at_ns).map(|fault| fault.size),
        }
    }

    /// Returns the camera with its mount at a time.
    pub(super) fn mounted(&self, camera: &Camera, at_ns: u64) -> Camera {
        let turned_deg =
            self.size(FaultKind::MountMoved, at_ns) + self.size(FaultKind::MountKnocked, at_ns);
        turned(camera, turned_deg)
    }

    /// Returns the camera as the robot describes it at a time; the same object while it is
    /// unchanged.
    pub(super) fn described(&self, camera: &Arc<Camera>, at_ns: u64) -> Arc<Camera> {
        let calibrated = self.active(FaultKind::CalibrationChanged, at_ns);
        let turned_deg = self.size(FaultKind::MountMoved, at_ns);
        if calibrated.is_none() && turned_deg == 0.0 {
            return Arc::clone(camera);
        }
        let mut described = turned(camera, turned_deg);
        if let (Some(fault), Lens::Pinhole(lens)) = (calibrated, &mut described.lens) {
            lens.fx *= fault.size;
            lens.fy *= fault.size;
        }
        Arc::new(described)
    }

    /// Returns the images and the scan of a moment as they arrive.
    pub(super) fn deliver(&mut self, mut shot: Shot) -> Shot {
        if self.faults.is_empty() {
            return shot;
        }
        let at_ns = shot.captured_ns;
        self.freeze(&mut shot);
        if let Some(depth) = shot.images.depth.take() {
            shot.images.depth = Some(self.broken_depth(depth, at_ns));
        }
        self.break_scan(&mut shot);
        shot.stamp_ns = self.robot_clock_ns(at_ns);
        shot.depth_ns = shot.stamp_ns.saturating_add(shot.depth_ns - at_ns);
        shot.recorded_ns += (self.size(FaultKind::Delay, at_ns) * 1e9) as u64;
        shot.arrived_ns = self.robot_clock_ns(shot.recorded_ns);
        self.resend(shot)
    }

    /// Returns the last shot instead of a new one while the camera repeats it.
    fn resend(&mut self, shot: Shot) -> Shot {
        let resends = self.is_active(FaultKind::Resend, shot.captured_ns);
        if let Some(last) = self.last.as_ref().filter(|_| resends) {
            let Shot { recorded_ns, arrived_ns, .. } = shot;
            return Shot { recorded_ns, arrived_ns, ..Shot::clone(last) };
        }
        self.last = Some(Box::new(shot.clone()));
        shot
    }

    /// Repeats frozen data, and stores the other data.
    fn freeze(&mut self, shot: &mut Shot) {
        let at_ns = shot.captured_ns;
        let all = self.is_active(FaultKind::FreezeAll, at_ns);
        let depth = all || self.is_active(FaultKind::FreezeDepth, at_ns);
        let Images { colour, grey, right, .. } = &mut shot.images;
        repeat(colour, &mut self.held.colour, all);
        repeat(grey, &mut self.held.grey, all);
        repeat(right, &mut self.held.right, all);
        repeat(&mut shot.images.depth, &mut self.held.depth, depth);
        let scan = self.is_active(FaultKind::FreezeLaser, at_ns);
        repeat(&mut shot.laser, &mut self.held_scan, scan);
    }

    fn broken_depth(&self, mut depth: Arc<DepthImage>, at_ns: u64) -> Arc<DepthImage> {
        if self.is_active(FaultKind::BlankDepth, at_ns) {
            return Arc::new(depth.map(|_| f32::NAN));
        }
        if self.is_active(FaultKind::SaturateDepth, at_ns) {
            return Arc::new(depth.map(|_| SATURATED_M));
        }
        if let Some(fault) = self.active(FaultKind::NoiseDepth, at_ns) {
            let seed = number_at(self.seed, at_ns);
            let pixels = Arc::make_mut(&mut depth).pixels_mut().iter_mut();
            for (z, key) in pixels.zip(0..) {
                let noisy = *z + (fault.size * normal_at(seed, key)) as f32;
                // A pixel without a reading is left without one.
                *z = if z.is_nan() { *z } else { noisy.max(NEAREST_NOISY_M) };
            }
        }
        if let Some(fault) = self.active(FaultKind::DarkColumns, at_ns) {
            let width = depth.width();
            let lit = lit_columns(width, fault.share, self.seed);
            let pixels = Arc::make_mut(&mut depth).pixels_mut().iter_mut();
            for (z, lit) in pixels.zip(lit.iter().cycle()) {
                *z = if *lit { *z } else { f32::NAN };
            }
        }
        depth
    }

    fn break_scan(&self, shot: &mut Shot) {
        let at_ns = shot.captured_ns;
        if self.is_active(FaultKind::DropLaser, at_ns) {
            shot.laser = None;
        }
        let Some(ranges) = &mut shot.laser else { return };
        let seed = number_at(self.seed, at_ns ^ 1);
        for kind in [FaultKind::LaserInvalid, FaultKind::LaserNear] {
            let Some(fault) = self.active(kind, at_ns) else { continue };
            let rays = ranges.len();
            for (ray, range) in ranges.iter_mut().enumerate() {
                // The middle ray points forward, so the share is counted from the middle.
                let off = (ray as f64 + 0.5) / rays as f64 - 0.5;
                if off.abs() <= 0.5 * fault.share {
                    *range = broken_range(kind, uniform_at(seed, ray as u64));
                }
            }
        }
    }

    /// Returns the reading of a further sensor as it arrives; `None` if it does not.
    pub(super) fn feel(&mut self, mut reading: SensorReading) -> Option<SensorReading> {
        let at_ns = reading.at_ns;
        reading.stamp_ns = self.robot_clock_ns(at_ns);
        if self.is_active(FaultKind::DropSensors, at_ns) {
            return None;
        }
        let is_frozen = self.is_active(FaultKind::FreezeSensors, at_ns);
        match self.held_readings.get(&reading.name) {
            Some(held) if is_frozen => reading.data = held.clone(),
            _ => {
                self.held_readings.insert(Arc::clone(&reading.name), reading.data.clone());
            }
        }
        Some(reading)
    }

    /// Returns the reading of the odometry as it arrives, or an event without one.
    pub(super) fn hear(&mut self, reading: OdometryReading) -> Event {
        if self.faults.is_empty() {
            return Event::Odometry(reading);
        }
        let at_ns = reading.at_ns;
        let mut heard = self.mismeasured(reading);
        heard.stamp_ns = self.robot_clock_ns(at_ns);
        match self.reading.filter(|_| self.is_active(FaultKind::OdometryFrozen, at_ns)) {
            Some(held) => {
                heard.odom_from_robot = held.odom_from_robot;
                heard.speed_mps = held.speed_mps;
                heard.turn_rate = held.turn_rate;
                heard.encoders = held.encoders;
            }
            None => self.reading = Some(heard),
        }
        if self.is_active(FaultKind::NanOdometry, at_ns) {
            heard.odom_from_robot = Isometry2::new(Vector2::repeat(f64::NAN), f64::NAN);
        }
        let ahead_s = self.size(FaultKind::OdometryLateStamps, at_ns);
        heard.stamp_ns = heard.stamp_ns.saturating_add((ahead_s * 1e9) as u64);
        if self.is_active(FaultKind::OdometrySilent, at_ns) {
            return Event::NoOdometry { at_ns };
        }
        Event::Odometry(heard)
    }

    /// Returns the reading with the motion that the odometry measures.
    fn mismeasured(&mut self, whole: OdometryReading) -> OdometryReading {
        let factor =
            self.active(FaultKind::OdometryWrong, whole.at_ns).map_or(1.0, |fault| fault.size);
        let before = self.whole.replace(whole).unwrap_or(whole);
        // Before the first fault nothing is accumulated, so that the reading is unchanged.
        if factor == 1.0 && self.odometer.is_none() {
            return whole;
        }
        let mut odometer = self.odometer.unwrap_or(Odometer {
            told: before.odom_from_robot,
            angles_rad: before.encoders.map(|encoder| encoder.angle_rad),
        });
        let moved = before.odom_from_robot.inverse() * whole.odom_from_robot;
        let turn = moved.rotation.angle();
        odometer.told *= Isometry2::new(moved.translation.vector * factor, turn * factor);
        let encoders = whole.encoders.iter().zip(before.encoders);
        for (told, (now, before)) in odometer.angles_rad.iter_mut().zip(encoders) {
            *told += factor * (now.angle_rad - before.angle_rad);
        }
        self.odometer = Some(odometer);
        OdometryReading {
            odom_from_robot: odometer.told,
            speed_mps: whole.speed_mps * factor,
            turn_rate: whole.turn_rate * factor,
            encoders: [0, 1].map(|side| Encoder {
                angle_rad: odometer.angles_rad[side],
                rate_rad_s: whole.encoders[side].rate_rad_s * factor,
            }),
            ..whole
        }
    }
}

/// Replaces new data by the stored data while it is frozen, and otherwise stores the new data.
fn repeat<T: Clone>(data: &mut Option<T>, held: &mut Option<T>, is_frozen: bool) {
    match held {
        Some(held) if is_frozen && data.is_some() => *data = Some(held.clone()),
        _ => held.clone_from(data),
    }
}

/// Returns the range of a broken ray; `chance` in 0 to 1 selects one.
fn broken_range(kind: FaultKind, chance: f64) -> f32 {
    if kind == FaultKind::LaserNear {
        return f32::NEG_INFINITY;
    }
    match chance {
        chance if chance < 1.0 / 3.0 => f32::NAN,
        chance if chance < 2.0 / 3.0 => 0.0,
        _ => f32::INFINITY,
    }
}

/// Returns the columns that have readings: a scattered share of them.
fn lit_columns(width: usize, share: f64, seed: u64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..width).collect();
    order.sort_by_key(|column| number_at(seed, *column as u64));
    let mut lit = vec![false; width];
    let count = (share * width as f64).round() as usize;
    for column in order.into_iter().take(count) {
        lit[column] = true;
    }
    lit
}

/// Returns a camera that is turned to the left by this angle, at the same position.
fn turned(camera: &Camera, left_deg: f64) -> Camera {
    if left_deg == 0.0 {
        return camera.clone();
    }
    let pose = camera.robot_from_camera;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), left_deg.to_radians());
    let robot_from_camera = Isometry3::from_parts(pose.translation, turn * pose.rotation);
    Camera { robot_from_camera, ..camera.clone() }
}

#[cfg(test)]
mod tests;
