//! The shipped `recorded` config on the sequences of the SORT paper, with its detections. Without
//! `../shared/data/mot` the test reports that it skips.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a broken test may stop loudly")]

use std::path::{Path, PathBuf};

use tagalong_config::Registry;
use tagalong_reproduce::{Lab, Progress, SimulatedScenes, Table, system};

/// Published MOTA of SORT for its six validation sequences together, per cent (its README).
const SORT_MOTA: f64 = 34.0;

struct Silent;

impl Progress for Silent {
    fn begin(&self, _: usize, _: &str) {}
    fn step(&self) {}
}

fn table(data: PathBuf) -> Table {
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let lab = Lab {
        registry: &registry,
        configs: root.join("configs"),
        data: Some(data),
        quick: false,
        seeds: None,
        first_seed: 0,
        simulated: SimulatedScenes::default(),
        jobs: 1,
        progress: &Silent,
    };
    let experiments = system("rgbd-compressive").unwrap().experiments;
    let given = experiments.iter().find(|experiment| experiment.name == "given").unwrap();
    given.find(&lab).unwrap().findings.tables.remove(0)
}

#[test]
fn with_the_detections_of_sort_it_is_at_least_as_accurate_as_sort() {
    let Some(mot) = tagalong_testdata::find("mot") else { return };
    let table = table(mot.with_file_name(""));
    println!("{}", table.text());
    let ours: Vec<_> = table.rows.iter().filter(|row| !row.published).collect();
    // Eleven sequences, and two sums.
    assert_eq!(ours.len(), 11 + 2);
    let mota = |name: &str| {
        let row = ours.iter().find(|row| row.name.ends_with(name)).unwrap();
        row.cells[0].value.unwrap()
    };
    let (all, six) = (mota("all eleven"), mota("these six"));
    assert!(all >= SORT_MOTA && six >= SORT_MOTA, "{all} {six}");
}
