use tagalong_config::Registry;
use tagalong_core::{Controller, Scene, Twist, WheelSpeeds};

use super::{mood, register_with_fault};

pub fn register(registry: &mut Registry, name: &'static str) {
    let plugin = move || Proportional { fault: name, mood: mood(), last: Twist::STOP };
    register_with_fault!(registry, controller, name, plugin);
}

/// Controller with speeds in proportion to distance and bearing.
struct Proportional {
    fault: &'static str,
    mood: f64,
    last: Twist,
}

impl Proportional {
    fn towards(&self, x: f64, y: f64, scene: &Scene<'_>) -> Twist {
        let forward = (0.5 * (x - 1.2)).clamp(0.0, 0.6);
        let turn = scene.wheels.half_separation_m * y.atan2(x);
        let extra = match self.fault {
            "moody" => 1e-3 * self.mood,
            "one-sided" => 0.05,
            _ => 0.0,
        };
        let limit = if self.fault == "reckless" { 1.0 } else { scene.max_speed_mps };
        let faster = if self.fault == "reckless" { 2.0 } else { 1.0 };
        let wheel = |speed: f64| (faster * speed).clamp(-limit, limit);
        let left = wheel(forward - turn + extra);
        let right = wheel(forward + turn);
        scene.wheels.twist(WheelSpeeds { left, right })
    }
}

impl Controller for Proportional {
    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        assert!(self.fault != "panics" || scene.frame.camera.width > 1, "cannot see");
        let Some(target) = scene.target else {
            return if self.fault == "never-stops" { self.last } else { Twist::STOP };
        };
        let place = target.estimate.person.position;
        if place.iter().all(|v| v.is_finite()) {
            self.last = self.towards(place.x, place.y, scene);
            self.last
        } else {
            Twist::STOP
        }
    }
}
