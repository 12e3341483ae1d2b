use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::*;
use crate::{Example, Fitted};
use tagalong_core::{
    Associations, Capabilities, Detection, EgoMotion, Estimate, Evidence, Frame, Funnel, Gate,
    Initiation, Inputs, ObservedTrack, Query, Scene, Track, TrackChanges, TrackId, Twist,
    Unassociated, Update,
};
use tagalong_geometry::Camera;

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Config {}

struct Counting;

impl Verifier for Counting {
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    fn log_odds(&mut self, _: &Frame, _: &Detection) -> Result<f64> {
        Ok(0.0)
    }
}

impl Trainer for Counting {
    fn add(&mut self, _: &Frame, _: &Detection, _: Example) -> Result<()> {
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        progress(1.0);
        Ok(Fitted::default())
    }
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.verifier("counting", "counts", |_: Config, _| Ok(Counting));
    registry.verifier("fixed", "never learns", |_: Config, _| Ok(Counting));
    registry.trainer("counting", |_: Config, _| Ok(Counting));
    registry
}

fn refusal(name: &str) -> String {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    let context = Context::new(0, PathBuf::new(), wheels);
    let built = registry().build_trainer(name, None, &context);
    built.map_or_else(|error| error.to_string(), |_| String::new())
}

#[test]
fn a_trainer_is_found_under_the_name_of_its_plugin() {
    assert_eq!(refusal("counting"), "");
}

#[test]
fn a_model_is_trained_as_its_plugin_says_and_else_as_is_usual_for_its_kind() {
    let mut registry = registry();
    assert!(registry.has_trainers() && !Registry::default().has_trainers());
    let usual = registry.training_offer("counting");
    assert_eq!((usual.data, usual.quick_settings), (TrainingData::Candidates, ""));
    let offer = TrainingOffer::new(TrainingData::LaserScans, "trees = 1");
    registry.training("counting", offer);
    assert_eq!(registry.training_offer("counting"), offer);
}

#[test]
fn what_plugins_offer_is_listed_with_their_names() {
    let mut registry = registry();
    registry.remedies("fixed", &[Remedy { test: "odd", settings: &["least"], look: "noise" }]);
    registry.trial_values("counting", &[TrialValues { setting: "least", values: &[1.0] }]);
    registry.alternative("fixed");
    registry.alternative("not registered");
    let remedies: Vec<_> = registry.all_remedies().map(|(name, of)| (name, of.test)).collect();
    assert_eq!(remedies, [("fixed", "odd")]);
    let values: Vec<_> = registry.all_trial_values().map(|(name, of)| (name, of.setting)).collect();
    assert_eq!(values, [("counting", "least")]);
    let alternatives: Vec<_> = registry.alternatives().map(|plugin| plugin.name).collect();
    assert_eq!(alternatives, ["fixed"]);
}

#[test]
fn a_default_is_of_its_kind_and_the_later_one_counts() {
    let mut registry = registry();
    assert!(registry.default_of(Kind::Verifier).is_none());
    registry.default_plugin(Kind::Verifier, "not registered");
    assert!(registry.default_of(Kind::Verifier).is_none());
    registry.default_plugin(Kind::Verifier, "fixed");
    registry.default_plugin(Kind::Associator, "fixed");
    assert_eq!(registry.default_of(Kind::Verifier).map(|plugin| plugin.name), Some("fixed"));
    assert!(registry.default_of(Kind::Associator).is_none(), "a verifier is no associator");
}

#[test]
fn detectors_of_recorded_detections_and_of_networks_are_known() {
    let mut registry = registry();
    let offer = RecordedOffer { whole_people: "body = 'full'", known_positions: "" };
    registry.recorded("fixed", offer);
    assert_eq!(registry.all_recorded().collect::<Vec<_>>(), [("fixed", offer)]);
    registry.network_of_a_file("counting");
    assert!(registry.runs_network_of_a_file("counting"));
    assert!(!registry.runs_network_of_a_file("fixed"));
}

#[test]
fn who_cannot_be_trained_is_answered_with_who_can() {
    let fixed = "the verifier `fixed` cannot be trained; available: counting";
    assert_eq!(refusal("fixed"), fixed);
    assert!(refusal("countng").contains("did you mean `counting`?"));
}

fn context() -> Context {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    Context::new(0, PathBuf::new(), wheels)
}

/// A plugin of each kind that does nothing.
struct Idle;

impl Detector for Idle {
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    fn detect(&mut self, _: &Frame, _: &Query<'_>, _: &mut Funnel) -> Result<Vec<Detection>> {
        Ok(Vec::new())
    }
}

impl Filter for Idle {
    fn start(&mut self, _: TrackId, _: &Detection, _: &Camera) {}

    fn predict(&mut self, _: &EgoMotion, _: &Camera) {}

    fn update(&mut self, _: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        Ok(BTreeMap::new())
    }

    fn estimates(&self, _: &Camera) -> BTreeMap<TrackId, Estimate> {
        BTreeMap::new()
    }

    fn stop(&mut self, _: TrackId) {}
}

impl Associator for Idle {
    fn fits(&self, _: &Track, _: &Detection, _: &Gate) -> bool {
        false
    }

    fn associate(&mut self, _: &[Track], _: &[Detection], _: &Gate) -> Associations {
        Associations::default()
    }
}

impl TrackManager for Idle {
    fn initiate(&mut self, _: TrackId, _: &Unassociated<'_>) -> Initiation {
        Initiation::Drop("idle")
    }

    fn manage(&mut self, _: &[ObservedTrack<'_>]) -> TrackChanges {
        TrackChanges::default()
    }
}

impl Controller for Idle {
    fn command(&mut self, _: &Scene<'_>) -> Twist {
        Twist::STOP
    }
}

fn all_kinds() -> Registry {
    let mut registry = registry();
    registry.detector("finder", "finds", |_: Config, _| Ok(Idle));
    registry.associator("matcher", "matches", |_: Config, _| Ok(Idle));
    registry.filter("believer", "believes", |_: Config, _| Ok(Idle));
    registry.manager("keeper", "keeps", |_: Config, _| Ok(Idle));
    registry.controller("driver", "drives", |_: Config, _| Ok(Idle));
    registry
}

#[test]
fn a_plugin_is_built_as_what_it_is_and_as_nothing_else() {
    let registry = all_kinds();
    for (place, name) in
        ["finder", "fixed", "matcher", "believer", "keeper", "driver"].iter().enumerate()
    {
        let built = [
            registry.build_detector(name, None, &context()).is_ok(),
            registry.build_verifier(name, None, &context()).is_ok(),
            registry.build_associator(name, None, &context()).is_ok(),
            registry.build_filter(name, None, &context()).is_ok(),
            registry.build_manager(name, None, &context()).is_ok(),
            registry.build_controller(name, None, &context()).is_ok(),
        ];
        for (kind, is_ok) in built.into_iter().enumerate() {
            assert_eq!(is_ok, kind == place, "{name}");
        }
    }
    let kinds: Vec<_> = registry.plugins().map(|p| format!("{} {}", p.kind, p.name)).collect();
    let expected = ["filter believer", "verifier counting", "controller driver", "detector finder"];
    assert_eq!(kinds[..4], expected);
}

#[test]
fn who_names_a_plugin_of_another_kind_is_told_which_there_are() {
    let registry = all_kinds();
    let refused = registry.build_verifier("finder", None, &context()).err().unwrap();
    let expected = "`finder` is a detector, not a verifier; available verifiers: counting, fixed";
    assert_eq!(refused.to_string(), expected);
    let refused = registry.build_verifier("matcher", None, &context()).err().unwrap();
    assert!(refused.to_string().starts_with("`matcher` is an associator, not a verifier;"));
    let refused = registry.build_filter("beleiver", None, &context()).err().unwrap();
    let expected = "unknown filter plugin `beleiver`; did you mean `believer`? available: believer";
    assert_eq!(refused.to_string(), expected);
    let unknown = registry.find("zzzzzzzz").err().unwrap().to_string();
    assert!(unknown.starts_with("unknown plugin `zzzzzzzz`; available: believer"), "{unknown}");
    assert_eq!(registry.find("driver").map(|info| info.kind), Ok(Kind::Controller));
}

#[test]
fn settings_of_a_plugin_are_documented_and_checked() {
    #[derive(Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Height {
        /// Height, m.
        height_m: f64,
    }
    let mut registry = Registry::default();
    registry.verifier("tall", "doubts the small", |config: Height, _| match config.height_m {
        height if height < 0.0 => Err(Error::setting("height_m", "is below the floor")),
        _ => Ok(Counting),
    });
    let info = registry.find("tall").unwrap();
    assert_eq!(info.defaults(), "# Height, m.\nheight_m = 0.0\n");
    assert_eq!(info.schema()["properties"]["height_m"]["description"], "Height, m.");
    let text = "{ height_m = -1.0 }";
    let value = toml::de::DeValue::parse(text).unwrap();
    let error = registry.build_verifier("tall", Some(value), &context()).err().unwrap();
    assert_eq!(
        error.render("a.toml", text).lines().next(),
        Some("a.toml:1:14: `height_m` is below the floor")
    );
}

#[test]
#[should_panic(expected = "two plugins are called `fixed`")]
fn a_name_is_taken_once() {
    registry().verifier("fixed", "again", |_: Config, _| Ok(Counting));
}

#[test]
#[should_panic(expected = "two trainers for `counting`")]
fn a_model_is_trained_in_one_way() {
    registry().trainer("counting", |_: Config, _| Ok(Counting));
}

#[test]
fn a_model_is_the_built_in_one_or_that_of_the_file() {
    let context = Context::new(0, env!("CARGO_MANIFEST_DIR"), context().wheels);
    assert_eq!(context.model("", "built in", first_line), Ok("built in".into()));
    assert_eq!(context.model("Cargo.toml", "built in", first_line), Ok("[package]".into()));
    let empty = context.model("", "", first_line).expect_err("there is no line");
    assert_eq!(empty.to_string(), "model file ``: empty");
    let tried = context.base_dir.join("nowhere.toml").display().to_string();
    let missing = context.model("nowhere.toml", "x", first_line).expect_err("there is no file");
    assert!(missing.to_string().starts_with(&format!("model file `{tried}`: ")), "{missing}");
}

/// A model that is the first line of its file.
fn first_line(text: &str) -> std::result::Result<String, String> {
    text.lines().next().map(str::to_owned).ok_or("empty".to_owned())
}
