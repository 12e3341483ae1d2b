use proptest::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{Kind, commented_defaults};

use crate::tests::doubles::{PLAIN, World, frame, person};
use crate::{MissingSource, Pipeline, PipelineSettings, Sources};

fn build(text: &str) -> Result<Pipeline, String> {
    let built = Pipeline::builder(&World::default().registry()).from_toml(text);
    built.map_err(|error| error.to_string())
}

const FILTER: &str = "filter.plugin = 'steady'\n";
const SCRIPT: &str = "[[detectors]]\nplugin = 'script'\n";

#[test]
fn a_section_may_name_no_plugin_only_where_a_default_of_its_kind_is_registered() {
    let config = format!("{FILTER}{SCRIPT}");
    let pipeline = build(&config).unwrap();
    let values = pipeline.config().values();
    assert_eq!(values["associator"]["plugin"].as_str(), Some("associate-hungarian"));
    assert_eq!(values["manager"]["plugin"].as_str(), Some("manage-m-of-n"));

    let mut registry = World::default().registry();
    registry.default_plugin(Kind::Associator, "not registered");
    let error = Pipeline::builder(&registry).from_toml(&config).map(drop).unwrap_err().to_string();
    assert!(error.contains("add a section [associator] with `plugin"), "{error}");
    let named = format!("associator.plugin = 'associate-hungarian'\n{config}");
    assert!(Pipeline::builder(&registry).from_toml(&named).is_ok());
}

#[test]
fn mistakes_are_shown_with_their_place_and_the_remedy() {
    fn plain(rest: &str) -> String {
        format!("{FILTER}{SCRIPT}{rest}")
    }

    fn own(line: &str) -> String {
        format!("{line}\n{FILTER}{SCRIPT}")
    }

    let weighing = "filter = { plugin = 'odd', config = { how = 'weighs' } }\n";
    let cases: Vec<(String, &[&str])> = vec![
        (
            own("suits.camera_height_m = [2.0, 1.0]"),
            &["config.toml:1:", "the lowest and the highest value"],
        ),
        (own("suits.heigth = [1.0, 2.0]"), &["config.toml:1:7", "unknown field `heigth`"]),
        (own("sed = 1"), &["config.toml:1:1", "unknown key `sed`", "did you mean `seed`?"]),
        (
            own("manager.config.confirm_hit = 1"),
            &["config.toml:1:16", "did you mean `confirm_hits`?"],
        ),
        (
            own("associator.config.cost = 'overlapp'"),
            &["config.toml:1:26", "did you mean `overlap`?"],
        ),
        (own("associator.config.gate = -1.0"), &["config.toml:1:26", "`gate` must be positive"]),
        (own("associator.config.gate_m = nan"), &["config.toml:1:28", "`gate_m` must be positive"]),
        (
            own("occlusion.min_visible = 1.5"),
            &["config.toml:1:25", "must be positive and at most 1, not 1.5"],
        ),
        (
            own("manager.config.confirm_hits = 9"),
            &["config.toml:1:", "`confirm_within` must be at least 9"],
        ),
        (
            own("manager.config.confirm_within = 40"),
            &["config.toml:1:33", "`confirm_within` must lie between 1 and 32"],
        ),
        (
            own("association.gate = 9.0"),
            &["config.toml:1:1", "now `[associator.config]`", "[merge]"],
        ),
        (own("governor.margin_m = 0.5"), &["config.toml:1:1", "now `[command_limiter]`"]),
        (plain("roles = ['follow']"), &["config.toml:4:10", "role `follow` is now `track`"]),
        (own("lifecycle.confirm_hits = 2"), &["config.toml:1:1", "now `[manager.config]`"]),
        (
            own("manager.plugin = 'steady'"),
            &["config.toml:1:18", "`steady` is a filter, not a track"],
        ),
        (
            own("associator.plugin = 'manage-m-of-n'"),
            &["not an associator; available", "hungarian"],
        ),
        (
            own("robot.max_speed_mps = inf"),
            &["config.toml:1:23", "must lie between 0.05 and 0.9, not inf"],
        ),
        (own("stereo.window = 4"), &["config.toml:1:17", "`stereo.window` must be 3, 5, 7 or 9"]),
        (
            own("odometry.cell_px = 4"),
            &["config.toml:1:20", "`odometry.cell_px` must lie between 8 and 256"],
        ),
        (own("stereo.metod = 'block'"), &["config.toml:1:8", "did you mean `method`?"]),
        (own("stereo.method = 'blok'"), &["config.toml:1:17", "did you mean `block`?"]),
        (own("seed = 'x'"), &["config.toml:1:8", "invalid type"]),
        (own("seed = -4"), &["config.toml:1:8"]),
        (own("seed = "), &["config.toml:1:8"]),
        (own("seed = 1\nseed = 2"), &["config.toml:2:1", "duplicate key"]),
        (SCRIPT.into(), &["config.toml: no filter: add a section [filter]"]),
        (FILTER.into(), &["no detector discovers anybody"]),
        (plain("every = 0"), &["config.toml:4:9", "`every` must be at least 1"]),
        (plain("every = 2\noffset = 2"), &["config.toml:5:10", "2 is not below 2"]),
        (plain("roles = []"), &["config.toml:4:9", "`script` has no role"]),
        (plain("roles = ['trak']"), &["config.toml:4:10", "did you mean `track`?"]),
        (plain("roles = ['track']"), &["config.toml:2:1", "give one of [[detectors]] the role"]),
        (plain("roles = ['discover', 'weigh']"), &["config.toml:4:9", "cannot weigh scenes"]),
        (
            plain("config = { how = 'track' }"),
            &["config.toml:2:1", "`script` cannot discover people: remove the role discover"],
        ),
        (
            plain("roles = ['discover', 'track']\nconfig = { how = 'discover' }"),
            &["config.toml:4:9", "cannot find a tracked person again: remove the role track"],
        ),
        (own("without = ['dept']"), &["config.toml:1:12", "did you mean `depth`?"]),
        (
            format!("without = ['depth']\n{}config = {{ how = 'depth' }}", plain("")),
            &[
                "config.toml:1:11",
                "`script` requires depth images",
                "remove \"depth\" from `without`",
            ],
        ),
        (
            format!("without = ['depth']\nodometry = {{}}\n{}", plain("")),
            &["config.toml:1:11", "`[odometry]` requires depth images"],
        ),
        (
            format!("without = ['right']\nstereo = {{}}\n{}", plain("")),
            &["config.toml:1:11", "`[stereo]` requires right images of a stereo pair"],
        ),
        (plain("rolls = ['discover']"), &["config.toml:4:1", "did you mean `roles`?"]),
        (plain("config = { scrip = 1 }"), &["config.toml:4:12", "did you mean `script`?"]),
        (plain("[controller]\nplugin = 'script'"), &["config.toml:5:10", "not a controller"]),
        (
            format!("{FILTER}[[detectors]]\nplugin = 'scripts'"),
            &["config.toml:3:10", "unknown detector plugin `scripts`", "did you mean `script`?"],
        ),
        (format!("{SCRIPT}[filter]\nplugin = 'choosy'"), &["config.toml:4:10", "is a verifier"]),
        (format!("{FILTER}[detectors]\nplugin = 'script'"), &["config.toml:2:1", "[[detectors]]"]),
        (format!("{FILTER}detectors = [1]"), &["config.toml:2:14", "must be a table"]),
        (format!("{weighing}{SCRIPT}"), &["config.toml:1:21", "add the role weigh to a detector"]),
        ("\u{0}".into(), &["config.toml:1:"]),
    ];
    for (text, expected) in cases {
        let shown = build(&text).map(|_| ()).expect_err(&text);
        for words in expected {
            assert!(shown.contains(words), "{text}\n{shown}\nlacks {words}");
        }
    }
}

#[test]
fn a_filter_that_weighs_scenes_is_content_with_a_detector_that_does() {
    let filter = "filter = { plugin = 'odd', config = { how = 'weighs' } }\n";
    let roles = "roles = ['discover', 'weigh']\nconfig = { how = 'weigh' }\n";
    build(&format!("{filter}{SCRIPT}{roles}")).map(|_| ()).unwrap();
}

#[test]
fn too_long_and_too_deep_configs_are_refused() {
    let long = format!("{PLAIN}\n# {}", "x".repeat(1 << 20));
    assert!(build(&long).err().unwrap().contains("at most 1048576 are read"));
    let deep = format!("input = {}1{}\n{PLAIN}", "[".repeat(40), "]".repeat(40));
    assert!(build(&deep).err().unwrap().contains("config.toml:1:9: nested deeper than 32 levels"));
    let deeper = format!("input = {}1{}\n{PLAIN}", "[".repeat(50_000), "]".repeat(50_000));
    assert!(build(&deeper).is_err());
    assert!(build(&format!("input{} = 1\n{PLAIN}", ".a".repeat(50_000))).is_err());
}

#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Input {
    /// A topic.
    topic: String,
}

#[test]
fn tables_of_others_are_left_to_them() {
    let text = format!("{PLAIN}\n[input]\ntopic = '/depth'\n[limits]\ntpoic = 1");
    let pipeline = build(&text).unwrap();
    let config = pipeline.config();
    assert_eq!(config.table::<Input>("input").unwrap().topic, "/depth");
    assert_eq!(config.table::<Input>("absent").unwrap().topic, "");
    let error = config.table::<Input>("limits").unwrap_err().to_string();
    assert!(error.contains("did you mean `topic`?") && error.contains("tpoic = 1"), "{error}");
}

#[test]
fn the_resolved_config_holds_every_default_and_means_the_same() {
    let text = format!("{PLAIN}\n[manager.config]\nconfirm_hits = 2\n[input]\ntopic = 'x'");
    let pipeline = build(&text).unwrap();
    let resolved = pipeline.resolved();
    for line in ["gate = 11.34", "confirm_hits = 2", "every = 1", "how = \"\"", "topic = \"x\""] {
        assert!(resolved.contains(line), "{line} in\n{resolved}");
    }
    let again = build(&resolved).unwrap();
    assert_eq!(again.resolved(), resolved);
}

#[test]
fn the_seed_can_be_replaced() {
    let registry = World::default().registry();
    let builder = Pipeline::builder(&registry);
    let pipeline = builder.clone().seed(42).from_toml(PLAIN).unwrap();
    assert_eq!(pipeline.config().seed, 42);
    assert!(pipeline.resolved().contains("seed = 42"));
    let error = builder.seed(u64::MAX).from_toml(PLAIN).err().unwrap();
    assert!(error.to_string().contains("`seed` must be at most"));
}

#[test]
fn the_defaults_are_printed_under_their_documentation_and_parse() {
    let text = commented_defaults::<PipelineSettings>();
    for key in ["[merge]", "# Largest number of detections in a frame;", "max_detections = 1024"] {
        assert!(text.contains(key), "{key} in\n{text}");
    }
    for key in ["# [stereo]", "# method = \"semi-global\"", "# min_depth_m = 0.5"] {
        assert!(text.contains(key), "{key} in\n{text}");
    }
    assert_eq!(toml::from_str::<PipelineSettings>(&text).unwrap(), PipelineSettings::default());
}

#[test]
fn a_pipeline_built_from_text_tracks() {
    let world = World::of([vec![person(2.0, 0.0)]]);
    let report = world.pipeline(PLAIN).step(frame(1, 0.0)).unwrap();
    assert_eq!(report.tracks.len(), 1);
}

/// Returns a copy of the table, as lines, for each number that is replaced by NaN.
fn without_a_number(table: &toml::Table, path: &str) -> Vec<String> {
    let mut lines = Vec::new();
    for (key, value) in table {
        let name = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        match value {
            toml::Value::Float(_) => lines.push(format!("{name} = nan")),
            toml::Value::Array(_) => {
                lines.extend([format!("{name} = [nan, 1.0]"), format!("{name} = [1.0, nan]")]);
            }
            toml::Value::Table(inner) => lines.extend(without_a_number(inner, &name)),
            _ => {}
        }
    }
    lines
}

/// A comparison with NaN is never true: the robot would drive on.
#[test]
fn no_setting_may_be_no_number() {
    let defaults = toml::Table::try_from(PipelineSettings::default()).unwrap();
    let lines = without_a_number(&defaults, "");
    assert!(lines.len() > 40, "{}", lines.len());
    for line in lines {
        let shown = build(&format!("{line}\n{PLAIN}")).map(|_| ()).expect_err(&line);
        assert!(shown.starts_with("config.toml:1:"), "{line}: {shown}");
    }
}

#[test]
fn settings_may_be_at_their_bounds_and_not_beyond() {
    for (line, fits) in [
        ("associator.config.gate = 0.0", false),
        ("associator.config.gate = inf", false),
        ("robot.wheel_slip = 0.0", true),
        ("robot.wheel_slip = -0.01", false),
        ("robot.wheel_slip = inf", false),
        ("occlusion.min_visible = 1.0", true),
        ("occlusion.min_visible = 0.0", false),
        ("target.again_from = 0.99", true),
        ("target.again_from = 1.0", false),
        ("target.again_from = 0.0", false),
        ("target.refuse_below = 0.4", true),
        ("target.refuse_below = 0.41", false),
        ("manager.config.miss_score = -inf", false),
        ("manager.config.drop_score = -inf", false),
        ("manager.config.drop_score = -1e9", true),
        ("manager.config.drop_score = 0.0", true),
        ("manager.config.drop_score = 0.1", false),
        ("manager.config.confirm_within = 2", true),
        ("manager.config.confirm_within = 1", false),
        ("manager.config.confirm_within = 32", true),
        ("merge.max_tracks = 0", false),
        ("clock = { max_gap_s = 2.0, reset_gap_s = 2.0 }", true),
        ("clock = { max_gap_s = 2.0, reset_gap_s = 1.9 }", false),
        ("collision_monitor.range_m = 10.0", true),
        ("collision_monitor.range_m = 10.1", false),
        // The ceilings of the governor, and the limits that contradict each other.
        ("robot.max_speed_mps = 0.91", false),
        ("robot.max_speed_mps = 50.0", false),
        ("robot.wheel_half_separation_m = 0.0", false),
        ("command_limiter.valid_s = 0.5", true),
        ("command_limiter.valid_s = 0.51", false),
        ("command_limiter.valid_s = 3600.0", false),
        ("command_limiter.stop_after_s = 1e9", false),
        ("command_limiter.margin_m = 0.0", false),
        ("command_limiter.reaction_s = 0.0", false),
        ("command_limiter.enable_s = 1.0", true),
        ("command_limiter.enable_s = 1.1", false),
        ("command_limiter.enable_s = 0.0", false),
        ("command_limiter.max_accel_mps2 = 1.1", false),
        ("command_limiter.max_decel_mps2 = 100.0", false),
        ("command_limiter.max_turn_accel_radps2 = 100.0", false),
        ("command_limiter.max_jerk_mps3 = 50.0", true),
        ("command_limiter.max_jerk_mps3 = 0.9", false),
        ("command_limiter.max_turn_jerk_radps3 = 501.0", false),
        ("robot = { base = 'ackermann', min_turn_radius_m = 0.1 }", true),
        ("robot = { base = 'ackermann', min_turn_radius_m = 0.0 }", false),
        ("robot.base = 'tracked'", false),
        ("target.choose = 'approach'", true),
        ("target.choose = 'nobody'", false),
        ("command_limiter = { reaction_s = 0.25, valid_s = 0.25 }", true),
        ("command_limiter = { reaction_s = 0.24, valid_s = 0.25 }", false),
        ("command_limiter = { slow_after_s = 0.5, stop_after_s = 0.4 }", false),
        ("command_limiter = { max_accel_mps2 = 0.8, max_decel_mps2 = 0.7 }", false),
        ("command_limiter.max_odometry_mps = 0.8", false),
        ("command_limiter.max_odometry_radps = 1.4", false),
        ("command_limiter.max_odometry_radps = 1.5", true),
        ("command_limiter.max_odometry_radps = 13.0", false),
        ("collision_monitor.min_seen = 0.0", false),
        ("collision_monitor.stop_m = 0.0", false),
        ("collision_monitor.memory_s = 0.0", false),
        ("robot.footprint = [[0.3, 0.16], [0.3, -0.16], [-0.3, -0.16], [-0.3, 0.16]]", false),
        ("robot.footprint = [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]", true),
        ("robot.footprint = [[0.9, 0.2], [0.9, -0.2], [0.3, 0.0]]", false),
        ("robot.footprint = [[0.3, 0.2], [0.3, -0.2]]", false),
        ("robot.footprint = [[0.3, nan], [0.3, -0.2], [-0.3, 0.2]]", false),
        ("robot.height_m = 1.6", false),
        ("collision_monitor.range_m = 1.29", false),
        ("collision_monitor.range_m = 1.3", true),
        ("collision_monitor.obstacles = 'none'", true),
        ("collision_monitor.obstacles = 'off'", false),
        ("robot.odometry = 'none'", true),
        ("robot.odometry = false", false),
    ] {
        assert_eq!(build(&format!("{line}\n{PLAIN}")).is_ok(), fits, "{line}");
    }
}

#[test]
fn a_limit_beyond_its_ceiling_is_shown_with_its_line_and_the_remedy() {
    fn refused(line: &str) -> String {
        build(&format!("seed = 1\n{line}\n{PLAIN}")).map(drop).unwrap_err()
    }

    for (line, words) in [
        ("robot.max_speed_mps = 50.0", "max_speed_mps` must lie between 0.05 and 0.9, not 50"),
        ("command_limiter.valid_s = 3600.0", "valid_s` must lie between 0.05 and 0.5, not 3600"),
        ("command_limiter.reaction_s = 0.2", "must be at least 0.25, as `valid_s`, not 0.2"),
        ("collision_monitor.range_m = 1.2", "raise it or lower `max_speed_mps` in [robot]"),
    ] {
        let shown = refused(line);
        assert!(shown.contains("config.toml:2:"), "{shown}");
        assert!(shown.contains(words), "{shown}");
    }
}

#[test]
fn a_controller_without_sensors_of_obstacles_is_refused_unless_the_config_says_so() {
    fn with(head: &str) -> Result<(), String> {
        let text = format!("{head}\n{PLAIN}[controller]\nplugin = 'drive'\n");
        build(&text).map(drop)
    }

    let blind = "without = ['depth', 'laser']";
    let refused = with(blind).unwrap_err();
    for words in ["config.toml:1:", "no sensor of obstacles", "obstacles = \"none\"", "without = "]
    {
        assert!(refused.contains(words), "{refused}");
    }
    assert_eq!(with("without = ['depth']"), Ok(()), "a laser may be there");
    assert_eq!(with("without = ['laser']"), Ok(()), "depth may be there");
    assert_eq!(with(&format!("{blind}\ncollision_monitor.obstacles = 'none'")), Ok(()));
    assert_eq!(build(&format!("{blind}\n{PLAIN}")).map(drop), Ok(()), "no controller");
}

#[test]
fn a_source_without_the_data_of_a_controller_is_refused_unless_the_config_says_so() {
    fn check(head: &str, tail: &str, sources: Sources) -> Result<(), MissingSource> {
        let text = format!("{head}\n{PLAIN}{tail}");
        build(&text).unwrap().check_sources(sources)
    }

    let all = Sources { depth: true, right: false, laser: true, odometry: true };
    let eyes = Sources { depth: false, laser: false, ..all };
    let odometry = Sources { odometry: false, ..all };
    let drive = "[controller]\nplugin = 'drive'\n";
    assert_eq!(check("", drive, all), Ok(()));
    assert_eq!(check("", drive, Sources { depth: false, ..all }), Ok(()));
    assert_eq!(check("", drive, Sources { laser: false, ..all }), Ok(()));
    assert_eq!(check("", drive, eyes), Err(MissingSource::Obstacles));
    assert_eq!(check("", drive, Sources { right: true, ..eyes }), Err(MissingSource::Obstacles));
    assert_eq!(check("collision_monitor.obstacles = 'none'", drive, eyes), Ok(()));
    assert_eq!(check("", drive, odometry), Err(MissingSource::Odometry));
    assert_eq!(check("robot.odometry = 'none'", drive, odometry), Ok(()));
    assert_eq!(check("", "", Sources::default()), Ok(()), "without a controller");
    let none = "controller.plugin = 'none'\n";
    let left_out = format!("{none}controller.config = {{ keeps = 1 }}");
    assert_eq!(check(&left_out, "", Sources::default()), Ok(()), "an inherited one is left out");
    let pipeline = build(&format!("{none}{PLAIN}")).expect("a pipeline without a controller");
    assert!(!pipeline.has_controller());
    assert_eq!(pipeline.config().values().get("controller"), None);
    let driving = build(&format!("{PLAIN}{drive}")).expect("a pipeline with one");
    let tracking = driving.without_controller().expect("its config as text");
    assert_eq!(tracking.check_sources(Sources::default()), Ok(()));
    assert_eq!(tracking.config().values().get("controller"), None);
    assert!(!tracking.config().to_toml().contains("[controller]"));
    for missing in [MissingSource::Obstacles, MissingSource::Odometry] {
        assert!(missing.to_string().contains("= \"none\"` in ["), "{missing}");
    }
}

#[test]
fn a_robot_that_cannot_stop_before_the_person_is_refused() {
    fn with(keeps_m: f64) -> Result<(), String> {
        let config = format!("config = {{ how = 'keeps {keeps_m}' }}");
        build(&format!("{PLAIN}[controller]\nplugin = 'drive'\n{config}\n")).map(|_| ())
    }

    // 0.45 m of reaction, 0.495 m of braking within the limit of the jerk and a margin of 0.3 m.
    assert_eq!(with(1.25), Ok(()));
    let refused = with(1.24).unwrap_err();
    for words in
        ["0.9 m/s needs 1.25 m to stop", "follows at 1.24 m", "plugin = 'drive'", "^^^^^^^"]
    {
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
#[cfg(feature = "plugins")]
fn a_distance_that_is_too_small_is_shown_where_it_stands() {
    use crate::ConfigSource;

    let text = "extends = 'follow-depth.toml'\n[controller]\nconfig = { stand_off_m = 0.8 }\n";
    let source = ConfigSource::from_text(text, "");
    let refused = Pipeline::builder(&crate::builtin_registry()).build(&source);
    let refused = refused.map(drop).expect_err("0.8 m").to_string();
    for words in [
        "config.toml:3:26: a robot at 0.9 m/s needs 1.25 m to stop (0.95 m, and `margin_m` of 0.30 m), and \
         follows at 0.8 m",
        "config = { stand_off_m = 0.8 }",
    ] {
        assert!(refused.contains(words), "{refused}");
    }
    let text = "extends = 'follow-depth.toml'\n[robot]\nmax_speed_mps = 0.9\n[command_limiter]\n\
                reaction_s = 2.0\n";
    let refused =
        Pipeline::builder(&crate::builtin_registry()).build(&ConfigSource::from_text(text, ""));
    let refused = refused.map(drop).expect_err("a late robot").to_string();
    assert!(refused.contains("it extends the built-in follow-depth.toml, where:"), "{refused}");
}

/// Returns the seeds of the plugins, by their place in a config.
fn seeds(run: u64) -> Vec<u64> {
    let seen = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let mut registry = World::default().registry();
    let list = seen.clone();
    registry.controller("draws", "", move |_: Input, context| {
        list.lock().unwrap().push(context.seed);
        Ok(Still)
    });
    for name in ["one", "other"] {
        let list = seen.clone();
        registry.verifier(name, "", move |_: Input, context| {
            list.lock().unwrap().push(context.seed);
            Ok(Still)
        });
    }
    let verifiers =
        ["one", "other", "one"].map(|name| format!("[[verifiers]]\nplugin = '{name}'\n"));
    let text = format!("{PLAIN}{}[controller]\nplugin = 'draws'\n", verifiers.concat());
    Pipeline::builder(&registry).seed(run).from_toml(&text).unwrap();
    seen.lock().unwrap().clone()
}

struct Still;

impl tagalong_core::Controller for Still {
    fn command(&mut self, _: &tagalong_core::Scene<'_>) -> tagalong_core::Twist {
        tagalong_core::Twist::STOP
    }
}

impl tagalong_core::Verifier for Still {
    fn inputs(&self) -> tagalong_core::Inputs {
        tagalong_core::Inputs::NONE
    }

    fn log_odds(
        &mut self,
        _: &tagalong_core::Frame,
        _: &tagalong_core::Detection,
    ) -> tagalong_core::Result<f64> {
        Ok(0.0)
    }
}

#[test]
fn each_plugin_draws_from_a_seed_of_its_own_that_the_run_decides() {
    let first = seeds(1);
    let again = seeds(1);
    let other = seeds(2);
    assert_eq!((first.len(), &first), (4, &again));
    let all: std::collections::BTreeSet<u64> = first.iter().chain(&other).copied().collect();
    assert_eq!(all.len(), 8, "{first:?} {other:?}");
}

const WHOLE: &str = "seed = 1
[[detectors]]
plugin = 'script'
roles = ['discover', 'track']
every = 2
offset = 1
config = { script = 1, how = 'x' }
[[verifiers]]
plugin = 'choosy'
[filter]
plugin = 'steady'
[controller]
plugin = 'drive'
[associator.config]
cost = 'overlap'
gate = 9.0
";

proptest! {
    #[test]
    fn a_damaged_config_is_an_error_or_works(
        edits in prop::collection::vec((0..WHOLE.len(), 0..4usize, "[-0-9a-z='\\[\\]{}., \\n]{0,3}"), 1..4),
    ) {
        let mut text = WHOLE.to_owned();
        for (at, removed, inserted) in edits {
            let at = at.min(text.len());
            text.replace_range(at..(at + removed).min(text.len()), &inserted);
        }
        if let Err(shown) = build(&text) {
            prop_assert!(shown.starts_with("config.toml:"), "{shown}");
        }
    }
}

#[test]
fn a_config_states_its_cameras_and_inherits_the_statement() {
    let text = format!("{FILTER}{SCRIPT}[suits]\ncamera_height_m = [0.9, 2.4]\n");
    let pipeline = build(&text).unwrap();
    let suits = pipeline.config().suits;
    assert_eq!(suits.camera_height_m, Some([0.9, 2.4]));
    assert_eq!(suits.pitch_down_deg, None);
    let plain = build(&format!("{FILTER}{SCRIPT}")).unwrap();
    assert_eq!(pipeline.resolved(), plain.resolved(), "a run takes no notice of it");
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("base.toml"), text).unwrap();
    let registry = World::default().registry();
    let builder = Pipeline::builder(&registry).folder(home.path());
    let heir = builder.from_toml("extends = 'base.toml'\n").unwrap();
    assert_eq!(heir.config().suits.camera_height_m, Some([0.9, 2.4]));
}
