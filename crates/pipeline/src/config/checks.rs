use std::ops::Range;

use tagalong_config::ConfigError;
use tagalong_core::{Error, Result};
use toml::Spanned;
use toml::de::DeTable;

use crate::PipelineSettings;

/// Refuses settings that contradict each other. Single ones were compared with their ranges
/// when they were parsed.
pub(super) fn check(
    settings: &PipelineSettings,
    root: &DeTable<'_>,
) -> std::result::Result<(), ConfigError> {
    let PipelineSettings { stereo, odometry, robot, command_limiter, collision_monitor, .. } =
        settings;
    let found = [
        ("clock", check_clock(settings)),
        ("target", check_target(settings)),
        ("target", settings.target.looks.check()),
        ("robot", robot.check()),
        ("command_limiter", command_limiter.check(robot)),
        ("collision_monitor", collision_monitor.check(robot, command_limiter)),
        ("stereo", stereo.as_ref().map_or(Ok(()), |stereo| stereo.check())),
        ("odometry", odometry.as_ref().map_or(Ok(()), |odometry| odometry.check())),
    ];
    for (section, result) in found {
        if let Err(Error::Settings { key, why }) = result {
            let message = format!("`{section}.{key}` {why}");
            // A default may contradict a setting of the robot.
            let span = place(root, section, &key).or_else(|| root.get("robot").map(Spanned::span));
            return Err(ConfigError::new(message).or_at(span));
        }
    }
    // TOML knows no larger numbers, and the seed is written into the reports.
    if i64::try_from(settings.seed).is_err() {
        return Err(ConfigError::new(format!("`seed` must be at most {}", i64::MAX)));
    }
    Ok(())
}

/// Returns where a key of a section stands; keys of tables within it are dotted.
fn place(root: &DeTable<'_>, section: &str, key: &str) -> Option<Range<usize>> {
    let mut value = root.get(section)?;
    for key in key.split('.') {
        value = value.get_ref().as_table()?.get(key)?;
    }
    Some(value.span())
}

fn check_clock(settings: &PipelineSettings) -> Result<()> {
    let clock = &settings.clock;
    at_least("reset_gap_s", clock.reset_gap_s, "max_gap_s", clock.max_gap_s)
}

fn check_target(settings: &PipelineSettings) -> Result<()> {
    let target = &settings.target;
    if target.refuse_below > target.doubt_below {
        let why = format!("must be at most {}, as `doubt_below`", target.doubt_below);
        return Err(Error::setting("refuse_below", why));
    }
    at_least("lose_after_s", target.lose_after_s, "doubt_after_s", target.doubt_after_s)?;
    let looks = &target.looks;
    let weighted = [
        ("looks.torso", looks.torso),
        ("looks.legs", looks.legs),
        ("looks.texture", looks.texture),
        ("looks.vector", looks.vector),
        ("looks.height", looks.height),
    ];
    match weighted.iter().find(|(_, [_, weight])| *weight < 0.0) {
        Some((key, [_, weight])) => {
            Err(Error::setting(*key, format!("must have a weight of at least 0, not {weight}")))
        }
        None => Ok(()),
    }
}

fn at_least(key: &str, value: f64, other: &str, least: f64) -> Result<()> {
    if value >= least {
        return Ok(());
    }
    Err(Error::setting(key, format!("must be at least {least}, as `{other}`, not {value}")))
}
