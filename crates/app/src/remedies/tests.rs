use std::collections::BTreeSet;

use tagalong_config::commented_defaults;
use tagalong_core::TRACKER_TESTS;
use tagalong_pipeline::PipelineSettings;

use super::*;
use crate::config_file::OuterSettings;

fn keys(text: &str) -> impl Iterator<Item = String> {
    text.lines()
        .filter_map(|line| Some(line.trim_start_matches("# ").split_once(" =")?.0.to_owned()))
}

#[test]
fn every_setting_of_a_remedy_exists() {
    let registry = tagalong_catalog::registry();
    let mut known: BTreeSet<String> = BTreeSet::new();
    registry.plugins().for_each(|plugin| known.extend(keys(&plugin.defaults())));
    known.extend(keys(&commented_defaults::<PipelineSettings>()));
    known.extend(keys(&commented_defaults::<OuterSettings>()));
    for remedy in Remedies::new(&registry).all() {
        let of_plugin = remedy.plugin.as_ref().map(|plugin| registry.find(plugin).unwrap());
        let own: BTreeSet<String> =
            of_plugin.map_or_else(BTreeSet::new, |plugin| keys(&plugin.defaults()).collect());
        for setting in &remedy.settings {
            let (_, key) = setting.split_once('.').unwrap_or(("", setting));
            assert!(known.contains(key), "{}: there is no `{setting}`", remedy.test);
        }
        // A test of a plugin may depend on a section of the config, too.
        let is_own = remedy.settings.iter().any(|setting| own.contains(setting));
        assert!(remedy.plugin.is_none() || is_own, "{}", remedy.test);
    }
}

#[test]
fn every_offer_fits_its_plugin() {
    let registry = tagalong_catalog::registry();
    let remedies = Remedies::new(&registry);
    assert!(remedies.offers.len() > 2);
    for offer in &remedies.offers {
        let Some(plugin) = offer.plugin else { continue };
        let defaults: BTreeSet<String> = keys(&registry.find(plugin).unwrap().defaults()).collect();
        assert!(defaults.contains(offer.setting), "{offer:?}");
    }
}

#[test]
fn a_plugin_from_outside_brings_its_remedies() {
    let mut registry = Registry::default();
    registry.remedies(
        "own",
        &[tagalong_config::Remedy { test: "too blue", settings: &["hue"], look: "the sky" }],
    );
    let remedies = Remedies::new(&registry);
    let resolved: Table =
        toml::from_str("[[detectors]]\nplugin = 'own'\nconfig = { hue = 3 }\n").unwrap();
    let lines = remedies.of("too blue").unwrap().lines(&resolved);
    assert_eq!(lines, ["detectors.0.config.hue = 3 (own)"]);
    assert!(Remedies::default().of("too blue").is_none());
}

#[test]
fn a_sentence_names_the_test_its_meaning_and_two_settings_at_most() {
    let mut registry = Registry::default();
    registry.remedies(
        "own",
        &[tagalong_config::Remedy {
            test: "too blue",
            settings: &["a", "b", "c"],
            look: "the sky",
        }],
    );
    let remedies = Remedies::new(&registry);
    let config = "[[detectors]]\nplugin = 'own'\nconfig = { a = 1, b = 2, c = 3 }\n";
    let resolved: Table = toml::from_str(config).unwrap();
    assert_eq!(
        remedies.sentence("too blue", &resolved),
        "the test \"too blue\" dropped the candidate; decided by detectors.0.config = \
         { a = 1, b = 2 } (own) and 1 more: the sky"
    );
    let without = remedies.sentence("too blue", &Table::new());
    assert!(without.ends_with("; no setting decides it: the sky"), "{without}");
    assert_eq!(
        remedies.sentence("unknown", &resolved),
        "the test \"unknown\" dropped the candidate"
    );
}

#[test]
fn a_measured_candidate_passes_with_the_named_values() {
    fn value(what: &str, value: f64, limits: &[(&str, f64)]) -> MeasuredValue {
        let limits = limits.iter().map(|(name, limit)| ((*name).to_owned(), *limit)).collect();
        MeasuredValue { what: what.to_owned(), value, limits }
    }

    let remedies = Remedies::new(&tagalong_catalog::registry());
    let config: Table = toml::from_str(
        "[[detectors]]\nplugin = 'other'\nconfig = { refine_cost = 0.4 }\n[[detectors]]\n\
         plugin = 'depth-template'\n[detectors.config]\nrefine_cost = 0.4\ndiscover_cost = 0.3\n\
         min_cells = 2\nmin_body = 0.5\n[manager]\nplugin = 'manage-sprt'\n\
         config = { start_log_odds = 0.0, end_log_odds = -2.0 }\n",
    )
    .expect("a config");
    let cost = value("cost", 0.4712, &[("refine_cost", 0.4), ("discover_cost", 0.3)]);
    let told = remedies.sentence_measured("not refined", &cost, &config);
    assert!(
        told.starts_with(
            "the test \"not refined\" dropped the candidate, cost 0.47 > refine_cost 0.4 and > \
             discover_cost 0.3; it passes with detectors.1.config = { refine_cost = 0.48, \
             discover_cost = 0.48 } (depth-template): "
        ),
        "{told}"
    );
    for (test, measured, with) in [
        ("component size", value("cells", 1.0, &[("min_cells", 2.0)]), "config.min_cells = 1 ("),
        ("body below", value("body", 0.458, &[("min_body", 0.5)]), "config.min_body = 0.45 ("),
        (
            "score",
            value("log-odds", -1.303, &[("start_log_odds", 0.0)]),
            "start_log_odds = -1.31 }",
        ),
        // The score was rounded up, perhaps.
        (
            "score",
            value("log-odds", -2.93, &[("start_log_odds", 0.0), ("end_log_odds", -2.0)]),
            "{ start_log_odds = -2.94, end_log_odds = -2.95 }",
        ),
        ("body below", value("body", 0.0, &[("min_body", 0.5)]), "config.min_body = 0.0 ("),
    ] {
        let told = remedies.sentence_measured(test, &measured, &config);
        assert!(told.contains(with), "{told}");
    }
    let unknown = remedies.sentence_measured("unknown", &cost, &config);
    assert!(unknown.ends_with("candidate, cost 0.47 > refine_cost 0.4 and > discover_cost 0.3"));
    let of_another_run = value("cost", 0.6, &[("refine_cost", 0.5)]);
    let told = remedies.sentence_measured("not refined", &of_another_run, &config);
    assert!(told.contains("> refine_cost 0.5; decided by detectors.1.config"), "{told}");
}

#[test]
fn the_reach_is_that_of_the_detector_that_looks_farthest() {
    let config = "[[detectors]]\nplugin = 'a'\nconfig = { max_depth_m = 15 }\n[[detectors]]\n\
                  plugin = 'b'\nconfig = { max_depth_m = 5.5 }\n";
    assert_eq!(reach_m(&toml::from_str(config).expect("a config")), Some(15.0));
    assert_eq!(reach_m(&Table::new()), None);
}

#[test]
fn each_manager_names_its_settings_for_a_track_that_is_not_confirmed() {
    let remedies = Remedies::new(&tagalong_catalog::registry());
    let sprt: Table = toml::from_str(
        "[manager]\nplugin = 'manage-sprt'\n[manager.config]\ntentative_misses = 2\n\
         confirm_log_odds = 4.6\n",
    )
    .unwrap();
    let told = remedies.sentence("track: not confirmed", &sprt);
    assert!(told.contains("{ tentative_misses = 2, confirm_log_odds = 4.6 }"), "{told}");
    let m_of_n: Table = toml::from_str(
        "[manager]\nplugin = 'manage-m-of-n'\n[manager.config]\ntentative_misses = 2\n\
         confirm_hits = 3\n",
    )
    .unwrap();
    let told = remedies.sentence("track: not confirmed", &m_of_n);
    assert!(told.contains("{ tentative_misses = 2, confirm_hits = 3 }"), "{told}");
}

#[test]
fn stages_are_in_the_order_in_which_a_candidate_passes_the_tests() {
    let remedies = Remedies::new(&tagalong_catalog::registry());
    let config: Table = toml::from_str(
        "[[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_body = 0.5\n\
         discover_cost = 0.2\nfollow_radius_m = 1.0\n[manager]\nplugin = 'manage-sprt'\n\
         [manager.config]\nmax_clutter = 1.0\nstart_score = 0.5\n",
    )
    .expect("a config");
    let order =
        ["body below", "search window", "template cost", "unknown", "gate", "score", "clutter"];
    let stages = order.map(|test| remedies.stage(test, &config));
    assert!(stages.is_sorted_by(|a, b| a < b), "{stages:?}");
}

#[test]
fn no_change_is_to_the_present_value() {
    let resolved: Table = toml::from_str(
        "[manager]\nplugin = 'manage-sprt'\n[manager.config]\nend_log_odds = -2.0\n\
         [[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_head_height_m = 1\ndiscover_cost = 0.2\n",
    )
    .unwrap();
    let offered = Remedies::new(&tagalong_catalog::registry()).offered(&resolved);
    let lines: Vec<String> = offered.into_iter().map(|change| change.line).collect();
    assert!(!lines.iter().any(|line| line.contains("manage-sprt")), "{lines:?}");
    assert!(!lines.iter().any(|line| line.contains("min_head_height_m")), "{lines:?}");
    let costs: Vec<&String> = lines.iter().filter(|line| line.contains("discover_cost")).collect();
    assert!(!costs.is_empty(), "{lines:?}");
    assert!(!costs.iter().any(|line| line.contains("= 0.2 ")), "{costs:?}");
    let other: Table = toml::from_str("[manager]\nplugin = 'm'\n").unwrap();
    let offered = Remedies::new(&tagalong_catalog::registry()).offered(&other);
    assert_eq!(offered[0].line, "[manager] plugin = \"manage-sprt\"");
}

#[test]
fn changes_are_lines_of_a_config() {
    let resolved: Table =
        toml::from_str("[manager]\nplugin = 'm'\n[[detectors]]\nplugin = 'd'\n").unwrap();
    let sprt = Value::Table(toml::from_str("plugin = 'manage-sprt'").unwrap());
    for (key, value, line) in [
        ("manager.config.hits", 3.into(), "[manager.config] hits = 3"),
        ("detectors.0.config.cost", 0.2.into(), "detectors.0.config.cost = 0.2 # d"),
        ("manager", sprt, "[manager] plugin = \"manage-sprt\""),
    ] {
        assert_eq!(Change::of(&resolved, key, &value).line, line);
    }
}

/// A detector with such a test would get the advice for the tracker's.
#[test]
fn detectors_must_not_take_the_names_of_tests_of_the_tracker() {
    for remedy in Remedies::default().all() {
        // Two parts are of one stage, which the first names; `occupied` is a test of detectors.
        let is_of_tracker = !remedy.test.contains(':') && remedy.test != "occupied";
        let is_known = TRACKER_TESTS.contains(&remedy.test.as_str());
        assert_eq!(is_known, is_of_tracker, "{}", remedy.test);
    }
}

#[test]
fn settings_are_shown_where_they_stand() {
    let resolved: Table = toml::from_str(
        "seed = 1\n[manager]\nplugin = 'm'\n[manager.config]\nstart_score = 0.5\n[[verifiers]]\nplugin = 'a'\n\
         [verifiers.config]\nweight = 2.0\n",
    )
    .unwrap();
    let remedies = Remedies::default();
    let lines = remedies.of("verifier").unwrap().lines(&resolved);
    assert_eq!(
        lines,
        [
            "[manager] plugin = \"m\", config = { start_score = 0.5 }",
            "verifiers.0.config.weight = 2.0 (a)"
        ]
    );
    assert_eq!(remedies.of("stereo pixels: speckle").unwrap().test, "stereo pixels: *");
    assert!(remedies.of("something new").is_none());
}
