//! Card of a model: its training data and its scores.

use std::fmt::Write as _;

use serde::Serialize;
use tagalong_app::outcome::Failure;
use tagalong_app::serialize::to_toml;

use super::args::TrainArgs;
use super::held_out::{Effect, Share};

/// Counts of the candidates of one round.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct CandidateCounts {
    /// Candidates with a label.
    pub seen: u64,
    /// Candidates that the model of the previous round judged wrongly.
    pub mistakes: u64,
    /// People that were added.
    pub people: u64,
    /// Other candidates that were added.
    pub others: u64,
}

/// Card of a verifier.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Card {
    /// Plugin that reads the model.
    pub plugin: String,
    /// True for the quick version of the training.
    pub quick: bool,
    /// Seed of the training.
    pub seed: u64,
    /// Number of scenes simulated for the first round.
    pub scenes: u64,
    /// Training data.
    pub trained_on: Vec<String>,
    /// Added candidates of each round.
    pub rounds: Vec<CandidateCounts>,
    /// Figures of the trainer.
    pub fit: toml::Table,
    /// Scores in held-out rooms.
    pub held_out_rooms: Effect,
    /// Scores on held-out logs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_logs: Option<Effect>,
}

impl Card {
    /// Returns a card without figures.
    pub fn new(args: &TrainArgs, scenes: u64, trained_on: Vec<String>) -> Self {
        Self {
            plugin: args.plugin.clone(),
            quick: args.quick,
            seed: args.seed,
            scenes,
            trained_on,
            ..Self::default()
        }
    }

    /// Returns the card as TOML.
    pub fn to_text(&self) -> Result<String, Failure> {
        let text = to_toml("the card", self)?;
        Ok(format!(
            "# Shares come with 95 % intervals (Wilson), too narrow for detections, which are not independent.\n{text}"
        ))
    }

    /// Returns the main figures, for a terminal.
    pub fn summary(&self) -> String {
        let mut out = String::new();
        let logs = self.held_out_logs.iter().map(|effect| ("held-out logs", effect));
        for (name, effect) in [("held-out rooms", &self.held_out_rooms)].into_iter().chain(logs) {
            let _ = writeln!(out, "{name}");
            for (what, share) in [
                ("false proposals rejected", effect.false_proposals_rejected),
                ("people's proposals rejected", effect.people_proposals_rejected),
                ("false detections removed", effect.false_sightings_removed),
                ("detections of people lost", effect.people_sightings_lost),
                ("detections of parts removed", effect.part_sightings_removed),
                ("false tracks removed", effect.false_tracks_removed),
                ("false track frames removed", effect.false_track_frames_removed),
                ("tracked people lost (frames)", effect.tracked_people_lost),
                ("people never tracked", effect.people_never_tracked),
            ] {
                let _ = writeln!(out, "  {what:<30}{}", line(share));
            }
        }
        out
    }
}

/// Card of a window detector.
#[derive(Clone, Debug, Serialize)]
pub struct WindowCard {
    /// Plugin that reads the model.
    plugin: String,
    /// True for the quick version of the training.
    quick: bool,
    /// Seed of the training.
    seed: u64,
    /// Training data.
    trained_on: Vec<String>,
    /// Number of photographs; a fifth of their groups is held out for the figures, and a tenth is
    /// used for the calibration.
    photographs: usize,
    /// Figures of the trainer.
    fit: toml::Table,
}

impl WindowCard {
    /// Creates a card; `sources` are the folders and logs that were read.
    pub fn new(
        args: &TrainArgs,
        sources: Vec<String>,
        photographs: usize,
        fit: toml::Table,
    ) -> Self {
        Self {
            plugin: args.plugin.clone(),
            quick: args.quick,
            seed: args.seed,
            trained_on: sources,
            photographs,
            fit,
        }
    }

    /// Returns the card as TOML.
    pub fn to_text(&self) -> Result<String, Failure> {
        to_toml("the card", self)
    }
}

fn line(share: Share) -> String {
    fn percent(fraction: f64) -> String {
        format!("{:.1}", 100.0 * fraction)
    }

    let fraction = share.count as f64 / share.of.max(1) as f64;
    format!(
        "{} of {} ({} %, 95 % interval {} to {})",
        share.count,
        share.of,
        percent(fraction),
        percent(share.lower),
        percent(share.upper)
    )
}
