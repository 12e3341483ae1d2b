//! Robot of a run and the zones around it, from the resolved config.

use serde::Deserialize;
use tagalong_pipeline::{
    CollisionMonitorSettings, CommandLimiterSettings, FollowSettings, RobotSettings,
    SafetyDistances,
};
use toml::{Table, Value};

use crate::page::data::RobotData;

/// Tables of the config that determine the zones.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Tables {
    robot: RobotSettings,
    command_limiter: CommandLimiterSettings,
    collision_monitor: CollisionMonitorSettings,
}

/// Returns the robot of a resolved config; `None` without a controller, or if the tables were
/// written by an earlier version and cannot be read any more.
pub fn robot_data(config: &Table) -> Option<RobotData> {
    config.get("controller")?;
    let own = ["robot", "command_limiter", "collision_monitor"];
    let tables = config.iter().filter(|(key, _)| own.contains(&key.as_str()));
    let tables = tables.map(|(key, value)| (key.clone(), value.clone())).collect();
    let Tables { robot, command_limiter, collision_monitor } =
        Value::Table(tables).try_into().ok()?;
    let settings =
        FollowSettings { robot, command_limiter, collision_monitor, ..FollowSettings::default() };
    let distances = SafetyDistances::of(&settings);
    let FollowSettings { robot, command_limiter, collision_monitor, .. } = settings;
    let people = [distances.least_separation_m, distances.separation_m];
    Some(RobotData {
        footprint: robot.footprint,
        stop: collision_monitor.stop,
        slowdown: collision_monitor.slowdown,
        people: collision_monitor.separation.then_some(people),
        things: collision_monitor.stop_m,
        reaction: command_limiter.reaction_s,
        decel: command_limiter.max_decel_mps2,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zones_are_those_of_the_config() {
        let text = "[controller]\nplugin = 'c'\n[collision_monitor]\nstop_m = 0.4\n\
            [input]\nodd = 1\n";
        let robot = robot_data(&toml::from_str(text).unwrap()).unwrap();
        let default = FollowSettings::default();
        let distances = SafetyDistances::of(&default);
        assert_eq!(robot.things, 0.4);
        assert_eq!(robot.footprint, default.robot.footprint);
        assert_eq!(robot.people, Some([distances.least_separation_m, distances.separation_m]));
    }

    #[test]
    fn a_run_without_a_controller_has_no_zones() {
        assert_eq!(robot_data(&toml::from_str("[robot]\n").unwrap()), None);
    }
}
