use clap::Parser;

use super::*;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    follow: FollowArgs,
}

/// A person stands where the camera does not look, behind the robot or, with `block`, behind a wall.
fn scene(block: &str) -> Scene {
    let text = format!(
        "duration_s = 6.0\n{block}\n[camera]\nwidth = 80\nheight = 60\nrate_hz = 10.0\n\
         [room]\nsize_m = [12.0, 8.0]\n[robot]\nstart = [7.0, 4.0]\n\
         [[people]]\nwalk = 'orca'\npath = [[3.0, 4.0], [2.9, 4.0]]\n"
    );
    Scene::parse(&text).unwrap()
}

fn ridden(block: &str, is_told: bool) -> Ridden {
    let registry = tagalong_catalog::registry();
    let config = "[[detectors]]\nplugin = \"depth-template\"\nroles = [\"track\", \"discover\"]\n\
        [filter]\nplugin = \"ekf\"\n[controller]\nplugin = \"clear-follow\"\n";
    let seeing = Contender::new("follow", config);
    let ride = if is_told {
        Ride::told(&scene(block), &seeing.told(&registry).unwrap(), &registry, &mut ())
    } else {
        Ride::new(&scene(block), &seeing, &registry, &mut ())
    };
    RideJudge::default().judge(&ride.unwrap())
}

#[test]
fn a_pipeline_that_is_told_follows_a_person_behind_the_robot_but_not_behind_a_wall() {
    let told = ridden("", true);
    assert!(told.right_s > 4.0 && told.wrong_s == 0.0, "{told:?}");
    let seeing = ridden("", false);
    assert_eq!(seeing.right_s, 0.0, "{seeing:?}");
    let hidden = ridden("blocks = [{ at = [5.0, 4.0], size_m = [0.2, 6.0] }]", true);
    assert_eq!(hidden.right_s, 0.0, "{hidden:?}");
}

#[test]
fn each_pipeline_is_told_beside_seeing() {
    let seeing = ("follow-depth".to_owned(), false);
    let told = ("follow-depth-told".to_owned(), true);
    assert_eq!(jobs_with(&[]), [seeing.clone(), seeing.clone()]);
    assert_eq!(jobs_with(&["--told"]), [seeing.clone(), seeing, told.clone(), told]);
}

/// The name of each job's pipeline, and whether it is told, with these further arguments.
fn jobs_with(more: &[&str]) -> Vec<(String, bool)> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/follow-depth.toml");
    let registry = tagalong_catalog::registry();
    let line = ["follow", config.to_str().expect("UTF-8"), "among-circular", "--seeds", "2"];
    let args = Cli::parse_from(line.iter().chain(more)).follow;
    let seeds = args.split.seeds(0, args.seeds).expect("enough seeds");
    let jobs = jobs(&args, seeds, &registry).expect("valid arguments");
    jobs.into_iter().map(|job| (job.contender.name, job.is_told)).collect()
}

#[test]
fn a_source_of_obstacles_that_the_scene_lacks_is_named_before_the_ride() {
    let registry = tagalong_catalog::registry();
    let config = "[[detectors]]\nplugin = \"depth-template\"\nroles = [\"track\", \"discover\"]\n\
        [filter]\nplugin = \"ekf\"\n[controller]\nplugin = \"clear-follow\"\n\
        [[collision_monitor.sources]]\nname = \"hazards\"\ntype = \"bumper\"\n";
    let contender = Contender::new("robot", config);
    let [other, none, same] =
        ["bumpers = [{ name = \"other\" }]", "", "bumpers = [{ name = \"hazards\" }]"]
            .map(|block| Ride::new(&scene(block), &contender, &registry, &mut ()));
    let refused = other.unwrap_err().to_string();
    assert!(refused.contains("lacks the source `hazards`"), "{refused}");
    assert!(refused.contains("add `[[bumpers]]` with `name = \"hazards\"`"), "{refused}");
    let refused = none.unwrap_err().to_string();
    assert!(refused.contains("--set 'bumpers=[{name=\"hazards\"}]'"), "{refused}");
    assert!(same.is_ok());
}

/// Returns the refusal of an argument line, whose paths are those of a clone.
fn refusal(line: &[&str]) -> String {
    let registry = tagalong_catalog::registry();
    let args = Cli::parse_from(std::iter::once(&"follow").chain(line)).follow;
    let seeds = args.split.seeds(0, args.seeds).unwrap();
    match jobs(&args, seeds, &registry) {
        Ok(_) => String::new(),
        Err(failure) => failure.message,
    }
}

#[test]
fn a_laser_scanner_that_the_pipeline_requires_is_asked_for_before_the_ride() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/robots/turtlebot3.toml");
    let line = [config.to_str().unwrap(), "follow-passing"];
    let refused = refusal(&line);
    assert!(refused.contains("add it with `--set 'laser={}'`"), "{refused}");
    assert_eq!(refusal(&[line[0], line[1], "--set", "laser={}"]), "");
}

#[test]
fn a_fault_after_the_end_of_the_ride_is_refused() {
    let line = ["follow-depth", "follow-passing", "--inject", "drop@500"];
    let refused = refusal(&line);
    assert!(refused.contains("--inject drop@500: the ride ends at "), "{refused}");
    assert!(refused.contains("`--set duration_s=520.0`"), "{refused}");
    assert_eq!(refusal(&[line[0], line[1], "--inject", "drop@5"]), "");
}

#[test]
fn a_scene_in_place_of_the_config_leads_to_the_command_that_was_meant() {
    for (line, command) in [
        (&["follow-passing"][..], "`tagalong follow follow-depth follow-passing`"),
        (&["follow-passing", "follow-low"], "`tagalong follow follow-low follow-passing`"),
    ] {
        let refused = refusal(line);
        assert!(refused.ends_with(&format!("is a scene: {command}")), "{refused}");
    }
}

#[test]
fn a_config_without_a_controller_leads_to_those_with_one() {
    let refused = refusal(&["depth-ekf", "follow-passing"]);
    assert!(refused.contains("built-in configs with one: "), "{refused}");
    assert!(refused.contains("follow-depth") && !refused.contains("depth-verified"), "{refused}");
}

#[test]
fn the_summary_is_first_and_the_calibration_last_and_on_request() {
    fn table(title: &str) -> Table {
        let title = title.to_owned();
        Table { title, columns: Vec::new(), rows: Vec::new(), notes: Vec::new() }
    }

    let tables = [table("Following"), table("How far the lock of a can be believed")];
    let ride = Followed { story: vec!["0.1 s  track 1".into()], ..Followed::default() };
    let order = ["Why the robot", "Following", "0.1 s  track 1", "How far the lock"];
    let with = text(std::slice::from_ref(&ride), &tables, true);
    let places: Vec<_> = order.iter().map(|part| with.find(part).expect("is told")).collect();
    assert!(places.is_sorted(), "{with}");
    let without = text(std::slice::from_ref(&ride), &tables, false);
    assert!(!without.contains("How far the lock") && without.contains("Following"), "{without}");
    let two = text(&[ride.clone(), ride], &tables, false);
    assert!(!two.contains("track 1"), "{two}");
}
