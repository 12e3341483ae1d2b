use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{ANY, Error, NOT_NEGATIVE, POSITIVE, Result, check_ranges};

/// Settings of the track manager `manage-sprt`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// A detection that belongs to no track starts one from these log-odds on (verifiers and
    /// clutter included).
    pub start_log_odds: f64,
    /// A track is confirmed from these log-odds on. Wald's bound ln((1 - b) / a) is 4.6 for
    /// one false confirmation in a hundred ...
    pub confirm_log_odds: f64,
    /// ... and it ends below these.
    pub end_log_odds: f64,
    /// Log-odds are kept below this bound, so that misses count in time.
    pub max_log_odds: f64,
    /// One detection says no more than this, for or against, log-odds.
    pub max_look: f64,
    /// What a look counts that is the same as the last one, 0 to 1.
    pub same_look: f64,
    /// A look is a new one after the track, or the robot that sees it, moved so far, m.
    pub new_look_m: f64,
    /// What a miss says, log-odds.
    pub miss_log_odds: f64,
    /// What it says that the track moved, log-odds.
    pub moved_log_odds: f64,
    /// A track has moved when it is so far from where it started, m, and farther than its
    /// uncertainty explains.
    pub moved_m: f64,
    /// A track that is not confirmed and did not move ends after this time, s.
    pub undecided_s: f64,
    /// Clutter is remembered with this time constant, s.
    pub clutter_s: f64,
    /// Clutter is at a place within this, m.
    pub clutter_m: f64,
    /// No place counts for more clutter than this, log-odds.
    pub max_clutter: f64,
    /// A track that is not confirmed ends after this many misses in a row.
    pub tentative_misses: u32,
    /// A track ends when it should have been visible and was not seen for longer, s.
    pub drop_after_s: f64,
    /// A track that left the image ends when it was not seen for longer, s.
    pub left_drop_after_s: f64,
    /// A track that is hidden behind another one ends when it was not seen for longer, s.
    pub occluded_drop_after_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            start_log_odds: 0.0,
            confirm_log_odds: 4.6,
            end_log_odds: -2.0,
            max_log_odds: 8.0,
            max_look: 3.0,
            same_look: 0.1,
            new_look_m: 0.15,
            miss_log_odds: -0.5,
            moved_log_odds: 3.0,
            moved_m: 0.4,
            undecided_s: 2.0,
            clutter_s: 60.0,
            clutter_m: 0.3,
            max_clutter: 6.0,
            tentative_misses: 2,
            drop_after_s: 1.0,
            left_drop_after_s: 2.0,
            occluded_drop_after_s: 3.0,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_ranges(&[
            ("start_log_odds", self.start_log_odds, ANY),
            ("confirm_log_odds", self.confirm_log_odds, ANY),
            ("end_log_odds", self.end_log_odds, ANY),
            ("max_log_odds", self.max_log_odds, ANY),
            ("max_look", self.max_look, POSITIVE),
            ("same_look", self.same_look, 0.0..=1.0),
            ("new_look_m", self.new_look_m, POSITIVE),
            ("miss_log_odds", self.miss_log_odds, -1e6..=0.0),
            ("moved_log_odds", self.moved_log_odds, NOT_NEGATIVE),
            ("moved_m", self.moved_m, POSITIVE),
            ("undecided_s", self.undecided_s, POSITIVE),
            ("clutter_s", self.clutter_s, POSITIVE),
            ("clutter_m", self.clutter_m, NOT_NEGATIVE),
            ("max_clutter", self.max_clutter, NOT_NEGATIVE),
            ("tentative_misses", f64::from(self.tentative_misses), 1.0..=1e6),
            ("drop_after_s", self.drop_after_s, NOT_NEGATIVE),
            ("left_drop_after_s", self.left_drop_after_s, NOT_NEGATIVE),
            ("occluded_drop_after_s", self.occluded_drop_after_s, NOT_NEGATIVE),
        ])?;
        let Self { start_log_odds, confirm_log_odds, end_log_odds, max_log_odds, .. } = *self;
        let in_order = end_log_odds < start_log_odds
            && start_log_odds <= confirm_log_odds
            && confirm_log_odds <= max_log_odds;
        if !in_order {
            let message = format!(
                "`end_log_odds` = {end_log_odds}, `start_log_odds` = {start_log_odds}, \
                 `confirm_log_odds` = {confirm_log_odds} and `max_log_odds` = {max_log_odds} must \
                 rise in this order"
            );
            return Err(Error::Settings(message));
        }
        Ok(())
    }
}
