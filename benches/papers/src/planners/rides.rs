//! Rides of our controllers and of the planners through the settings of Follow-Bench.

use tagalong_sim::Scene;
use tagalong_trials::{Contender, CrowdMeasures, Ride, Tick, TrialError, Witness, in_order};
use toml::Table as Toml;

use crate::lab::{Lab, ReproduceError};

/// Settings of the benchmark.
pub(super) const SETTINGS: [&str; 5] = ["circular", "corridor", "crossing", "doorway", "clutter"];
/// Names of the controllers in the tables, and their configs.
pub(super) const PLANNERS: [(&str, &str); 5] = [
    ("clear-follow", "follow-bench-robot"),
    ("foresee-follow", "follow-bench-foresee"),
    ("their DWA", "follow-bench-dwa"),
    ("their SFM", "follow-bench-sfm"),
    ("their RDA", "follow-bench-rda"),
];
/// Seeds of each setting.
const SEEDS: u64 = 20;
/// Rays of a common scanner over a full turn, half a degree apart.
const FINE_RAYS: &str = "720";
/// Config of people by a laser scanner, and its sections that find them.
const BY_LASER: &str = "laser-legs";
const FINDS: [&str; 5] = ["detectors", "filter", "associator", "manager", "merge"];

/// Way in which a robot knows where people are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// It is told the places of all people in sight, and which of them is the target.
    Told,
    /// It finds legs in the scans of the benchmark's laser scanner, 200 rays over a full turn.
    Laser,
    /// It finds legs in the scans of a scanner of [`FINE_RAYS`].
    FineLaser,
    /// It finds heads and shoulders in its depth images.
    Depth,
}

impl Source {
    /// Returns the values of a scene with the sensors that are needed: colours tell people apart by their
    /// clothes, and take more than half of the time of a ride.
    fn sensors(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Told | Self::Laser => &[("camera.colour", "false")],
            Self::FineLaser => &[("camera.colour", "false"), ("laser.rays", FINE_RAYS)],
            Self::Depth => &[],
        }
    }
}

/// A ride to come.
pub(super) struct Job {
    pub(super) setting: &'static str,
    /// Name of the controller.
    pub(super) planner: &'static str,
    pub(super) scene: Scene,
    pub(super) contender: Contender,
    pub(super) source: Source,
}

/// The kept parts of a ride.
pub(super) struct Driven {
    pub(super) setting: &'static str,
    pub(super) planner: &'static str,
    pub(super) measures: CrowdMeasures,
    /// Processor time of each step of the pipeline, ms.
    pub(super) took_ms: Vec<f64>,
}

/// Ends a ride when the target has arrived, as the benchmark does, or at a time.
pub(super) struct UntilArrival {
    ends_s: f64,
    is_over: bool,
}

impl UntilArrival {
    pub(super) fn or_at(ends_s: f64) -> Self {
        Self { ends_s, is_over: false }
    }
}

impl Witness for UntilArrival {
    fn tick(&mut self, tick: &Tick) {
        let has_arrived = tick.crowd.is_some_and(|view| view.target_arrived);
        self.is_over |= has_arrived || tick.at_s >= self.ends_s;
    }

    fn goes_on(&self) -> bool {
        !self.is_over
    }

    fn uses_images(&self) -> bool {
        false
    }
}

impl Job {
    pub(super) fn ride(&self, lab: &Lab) -> Result<Ride, TrialError> {
        self.ride_until(lab, f64::INFINITY)
    }

    pub(super) fn ride_until(&self, lab: &Lab, ends_s: f64) -> Result<Ride, TrialError> {
        let mut end = UntilArrival::or_at(ends_s);
        let ride = match self.source {
            Source::Told => Ride::told,
            Source::Laser | Source::FineLaser | Source::Depth => Ride::new,
        };
        ride(&self.scene, &self.contender, lab.registry, &mut end)
    }
}

/// Returns the rides of these controllers with the target at its speed in the benchmark, or at another
/// one, m/s.
pub(super) fn jobs(
    lab: &Lab,
    planners: &[(&'static str, &'static str)],
    source: Source,
    target_mps: Option<f64>,
) -> Result<Vec<Job>, ReproduceError> {
    let mut jobs = Vec::new();
    for setting in SETTINGS {
        let scenes = lab.scenes(&format!("among-{setting}"), source.sensors(), lab.seeds(SEEDS))?;
        for (planner, config) in planners {
            let contender = contender(lab, config, source)?;
            for scene in &scenes {
                let mut scene = scene.clone();
                if let (Some(speed_mps), Some(target)) = (target_mps, scene.people.first_mut()) {
                    target.speed_mps = speed_mps;
                }
                let contender = contender.clone();
                jobs.push(Job { setting, planner, scene, contender, source });
            }
        }
    }
    Ok(jobs)
}

fn contender(lab: &Lab, config: &str, source: Source) -> Result<Contender, ReproduceError> {
    let contender = lab.contender(config)?;
    match source {
        Source::Told => Ok(contender.told(lab.registry)?),
        Source::Laser | Source::FineLaser => by_laser(&contender, &lab.contender(BY_LASER)?),
        Source::Depth => Ok(contender),
    }
}

/// Returns a contender that finds people as another config does.
fn by_laser(contender: &Contender, finder: &Contender) -> Result<Contender, ReproduceError> {
    fn parsed(config: &str) -> Result<Toml, ReproduceError> {
        config.parse().map_err(|error: toml::de::Error| ReproduceError::Other(error.to_string()))
    }

    let mut config = parsed(&contender.config)?;
    let mut theirs = parsed(&finder.config)?;
    for key in FINDS {
        config.remove(key);
        config.extend(theirs.remove(key).map(|section| (key.to_owned(), section)));
    }
    // Cameras that a detector suits are no matter of the scanner.
    config.remove("suits");
    Ok(Contender { config: config.to_string(), ..contender.clone() })
}

/// Drives all of them.
pub(super) fn drive(lab: &Lab, what: &str, jobs: &[Job]) -> Result<Vec<Driven>, ReproduceError> {
    lab.progress.begin(jobs.len(), what);
    Ok(in_order(jobs, lab.jobs, |job| drive_one(lab, job), |_| lab.progress.step())?)
}

/// Drives one ride.
fn drive_one(lab: &Lab, job: &Job) -> Result<Driven, TrialError> {
    let ride = job.ride(lab)?;
    let Job { setting, planner, .. } = *job;
    // People of these scenes react, so that there are measures of every ride.
    let measures = CrowdMeasures::of(&ride.ticks).unwrap_or_default();
    Ok(Driven { setting, planner, measures, took_ms: ride.took_ms })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::testing::lab;

    #[test]
    fn each_source_has_its_detectors_and_the_same_controller() {
        let mut registry = tagalong_config::Registry::default();
        crate::register(&mut registry);
        let lab = lab(&registry, true, None);
        for (_, config) in PLANNERS {
            let mut controllers = Vec::new();
            for source in [Source::Told, Source::Laser, Source::FineLaser, Source::Depth] {
                let contender = contender(&lab, config, source).unwrap();
                let pipeline = contender.pipeline(&registry, 0).unwrap();
                assert!(pipeline.has_controller(), "{config}");
                let table: Toml = contender.config.parse().unwrap();
                assert_eq!(table["robot"]["footprint"].as_array().unwrap().len(), 4, "{config}");
                controllers.push(table["controller"].clone());
                let detectors = table["detectors"].as_array().unwrap();
                let names: Vec<_> = detectors.iter().filter_map(|d| d["plugin"].as_str()).collect();
                let expected = match source {
                    Source::Told => "recorded-detections",
                    Source::Laser | Source::FineLaser => "laser-legs",
                    Source::Depth => "depth-template",
                };
                assert_eq!(names, [expected], "{config}");
            }
            assert!(controllers.iter().all(|one| *one == controllers[0]), "{config}");
        }
    }

    #[test]
    fn the_scanners_differ_in_their_rays() {
        let registry = tagalong_config::Registry::default();
        let lab = lab(&registry, true, None);
        for (source, rays) in [(Source::Laser, 200), (Source::FineLaser, 720)] {
            for job in jobs(&lab, &PLANNERS[..1], source, None).unwrap() {
                assert_eq!(job.scene.laser.as_ref().map(|laser| laser.rays), Some(rays));
            }
        }
    }

    #[test]
    fn a_slower_target_is_the_first_person_alone() {
        let registry = tagalong_config::Registry::default();
        let lab = lab(&registry, true, None);
        let some = &PLANNERS[..1];
        let jobs = jobs(&lab, some, Source::Depth, Some(0.8)).unwrap();
        assert_eq!(jobs.len(), SETTINGS.len());
        for job in &jobs {
            let speeds: Vec<f64> = job.scene.people.iter().map(|one| one.speed_mps).collect();
            assert_eq!((speeds[0], speeds[1]), (0.8, 1.5), "{}", job.setting);
        }
    }
}
