//! Rides in which the pipeline is given the true positions of people, to measure the cost of
//! perception.

use nalgebra::Point2;
use tagalong_config::Registry;
use tagalong_core::{ExternalDetection, TrackId};
use tagalong_pipeline::{Choice, Enrollment, FrameReport, Pipeline};
use tagalong_sim::Simulation;
use toml::Table;

use crate::{Contender, SimulatedFrame, TrialError};

/// Log-odds of a given position.
const SURE: f64 = 6.0;
/// Maximum distance between a track and the target's head, m.
const SAME_M: f64 = 0.4;

impl Contender {
    /// Returns the same pipeline with a single detector, which uses the given positions; see
    /// [`crate::Ride::told`].
    ///
    /// # Errors
    /// [`TrialError::Config`] for a config that is not TOML, and if no registered detector takes
    /// positions.
    pub fn told(&self, registry: &Registry) -> Result<Self, TrialError> {
        let mut config = self.table_of(&self.config)?;
        let Some((plugin, offer)) = registry.all_recorded().next() else {
            let why = "no registered detector takes the positions that a pipeline is told";
            return Err(TrialError::Config(why.to_owned()));
        };
        let mut detector = Table::new();
        detector.insert("plugin".to_owned(), plugin.into());
        detector.insert("roles".to_owned(), vec!["discover"].into());
        let settings = self.table_of(offer.known_positions)?;
        detector.insert("config".to_owned(), settings.into());
        config.insert("detectors".to_owned(), vec![detector].into());
        // The cameras that a detector suits do not matter for given positions.
        config.remove("suits");
        let config = config.to_string();
        Ok(Self { name: format!("{}-told", self.name), config, ..self.clone() })
    }

    /// Reads TOML; an error names this contender.
    fn table_of(&self, text: &str) -> Result<Table, TrialError> {
        text.parse::<Table>().map_err(|error| TrialError::Config(format!("{}: {error}", self.name)))
    }
}

/// Returns a frame with the positions of all people within range of the laser scanner and in free
/// sight.
pub(super) fn tell(simulation: &Simulation, simulated: SimulatedFrame) -> SimulatedFrame {
    let world_from_robot = simulated.world_from_robot;
    let places: Vec<Point2<f64>> = simulated
        .truth
        .iter()
        .map(|person| world_from_robot * person.torso_in_robot.xy())
        .collect();
    let robot = Point2::from(world_from_robot.translation.vector);
    let in_sight = simulation.in_sight(&robot, &places);
    let seen = simulated.truth.iter().zip(in_sight).filter(|(_, is_seen)| *is_seen);
    let told = seen.map(|(person, _)| ExternalDetection::at(person.head_in_robot, SURE));
    let told = told.collect();
    SimulatedFrame { frame: simulated.frame.with_recorded(Some(told)), ..simulated }
}

/// Tells the pipeline which of its tracks is the target, as a program that knows it would do: a
/// target whose position was given in the frame, and whose track is not followed yet, is enrolled.
pub(super) fn tell_target(
    pipeline: &mut Pipeline,
    simulated: &SimulatedFrame,
    report: &FrameReport,
) {
    let Some(track) = track_of_target(simulated, report) else { return };
    if report.target == Some(track) {
        return;
    }
    let person = Choice::Track(track);
    let enrollment = Enrollment { person, lose_after_s: None, search: None, give_up_s: None };
    // A track that is not confirmed yet is rejected, and enrolled with a later frame.
    let _ = pipeline.enroll(&enrollment);
}

/// Returns the observed track at the target's position.
fn track_of_target(simulated: &SimulatedFrame, report: &FrameReport) -> Option<TrackId> {
    let target = simulated.truth.iter().find(|person| person.id == 1)?.head_in_robot;
    let told = simulated.frame.recorded()?;
    if !told.iter().any(|one| one.head == Some(target)) {
        return None;
    }
    let seen = report.tracks.iter().filter(|track| track.seen);
    let off = seen.map(|it| (it.id, (it.estimate.person.position.xy() - target.xy()).norm()));
    let (id, off_m) = off.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (off_m < SAME_M).then_some(id)
}
