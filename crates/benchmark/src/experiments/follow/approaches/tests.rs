use std::collections::BTreeSet;

use clap::Parser;
use tagalong_core::{Controller, Scene as Steered, Twist};
use tagalong_sim::{ApproachBy, ApproachSettings};
use tagalong_trials::Side;

use super::*;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    follow: FollowArgs,
}

fn args(line: &str) -> FollowArgs {
    Cli::parse_from(std::iter::once("follow").chain(line.split_whitespace())).follow
}

/// Never moves.
struct Standing;

impl Controller for Standing {
    fn command(&mut self, _: &Steered<'_>) -> Twist {
        Twist::STOP
    }
}

fn registry() -> Registry {
    let mut registry = tagalong_catalog::registry();
    registry.controller("stands", "stands", |_: Unset, _| Ok(Standing));
    registry
}

/// Settings of a controller without any.
#[derive(Clone, Default, Serialize, serde::Deserialize, schemars::JsonSchema)]
struct Unset {}

/// A pipeline whose collision monitor is off.
fn unheeding(controller: &str) -> Contender {
    let config = format!(
        "[[detectors]]\nplugin = \"depth-template\"\nroles = [\"track\", \"discover\"]\n\
         [filter]\nplugin = \"ekf\"\n[controller]\nplugin = \"{controller}\"\n\
         [collision_monitor]\nobstacles = \"none\"\n"
    );
    Contender::new(controller, config)
}

/// Rides these approaches, some at a time.
fn ridden(controller: &str, count: u64, line: &str, threads: usize) -> Vec<Approached> {
    let contenders = [unheeding(controller)];
    let args = args(line);
    let paths = scenes(&args);
    let jobs = jobs(&args, &contenders, &paths, Split::Test.seeds(0, count).unwrap());
    let registry = registry();
    let signals = Signals::default();
    let results =
        in_order(&jobs, threads, |job| approach(job, &args, &registry, &signals), |_| {}).unwrap();
    results.into_iter().map(|one| one.unwrap().approached).collect()
}

#[test]
fn approaches_come_from_all_sides_at_all_speeds() {
    fn approach(scene: &Scene) -> &ApproachSettings {
        scene.approach.as_ref().unwrap()
    }

    let args = args("--approaches 500 --faults one");
    let contenders = [unheeding("stands")];
    let paths = scenes(&args);
    let jobs = jobs(&args, &contenders, &paths, seeds(&args).unwrap());
    let scenes: Vec<Scene> = jobs.iter().map(|job| read_scene(job, &args).unwrap()).collect();
    assert_eq!(scenes.len(), 500);
    for eighth in 0..8 {
        let there = count_of(&scenes, |s| (approach(s).bearing_deg / 45.0) as i32 == eighth);
        assert!((40..90).contains(&there), "{eighth}: {there}");
    }
    for seventh in 0..7 {
        let low = 0.2 + 0.2 * f64::from(seventh);
        let there = count_of(&scenes, |s| (low..low + 0.2).contains(&approach(s).speed_mps));
        assert!((45..100).contains(&there), "{low} m/s: {there}");
    }
    for side in Side::ALL {
        let near = scenes.iter().map(approach).filter(|of| of.distance_m() < 3.0);
        let near = near.filter(|of| Side::of_bearing(of.bearing_deg) == side);
        assert!(near.count() > 20, "{side}");
    }
    for by in [ApproachBy::Person, ApproachBy::Trolley] {
        let aimed = count_of(&scenes, |s| approach(s).by == by && approach(s).aims);
        assert!(aimed > 90, "{by:?}: {aimed}");
    }
    for height_m in [0.3, 0.5, 0.8, 1.2] {
        for latency_s in [0.1, 0.4] {
            let high = scenes.iter().filter(|scene| scene.camera.height_m == height_m);
            let late = high.filter(|scene| scene.robot.latency_s == latency_s).count();
            assert!(late > 35, "{height_m} m, {latency_s} s: {late}");
        }
    }
    assert_eq!(count_of(&scenes, |scene| scene.laser.is_some()), 250);
    let faults: Vec<_> = scenes.iter().flat_map(Scene::scheduled_faults).collect();
    let kinds: BTreeSet<&str> = faults.iter().map(|fault| fault.kind.name()).collect();
    assert!(faults.len() == 500 && kinds.len() > 20, "{kinds:?}");
    assert!(
        scenes
            .iter()
            .all(|scene| { scene.scheduled_faults()[0].from_s <= approach(scene).arrives_s() })
    );
}

/// The number of scenes that have a property.
fn count_of(scenes: &[Scene], has_it: impl Fn(&Scene) -> bool) -> usize {
    scenes.iter().filter(|scene| has_it(scene)).count()
}

#[test]
fn a_robot_that_heeds_nothing_moves_at_contacts_and_one_that_stands_does_not() {
    // At this height the robot finds the person, without whom it does not move.
    let line = "--approaches 12 --set camera.height_m=1.2";
    let driven = ridden("clear-follow", 8, line, 2);
    let contacts = driven.iter().filter(|one| one.contact.is_some()).count();
    assert!(contacts >= 1, "{contacts}");
    let stood = ridden("stands", 12, line, 2);
    assert!(stood.iter().all(|one| one.contact.is_none() && !one.moved));
    let touched = stood.iter().filter(|one| one.touched.is_some()).count();
    assert!(touched >= 7, "an approacher reaches a robot that stands: {touched}");
}

#[test]
fn a_seed_gives_the_same_approach_on_any_number_of_jobs() {
    let line = "--approaches 4 --faults one";
    let alone = ridden("clear-follow", 4, line, 1);
    assert_eq!(alone, ridden("clear-follow", 4, line, 2));
    let seeds: Vec<u64> = alone.iter().map(|one| one.seed).collect();
    assert_eq!(seeds, [2_000_000_000, 2_000_000_001, 2_000_000_002, 2_000_000_003]);
}

#[test]
fn contacts_leave_a_log_and_other_approaches_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder_shown = folder.path().display();
    let line = format!("--approaches 12 --set camera.height_m=1.2 -o {folder_shown}");
    let ridden = ridden("clear-follow", 8, &line, 2);
    for one in &ridden {
        let file = folder.path().join(format!("approach-clear-follow-{}.mcap", one.seed));
        assert_eq!(file.exists(), one.contact.is_some(), "{}", file.display());
    }
    assert!(ridden.iter().any(|one| one.contact.is_some()));
}

#[test]
fn a_replay_tells_what_came_from_where() {
    let contenders = [unheeding("clear-follow")];
    let args = args("--replay 2000000003 --faults one");
    let paths = scenes(&args);
    let jobs = jobs(&args, &contenders, &paths, seeds(&args).unwrap());
    let [job] = &jobs[..] else { panic!("one job") };
    let told = approach(job, &args, &registry(), &Signals::default()).unwrap().unwrap();
    assert_eq!(
        kept(Path::new("rep"), std::slice::from_ref(&told)),
        "the tables are in rep; no robot moved at a contact, so no log was kept"
    );
    let log = Some(PathBuf::from("rep/approach-follow-2000000003.mcap"));
    assert_eq!(
        kept(Path::new("rep"), &[Outlived { log, ..told.clone() }]),
        "the tables and the logs of 1 ride are in rep; `tagalong view rep/approach-follow-2000000003` \
         shows one"
    );
    assert_eq!(told.approached, ridden("clear-follow", 4, "--approaches 4 --faults one", 1)[3]);
    let story = told.story.join("\n");
    assert!(story.starts_with("seed 2000000003: a "), "{story}");
    assert!(story.contains("\nfault: ") && story.contains("the approacher is"), "{story}");
}

#[test]
fn a_scene_without_an_approach_is_refused_with_a_remedy() {
    let args = args("configs/follow-depth.toml demo --approaches 2");
    let contenders = [unheeding("stands")];
    let paths = scenes(&args);
    let jobs = jobs(&args, &contenders, &paths, seeds(&args).unwrap());
    let error = read_scene(&jobs[0], &args).unwrap_err();
    assert!(error.message.contains("add one, or leave out the scene"), "{}", error.message);
}
