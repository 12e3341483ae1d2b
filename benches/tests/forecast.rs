//! The forecast is calibrated on simulated walks that its settings were not learnt from.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use tagalong_controllers::ForecastSettings;
use tagalong_sim::Split;

mod walks;

use walks::{AHEAD_S, SHARES, held, samples};

/// Largest difference from the stated share that still counts as calibrated.
const OFF: f64 = 0.08;

#[test]
fn ellipses_hold_about_their_share_of_the_true_places() {
    let test = samples(Split::Test, 1);
    assert!(test.len() > 500, "{} samples", test.len());
    let found = held(&test, &ForecastSettings::default());
    for (row, seconds) in AHEAD_S.iter().enumerate() {
        for (column, share) in SHARES.iter().enumerate() {
            let held = found[row][column];
            assert!((held - share).abs() < OFF, "{share} after {seconds} s: {held}");
        }
    }
}

#[test]
fn a_forecast_without_disturbances_would_be_too_sure() {
    let test = samples(Split::Test, 1);
    let sure = ForecastSettings { unrest: 0.0, ..ForecastSettings::default() };
    let [_, _, _, [_, held, _]] = held(&test, &sure);
    assert!(held < 0.9 - OFF, "{held}");
}
