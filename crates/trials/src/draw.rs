use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Isometry2;
use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Stamp, WheelSpeeds};
use tagalong_geometry::{Camera, Lens};
use tagalong_sim::{Event, Scene, Shot, Simulation, Truth};
use tagalong_vision::Unwrapping;

/// Standard deviation of odometry as a fraction of the travel, as the log
/// reader takes it where its `[input] odometry_sigma` is left out.
pub const ODOMETRY_SIGMA: f64 = 0.02;
/// Images that come up to this many frames late are put in order, as the log
/// reader does.
const REORDERED: usize = 3;
/// Odometry is kept for this long before the oldest image that waits, ns: longer than any image is
/// late.
const KEPT_NS: u64 = 1_000_000_000;

/// Input of a pipeline at one moment of a scene, and the truth at that moment.
pub struct SimulatedFrame {
    /// The frame.
    pub frame: Frame,
    /// Everybody.
    pub truth: Vec<Truth>,
    /// The robot in the odometry frame, as it believes, m and rad.
    pub odom_from_robot: Isometry2<f64>,
    /// The robot in the world, as it is, m and rad.
    pub world_from_robot: Isometry2<f64>,
}

/// A scene as the frames of a log.
pub struct Draw {
    simulation: Simulation,
    camera: Arc<Camera>,
    unwrapping: Unwrapping,
    odometry: BTreeMap<u64, Isometry2<f64>>,
    /// Images by their stamps, ns.
    waiting: BTreeMap<u64, Shot>,
    patience: usize,
    previous: Option<(Stamp, Isometry2<f64>)>,
    index: u64,
}

impl Draw {
    /// Frames in the order of their stamps, as out of a log; `threads` draw.
    pub fn new(scene: &Scene, threads: usize) -> Self {
        Self::with_patience(scene, threads, REORDERED)
    }

    /// Frames in the order in which they arrive, as on a robot, which may be
    /// steered between them.
    pub fn live(scene: &Scene, threads: usize) -> Self {
        Self::with_patience(scene, threads, 0)
    }

    fn with_patience(scene: &Scene, threads: usize, patience: usize) -> Self {
        let simulation = Simulation::new(scene, threads);
        Self {
            camera: Arc::new(seen_by(&simulation)),
            unwrapping: Unwrapping::default(),
            simulation,
            odometry: BTreeMap::new(),
            waiting: BTreeMap::new(),
            patience,
            previous: None,
            index: 0,
        }
    }

    /// Commands the wheels from now on; see [`Simulation::steer`].
    pub fn steer(&mut self, command: WheelSpeeds) {
        self.simulation.steer(command);
    }

    /// The camera of all frames, as the pipelines believe it to be.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The scene in motion.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The next frame; `None` at the end of the scene.
    pub fn next_frame(&mut self) -> Option<SimulatedFrame> {
        self.next_frame_while(|_, _| None)
    }

    /// Returns the next frame, with a caller at the wheels until it comes: `at_wheels` receives all
    /// events, and may command them.
    pub fn next_frame_while(
        &mut self,
        mut at_wheels: impl FnMut(&Simulation, &Event) -> Option<WheelSpeeds>,
    ) -> Option<SimulatedFrame> {
        while self.waiting.len() <= self.patience {
            let event = self.simulation.next_event();
            if let Some(wheels) = event.as_ref().and_then(|e| at_wheels(&self.simulation, e)) {
                self.simulation.steer(wheels);
            }
            match event {
                Some(Event::Odometry(reading)) => {
                    self.odometry.insert(reading.at_ns, reading.odom_from_robot);
                    self.forget_odometry(reading.at_ns);
                }
                Some(Event::Shot(shot)) => drop(self.waiting.insert(shot.captured_ns, *shot)),
                Some(Event::Webcam(_)) => {}
                None => break,
            }
        }
        let (_, shot) = self.waiting.pop_first()?;
        Some(self.simulated(shot))
    }

    /// Drops odometry that is older than any image to come: at few images a second those that wait
    /// to be put in order are old themselves.
    fn forget_odometry(&mut self, now_ns: u64) {
        let oldest_ns = self.waiting.keys().next().map_or(now_ns, |waits| now_ns.min(*waits));
        self.odometry = self.odometry.split_off(&oldest_ns.saturating_sub(KEPT_NS));
    }

    fn simulated(&mut self, shot: Shot) -> SimulatedFrame {
        self.index += 1;
        let stamp = Stamp::from_nanos(shot.captured_ns);
        // The odometry speaks at every step of the simulation, so at this one.
        let odom_from_robot = self
            .odometry
            .range(..=shot.captured_ns)
            .next_back()
            .map_or_else(Isometry2::identity, |(_, pose)| *pose);
        let motion = self.motion(stamp, odom_from_robot);
        let camera = Arc::clone(&self.camera);
        let scan = self.simulation.laser().zip(shot.laser.as_deref());
        let laser = scan.map(|(laser, ranges)| laser.scan(ranges));
        let frame = Frame::new(self.index, stamp, camera, motion, self.as_logged(shot.images));
        SimulatedFrame {
            frame: frame.with_laser(laser),
            truth: shot.truth,
            odom_from_robot,
            world_from_robot: shot.world_from_robot,
        }
    }

    /// Converts images as a log does: depth is stored in millimetres, and log readers unwrap
    /// circles. The panorama of a simulation fits its images, so nothing is ever left wrapped.
    fn as_logged(&mut self, images: Images) -> Images {
        if let Some(panorama) = self.camera.panorama() {
            return self.unwrapping.apply(panorama, &images).unwrap_or(images);
        }
        // Recorded depth has whole millimetres.
        let round = |depth: Arc<DepthImage>| Arc::new(depth.map(|z| (1000.0 * z).round() * 0.001));
        Images { depth: images.depth.map(round), ..images }
    }

    /// From the frame before; none to a frame that is older than that.
    fn motion(&mut self, stamp: Stamp, here: Isometry2<f64>) -> EgoMotion {
        // An image that is older than the last one has no motion since then.
        let before = self.previous.filter(|(then, _)| *then < stamp);
        if before.is_some() || self.previous.is_none() {
            self.previous = Some((stamp, here));
        }
        before.map_or(EgoMotion::at_rest(0.0), |(then, pose)| {
            EgoMotion::between(&pose, &here, stamp.seconds_since(then), ODOMETRY_SIGMA)
        })
    }
}

/// The camera of the frames: that of the log, with the circular image of a
/// mirror unwrapped.
fn seen_by(simulation: &Simulation) -> Camera {
    let camera = simulation.camera().clone();
    match simulation.panorama() {
        Some(panorama) => Camera {
            lens: Lens::Panorama(*panorama),
            width: panorama.columns,
            height: panorama.rows,
            ..camera
        },
        None => camera,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "seed = 3\nduration_s = 4.0\n[camera]\nwidth = 32\nheight = 24\n\
        rate_hz = 20.0\n[robot]\npath = [[6.0, 4.0]]\n[faults]\nlate = 0.4\ndropped = 0.2\n\
        [[people]]\npath = [[4.0, 3.0], [4.0, 1.0]]\n";

    fn simulated(mut draw: Draw) -> Vec<SimulatedFrame> {
        std::iter::from_fn(|| draw.next_frame()).collect()
    }

    fn stamps(all: &[SimulatedFrame]) -> Vec<u64> {
        all.iter().map(|simulated| simulated.frame.stamp.nanos() / 1_000_000).collect()
    }

    fn scene() -> Scene {
        Scene::parse(SCENE).unwrap()
    }

    #[test]
    fn late_frames_are_in_order_in_a_log_and_not_on_a_robot() {
        let (log, live) = (simulated(Draw::new(&scene(), 1)), simulated(Draw::live(&scene(), 1)));
        let sorted =
            |all: &[SimulatedFrame]| all.windows(2).all(|p| p[0].frame.stamp < p[1].frame.stamp);
        assert!(sorted(&log), "{:?}", stamps(&log));
        assert!(!sorted(&live), "{:?}", stamps(&live));
        assert!(log.len() == live.len() && log.len() < 80);
    }

    #[test]
    fn images_that_wait_for_longer_than_odometry_is_kept_have_their_motion() {
        let slow = Scene::parse(&SCENE.replace("rate_hz = 20.0", "rate_hz = 2.0")).unwrap();
        let (driven, jumped) = simulated(Draw::new(&slow, 1)).iter().fold((0.0, 0.0), |sums, d| {
            let step: f64 = d.frame.motion.forward.hypot(d.frame.motion.left);
            (sums.0 + step, step.max(sums.1))
        });
        assert!(driven > 0.3 && jumped < 0.6, "{driven} {jumped}");
    }

    #[test]
    fn motions_add_up_to_the_odometry() {
        for draw in [Draw::new(&scene(), 1), Draw::live(&scene(), 1)] {
            let all = simulated(draw);
            let sum =
                all.iter().fold(all[0].odom_from_robot, |pose, d| pose * d.frame.motion.isometry());
            let last = all.iter().max_by_key(|d| d.frame.stamp).unwrap();
            assert!(
                (sum.translation.vector - last.odom_from_robot.translation.vector).norm() < 1e-9
            );
            assert!(sum.translation.vector.norm() > 0.3, "{sum}");
        }
    }

    #[test]
    fn a_steered_robot_goes_where_it_is_told() {
        let mut draw = Draw::live(&scene(), 1);
        let mut last = Isometry2::identity();
        while let Some(simulated) = draw.next_frame() {
            last = simulated.world_from_robot;
            draw.steer(WheelSpeeds { left: -0.2, right: -0.2 });
        }
        assert!(last.translation.x < 0.85, "{last}");
    }
}
