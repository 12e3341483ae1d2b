use tagalong_core::WheelSpeeds;

use super::*;
use crate::faults::InjectedFault;
use crate::scene::Scene;
use crate::simulation::Simulation;

/// A robot that drives past a person; every image comes, and none is late.
const SCENE: &str = "seed = 3\nduration_s = 3.0\n[laser]\nrays = 72\n[camera]\nwidth = 32\nheight = 24\n\
    mount_error_deg = 0.0\n[robot]\npath = [[6.0, 4.0]]\nwheel_bias = 0.0\nslip = 0.0\n[faults]\nlate = 0.0\n\
    dropped = 0.0\n[[ranges]]\nname = \"sonar\"\nmount = [-0.2, 0.0, 0.25, 180.0]\n[[people]]\npath = [[4.0, 3.0], [4.0, 1.0]]\n";
/// The faults of these tests begin at this time and last for a second, s.
const FROM_S: f64 = 1.0;

fn fault(kind: FaultKind) -> InjectedFault {
    InjectedFault::new(kind).at(FROM_S).lasting(1.0)
}

fn simulation(faults: &[InjectedFault]) -> Simulation {
    let mut scene = Scene::parse(SCENE).unwrap();
    scene.faults.inject = faults.to_vec();
    scene.check_faults().unwrap();
    Simulation::new(&scene, 1)
}

fn events(faults: &[InjectedFault]) -> Vec<Event> {
    let mut simulation = simulation(faults);
    std::iter::from_fn(|| simulation.next_event()).collect()
}

fn shots_of(faults: &[InjectedFault]) -> Vec<Shot> {
    events(faults)
        .into_iter()
        .filter_map(|event| if let Event::Shot(shot) = event { Some(*shot) } else { None })
        .collect()
}

fn readings(faults: &[InjectedFault]) -> Vec<OdometryReading> {
    events(faults)
        .into_iter()
        .filter_map(|event| if let Event::Odometry(reading) = event { Some(reading) } else { None })
        .collect()
}

fn is_within(at_ns: u64) -> bool {
    (FROM_S..FROM_S + 1.0).contains(&(at_ns as f64 * 1e-9))
}

fn depth_bits(shot: &Shot) -> Vec<u32> {
    shot.images.depth.iter().flat_map(|depth| depth.pixels()).map(|z| z.to_bits()).collect()
}

fn scan_bits(shot: &Shot) -> Vec<u32> {
    shot.laser.iter().flatten().map(|range| range.to_bits()).collect()
}

/// Checks that all data outside of the fault are those of a whole robot; returns the broken shots,
/// each with the whole one.
fn broken(fault: InjectedFault) -> Vec<(Shot, Shot)> {
    // The exposure remembers a view, so that colours differ after the camera looked elsewhere.
    let is_turned = matches!(fault.kind, Some(FaultKind::MountMoved | FaultKind::MountKnocked));
    let whole = shots_of(&[]);
    let shots = shots_of(&[fault]);
    assert!(whole.len() == shots.len() && whole.len() == 30, "{}", shots.len());
    let mut broken = Vec::new();
    for (shot, whole) in shots.into_iter().zip(whole) {
        if is_within(whole.captured_ns) {
            broken.push((shot, whole));
            continue;
        }
        assert_eq!(shot.stamp_ns, whole.stamp_ns);
        assert_eq!(shot.recorded_ns, whole.recorded_ns);
        assert_eq!(shot.arrived_ns, whole.arrived_ns);
        assert!(is_turned || shot.images.colour == whole.images.colour, "{} ns", whole.captured_ns);
        assert_eq!(depth_bits(&shot), depth_bits(&whole));
        assert_eq!(scan_bits(&shot), scan_bits(&whole));
        assert_eq!(shot.camera, whole.camera);
    }
    assert_eq!(broken.len(), 10);
    broken
}

#[test]
fn a_frozen_depth_image_repeats_itself_with_new_stamps_and_colour_goes_on() {
    let broken = broken(fault(FaultKind::FreezeDepth));
    let first = depth_bits(&broken[0].0);
    for (shot, whole) in &broken {
        assert_eq!(depth_bits(shot), first);
        assert_ne!(depth_bits(shot), depth_bits(whole));
        assert_eq!(shot.stamp_ns, whole.captured_ns);
        assert!(shot.images.colour == whole.images.colour);
        assert_eq!(scan_bits(shot), scan_bits(whole));
    }
}

#[test]
fn a_frozen_camera_repeats_all_of_its_images() {
    let broken = broken(fault(FaultKind::FreezeAll));
    let first = &broken[0].0;
    for (shot, whole) in &broken {
        assert_eq!(depth_bits(shot), depth_bits(first));
        assert!(shot.images.colour == first.images.colour);
        assert!(shot.images.colour != whole.images.colour);
        assert_eq!(scan_bits(shot), scan_bits(whole));
    }
}

#[test]
fn a_camera_that_is_frozen_from_the_start_repeats_its_first_image() {
    let shots = shots_of(&[InjectedFault::new(FaultKind::FreezeDepth).at(0.0)]);
    assert!(shots.iter().all(|shot| depth_bits(shot) == depth_bits(&shots[0])));
}

#[test]
fn a_frozen_laser_repeats_its_scan() {
    let broken = broken(fault(FaultKind::FreezeLaser));
    let first = scan_bits(&broken[0].0);
    for (shot, whole) in &broken {
        assert_eq!(scan_bits(shot), first);
        assert_ne!(scan_bits(shot), scan_bits(whole));
        assert_eq!(depth_bits(shot), depth_bits(whole));
    }
}

#[test]
fn blank_and_saturated_depth_says_nothing() {
    for (shot, _) in broken(fault(FaultKind::BlankDepth)) {
        assert!(shot.images.depth.unwrap().pixels().iter().all(|z| z.is_nan()));
    }
    for (shot, _) in broken(fault(FaultKind::SaturateDepth)) {
        assert!(shot.images.depth.unwrap().pixels().iter().all(|z| *z == 65.535));
    }
}

#[test]
fn of_dark_columns_only_a_share_has_readings() {
    for (shot, whole) in broken(fault(FaultKind::DarkColumns).with_share(0.25)) {
        let depth = shot.images.depth.unwrap();
        let whole = whole.images.depth.unwrap();
        let (dark, lit): (Vec<usize>, Vec<usize>) = (0..32).partition(|column| {
            (0..depth.height()).all(|row| depth.pixels()[row * 32 + column].is_nan())
        });
        assert_eq!(dark.len(), 24);
        for column in lit {
            let [broken, whole] =
                [&depth, &whole].map(|image| image.pixels()[10 * 32 + column].to_bits());
            assert_eq!(broken, whole);
        }
    }
}

#[test]
fn noise_has_the_size_that_is_asked_for() {
    let mut squares = 0.0;
    let mut count = 0.0;
    for (shot, whole) in broken(fault(FaultKind::NoiseDepth).with_size(0.2)) {
        let depth = shot.images.depth.unwrap();
        let whole = whole.images.depth.unwrap();
        for (z, whole) in depth.pixels().iter().zip(whole.pixels()) {
            assert_eq!(z.is_nan(), whole.is_nan());
            if *whole > 1.5 {
                squares += f64::from(z - whole).powi(2);
                count += 1.0;
            }
        }
    }
    let sigma_m: f64 = f64::sqrt(squares / count);
    assert!(count > 1000.0 && (0.18..0.22).contains(&sigma_m), "{count} {sigma_m}");
}

#[test]
fn broken_rays_are_those_ahead() {
    fn ahead(ray: &usize) -> bool {
        (*ray as f64 + 0.5 - 36.0).abs() <= 9.0
    }

    let mut kinds = [0; 3];
    for (shot, whole) in broken(fault(FaultKind::LaserInvalid)) {
        let ranges = shot.laser.unwrap();
        let whole = whole.laser.unwrap();
        for ray in (0..72).filter(ahead) {
            match ranges[ray] {
                range if range.is_nan() => kinds[0] += 1,
                0.0 => kinds[1] += 1,
                range => {
                    assert_eq!(range, f32::INFINITY);
                    kinds[2] += 1;
                }
            }
        }
        assert!((0..72).filter(|ray| !ahead(ray)).all(|ray| ranges[ray] == whole[ray]));
    }
    assert!(kinds.iter().sum::<i32>() == 180 && kinds.iter().all(|count| *count > 40), "{kinds:?}");
    for (shot, whole) in broken(fault(FaultKind::LaserNear).with_share(1.0)) {
        assert_eq!(shot.laser.as_ref().unwrap().len(), whole.laser.unwrap().len());
        assert!(shot.laser.unwrap().iter().all(|range| *range == f32::NEG_INFINITY));
    }
}

#[test]
fn a_laser_that_drops_out_leaves_the_images() {
    for (shot, whole) in broken(fault(FaultKind::DropLaser)) {
        assert!(shot.laser.is_none() && depth_bits(&shot) == depth_bits(&whole));
    }
}

#[test]
fn images_that_are_late_say_so_by_their_stamps() {
    let shots = shots_of(&[fault(FaultKind::Delay).with_size(0.3)]);
    assert_eq!(shots.len(), 30);
    for shot in &shots {
        let late_ns = if is_within(shot.captured_ns) { 300_000_000 } else { 0 };
        assert_eq!(shot.recorded_ns, shot.captured_ns + late_ns);
        assert_eq!((shot.arrived_ns, shot.stamp_ns), (shot.recorded_ns, shot.captured_ns));
    }
    // The last late images overtake none of those after the fault.
    assert!(shots.windows(2).any(|pair| pair[0].captured_ns > pair[1].captured_ns));
    assert!(shots.windows(2).all(|pair| pair[0].recorded_ns <= pair[1].recorded_ns));
}

#[test]
fn an_image_that_is_sent_again_has_its_old_stamp() {
    let shots = shots_of(&[fault(FaultKind::Resend)]);
    let again: Vec<&Shot> = shots.iter().filter(|shot| is_within(shot.recorded_ns)).collect();
    assert_eq!((shots.len(), again.len()), (30, 10));
    for shot in again {
        assert_eq!(shot.stamp_ns, 900_000_000);
        assert_eq!(depth_bits(shot), depth_bits(&shots[9]));
        assert_eq!(shot.arrived_ns, shot.recorded_ns);
    }
    assert_eq!(shots[20].stamp_ns, 2_000_000_000);
}

#[test]
fn no_image_arrives_while_they_are_dropped() {
    let shots = shots_of(&[fault(FaultKind::Drop)]);
    assert!(shots.len() == 20 && shots.iter().all(|shot| !is_within(shot.captured_ns)));
}

#[test]
fn odometry_that_is_no_number_or_silent_or_frozen_is_whole_before_and_after() {
    let whole = readings(&[]);
    assert_eq!(whole.len(), 150);
    let nan = readings(&[fault(FaultKind::NanOdometry)]);
    let frozen = readings(&[fault(FaultKind::OdometryFrozen)]);
    let held = whole.iter().rfind(|reading| reading.at_ns < 1_000_000_000).unwrap();
    for ((whole, nan), frozen) in whole.iter().zip(&nan).zip(&frozen) {
        assert_eq!((nan.stamp_ns, frozen.stamp_ns), (whole.at_ns, whole.at_ns));
        if is_within(whole.at_ns) {
            assert!(nan.odom_from_robot.translation.x.is_nan());
            assert_eq!(frozen.odom_from_robot, held.odom_from_robot);
            assert_eq!((frozen.speed_mps, frozen.encoders), (held.speed_mps, held.encoders));
            assert_ne!(whole.odom_from_robot, held.odom_from_robot);
        } else {
            assert_eq!((nan, frozen), (whole, whole));
        }
    }
    let events = events(&[fault(FaultKind::OdometrySilent)]);
    let silent = events.iter().filter(|event| matches!(event, Event::NoOdometry { .. }));
    assert!(silent.clone().all(|event| is_within(event.step_ns().unwrap())));
    assert_eq!(silent.count(), 50);
    assert_eq!(events.iter().filter_map(Event::step_ns).count(), 150);
}

#[test]
fn wrong_odometry_measures_a_part_of_the_motion() {
    fn moved(pair: &[OdometryReading]) -> f64 {
        (pair[0].odom_from_robot.inverse() * pair[1].odom_from_robot).translation.vector.norm()
    }

    fn turned(pair: &[OdometryReading]) -> f64 {
        pair[1].encoders[0].angle_rad - pair[0].encoders[0].angle_rad
    }

    let whole = readings(&[]);
    let wrong = readings(&[fault(FaultKind::OdometryWrong).with_size(0.5)]);
    for (pair, wrong) in whole.windows(2).zip(wrong.windows(2)) {
        // The step that ends within the fault is the first wrong one.
        let factor = if is_within(pair[1].at_ns) { 0.5 } else { 1.0 };
        assert!((moved(wrong) - factor * moved(pair)).abs() < 1e-9);
        assert!((wrong[1].speed_mps - factor * pair[1].speed_mps).abs() < 1e-12);
        assert!((turned(wrong) - factor * turned(pair)).abs() < 1e-9);
    }
    assert!(whole.iter().zip(&wrong).take(50).all(|(whole, wrong)| whole == wrong));
}

#[test]
fn stamps_ahead_are_those_of_the_odometry_alone() {
    let ahead = readings(&[fault(FaultKind::OdometryLateStamps)]);
    for reading in &ahead {
        let ahead_ns = if is_within(reading.at_ns) { 3_600_000_000_000 } else { 0 };
        assert_eq!(reading.stamp_ns, reading.at_ns + ahead_ns);
    }
    for (shot, whole) in broken(fault(FaultKind::OdometryLateStamps)) {
        assert_eq!(shot.stamp_ns, whole.stamp_ns);
    }
}

#[test]
fn a_clock_that_jumps_moves_all_stamps_and_no_event() {
    for (kind, ahead_ns) in
        [(FaultKind::ClockForward, 700_000_000), (FaultKind::ClockBack, -700_000_000)]
    {
        let jumped = fault(kind).with_size(0.7);
        for (shot, whole) in broken(jumped.clone()) {
            let told_ns = whole.captured_ns.checked_add_signed(ahead_ns).unwrap();
            assert_eq!([shot.stamp_ns, shot.depth_ns, shot.arrived_ns], [told_ns; 3]);
            assert_eq!(shot.recorded_ns, whole.recorded_ns);
        }
        for reading in readings(&[jumped]) {
            let ahead_ns = if is_within(reading.at_ns) { ahead_ns } else { 0 };
            let told_ns = reading.at_ns.checked_add_signed(ahead_ns).unwrap();
            assert_eq!(reading.stamp_ns, told_ns);
        }
    }
    // There is no stamp before the start.
    let back = shots_of(&[fault(FaultKind::ClockBack).with_size(50.0)]);
    assert_eq!(back[10].stamp_ns, 0);
}

#[test]
fn a_calibration_that_changes_is_told_and_the_images_stay() {
    for (shot, whole) in broken(fault(FaultKind::CalibrationChanged).with_size(1.2)) {
        assert!((shot.camera.focal_px() - 1.2 * whole.camera.focal_px()).abs() < 1e-9);
        assert_eq!(shot.camera.robot_from_camera, whole.camera.robot_from_camera);
        assert_eq!(depth_bits(&shot), depth_bits(&whole));
    }
}

#[test]
fn a_mount_that_moves_is_told_and_one_that_is_knocked_is_not() {
    fn ahead(camera: &Camera) -> Vector3<f64> {
        camera.robot_from_camera.rotation * Vector3::z()
    }

    for (kind, is_told) in [(FaultKind::MountMoved, true), (FaultKind::MountKnocked, false)] {
        for (shot, whole) in broken(fault(kind)) {
            assert_ne!(depth_bits(&shot), depth_bits(&whole));
            assert_eq!(shot.camera != whole.camera, is_told);
            assert_eq!(shot.truth[0].head_in_robot, whole.truth[0].head_in_robot);
        }
        let moved = simulation(&[fault(kind)]);
        let mounted = moved.injector.mounted(moved.camera(), 1_500_000_000);
        let turned = ahead(&mounted).angle(&ahead(moved.camera())).to_degrees();
        assert!((turned - 10.0).abs() < 1e-6 && ahead(&mounted).y > 0.1, "{turned}");
    }
}

/// Speed over ground and by the encoders at each step of a robot that is told to drive at 0.4 m/s,
/// and to stop after 1.5 s.
fn driven(fault: InjectedFault) -> Vec<(f64, f64, f64)> {
    let mut simulation = simulation(&[fault]);
    let mut steps = Vec::new();
    while let Some(event) = simulation.next_event() {
        let Event::Odometry(reading) = event else { continue };
        let at_s = reading.at_ns as f64 * 1e-9;
        steps.push((at_s, simulation.speed_mps(), reading.speed_mps));
        let speed = if at_s < 1.5 { 0.4 } else { 0.0 };
        simulation.steer(WheelSpeeds { left: speed, right: speed });
    }
    steps
}

/// Returns speed over ground and by the encoders at a time.
fn speeds_at(steps: &[(f64, f64, f64)], at_s: f64) -> [f64; 2] {
    let step = steps.iter().find(|step| step.0 >= at_s - 1e-9).unwrap();
    [step.1, step.2]
}

#[test]
fn wheels_that_fail_do_not_obey() {
    let stuck = driven(fault(FaultKind::WheelsStuck));
    assert!(speeds_at(&stuck, 0.9)[0] > 0.35);
    assert_eq!(speeds_at(&stuck, 1.2), [0.0, 0.0]);

    let slip = driven(fault(FaultKind::WheelsSlip).with_share(0.75));
    let [ground, encoders] = speeds_at(&slip, 1.4);
    assert!((ground - 0.25 * encoders).abs() < 0.01 && encoders > 0.38, "{ground} {encoders}");
    assert!((speeds_at(&slip, 0.9)[0] - speeds_at(&slip, 0.9)[1]).abs() < 0.02);

    let runaway = driven(fault(FaultKind::WheelsRunaway));
    assert!(speeds_at(&runaway, 1.98)[0] > 0.38, "goes on after the stop");
    assert!(speeds_at(&runaway, 2.9)[0] < 0.02, "obeys after the fault");

    let late = driven(fault(FaultKind::WheelLatency).with_size(0.8));
    assert!(speeds_at(&late, 2.2)[0] > 0.38 && speeds_at(&late, 2.95)[0] < 0.1);
    let whole = driven(InjectedFault::new(FaultKind::Drop).at(2.9));
    assert!(speeds_at(&whole, 2.2)[0] < 0.05, "a whole robot stops in time");
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    fn broken(seed: u64) -> Vec<Vec<u32>> {
        let mut scene = Scene::parse(SCENE).unwrap();
        scene.seed = seed;
        scene.faults.inject = vec![fault(FaultKind::NoiseDepth), fault(FaultKind::DarkColumns)];
        let mut simulation = Simulation::new(&scene, 1);
        let mut all = Vec::new();
        while let Some(event) = simulation.next_event() {
            if let Event::Shot(shot) = event {
                all.push(depth_bits(&shot));
            }
        }
        all
    }

    assert_eq!(broken(3), broken(3));
    assert_ne!(broken(3)[12], broken(4)[12]);
}

#[test]
fn further_sensors_fall_silent_or_repeat_themselves() {
    fn readings(faults: &[InjectedFault]) -> Vec<SensorReading> {
        let mut all = Vec::new();
        for event in events(faults) {
            if let Event::Sensor(reading) = event {
                all.push(reading);
            }
        }
        all
    }

    let whole = readings(&[]);
    let silent = readings(&[fault(FaultKind::DropSensors)]);
    assert_eq!((whole.len(), silent.len()), (30, 20));
    assert!(silent.iter().all(|reading| !is_within(reading.at_ns) && whole.contains(reading)));
    let frozen = readings(&[fault(FaultKind::FreezeSensors)]);
    for (frozen, whole) in frozen.iter().zip(&whole) {
        assert_eq!(frozen.stamp_ns, whole.at_ns);
        assert_eq!(frozen.data == whole.data, !is_within(whole.at_ns));
    }
    assert!(frozen[10..20].iter().all(|reading| reading.data == frozen[10].data));
}
