//! Readings of the further obstacle sensors.

use std::sync::Arc;

use super::{Event, Simulation};
use crate::footprint::{Outline, ROBOT_RADIUS_M};
use crate::obstacle_sensors::{
    BumperSettings, RangeSettings, ScannerSettings, SensorData, SensorReading,
};
use crate::scene::Scene;

/// Further sensors of a scene, and the number of readings that each has delivered.
#[derive(Clone, Debug)]
pub(super) struct Sensing(Vec<Sensor>);

/// One of the sensors.
#[derive(Clone, Debug)]
struct Sensor {
    name: Arc<str>,
    rate_hz: f64,
    delivered: u64,
    device: Device,
}

#[derive(Clone, Debug)]
enum Device {
    Scanner(Arc<ScannerSettings>),
    Range(Arc<RangeSettings>),
    Bumper(BumperSettings),
}

impl Sensing {
    pub(super) fn new(scene: &Scene) -> Self {
        fn sensor(name: &str, rate_hz: f64, device: Device) -> Sensor {
            Sensor { name: name.into(), rate_hz, delivered: 0, device }
        }

        let mut sensors = Vec::new();
        for laser in &scene.lasers {
            let device = Device::Scanner(Arc::new(laser.clone()));
            sensors.push(sensor(&laser.name, laser.rate_hz, device));
        }
        for range in &scene.ranges {
            let device = Device::Range(Arc::new(range.clone()));
            sensors.push(sensor(&range.name, range.rate_hz, device));
        }
        for bumper in &scene.bumpers {
            sensors.push(sensor(&bumper.name, bumper.rate_hz, Device::Bumper(bumper.clone())));
        }
        Self(sensors)
    }

    /// Returns the sensors that deliver a reading at this time, and counts it.
    fn due(&mut self, now_ns: u64) -> Vec<(Arc<str>, Device)> {
        let mut due = Vec::new();
        for sensor in &mut self.0 {
            let due_ns = (sensor.delivered as f64 * 1e9 / sensor.rate_hz) as u64;
            if due_ns <= now_ns {
                sensor.delivered += 1;
                due.push((Arc::clone(&sensor.name), sensor.device.clone()));
            }
        }
        due
    }
}

impl Simulation {
    /// Records the readings of the further sensors that are due.
    pub(super) fn sense(&mut self) {
        let due = self.sensing.due(self.now_ns);
        if due.is_empty() {
            return;
        }
        // The positions of people cost more time than all bumpers.
        let needs_world = due.iter().any(|(_, device)| !matches!(device, Device::Bumper(_)));
        let world = needs_world.then(|| self.world().0);
        let pose = self.world_from_robot(0.5);
        let seed = self.scene.seed.rotate_left(20) ^ self.now_ns.rotate_left(32);
        for (name, device) in due {
            let data = match (device, &world) {
                (Device::Bumper(bumper), _) => SensorData::Bumper(self.touches(&bumper)),
                (Device::Scanner(scanner), Some(world)) => {
                    let ranges = scanner.measure(world, &pose, seed);
                    SensorData::Scan { scanner, ranges }
                }
                (Device::Range(sensor), Some(world)) => {
                    let reading = sensor.measure(world, &pose, seed);
                    SensorData::Range { sensor, reading }
                }
                (_, None) => continue,
            };
            let at_ns = self.now_ns;
            let reading = SensorReading { name, at_ns, stamp_ns: at_ns, data };
            if let Some(reading) = self.injector.feel(reading) {
                self.record(at_ns, Event::Sensor(reading));
            }
        }
    }

    /// Returns true while the robot's body touches an object within the arc of a bumper.
    fn touches(&self, bumper: &BumperSettings) -> bool {
        let outline = self.outline(ROBOT_RADIUS_M);
        let mut gaps = self.gaps_to_people(&outline).chain(self.gaps_to_things(&outline));
        gaps.any(|gap| gap.presses(bumper.arc_deg))
    }

    /// Returns the outline of the robot: the footprint of the scene, or a disc of this radius.
    pub(super) fn outline(&self, radius_m: f64) -> Outline<'_> {
        match &self.scene.robot.footprint[..] {
            [] => Outline::Disc(radius_m),
            corners => Outline::Polygon(corners),
        }
    }
}
