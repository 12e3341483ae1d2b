//! The list of published systems.

use crate::findings::System;
use crate::{
    joint_particle, laser, omni_appearance, planners, recognition, rgbd_compressive, stereo,
};

/// All systems, in the order of the papers.
pub const SYSTEMS: &[System] = &[
    stereo::STEREO_EKF,
    rgbd_compressive::SYSTEM,
    joint_particle::SYSTEM,
    stereo::STEREO_SVM_EKF,
    omni_appearance::SYSTEM,
    laser::SYSTEM,
    planners::SYSTEM,
    recognition::SYSTEM,
];

/// Returns the system of this name.
pub fn system(name: &str) -> Option<&'static System> {
    SYSTEMS.iter().find(|system| system.name == name)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_name_means_one_thing() {
        let names: BTreeSet<&str> = SYSTEMS.iter().map(|system| system.name).collect();
        assert_eq!(names.len(), SYSTEMS.len());
        for each in SYSTEMS {
            let names: BTreeSet<&str> = each.experiments.iter().map(|e| e.name).collect();
            assert_eq!(names.len(), each.experiments.len(), "{}", each.name);
            assert!(system(each.name).is_some() && !each.experiments.is_empty());
        }
        assert!(system("perpetuum-mobile").is_none());
    }

    #[test]
    fn the_forms_of_each_paper_are_its_first_table() {
        for system in SYSTEMS.iter().filter(|system| system.about.starts_with('P')) {
            assert_eq!(system.experiments[0].name, "forms", "{}", system.name);
        }
    }
}
