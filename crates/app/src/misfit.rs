//! Logs and scenes for which a config is not suitable, according to its `[suits]`.

use tagalong_log::FrameSource;
use tagalong_math::counted;
use tagalong_pipeline::Suits;

/// Tolerance of the camera's pitch outside of the stated range, degrees.
const PITCH_TOLERANCE_DEG: f64 = 3.0;

/// Properties of a log or a scene that `[suits]` of a config can refer to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traits {
    /// Height of the camera above the floor, m; `None` without a camera, or if it is not known.
    pub camera_height_m: Option<f64>,
    /// Angle of its optical axis below the horizon, degrees, likewise.
    pub pitch_down_deg: Option<f64>,
    /// Baseline: distance of the right camera from the left one, m; `None` without a pair.
    pub baseline_m: Option<f64>,
    /// True if the motion of the robot is known.
    pub has_odometry: bool,
}

impl Traits {
    /// Returns the properties of an open log.
    pub fn of(source: &FrameSource) -> Self {
        let facts = source.facts();
        // A scanner has no camera, and an assumed pose is no evidence.
        let is_known = facts.width > 0 && !facts.camera_source.starts_with("an assumption");
        Self {
            camera_height_m: is_known.then_some(facts.camera_height_m),
            pitch_down_deg: is_known.then_some(facts.camera_pitch_down_deg),
            baseline_m: facts.baseline_m,
            has_odometry: source.has_odometry(),
        }
    }

    /// Returns a sentence for each property that does not fit a config; empty if all fit.
    pub fn misfits(&self, suits: &Suits) -> Vec<String> {
        let mut found = Vec::new();
        if suits.odometry && !self.has_odometry {
            found.push(
                "the config is for a robot with odometry, but there is none: objects that the \
                 robot passes seem to move"
                    .to_owned(),
            );
        }
        if let (Some(baseline_m), Some([low, high])) = (self.baseline_m, suits.baseline_m)
            && suits.baseline_off_m(baseline_m) > 0.0
        {
            found.push(format!(
                "the pair has a baseline of {baseline_m:.2} m, but the config is for {low} to {high} m"
            ));
        }
        if let (Some(height_m), Some([low, high])) = (self.camera_height_m, suits.camera_height_m)
            && suits.height_off_m(height_m) > Suits::HEIGHT_TOLERANCE_M
        {
            found.push(format!(
                "the camera is {height_m:.2} m high, but the config is for {low} to {high} m"
            ));
        }
        if let (Some(pitch_deg), Some([low, high])) = (self.pitch_down_deg, suits.pitch_down_deg)
            && suits.pitch_off_deg(pitch_deg) > PITCH_TOLERANCE_DEG
        {
            found.push(format!(
                "the camera looks down by {pitch_deg:.0} degrees, but the config is for {low} to {high}"
            ));
        }
        found
    }
}

/// Logs, or scenes, each with the reasons why a config is not suitable for it; empty if it is.
pub type LogMisfits = Vec<(String, Vec<String>)>;

/// Command that leads to better configs for a log.
pub const COMPARE: &str = "`tagalong doctor LOG` compares the configs that fit";

/// Returns one note for a config and all logs, or scenes, for which it is not suitable, each with
/// the reasons; `None` if it suits all.
pub fn misfit_note(config: &str, unsuited: &[(String, Vec<String>)]) -> Option<String> {
    let unsuited = unsuited.iter().filter(|(_, misfits)| !misfits.is_empty());
    let each: Vec<String> =
        unsuited.map(|(name, misfits)| format!("{name} ({})", misfits.join("; "))).collect();
    if each.is_empty() {
        return None;
    }
    Some(format!(
        "{config} is not made for {} according to its [suits]: expect worse tracks",
        each.join(", ")
    ))
}

/// Returns one note for all configs. For a single config that does not suit some logs it is that of
/// [`misfit_note`]; for several it has their names with the numbers of logs; `None` if each suits
/// all.
pub fn misfits_note(configs: &[(String, LogMisfits)]) -> Option<String> {
    let mut each = Vec::new();
    let mut last = None;
    for (config, logs) in configs {
        let count = logs.iter().filter(|(_, misfits)| !misfits.is_empty()).count();
        if count > 0 {
            each.push(format!("{config} ({})", counted(count, "log")));
            last = Some((config, logs));
        }
    }
    let (config, logs) = last?;
    if each.len() == 1 {
        return misfit_note(config, logs);
    }
    Some(format!(
        "{} configs are not made for some of the logs according to their [suits], and track worse \
         there: {}",
        each.len(),
        each.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEN: Traits = Traits {
        camera_height_m: Some(0.5),
        pitch_down_deg: Some(20.0),
        baseline_m: Some(0.5),
        has_odometry: false,
    };

    #[test]
    fn each_property_that_does_not_fit_is_named_with_both_values() {
        let suits = Suits {
            camera_height_m: Some([0.9, 2.0]),
            pitch_down_deg: Some([-5.0, 15.0]),
            baseline_m: Some([0.0, 0.3]),
            odometry: true,
        };
        let found = SEEN.misfits(&suits);
        let parts =
            ["there is none", "0.50 m, but the config is for 0 to 0.3 m", "0.50 m high", "20"];
        assert_eq!(found.len(), parts.len(), "{found:?}");
        for (misfit, part) in found.iter().zip(parts) {
            assert!(misfit.contains(part), "{misfit}");
        }
        let near = Traits { camera_height_m: Some(0.85), baseline_m: None, ..SEEN };
        let near = Traits { has_odometry: true, ..near };
        assert_eq!(near.misfits(&suits).len(), 1, "the pitch alone");
        assert_eq!(Traits::default().misfits(&Suits { odometry: false, ..suits }), [""; 0]);
        assert_eq!(SEEN.misfits(&Suits::default()), [""; 0]);
    }

    #[test]
    fn a_config_has_one_note_for_all_logs() {
        fn log(name: &str, misfits: &[&str]) -> (String, Vec<String>) {
            (name.to_owned(), misfits.iter().map(|it| (*it).to_owned()).collect())
        }

        let note =
            misfit_note("low", &[log("a", &["too high"]), log("b", &[]), log("c", &["x", "y"])]);
        let note = note.unwrap();
        assert!(
            note.starts_with("low is not made for a (too high), c (x; y) according to its [suits]"),
            "{note}"
        );
        assert_eq!(misfit_note("low", &[log("b", &[])]), None);
    }

    #[test]
    fn several_configs_have_one_note_without_reasons() {
        fn config(name: &str, misfits: [&[&str]; 2]) -> (String, LogMisfits) {
            let logs = ["a", "b"].iter().zip(misfits);
            let logs = logs.map(|(log, misfits)| {
                ((*log).to_owned(), misfits.iter().map(|it| (*it).to_owned()).collect())
            });
            (name.to_owned(), logs.collect())
        }

        let one = config("low", [&["too high"], &[]]);
        let two = config("wide", [&["too high"], &["x", "y"]]);
        let fits = config("all", [&[], &[]]);
        let note = misfits_note(&[one.clone(), fits.clone(), two]).expect("a note");
        assert!(note.starts_with("2 configs are not made for some"), "{note}");
        assert!(note.ends_with(": low (1 log), wide (2 logs)"), "{note}");
        assert_eq!(misfits_note(&[one.clone(), fits.clone()]), misfit_note("low", &one.1));
        assert_eq!(misfits_note(&[fits]), None);
    }
}
