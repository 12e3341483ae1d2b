use serde::Serialize;
use tagalong_report::Table;
use tagalong_sim::Seeds;

use crate::lab::{Lab, ReproduceError, SimulatedScene};

/// A published system.
#[derive(Clone, Copy, Debug)]
pub struct System {
    /// Name of its config.
    pub name: &'static str,
    /// Description in one line, with the paper.
    pub about: &'static str,
    /// Its tables and figures.
    pub experiments: &'static [Experiment],
}

/// Reproduction of one table or figure of a paper.
#[derive(Clone, Copy, Debug)]
pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// Description in one line.
    pub about: &'static str,
    /// Function that runs the experiment.
    pub run: fn(&Lab) -> Result<Findings, ReproduceError>,
}

impl Experiment {
    /// Runs the experiment, and adds to each table a note with the seeds of the simulated scenes.
    pub fn find(&self, lab: &Lab) -> Result<ExperimentFindings, ReproduceError> {
        let mut findings = (self.run)(lab)?;
        let simulated = lab.simulated.take();
        if !simulated.is_empty() {
            let note = seeds_note(&simulated);
            findings.tables.iter_mut().for_each(|table| table.notes.push(note.clone()));
        }
        Ok(ExperimentFindings { experiment: self.name, simulated, findings })
    }
}

/// Formats the note on seeds; scenes with the same seeds are listed together.
fn seeds_note(simulated: &[SimulatedScene]) -> String {
    let mut groups: Vec<(Seeds, Vec<&str>)> = Vec::new();
    for SimulatedScene { scene, seeds } in simulated {
        match groups.iter_mut().find(|(of, _)| of == seeds) {
            Some((_, scenes)) => scenes.push(scene),
            None => groups.push((*seeds, vec![scene])),
        }
    }
    format!(
        "Simulated for this table. {}.",
        groups
            .iter()
            .map(|(seeds, scenes)| format!("{}: {seeds}", scenes.join(", ")))
            .collect::<Vec<_>>()
            .join("; ")
    )
}

/// An experiment with its findings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExperimentFindings {
    /// Name of the experiment.
    pub experiment: &'static str,
    /// Scenes that were simulated for it.
    pub simulated: Vec<SimulatedScene>,
    /// Its findings.
    #[serde(flatten)]
    pub findings: Findings,
}

/// Findings of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Findings {
    /// Tables, the most important first.
    pub tables: Vec<Table>,
    /// Pictures.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
}

/// A chart of findings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Name of the file, without extension.
    pub name: String,
    /// Content, SVG.
    pub svg: String,
}

impl From<Table> for Findings {
    fn from(table: Table) -> Self {
        Self { tables: vec![table], pictures: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use tagalong_report::{Cell, Row};
    use tagalong_sim::Split;

    use super::*;
    use crate::lab::testing::lab;

    #[test]
    fn scenes_with_the_same_seeds_are_named_together() {
        fn simulated(scene: &str, first: u64) -> SimulatedScene {
            SimulatedScene { scene: scene.into(), seeds: Split::Test.seeds(first, 5).unwrap() }
        }

        let note =
            seeds_note(&[simulated("crowd", 0), simulated("turntable", 7), simulated("walk", 0)]);
        let expected = "Simulated for this table. crowd, walk: 5 seeds of the split test from 0 on; \
                        turntable: 5 seeds of the split test from 7 on.";
        assert_eq!(note, expected);
    }

    /// Runs an experiment with one table of seeds, and an empty one.
    fn drawing(lab: &Lab) -> Result<Findings, ReproduceError> {
        let scenes = lab.scenes("turntable", &[], lab.seeds(2))?;
        let cells = scenes.iter().map(|scene| Cell::number(scene.seed as f64, 0)).collect();
        let rows = vec![Row::ours("seeds", cells)];
        let tables = vec![Table { rows, ..Table::default() }, Table::default()];
        Ok(Findings { tables, pictures: Vec::new() })
    }

    #[test]
    fn every_table_of_an_experiment_names_the_seeds_of_its_draws() {
        let registry = tagalong_config::Registry::default();
        let mut lab = lab(&registry, false, None);
        let experiment = Experiment { name: "draws", about: "", run: drawing };
        let [here, again, there] = [30, 30, 31].map(|first_seed| {
            lab.first_seed = first_seed;
            experiment.find(&lab).unwrap()
        });
        assert_eq!(here, again);
        assert_ne!(here.findings.tables[0].rows, there.findings.tables[0].rows);
        let note = "Simulated for this table. turntable: 2 seeds of the split test from 30 on.";
        assert!(here.findings.tables.iter().all(|table| table.notes == [note]));
        let json = serde_json::to_value(&here).unwrap();
        assert_eq!(json["simulated"][0]["scene"], "turntable");
        assert_eq!(json["simulated"][0]["seeds"]["first"], 30);
        let none = Experiment { run: |_| Ok(Table::default().into()), ..experiment };
        assert_eq!(none.find(&lab).unwrap().findings.tables[0].notes, [""; 0]);
    }
}
