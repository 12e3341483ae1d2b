//! Scenes of Follow-Bench in the format of the benchmark's simulator: a world with a robot, a
//! target, people and rectangular obstacles (<https://github.com/MedlarTea/follow-bench>, folders
//! `config` of `socialRPF/dynamic_scenarios` and `socialRPF/layout_scenarios`).

use std::path::Path;

use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, spare, write_file};
use tagalong_config::{FileLimit, PathText, read_text};
use tagalong_sim::{AtEnd, Block, CrowdSettings, LaserSettings, PersonSettings, Scene, Walk};
use yaml_rust2::{Yaml, YamlLoader};

use super::args::ImportArgs;

/// Longest run of the benchmark, s: 400 steps of 0.1 s.
const DURATION_S: f64 = 40.0;
/// Largest number of people and obstacles in a file.
const MOST: usize = 150;

/// Converts a scene of the benchmark to a scene to simulate.
///
/// # Errors
/// Exit code 1 for a file that cannot be read or has another format; 2 for an output that exists.
pub fn import(args: &ImportArgs) -> Outcome {
    let path = &args.path;
    let output = args.output.clone().unwrap_or_else(|| path.with_extension("toml"));
    spare(&output, args.overwrite)?;
    let scene = read(path)?;
    let text = toml::to_string(&scene)
        .map_err(|error| Failure::failed(format!("the scene cannot be written: {error}")))?;
    write_file(&output, text)?;
    let people = scene.people.len();
    print(&match args.format {
        Format::Json => {
            format!("{:#}\n", serde_json::json!({ "scene": PathText(&output), "people": people }))
        }
        Format::Text => format!(
            "the scene with {people} people, the first of them the target, is in {}\n",
            output.display()
        ),
    })?;
    Ok(Ended::Well)
}

fn read(path: &Path) -> Result<Scene, Failure> {
    let name = path.display();
    let text = read_text(path, FileLimit::Config)
        .map_err(|error| Failure::failed(format!("cannot read {name}: {error}")))?;
    let about = path.file_stem().unwrap_or_default().to_string_lossy();
    scene_of_follow_bench(&text, &about)
        .map_err(|why| Failure::failed(format!("{name} is no scene of Follow-Bench: {why}")))
}

/// Reads the YAML text of a scene of the benchmark.
///
/// # Errors
/// A sentence with the cause.
pub fn scene_of_follow_bench(text: &str, about: &str) -> Result<Scene, String> {
    // An alias copies the content of its anchor, so that a few nested ones can fill the memory.
    if text.contains('&') {
        return Err("it has YAML anchors, which the benchmark does not use; write them out".into());
    }
    let documents = YamlLoader::load_from_str(text).map_err(|error| error.to_string())?;
    let Some(root) = documents.first() else { return Err("it is empty".into()) };
    let world = &root["world"];
    let offset_m = numbers::<2>(&world["offset"]).unwrap_or_default();
    let mut scene = Scene { about: about.to_owned(), duration_s: DURATION_S, ..Scene::default() };
    scene.room.size_m =
        [needed(&world["width"], "world.width")?, needed(&world["height"], "world.height")?];
    set_robot(&mut scene, first(&root["robot"], "robot")?, offset_m)?;
    let target = first(&root["target"], "target")?;
    set_crowd(&mut scene.reacting, target)?;
    scene.people.push(person(target, "target", offset_m)?);
    for (number, human) in listed(&root["human"], "human")?.iter().enumerate() {
        scene.people.push(person(human, &format!("human {number}"), offset_m)?);
    }
    for (number, obstacle) in listed(&root["obstacle"], "obstacle")?.iter().enumerate() {
        scene.blocks.push(block(obstacle, &format!("obstacle {number}"), offset_m)?);
    }
    // Imported scenes must also satisfy the rules of scenes.
    let text = toml::to_string(&scene).map_err(|error| error.to_string())?;
    Scene::parse(&text).map_err(|error| error.to_string())
}

fn set_robot(scene: &mut Scene, robot: &Yaml, offset_m: [f64; 2]) -> Result<(), String> {
    let [x, y, heading_rad] = state(&robot["state"], "robot.state", offset_m)?;
    scene.robot.start = [x, y];
    scene.robot.heading_deg = heading_rad.to_degrees();
    let half_m = size_m(&robot["shape"], "robot")?.map(|side| 0.5 * side);
    scene.robot.footprint = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
        .map(|[ahead, left]| [half_m[0] * ahead, half_m[1] * left])
        .to_vec();
    if let Some([speed_mps, _]) = numbers(&robot["vel_max"]) {
        scene.robot.speed_mps = speed_mps;
    }
    let sensors = listed(&robot["sensors"], "robot.sensors")?;
    let lidar = sensors.iter().find(|sensor| sensor["type"].as_str() == Some("lidar2d"));
    if let Some(lidar) = lidar {
        let rays = needed(&lidar["number"], "lidar2d.number")?;
        scene.laser = Some(LaserSettings {
            rays: rays.clamp(0.0, 1e6) as usize,
            field_of_view_deg: needed(&lidar["angle_range"], "lidar2d.angle_range")?.to_degrees(),
            max_range_m: needed(&lidar["range_max"], "lidar2d.range_max")?,
            ..LaserSettings::default()
        });
    }
    Ok(())
}

/// Sets the gait of all people to that of the target.
fn set_crowd(reacting: &mut CrowdSettings, target: &Yaml) -> Result<(), String> {
    let behavior = &target["behavior"];
    reacting.radius_m = needed(&target["shape"]["radius"], "target.shape.radius")?;
    for (value, setting) in [
        (&behavior["safe_dist"], &mut reacting.safe_distance_m),
        (&behavior["acceler"], &mut reacting.acceleration_mps2),
        (&target["goal_threshold"], &mut reacting.reached_m),
    ] {
        *setting = number(value).unwrap_or(*setting);
    }
    Ok(())
}

fn person(person: &Yaml, name: &str, offset_m: [f64; 2]) -> Result<PersonSettings, String> {
    let [x, y, heading_rad] = state(&person["state"], &format!("{name}.state"), offset_m)?;
    let walk = match person["behavior"]["name"].as_str() {
        Some("orca") => Walk::Orca,
        Some("sfm") => Walk::SocialForce,
        other => {
            let other = other.unwrap_or("none");
            return Err(format!("{name} has the behavior `{other}`; known are orca and sfm"));
        }
    };
    let goals = person["goal"].as_vec().ok_or_else(|| format!("{name} has no goal"))?;
    // Tours of the published files are the only entry of a list.
    let tour = goals.first().and_then(|only| only.as_vec());
    let goals = tour.filter(|tour| tour.iter().all(|goal| goal.is_array())).unwrap_or(goals);
    let is_tour = goals.first().is_some_and(|goal| goal.as_vec().is_some());
    let mut path = vec![[x, y]];
    if is_tour {
        for goal in goals.iter().take(MOST) {
            let [x, y, _] = state(goal, &format!("{name}.goal"), offset_m)?;
            // The first goal of the published scenes is the start.
            if path.last() != Some(&[x, y]) {
                path.push([x, y]);
            }
        }
    } else {
        let [x, y, _] = state(&person["goal"], &format!("{name}.goal"), offset_m)?;
        path.push([x, y]);
    }
    let [speed_mps, _] = numbers(&person["vel_max"])
        .ok_or_else(|| format!("{name} has no vel_max of two numbers"))?;
    Ok(PersonSettings {
        path,
        walk,
        speed_mps,
        heading_deg: Some(heading_rad.to_degrees()),
        at_end: if is_tour { AtEnd::Return } else { AtEnd::Stop },
        ..PersonSettings::default()
    })
}

fn block(obstacle: &Yaml, name: &str, offset_m: [f64; 2]) -> Result<Block, String> {
    let [x, y, heading_rad] = state(&obstacle["state"], &format!("{name}.state"), offset_m)?;
    let size_m = size_m(&obstacle["shape"], name)?;
    Ok(Block { at: [x, y], size_m, heading_deg: heading_rad.to_degrees() })
}

/// Returns length and width of a rectangle, m.
fn size_m(shape: &Yaml, name: &str) -> Result<[f64; 2], String> {
    match shape["name"].as_str() {
        Some("rectangle") => Ok([
            needed(&shape["length"], &format!("{name}.shape.length"))?,
            needed(&shape["width"], &format!("{name}.shape.width"))?,
        ]),
        other => {
            let other = other.unwrap_or("none");
            Err(format!("{name} has the shape `{other}`; only rectangles are read"))
        }
    }
}

/// Returns a position in the room, m, and a heading, rad.
fn state(value: &Yaml, name: &str, offset_m: [f64; 2]) -> Result<[f64; 3], String> {
    let [x, y, heading_rad] =
        numbers(value).ok_or_else(|| format!("{name} must have three numbers"))?;
    Ok([x - offset_m[0], y - offset_m[1], heading_rad])
}

fn number(value: &Yaml) -> Option<f64> {
    value.as_f64().or_else(|| value.as_i64().map(|whole| whole as f64)).filter(|n| n.is_finite())
}

fn needed(value: &Yaml, name: &str) -> Result<f64, String> {
    number(value).ok_or_else(|| format!("it has no number {name}"))
}

fn numbers<const COUNT: usize>(value: &Yaml) -> Option<[f64; COUNT]> {
    let all: Option<Vec<f64>> = value.as_vec()?.iter().take(COUNT + 1).map(number).collect();
    all?.try_into().ok()
}

/// Returns the entries of a list; a missing list is empty.
fn listed<'a>(value: &'a Yaml, name: &str) -> Result<&'a [Yaml], String> {
    let entries = value.as_vec().map_or(&[][..], Vec::as_slice);
    if entries.len() > MOST {
        return Err(format!("{name} has {} entries; at most {MOST} are read", entries.len()));
    }
    Ok(entries)
}

fn first<'a>(value: &'a Yaml, name: &str) -> Result<&'a Yaml, String> {
    listed(value, name)?.first().ok_or_else(|| format!("it has no {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "
world: {height: 10.0, width: 40, offset: [0, 1]}
robot:
  - shape: {name: rectangle, length: 0.7, width: 0.55}
    state: [6.7, 6.0, 1.5707963267948966]
    vel_max: [2.0, 3.14]
    sensors: [{type: lidar2d, range_max: 5, angle_range: 6.283185307179586, number: 200}]
target:
  - shape: {name: circle, radius: 0.3}
    state: [8, 6, 0]
    goal: [38.5, 6.0, 0.0]
    vel_max: [1.5, 1.5]
    goal_threshold: 2.0
    behavior: {name: orca, acceler: 1.0, safe_dist: 0.4}
obstacle:
  - shape: {name: rectangle, length: 40.0, width: 2.2}
    state: [20.0, 2.1, 0]
human:
  - shape: {name: circle, radius: 0.3}
    state: [11.5, 6.5, 0.5]
    goal:
      - [[11.5, 6.5, 0.5], [29.5, 4.5, -0.3]]
    vel_max: [1.2, 1.2]
    behavior: {name: sfm}
";

    #[test]
    fn a_scene_has_the_robot_the_people_and_the_walls_of_the_file() {
        let scene = scene_of_follow_bench(SCENE, "corridor").unwrap();
        assert_eq!(scene.room.size_m, [40.0, 10.0]);
        assert_eq!((scene.robot.start, scene.robot.heading_deg), ([6.7, 5.0], 90.0));
        assert_eq!(scene.robot.footprint[0], [0.35, 0.275]);
        let laser = scene.laser.unwrap();
        assert_eq!((laser.rays, laser.max_range_m), (200, 5.0));
        assert_eq!((scene.reacting.safe_distance_m, scene.reacting.reached_m), (0.4, 2.0));
        let [target, human] = &scene.people[..] else { panic!("{:?}", scene.people) };
        assert_eq!(target.path, [[8.0, 5.0], [38.5, 5.0]]);
        assert_eq!((target.walk, target.at_end, target.speed_mps), (Walk::Orca, AtEnd::Stop, 1.5));
        assert_eq!(human.path, [[11.5, 5.5], [29.5, 3.5]]);
        assert_eq!((human.walk, human.at_end), (Walk::SocialForce, AtEnd::Return));
        let walls = [Block { at: [20.0, 1.1], size_m: [40.0, 2.2], heading_deg: 0.0 }];
        assert_eq!(scene.blocks, walls);
    }

    #[test]
    fn files_with_something_else_are_refused_with_the_cause() {
        for (from, to, cause) in [
            ("width: 40", "depth: 40", "world.width"),
            ("name: sfm", "name: rvo", "`rvo`"),
            ("target:", "goal:", "no target"),
            ("rectangle, length: 40.0", "polygon, length: 40.0", "`polygon`"),
            ("state: [8, 6, 0]", "state: [8, 6]", "three numbers"),
            ("width: 40", "width: 4000", "size_m"),
            ("world:", "world: &a", "anchors"),
            ("world:", "world: [", "at "),
        ] {
            let why = scene_of_follow_bench(&SCENE.replace(from, to), "x").unwrap_err();
            assert!(why.contains(cause), "{to}: {why}");
        }
        assert!(scene_of_follow_bench("", "x").is_err());
    }

    #[test]
    fn the_published_scenes_are_read() {
        let folder =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/follow-bench");
        let Ok(files) = std::fs::read_dir(folder) else { return };
        let mut people = Vec::new();
        for file in files.flatten().map(|entry| entry.path()) {
            if file.extension().is_some_and(|ending| ending == "yaml") {
                let scene = read(&file).unwrap_or_else(|failure| panic!("{failure:?}"));
                people.push((scene.about, scene.people.len(), scene.blocks.len()));
            }
        }
        people.sort();
        let expected = [
            ("CorridorOrcaH4W5.6_back_1".to_owned(), 5, 2),
            ("DoorwayOrcaH2W2.8_back_1".to_owned(), 3, 2),
            ("IntersectionOrcaH2W4.8_back_1".to_owned(), 3, 4),
            ("NormalCircularOrcaH10W0_back_1".to_owned(), 11, 0),
        ];
        assert_eq!(people, expected);
    }
}
