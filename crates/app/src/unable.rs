//! Pipelines with a detector that cannot detect anything on a log, whatever the log shows.

use crate::remedies::Remedies;

/// Test of the funnel by which a detector reports that it has no model.
const NO_MODEL: &str = "no model";

/// Test of the funnel by which a detector reports that the camera of the log gives no panorama.
const NO_PANORAMA: &str = "no panorama";

/// Returns the reason why a detector of a pipeline cannot detect anything, with the remedy; `None`
/// if there is none. `tests` are the tests of the funnel that dropped candidates.
pub fn unable<'a>(
    config: &str,
    tests: impl IntoIterator<Item = &'a str>,
    has_people: bool,
    remedies: &Remedies,
) -> Option<String> {
    let result = if has_people { "it found nobody" } else { "no person was detected" };
    for test in tests {
        if test == NO_MODEL
            && let Some(remedy) = remedies.of(test)
        {
            let key = remedy.settings.join(", ");
            let look = &remedy.look;
            return Some(format!(
                "{config}: a detector has no model (`{key}`), so {result}: {look}"
            ));
        }
        if test == NO_PANORAMA {
            return Some(format!(
                "{config}: a detector needs panoramas of a conical mirror, but the camera of the \
                 log makes none, so {result}: take another config, as `tagalong run LOG` does, or \
                 record a `camera_info` that says `conical_mirror`"
            ));
        }
    }
    None
}

#[cfg(test)]
mod tests {

    use super::*;

    /// Returns the reason for a pipeline whose funnel has these tests.
    fn reason(tests: &[&str], has_people: bool) -> Option<String> {
        let registry = tagalong_catalog::registry();
        unable("some", tests.iter().copied(), has_people, &Remedies::new(&registry))
    }

    #[test]
    fn a_detector_that_can_detect_nothing_is_told_with_the_remedy() {
        assert_eq!(reason(&["same person", "verifier"], false), None);
        let model = reason(&["same person", "no model"], false).unwrap();
        assert!(model.starts_with("some: a detector has no model (`model`)"), "{model}");
        assert!(model.contains("no person was detected: an ONNX file is needed"), "{model}");
        let beside = reason(&["no model"], true).unwrap();
        assert!(beside.contains("so it found nobody"), "other detectors found people: {beside}");
        let mirror = reason(&["no panorama"], false).unwrap();
        assert!(mirror.contains("conical_mirror"), "{mirror}");
    }
}
