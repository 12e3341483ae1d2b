use std::ops::Range;

use tagalong_core::ConfigError;
use tagalong_odometry::OdometrySettings;
use tagalong_stereo::StereoSettings;
use toml::de::DeTable;

use crate::PipelineSettings;

/// What a number must be.
#[derive(Clone, Copy)]
enum Must {
    Positive,
    NotNegative,
    Fraction,
    Inside,
    Finite,
    AtLeast(f64, &'static str),
    AtMost(f64, &'static str),
}

impl Must {
    fn accepts(self, value: f64) -> bool {
        match self {
            Self::Positive => value.is_finite() && value > 0.0,
            Self::NotNegative => value.is_finite() && value >= 0.0,
            Self::Fraction => value > 0.0 && value <= 1.0,
            Self::Inside => value > 0.0 && value < 1.0,
            Self::Finite => value.is_finite(),
            Self::AtLeast(limit, _) => value >= limit,
            Self::AtMost(limit, _) => value <= limit,
        }
    }

    fn words(self) -> String {
        match self {
            Self::Positive => "positive".into(),
            Self::NotNegative => "at least 0".into(),
            Self::Fraction => "above 0 and at most 1".into(),
            Self::Inside => "above 0 and below 1".into(),
            Self::Finite => "finite".into(),
            Self::AtLeast(limit, what) => format!("at least {limit}{what}"),
            Self::AtMost(limit, what) => format!("at most {limit}{what}"),
        }
    }
}

/// Refuses settings that parse but cannot work.
pub(super) fn check(settings: &PipelineSettings, root: &DeTable<'_>) -> Result<(), ConfigError> {
    for (section, key, value, must) in rules(settings) {
        if !must.accepts(value) {
            let message = format!("`{section}.{key}` must be {}, not {value}", must.words());
            return Err(ConfigError { message, span: place(root, section, key) });
        }
    }
    let of_stereo = settings.stereo.as_ref().and_then(StereoSettings::mistake);
    let of_odometry = settings.odometry.as_ref().and_then(OdometrySettings::mistake);
    for (section, mistake) in [("stereo", of_stereo), ("odometry", of_odometry)] {
        if let Some((key, must)) = mistake {
            let message = format!("`{section}.{key}` must be {must}");
            return Err(ConfigError { message, span: place(root, section, key) });
        }
    }
    if i64::try_from(settings.seed).is_err() {
        return Err(ConfigError::new(format!("`seed` must be at most {}", i64::MAX)));
    }
    Ok(())
}

/// Where a key of a section stands; keys of tables within it are dotted.
fn place(root: &DeTable<'_>, section: &str, key: &str) -> Option<Range<usize>> {
    let mut value = root.get(section)?;
    for key in key.split('.') {
        value = value.get_ref().as_table()?.get(key)?;
    }
    Some(value.span())
}

type Rule = (&'static str, &'static str, f64, Must);

fn rules(settings: &PipelineSettings) -> Vec<Rule> {
    let PipelineSettings { robot, clock, occlusion, .. } = settings;
    let mut rules = vec![
        ("robot", "wheel_half_separation_m", robot.wheel_half_separation_m, Must::Positive),
        ("robot", "wheel_slip", robot.wheel_slip, Must::NotNegative),
        ("robot", "max_speed_mps", robot.max_speed_mps, Must::Positive),
        ("clock", "max_back_s", clock.max_back_s, Must::NotNegative),
        ("clock", "max_gap_s", clock.max_gap_s, Must::Positive),
        ("clock", "reset_gap_s", clock.reset_gap_s, Must::Finite),
        (
            "clock",
            "reset_gap_s",
            clock.reset_gap_s,
            Must::AtLeast(clock.max_gap_s, ", as `max_gap_s`"),
        ),
        ("occlusion", "min_visible", occlusion.min_visible, Must::Fraction),
        ("occlusion", "min_gap_m", occlusion.min_gap_m, Must::NotNegative),
        ("occlusion", "min_gap_sigmas", occlusion.min_gap_sigmas, Must::NotNegative),
        ("occlusion", "body_width_m", occlusion.body_width_m, Must::NotNegative),
    ];
    rules.extend(merge_rules(settings));
    rules.extend(governor_rules(settings));
    rules.extend(target_rules(settings));
    rules
}

fn merge_rules(settings: &PipelineSettings) -> impl Iterator<Item = Rule> {
    let s = &settings.merge;
    [
        ("same_person_m", s.same_person_m, Must::NotNegative),
        ("same_person_iou", s.same_person_iou, Must::Fraction),
        ("max_detections", s.max_detections as f64, Must::Positive),
        ("duplicate_m", s.duplicate_m, Must::NotNegative),
        ("max_tracks", s.max_tracks as f64, Must::Positive),
    ]
    .into_iter()
    .map(|(key, value, must)| ("merge", key, value, must))
}

fn governor_rules(settings: &PipelineSettings) -> impl Iterator<Item = Rule> {
    let s = &settings.governor;
    let corridor = &s.corridor;
    [
        ("max_accel_mps2", s.max_accel_mps2, Must::Positive),
        ("max_decel_mps2", s.max_decel_mps2, Must::Positive),
        ("max_turn_radps", s.max_turn_radps, Must::Positive),
        ("reaction_s", s.reaction_s, Must::NotNegative),
        ("margin_m", s.margin_m, Must::NotNegative),
        ("valid_s", s.valid_s, Must::Positive),
        ("slow_after_s", s.slow_after_s, Must::Positive),
        ("stop_after_s", s.stop_after_s, Must::Positive),
        ("max_odometry_mps", s.max_odometry_mps, Must::Positive),
        ("corridor.half_width_m", corridor.half_width_m, Must::Positive),
        ("corridor.front_m", corridor.front_m, Must::NotNegative),
        ("corridor.steps_in_m", corridor.steps_in_m, Must::NotNegative),
        ("corridor.stop_m", corridor.stop_m, Must::NotNegative),
        ("corridor.range_m", corridor.range_m, Must::Positive),
        ("corridor.range_m", corridor.range_m, Must::AtMost(100.0, "")),
        ("corridor.floor_m", corridor.floor_m, Must::NotNegative),
        ("corridor.top_m", corridor.top_m, Must::Positive),
        ("corridor.target_radius_m", corridor.target_radius_m, Must::NotNegative),
        ("corridor.min_points", f64::from(corridor.min_points), Must::Positive),
        ("corridor.min_seen", corridor.min_seen, Must::NotNegative),
        ("corridor.memory_s", corridor.memory_s, Must::NotNegative),
    ]
    .into_iter()
    .map(|(key, value, must)| ("governor", key, value, must))
}

fn target_rules(settings: &PipelineSettings) -> impl Iterator<Item = Rule> {
    let s = &settings.target;
    let search = &s.search;
    let sightings = f64::from(s.again_sightings);
    [
        ("choose_within_deg", s.choose_within_deg, Must::Positive),
        ("choose_within_m", s.choose_within_m, Must::Positive),
        ("choose_after_s", s.choose_after_s, Must::NotNegative),
        ("training_sightings", f64::from(s.training_sightings), Must::Positive),
        ("belief_weight", s.belief_weight, Must::Fraction),
        ("doubt_below", s.doubt_below, Must::Inside),
        ("refuse_below", s.refuse_below, Must::Inside),
        ("refuse_below", s.refuse_below, Must::AtMost(s.doubt_below, ", as `doubt_below`")),
        ("doubt_after_s", s.doubt_after_s, Must::Positive),
        ("lose_after_s", s.lose_after_s, Must::AtLeast(s.doubt_after_s, ", as `doubt_after_s`")),
        ("again_from", s.again_from, Must::Inside),
        ("again_sightings", sightings, Must::Positive),
        ("reach_mps", s.reach_mps, Must::Positive),
        ("alone_m", s.alone_m, Must::NotNegative),
        ("looks.torso", s.looks.torso[0], Must::Finite),
        ("looks.torso", s.looks.torso[1], Must::NotNegative),
        ("looks.legs", s.looks.legs[0], Must::Finite),
        ("looks.legs", s.looks.legs[1], Must::NotNegative),
        ("looks.texture", s.looks.texture[0], Must::Finite),
        ("looks.texture", s.looks.texture[1], Must::NotNegative),
        ("looks.height", s.looks.height[0], Must::Finite),
        ("looks.height", s.looks.height[1], Must::NotNegative),
        ("looks.rivals", s.looks.rivals, Must::NotNegative),
        ("search.wait_s", search.wait_s, Must::NotNegative),
        ("search.turn_radps", search.turn_radps, Must::Positive),
        ("search.speed_mps", search.speed_mps, Must::Positive),
        ("search.arrive_m", search.arrive_m, Must::Positive),
        ("search.drive_s", search.drive_s, Must::NotNegative),
        ("search.give_up_s", search.give_up_s, Must::NotNegative),
    ]
    .into_iter()
    .map(|(key, value, must)| ("target", key, value, must))
}
