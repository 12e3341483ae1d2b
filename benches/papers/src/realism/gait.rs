//! Steps of simulated people against the walking model of Boulic, Magnenat-Thalmann & Thalmann
//! (1990): with leg lengths per second `RV`, a cycle of two steps takes `1.346 / sqrt(RV)` seconds,
//! and the body rises and sinks by `0.03 RV` leg lengths.

use nalgebra::Point3;
use tagalong_trials::TrialError;

use super::{Check, scene, simulated};
use crate::draws::mean;

const GROUP: &str = "gait";
/// Requested speeds of the people, m/s.
const SPEEDS_MPS: [f64; 3] = [0.8, 1.1, 1.4];
/// Their height, m, and the leg's part of it.
const HEIGHT_M: f64 = 1.7;
const LEG: f64 = 0.491;
/// Samples per second.
const RATE_HZ: f64 = 50.0;

pub fn checks() -> Result<Vec<Check>, TrialError> {
    Ok(SPEEDS_MPS.iter().filter_map(|speed| of_speed(*speed)).flatten().collect())
}

fn of_speed(speed_mps: f64) -> Option<Vec<Check>> {
    fn near(wanted: f64, part: f64) -> [f64; 2] {
        [(1.0 - part) * wanted, (1.0 + part) * wanted].map(rounded)
    }

    let heads = heads(speed_mps);
    let first = heads.first()?;
    let last = heads.last()?;
    let seconds = (heads.len() - 1) as f64 / RATE_HZ;
    let speed = (last - first).xy().norm() / seconds;
    let leg_m = LEG * HEIGHT_M;
    let relative = speed / leg_m;
    let steps_per_s = crossings_per_s(&heads.iter().map(|head| head.z).collect::<Vec<f64>>());
    let bob =
        heads.iter().map(|h| h.z).fold((f64::MAX, f64::MIN), |(a, b), z| (a.min(z), b.max(z)));
    let wanted_rate = 2.0 * relative.sqrt() / 1.346;
    let at = format!("at {speed:.2} m/s");
    let length = speed / steps_per_s;
    Some(vec![
        Check::between(GROUP, format!("steps {at}"), steps_per_s, "1/s", near(wanted_rate, 0.05)),
        Check::between(
            GROUP,
            format!("step length {at}"),
            length,
            "m",
            near(speed / wanted_rate, 0.05),
        ),
        Check::between(
            GROUP,
            format!("rise and fall of the head {at}"),
            bob.1 - bob.0,
            "m",
            near(0.03 * relative * leg_m, 0.35),
        ),
    ])
}

fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// Returns the head positions of a person walking past a robot at rest, in full stride.
fn heads(speed_mps: f64) -> Vec<Point3<f64>> {
    let text = format!(
        "duration_s = 8.0\n[room]\nsize_m = [18.0, 6.0]\n[camera]\nwidth = 16\nheight = 12\n\
         rate_hz = {RATE_HZ:.1}\n[faults]\ndropped = 0.0\nlate = 0.0\n[robot]\nstart = [0.5, 0.5]\n\
         [[people]]\npath = [[1.5, 4.5], [17.0, 4.5]]\nspeed_mps = {speed_mps:.2}\n\
         height_m = {HEIGHT_M:.2}\n"
    );
    let all = simulated(&scene(&text)).filter_map(|d| d.truth.first().map(|t| t.head_in_robot));
    // The first two seconds are those in which the person gathers speed.
    all.skip((2.0 * RATE_HZ) as usize).collect()
}

/// Returns the rate at which a series rises through its mean, per second, from the first to the
/// last crossing.
fn crossings_per_s(values: &[f64]) -> f64 {
    let centre = mean(values);
    let at: Vec<f64> = (0..values.len().saturating_sub(1))
        .filter(|i| values[*i] < centre && values[*i + 1] >= centre)
        // Interpolated, because a step is only some 25 samples long.
        .map(|i| i as f64 + (centre - values[i]) / (values[i + 1] - values[i]))
        .collect();
    match at.as_slice() {
        [first, .., last] => (at.len() - 1) as f64 * RATE_HZ / (last - first),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_a_sine_is_found() {
        let wave: Vec<f64> = (0..300)
            .map(|i| 3.0 + (2.0 * std::f64::consts::TAU * f64::from(i) / RATE_HZ).sin())
            .collect();
        assert!((crossings_per_s(&wave) - 2.0).abs() < 0.01);
        assert_eq!(crossings_per_s(&[1.0, 1.0]), 0.0);
    }
}
