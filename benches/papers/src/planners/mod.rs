//! Planners of Follow-Bench, to ride beside ours with the same seeds.
//!
//! Ye et al., *Follow-Bench: A Unified Motion Planning Benchmark for Socially-Aware Robot Person
//! Following*, arXiv 2509.10796; equations and settings are those of its code (MedlarTea/follow-bench
//! at 7284e8e, MIT). There a planner commands the robot directly; here the command limiter and the
//! collision monitor of the config come after it, as after every controller.

mod avoidable;
mod dynamic_window;
mod obstacles;
mod planner;
mod regularised_dual;
mod rides;
mod social_force;
mod table;

use tagalong_config::Registry;

use crate::findings::{Experiment, System};

/// The benchmark: our controllers beside its planners, on the same seeds.
pub const SYSTEM: System = System {
    name: "follow-bench",
    about: "following among people: our controllers beside three planners of Follow-Bench",
    experiments: &[
        Experiment {
            name: "told",
            about: "told where people are, as the benchmark has it",
            run: table::told,
        },
        Experiment { name: "laser", about: "people by the laser scanner", run: table::laser },
        Experiment {
            name: "fine-laser",
            about: "people by a laser scanner of 720 rays",
            run: table::fine_laser,
        },
        Experiment { name: "depth", about: "people by depth images", run: table::depth },
        Experiment {
            name: "walk-told",
            about: "told, behind a target that the robot can keep up with",
            run: table::walk_told,
        },
        Experiment {
            name: "walk-laser",
            about: "people by a laser scanner of 720 rays, behind the same target",
            run: table::walk_laser,
        },
        Experiment {
            name: "walk-depth",
            about: "people by depth images, behind the same target",
            run: table::walk_depth,
        },
        Experiment {
            name: "avoidable",
            about: "times in the private zone of others, ridden again with a robot that stopped earlier",
            run: avoidable::avoidable,
        },
    ],
};

/// Registers the planners.
pub(crate) fn register(registry: &mut Registry) {
    dynamic_window::register(registry);
    regularised_dual::register(registry);
    social_force::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_planners_keep_the_promises_of_controllers() {
        tagalong_conformance::assert_conforms(register);
    }
}
