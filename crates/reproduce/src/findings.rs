use serde::Serialize;

use crate::{Lab, ReproduceError, Table, joint_particle, rgbd_compressive, stereo};

/// All systems, in the order of the papers.
pub const SYSTEMS: &[System] =
    &[stereo::STEREO_EKF, rgbd_compressive::SYSTEM, joint_particle::SYSTEM, stereo::STEREO_SVM_EKF];

/// A published system.
#[derive(Clone, Copy, Debug)]
pub struct System {
    /// The name of its config.
    pub name: &'static str,
    /// One line about it, with the paper.
    pub about: &'static str,
    /// Its tables and figures.
    pub experiments: &'static [Experiment],
}

/// What stands for one table or figure of a paper.
#[derive(Clone, Copy, Debug)]
pub struct Experiment {
    /// How it is named on the command line.
    pub name: &'static str,
    /// One line about it.
    pub about: &'static str,
    /// Does it.
    pub run: fn(&Lab) -> Result<Findings, ReproduceError>,
}

/// What an experiment found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Findings {
    /// Tables, the most important first.
    pub tables: Vec<Table>,
    /// Pictures.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
}

/// A picture of findings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Name of the file, without extension.
    pub name: String,
    /// The picture, SVG.
    pub svg: String,
}

impl From<Table> for Findings {
    fn from(table: Table) -> Self {
        Self { tables: vec![table], pictures: Vec::new() }
    }
}

/// The system of this name.
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
}
