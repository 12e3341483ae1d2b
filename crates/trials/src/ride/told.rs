//! Rides that are told where people are, to measure the price of perception.

use nalgebra::Point2;
use tagalong_config::Registry;
use tagalong_core::{ExternalDetection, TrackId};
use tagalong_pipeline::{Choice, Enrollment, FrameReport, Pipeline};
use tagalong_sim::Simulation;
use toml::Table;

use crate::{Contender, SimulatedFrame, TrialError};

/// Log-odds of a position that is told.
const SURE: f64 = 6.0;
/// A track within this distance of the target's head is on the target, m.
const SAME_M: f64 = 0.4;

impl Contender {
    /// Returns the same pipeline with one detector, that of the positions that it is told; see
    /// [`crate::Ride::told`].
    ///
    /// # Errors
    /// [`TrialError::Config`] for a config that is no TOML, and where no registered detector takes
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
        // Cameras that a detector suits are no matter of the positions that are told.
        config.remove("suits");
        let config = config.to_string();
        Ok(Self { name: format!("{}-told", self.name), config, ..self.clone() })
    }

    /// Reads TOML; an error names this contender.
    fn table_of(&self, text: &str) -> Result<Table, TrialError> {
        text.parse::<Table>().map_err(|error| TrialError::Config(format!("{}: {error}", self.name)))
    }
}

/// Returns a frame with the positions of all people that are within reach of the laser and in free
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

/// Tells the pipeline which of its tracks is the target, as a program does that knows it: a target
/// that was told in the frame and is on a track that is not followed is enrolled.
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
    // A track that is not confirmed yet is refused, and enrolled with a later frame.
    let _ = pipeline.enroll(&enrollment);
}

/// Returns the track that is observed at the target's place.
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
