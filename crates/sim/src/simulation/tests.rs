use super::*;
use crate::obstacle_sensors::SensorData;
use crate::ramp::Ramp;
use crate::room_settings::RoomSettings;
use crate::world;

const SMALL: &str = "seed = 4\nduration_s = 1.0\n[camera]\nwidth = 96\nheight = 72\n\
    [room]\nclutter = 3\n[[people]]\npath = [[4.0, 3.0]]\nheight_m = 1.7\n\
    [[people]]\npath = [[6.0, 3.0]]\nheight_m = 1.6\n";

fn events(text: &str, threads: usize) -> Vec<Event> {
    let mut simulation = Simulation::new(&Scene::parse(text).unwrap(), threads);
    std::iter::from_fn(|| simulation.next_event()).collect()
}

fn shots(text: &str, threads: usize) -> Vec<Shot> {
    events(text, threads)
        .into_iter()
        .filter_map(|event| if let Event::Shot(shot) = event { Some(*shot) } else { None })
        .collect()
}

#[test]
fn the_same_scene_is_the_same_whatever_the_number_of_threads() {
    let one = shots(SMALL, 1);
    let three = shots(SMALL, 3);
    assert!(one.len() >= 9 && one.len() == three.len());
    for (a, b) in one.iter().zip(&three) {
        assert_eq!(a.images.colour, b.images.colour);
        assert_eq!(a.truth, b.truth);
    }
    let other = shots(&SMALL.replace("seed = 4", "seed = 5"), 1);
    assert_ne!(one[0].images.colour, other[0].images.colour);
}

#[test]
fn depth_is_the_same_without_colour() {
    fn bits(shot: &Shot) -> Vec<u32> {
        shot.images.depth.iter().flat_map(|d| d.pixels()).map(|z| z.to_bits()).collect()
    }

    let with = shots(SMALL, 2);
    let without = shots(&SMALL.replace("[camera]\n", "[camera]\ncolour = false\n"), 2);
    assert!(with.len() == without.len() && with[0].images.colour.is_some());
    for (a, b) in with.iter().zip(&without) {
        assert!(b.images.colour.is_none() && bits(a) == bits(b));
        assert_eq!(a.truth, b.truth);
    }
}

/// One person 3 m before the robot, at this place along the room.
fn on_ramp(ramp: &str, robot_x: f64) -> Shot {
    let text = format!(
        "seed = 4\nduration_s = 0.2\n[camera]\nwidth = 96\nheight = 72\n[room]\n{ramp}\n\
         [robot]\nstart = [{robot_x:?}, 3.0]\n[[people]]\npath = [[{:?}, 3.0]]\nheight_m = 1.7\n",
        robot_x + 3.0
    );
    shots(&text, 1).swap_remove(0)
}

#[test]
fn a_ramp_lifts_people_and_tilts_the_robot() {
    let ramp = "ramp = { from_m = 3.0, length_m = 2.0, rise_m = 0.2 }";
    let level = on_ramp("", 2.0);
    let below = on_ramp(ramp, 2.0);
    let up = below.truth[0].head_in_robot - level.truth[0].head_in_robot;
    assert!((up - Vector3::new(0.0, 0.0, 0.2)).norm() < 1e-9, "{up:?}");
    let head = on_ramp("", 4.0).truth[0].head_in_robot;
    let slope = Rotation3::from_axis_angle(&Vector3::y_axis(), -0.1_f64.atan());
    let expected = slope.inverse() * (head + Vector3::new(0.0, 0.0, 0.1));
    let seen = on_ramp(ramp, 4.0).truth[0].head_in_robot;
    assert!((seen - expected).norm() < 1e-9, "{seen} {expected}");
    let above = on_ramp(ramp, 6.0).truth[0].head_in_robot;
    assert!((above - head).norm() < 1e-9, "the level floor above it: {above} {head}");
}

#[test]
fn the_floor_of_a_ramp_is_where_people_stand_on_it() {
    let settings = RoomSettings {
        ramp: Some(Ramp { from_m: 3.0, length_m: 2.0, rise_m: 0.2 }),
        ..RoomSettings::default()
    };
    let room = [room::room(&settings)];
    for x in [0.5, 2.9, 3.5, 4.5, 5.1, 8.0] {
        let down = world::distance(&room, &Point3::new(x, 2.0, 1.0), &-Vector3::z());
        let floor_m = settings.floor_m(&Point2::new(x, 2.0));
        assert!((1.0 - down - floor_m).abs() < 1e-3, "{x}: {down} above {floor_m}");
    }
}

const TURNING: &str = "seed = 4\nduration_s = 2.0\n[camera]\nwidth = 160\nheight = 120\n\
    [robot]\nstart = [1.0, 3.0]\nheading_deg = -60.0\npath = [[1.0, 5.5]]\n\
    [faults]\ndropped = 0.0\nlate = 0.0\n\
    [[people]]\npath = [[3.5, 3.0]]\nheight_m = 1.7\n";

#[test]
fn a_rolling_shutter_slants_the_image_and_the_truth_with_it() {
    let at_once = shots(TURNING, 2);
    let rolling = shots(&TURNING.replace("[camera]\n", "[camera]\nrolling_shutter_s = 0.05\n"), 2);
    let mut moved = 0.0_f64;
    for (a, b) in at_once.iter().zip(&rolling) {
        assert_eq!(a.truth[0].head_in_robot, b.truth[0].head_in_robot);
        let (Some(x), Some(y)) = (a.truth[0].upper_body, b.truth[0].upper_body) else {
            continue;
        };
        moved = moved.max((x.centre().x - y.centre().x).abs());
        let off = (a.truth[0].visible_fraction - b.truth[0].visible_fraction).abs();
        assert!(off < 0.12, "{:?} {:?}", a.truth, b.truth);
    }
    // 0.8 rad/s for a third of the shutter time are some 2 of 144 px / rad.
    assert!((0.5..6.0).contains(&moved), "{moved}");
}

#[test]
fn depth_may_be_taken_later_than_colour_and_changes_nothing_else() {
    fn ahead(shot: &Shot) -> f64 {
        let depth = shot.images.depth.as_ref().unwrap();
        let middle = (20..50).flat_map(|y| (60..90).map(move |x| (x, y)));
        let seen: Vec<f64> = middle
            .filter_map(|(x, y)| depth.get(x, y))
            .filter(|z| z.is_finite())
            .map(f64::from)
            .collect();
        seen.iter().sum::<f64>() / seen.len() as f64
    }

    let text = "duration_s = 2.0\n[camera]\nwidth = 96\nheight = 72\nmount_error_deg = 0.0\nbaseline_m = 0.8\n\
        [robot]\nstart = [5.0, 3.0]\npath = [[8.0, 3.0]]\n\
        [[people]]\npath = [[7.0, 4.0], [7.0, 5.0]]\n";
    let together = shots(text, 2);
    let later = shots(&text.replace("[camera]\n", "[camera]\ndepth_offset_s = 0.02\n"), 2);
    for (a, b) in together.iter().zip(&later) {
        assert_eq!((&a.images.colour, &a.truth), (&b.images.colour, &b.truth));
        assert_eq!(b.depth_ns, b.captured_ns + 20_000_000);
    }
    let nearer: f64 = together.iter().zip(&later).skip(10).map(|(a, b)| ahead(a) - ahead(b)).sum();
    // 0.5 m/s for 0.02 s, in about ten images.
    let nearer = nearer / (together.len() - 10) as f64;
    assert!((0.004..0.016).contains(&nearer), "{nearer}");
}

#[test]
fn truth_agrees_with_depth_and_knows_who_hides_whom() {
    let shot = &shots(SMALL, 2)[0];
    let near = &shot.truth[0];
    let far = &shot.truth[1];
    assert!((near.head_in_robot.x - 3.0).abs() < 0.05 && near.visible_fraction > 0.95);
    assert!(far.visible_fraction < 0.5 && far.occluder == Some(1), "{far:?}");
    let area = near.upper_body.unwrap();
    let x = area.centre().x as i64;
    let y = (area.y + 0.45 * area.height) as i64;
    let depth = f64::from(shot.images.depth.as_ref().unwrap().get(x, y).unwrap());
    assert!((depth - 2.9).abs() < 0.15, "{depth}");
}

#[test]
fn a_stereo_pair_is_shifted_by_the_disparity() {
    let text =
        SMALL.replace("[camera]\n", "[camera]\nkind = \"stereo\"\nfield_of_view_deg = 58.0\n");
    let images = &shots(&text, 2)[0].images;
    let left = images.grey.as_ref().unwrap();
    let right = &images.right.as_ref().unwrap().image;
    let mut differences = [0; 8];
    for (shift, difference) in (0..).zip(&mut differences) {
        for (x, y) in (44..52).flat_map(|x| (24..40).map(move |y| (x, y))) {
            let a = i64::from(left.get(x, y).unwrap());
            *difference += (a - i64::from(right.get(x - shift, y).unwrap())).abs();
        }
    }
    let best = (0..8).min_by_key(|shift| differences[*shift]).unwrap();
    // f = 86.6 px, depth 2.9 m.
    assert_eq!(best, 4, "{differences:?}");
}

#[test]
fn events_come_in_the_order_of_recording_and_late_images_after_their_time() {
    fn recorded(event: &Event) -> u64 {
        match event {
            Event::Odometry(reading) => reading.at_ns,
            Event::NoOdometry { at_ns } => *at_ns,
            Event::Shot(shot) => shot.recorded_ns,
            Event::Sensor(reading) => reading.at_ns,
            Event::Webcam(shot) => shot.captured_ns,
        }
    }

    let text = format!("{SMALL}[faults]\nlate = 0.5\ndropped = 0.2\n");
    let events = events(&text, 2);
    assert!(events.windows(2).all(|pair| recorded(&pair[0]) <= recorded(&pair[1])));
    let shots: Vec<_> = shots(&text, 2);
    assert!(shots.iter().any(|s| s.recorded_ns > s.captured_ns) && shots.len() < 10);
}

const OMNI: &str = "duration_s = 1.0\n[camera]\nkind = \"panorama\"\nwidth = 160\nheight = 160\n\
    rate_hz = 3.0\nheight_m = 1.55\n[robot]\nstart = [5.0, 3.0]\n[faults]\ndropped = 0.0\n\
    [[people]]\npath = [[3.0, 3.01]]\nheight_m = 1.7\n[[people]]\npath = [[5.0, 5.5]]\nheading_deg = 270.0\n\
    [[webcams]]\nwidth = 64\nheight = 48\n[[webcams]]\nwidth = 64\nheight = 48\nrate_hz = 5.0\n";

#[test]
fn a_mirror_shows_people_all_around_and_the_seam_cuts_nobody() {
    let one = shots(OMNI, 1);
    let three = shots(OMNI, 3);
    assert!(one.len() == 3 && one[0].images.depth.is_none());
    for (a, b) in one.iter().zip(&three) {
        assert!(a.images.colour == b.images.colour && a.truth == b.truth);
    }
    let behind = &one[0].truth[0];
    let left = &one[0].truth[1];
    let seam = behind.upper_body.unwrap();
    assert!(seam.x < 480.0 && seam.right() > 480.0 && seam.width < 50.0, "{seam:?}");
    assert!((left.upper_body.unwrap().centre().x - 119.5).abs() < 6.0, "{left:?}");
    for person in [behind, left] {
        let whole = person.upper_body.unwrap();
        let seen = person.visible.unwrap();
        assert!(person.visible_fraction > 0.9 && !person.ignore, "{person:?}");
        assert!(seen.intersection(&whole).area() > 0.95 * seen.area(), "{person:?}");
        assert!(seen.area() > 0.5 * whole.area(), "{person:?}");
    }
}

#[test]
fn webcams_deliver_at_their_own_rates() {
    let numbers: Vec<usize> = events(OMNI, 2)
        .iter()
        .filter_map(|event| if let Event::Webcam(shot) = event { Some(shot.webcam) } else { None })
        .collect();
    let counts = [0, 1].map(|number| numbers.iter().filter(|n| **n == number).count());
    assert_eq!(counts, [3, 5]);
}

#[test]
fn people_walk_through_a_doorway() {
    let text = "duration_s = 9.0\n[camera]\nwidth = 8\nheight = 8\n[[furniture]]\n\
        kind = \"doorway\"\nat = [5.0, 3.0]\n\
        [[people]]\npath = [[3.0, 3.4], [5.0, 3.0], [8.0, 2.6]]\n";
    let shots = shots(text, 1);
    let last = &shots[shots.len() - 1].truth[0].torso_in_robot;
    assert!(last.x > 5.5, "{last}");
    let at_wall = shots.iter().map(|s| s.truth[0].torso_in_robot);
    let aside = at_wall.filter(|at| (at.x - 4.0).abs() < 0.1).map(|at| at.y.abs());
    assert!(aside.fold(0.0, f64::max) < 0.35);
}

#[test]
fn people_walk_round_a_robot_at_rest() {
    let text = "duration_s = 14.0\n[camera]\nwidth = 8\nheight = 8\n[robot]\nstart = [4.0, 3.0]\n\
        [[people]]\npath = [[2.0, 3.0], [7.0, 3.0]]\ncompanions = 1\n";
    let mut nearest = f64::MAX;
    let shots = shots(text, 1);
    for shot in &shots {
        let away = shot.truth.iter().map(|t| t.torso_in_robot.coords.xy().norm());
        nearest = away.fold(nearest, f64::min);
    }
    assert!(nearest > 0.4, "{nearest}");
    let last: Vec<_> = shots[shots.len() - 1].truth.iter().map(|t| t.torso_in_robot).collect();
    assert!(last.len() == 2 && last.iter().all(|at| at.x > 2.0), "{last:?}");
    let apart = (last[0] - last[1]).norm();
    assert!((0.5..1.3).contains(&apart), "{apart}");
}

#[test]
fn a_steered_robot_leaves_its_path() {
    let scene = Scene::parse("duration_s = 3.0\n[camera]\nwidth = 16\nheight = 16\n").unwrap();
    let mut simulation = Simulation::new(&scene, 1);
    while simulation.next_event().is_some() {
        simulation.steer(WheelSpeeds { left: 0.3, right: 0.3 });
    }
    assert!(simulation.robot.pose.translation.vector.x > 1.5);
}

#[test]
fn clearance_is_to_what_is_really_there() {
    let scene = "[room]\nsize_m = [9.0, 6.0]\n[robot]\nstart = [2.0, 1.5]\n\
        [[people]]\npath = [[3.5, 1.5]]\n[[furniture]]\nkind = \"pillar\"\nat = [2.0, 2.6]\n";
    let simulation = Simulation::new(&Scene::parse(scene).unwrap(), 1);
    let Clearance { people_m, things_m } = simulation.clearance(0.25);
    assert!((people_m - (1.5 - 0.2 - 0.25)).abs() < 1e-9, "{people_m}");
    assert!((0.4..0.85).contains(&things_m), "the pillar is thinner than 0.4 m: {things_m}");
    let alone = Simulation::new(&Scene::parse("[robot]\nstart = [2.0, 1.5]\n").unwrap(), 1);
    let Clearance { people_m, things_m } = alone.clearance(0.25);
    assert!(people_m == f64::INFINITY && (things_m - 1.25).abs() < 0.02, "{things_m}");
}

/// Two people that wander, one after the other.
const TURNS: &str = "seed = 4\nduration_s = 6.0\n[camera]\nwidth = 16\nheight = 16\n\
    rate_hz = 2.0\n[room]\nclutter = 5\n[robot]\nstart = [4.5, 3.0]\n\
    [[people]]\nwander = 30\nleaves_s = 3.0\n[[people]]\nwander = 30\nenters_s = 3.0\n";

#[test]
fn one_leaves_as_the_other_enters() {
    let drawn = shots(&TURNS.replace("[camera]", "[faults]\ndropped = 0.0\n[camera]"), 1);
    let there: Vec<Vec<u16>> =
        drawn.iter().map(|shot| shot.truth.iter().map(|person| person.id).collect()).collect();
    assert_eq!(there, [[1]; 6].into_iter().chain([[2]; 6]).collect::<Vec<_>>());
}

#[test]
fn who_wanders_goes_elsewhere_with_every_seed_and_keeps_off_things() {
    let [first, again, second] = [4, 4, 5].map(|seed| {
        let text = TURNS.replace("seed = 4", &format!("seed = {seed}"));
        let scene = Scene::parse(&text).unwrap();
        let simulation = Simulation::new(&scene, 1);
        let people = walkers(&scene, &simulation.obstacles, &mut Random::new(seed, 3));
        let ways: Vec<Vec<Point2<f64>>> = people.iter().map(Walker::points).collect();
        for at in ways.iter().flatten() {
            let things = simulation.obstacles.iter().map(|o| (at - o.at).norm() - o.radius_m);
            let off = things.fold((at - Point2::new(4.5, 3.0)).norm() - 0.55, f64::min);
            assert!(off > 0.35, "{at}");
            assert!((0.5..8.5).contains(&at.x) && (0.6..5.4).contains(&at.y), "{at}");
        }
        ways
    });
    assert_eq!(first, again);
    assert!(first.iter().all(|way| way.len() == 30));
    assert!(first[0] != first[1] && first[0] != second[0]);
    // They come everywhere, near the robot and far from it.
    let near = first.iter().flatten().filter(|at| (*at - Point2::new(4.5, 3.0)).norm() < 1.6);
    assert!((3..30).contains(&near.count()));
}

#[test]
fn joints_are_where_the_body_is_and_know_what_hides_them() {
    let text = SMALL.replace("width = 96\nheight = 72", "width = 320\nheight = 240");
    let shot = shots(&text, 2).swap_remove(0);
    // Both look away from the robot, and the second stands right behind the first.
    let [left, right, hip, knee] = ["left_shoulder", "right_shoulder", "left_hip", "left_knee"]
        .map(|name| joint_of(&shot, 0, name).pixel.unwrap());
    assert!(left.x < right.x - 10.0 && (left.y - right.y).abs() < 6.0, "{left} {right}");
    assert!(hip.y > left.y && knee.y > hip.y);
    for name in ["left_shoulder", "right_knee"] {
        assert!(joint_of(&shot, 0, name).in_sight, "{name}");
    }
    let hidden = joint_of(&shot, 1, "left_shoulder");
    assert!(hidden.pixel.is_some() && !hidden.in_sight, "{hidden:?}");
    let [first, second] = [0, 1].map(|person| joint_of(&shot, person, "right_hip").in_robot.x);
    assert!((first - 3.0).abs() < 0.1 && (second - 5.0).abs() < 0.1, "{first} {second}");
}

/// Returns a joint of a person by its name.
fn joint_of(shot: &Shot, person: usize, name: &str) -> Joint {
    *shot.truth[person].joints.iter().find(|joint| joint.name == name).unwrap()
}

/// From behind, a body hides the wrist that is held before it.
#[test]
fn the_own_body_hides_a_joint_too() {
    let text = "seed = 4\nduration_s = 0.2\n[camera]\nwidth = 320\nheight = 240\n\
        [[people]]\npath = [[4.0, 3.0]]\nposture = \"phone\"\nextras = []\nheading_deg = ";
    for (degrees, in_sight) in [(180, true), (20, false)] {
        let shot = shots(&format!("{text}{degrees}.0\n"), 1).swap_remove(0);
        assert_eq!(joint_of(&shot, 0, "right_wrist").in_sight, in_sight, "{degrees}");
    }
}

/// In a room whose floor the sun reaches, before and after it comes through the windows.
#[test]
fn sunlight_makes_images_bright_and_takes_away_depth() {
    fn shot(sun_lux: f64) -> Shot {
        let text = format!(
            "seed = 4\nduration_s = 0.2\n[camera]\nwidth = 160\nheight = 120\npitch_down_deg = 15.0\n\
             [light.day]\nsun_lux = {sun_lux:?}\nsky_lux = 0.0\nelevation_deg = 35.0\n"
        );
        shots(&text, 2).swap_remove(0)
    }

    fn at(x: usize, y: usize) -> usize {
        y * 160 + x
    }

    let overcast = shot(0.0);
    let sunny = shot(30_000.0);
    let [dark, bright] = [&overcast, &sunny].map(|shot| shot.images.colour.clone().unwrap());
    let [all, left] = [&overcast, &sunny].map(|shot| shot.images.depth.clone().unwrap());
    let lit = (0..160 * 120).filter(|i| bright.pixels()[*i][1] > 250 && dark.pixels()[*i][1] < 200);
    let lit: Vec<usize> = lit.collect();
    assert!(lit.len() > 300, "{} white pixels", lit.len());
    let [before, after] =
        [&all, &left].map(|depth| lit.iter().filter(|i| !depth.pixels()[**i].is_nan()).count());
    assert!(before > 9 * lit.len() / 10 && after < lit.len() / 10, "{before} {after}");
    // The sky in a window is as bright as it is said to be, and a hole in the depth.
    let day = "seed = 4\nduration_s = 0.2\n[camera]\nwidth = 160\nheight = 120\n\
        [robot]\nstart = [4.5, 2.0]\nheading_deg = 90.0\n[light.day]\nsun_lux = 0.0\nsky_lux = ";
    let [(dark, _), (bright, hole)] = [0, 5000].map(|sky_lux| {
        let images = shots(&format!("{day}{sky_lux}.0\n"), 1).swap_remove(0).images;
        // Beside the bar in the middle of the window.
        let colour = images.colour.unwrap();
        let depth = images.depth.unwrap();
        (colour.pixels()[at(90, 50)][1], depth.pixels()[at(90, 50)])
    });
    assert!(dark < 200 && bright > 250 && hole.is_nan(), "{dark} {bright} {hole}");
    // In the shade it measures as before.
    let shade = at(40, 110);
    assert!((all.pixels()[shade] - left.pixels()[shade]).abs() < 0.01);
}

#[test]
fn a_footprint_takes_the_place_of_the_disc() {
    fn at(footprint: &str, heading_deg: f64) -> Clearance {
        let text = format!(
            "[room]\nsize_m = [9.0, 6.0]\n[robot]\nstart = [2.0, 3.0]\nheading_deg = {heading_deg:?}\n\
             {footprint}\n[[people]]\npath = [[3.5, 3.0]]\n"
        );
        Simulation::new(&Scene::parse(&text).unwrap(), 1).clearance(0.25)
    }

    let long = "footprint = [[0.6, 0.2], [-0.1, 0.2], [-0.1, -0.2], [0.6, -0.2]]";
    assert!((at("", 0.0).people_m - 1.05).abs() < 1e-9);
    assert!((at(long, 0.0).people_m - 0.7).abs() < 1e-9);
    assert!((at(long, 180.0).people_m - 1.2).abs() < 1e-9);
    // The wall behind the robot, 2 m away.
    assert!((at(long, 0.0).things_m - 1.9).abs() < 0.01, "{:?}", at(long, 0.0));
    assert!((at(long, 180.0).things_m - 1.4).abs() < 0.01, "{:?}", at(long, 180.0));
}

#[test]
fn a_bumper_is_pressed_by_what_touches_its_side_of_the_body() {
    let text = "duration_s = 2.6\n[camera]\nwidth = 8\nheight = 8\n[robot]\nstart = [1.0, 3.0]\n\
        [[bumpers]]\nname = \"front\"\narc_deg = [-60.0, 60.0]\n\
        [[bumpers]]\nname = \"back\"\narc_deg = [120.0, 240.0]\nrate_hz = 10.0\n";
    let mut simulation = Simulation::new(&Scene::parse(text).unwrap(), 1);
    let mut pressed: [Vec<bool>; 2] = Default::default();
    let mut touched = 0;
    // Backwards into the wall.
    while let Some(event) = simulation.next_event() {
        simulation.steer(WheelSpeeds { left: -0.4, right: -0.4 });
        touched += usize::from(
            matches!(event, Event::Odometry(_)) && simulation.clearance(0.25).things_m < 0.0,
        );
        let Event::Sensor(SensorReading { name, data: SensorData::Bumper(is_pressed), .. }) = event
        else {
            continue;
        };
        pressed[usize::from(&*name == "back")].push(is_pressed);
    }
    assert_eq!((pressed[0].len(), pressed[1].len()), (130, 26));
    assert!(touched > 5 && pressed[0].iter().all(|is_pressed| !is_pressed), "{touched}");
    assert!(!pressed[1][15] && pressed[1][25], "{:?}", pressed[1]);
}

#[test]
fn further_scanners_look_from_where_they_are_mounted() {
    let text = "duration_s = 0.2\n[camera]\nwidth = 8\nheight = 8\n[robot]\nstart = [2.0, 3.0]\n\
        [[lasers]]\nname = \"rear\"\nmount = [-0.3, 0.0, 0.3, 180.0]\nrays = 3\n\
        field_of_view_deg = 180.0\nsigma_m = 0.0\n";
    let events = events(text, 1);
    let scans: Vec<&SensorReading> = events
        .iter()
        .filter_map(|event| if let Event::Sensor(reading) = event { Some(reading) } else { None })
        .collect();
    assert_eq!(scans.len(), 2);
    let SensorData::Scan { scanner, ranges } = &scans[0].data else { panic!("no scan") };
    // To the left wall, the one behind, and the right one: right to left of one that looks back.
    assert!((ranges[0] - 3.0).abs() < 1e-3 && (ranges[1] - 1.7).abs() < 1e-3, "{ranges:?}");
    let scan = scanner.scan(scanner.robot_from_scanner(), ranges);
    assert!((scan.points[1] - Point3::new(-2.0, 0.0, 0.3)).norm() < 1e-3, "{:?}", scan.points);
}
