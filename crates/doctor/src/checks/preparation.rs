use super::super::evidence::{Evidence, Preparations};
use super::super::finding::{Finding, Severity};

/// Gain of the mean probability from which another preparation is recommended.
const MIN_GAIN: f64 = 0.1;

/// Checks that the preparation of images is the one that the neural network expects.
pub fn preparation(evidence: &Evidence) -> Option<Finding> {
    let judged = evidence.preparations.iter().map(judge);
    judged.max_by_key(|finding| finding.severity)
}

fn judge(tried: &Preparations) -> Finding {
    let Preparations { frames, now, best } = tried;
    let better = best.as_ref().filter(|best| best.score >= now.score + MIN_GAIN);
    let severity = match better {
        Some(best) if 2 * now.found < *frames && 2 * best.found >= *frames => Severity::Bad,
        Some(_) => Severity::Warn,
        None if now.found == 0 => Severity::Warn,
        None => Severity::Ok,
    };
    let other = better.map_or(String::new(), |best| {
        format!(", with other settings in {} (probability {:.2})", best.found, best.score)
    });
    let measured = format!(
        "the network finds people in {} of {frames} frames (probability {:.2}){other}",
        now.found, now.score
    );
    let finding = Finding::new("preparation", severity, measured)
        .figure("frames", *frames as f64)
        .figure("frames_with_people", now.found as f64)
        .figure("probability", now.score);
    match better {
        Some(best) => finding
            .figure("other_probability", best.score)
            .why(
                "a network finds nothing if the colours, scale or position of its input differ \
                 from those of its training",
            )
            .remedy(best.change.clone()),
        None => {
            finding.why("it finds no people with any order of colours, scale and position").remedy(
                "check that there are people in the log; then try `classes`, `discover_score`, or \
                 another export: `tagalong model FILE.onnx`",
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::evidence::Prepared;
    use super::*;

    fn finding(now: (usize, f64), best: Option<(usize, f64)>) -> Finding {
        judge(&Preparations { frames: 8, now: prepared(now), best: best.map(prepared) })
    }

    fn prepared((found, score): (usize, f64)) -> Prepared {
        Prepared { change: "a line".into(), found, score }
    }

    #[test]
    fn a_better_preparation_is_recommended_and_a_like_one_is_not() {
        let bad = finding((0, 0.0), Some((7, 0.8)));
        assert_eq!((bad.severity, bad.remedy.as_deref()), (Severity::Bad, Some("a line")));
        assert_eq!(finding((7, 0.6), Some((8, 0.8))).severity, Severity::Warn);
        assert_eq!(finding((7, 0.75), Some((8, 0.8))).severity, Severity::Ok);
        assert_eq!(finding((7, 0.75), None).severity, Severity::Ok);
        let none = finding((0, 0.0), Some((0, 0.0)));
        assert!(none.severity == Severity::Warn && none.remedy.unwrap().contains("classes"));
    }
}
