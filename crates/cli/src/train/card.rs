//! The card of a model: what it was trained on and what it is worth.

use std::fmt::Write as _;

use serde::Serialize;

use super::TrainArgs;
use super::held_out::{Effect, Share};

/// What one round of training showed to the trainer.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Harvest {
    /// Candidates with a label.
    pub seen: u64,
    /// Wrongly judged by the model of the round before.
    pub mistakes: u64,
    /// People that were added.
    pub people: u64,
    /// Others that were added.
    pub others: u64,
}

/// The card.
#[derive(Clone, Debug, Serialize)]
pub struct Card {
    /// The plugin that reads the model.
    pub plugin: String,
    /// A minute's version.
    pub quick: bool,
    /// The seed.
    pub seed: u64,
    /// Scenes that were drawn for the first round.
    pub scenes: u64,
    /// What it was trained on.
    pub trained_on: Vec<String>,
    /// What was added in each round.
    pub rounds: Vec<Harvest>,
    /// What the trainer says.
    pub fit: toml::Table,
    /// On rooms that nothing was trained on.
    pub held_out_rooms: Effect,
    /// On logs that nothing was trained on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_logs: Option<Effect>,
}

impl Card {
    /// A card without figures.
    pub fn new(args: &TrainArgs, scenes: u64, trained_on: Vec<String>) -> Self {
        Self {
            plugin: args.plugin.clone(),
            quick: args.quick,
            seed: args.seed,
            scenes,
            trained_on,
            rounds: Vec::new(),
            fit: toml::Table::new(),
            held_out_rooms: Effect::default(),
            held_out_logs: None,
        }
    }

    /// The card as TOML.
    pub fn to_text(&self) -> String {
        let text = toml::to_string(self).unwrap_or_default();
        format!(
            "# Shares come with 95 % intervals (Wilson), too narrow for sightings, which are not independent.\n{text}"
        )
    }

    /// The figures that matter most, for people.
    pub fn summary(&self) -> String {
        let mut out = String::new();
        let logs = self.held_out_logs.iter().map(|effect| ("held-out logs", effect));
        for (name, effect) in [("held-out rooms", &self.held_out_rooms)].into_iter().chain(logs) {
            let _ = writeln!(out, "{name}");
            for (what, share) in [
                ("false proposals rejected", effect.false_proposals_rejected),
                ("people's proposals rejected", effect.people_proposals_rejected),
                ("false sightings removed", effect.false_sightings_removed),
                ("people's sightings lost", effect.people_sightings_lost),
                ("sightings of parts removed", effect.part_sightings_removed),
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

/// The card of a detector that looks at windows.
#[derive(Clone, Debug, Serialize)]
pub struct WindowCard {
    /// The plugin that reads the model.
    plugin: String,
    /// A minute's version.
    quick: bool,
    /// The seed.
    seed: u64,
    /// What it was trained on.
    trained_on: Vec<String>,
    /// Photographs altogether; a fifth of their groups is held out for the
    /// figures, and a tenth for the calibration.
    photographs: usize,
    /// What the trainer says.
    fit: toml::Table,
}

impl WindowCard {
    /// A card; `folders` are those of the data that were read.
    pub fn new(args: &TrainArgs, folders: &[&str], photographs: usize, fit: toml::Table) -> Self {
        Self {
            plugin: args.plugin.clone(),
            quick: args.quick,
            seed: args.seed,
            trained_on: folders.iter().map(ToString::to_string).collect(),
            photographs,
            fit,
        }
    }

    /// The card as TOML.
    pub fn to_text(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }
}

fn line(share: Share) -> String {
    let percent = |fraction: f64| format!("{:.1}", 100.0 * fraction);
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
