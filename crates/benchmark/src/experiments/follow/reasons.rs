//! Reasons why the robot stopped or drove slower, as lines of text.

use std::collections::BTreeMap;

use tagalong_math::counted;

use super::Followed;

/// Maximum number of rides that have a line each; if there are more, those of a scene and a
/// pipeline share one.
const MOST_RIDES: usize = 12;

/// Sum of the shares of each reason over some rides, by effect.
#[derive(Default)]
struct Sums {
    rides: usize,
    shares: BTreeMap<(&'static str, &'static str), f64>,
}

/// Returns a line for each ride, or for the rides of a scene and a pipeline if there are many, with
/// the fraction of the time for each reason to stop or to drive slower.
pub fn lines(results: &[Followed]) -> Vec<String> {
    let has_line_each = results.len() <= MOST_RIDES;
    let mut labels: Vec<String> = Vec::new();
    let mut sums: Vec<Sums> = Vec::new();
    for Followed { suite, pipeline, ridden, .. } in results {
        let mut label = format!("{suite}: {pipeline}");
        if has_line_each {
            label += &format!(", seed {}", ridden.seed);
        }
        let at = labels.iter().position(|other| *other == label).unwrap_or_else(|| {
            labels.push(label);
            sums.push(Sums::default());
            labels.len() - 1
        });
        sums[at].rides += 1;
        for share in &ridden.reasons {
            *sums[at].shares.entry((share.effect, share.reason)).or_default() += share.share;
        }
    }
    let title =
        "Why the robot did not drive (it may turn), or drove slower, by the share of the time:"
            .to_owned();
    let all = labels.iter().zip(&sums).map(|(label, sums)| {
        let of = if has_line_each {
            String::new()
        } else {
            format!(", {}", counted(sums.rides, "ride"))
        };
        format!("  {label}{of}: {}", sums.told())
    });
    std::iter::once(title).chain(all).collect()
}

impl Sums {
    fn told(&self) -> String {
        let parts: Vec<String> = [("stands", "does not drive"), ("slower", "slower")]
            .iter()
            .filter_map(|(effect, words)| self.of(effect, words))
            .collect();
        if parts.is_empty() { "drove as asked".to_owned() } else { parts.join("; ") }
    }

    /// Returns the reasons of one effect in these words, the most frequent first; `None` if there
    /// were none.
    fn of(&self, effect: &str, words: &str) -> Option<String> {
        let own = self.shares.iter().filter(|((of, _), _)| *of == effect);
        let mut shares: Vec<(&str, f64)> =
            own.map(|((_, reason), sum)| (*reason, sum / self.rides as f64)).collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        let all: f64 = shares.iter().map(|(_, share)| share).sum();
        let each: Vec<String> =
            shares.iter().map(|(reason, share)| format!("{reason} {}", percent(*share))).collect();
        (!each.is_empty()).then(|| format!("{words} {} ({})", percent(all), each.join(", ")))
    }
}

/// Returns a fraction in per cent; one that would round to zero is not shown as zero.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent < 0.5 { "<1 %".to_owned() } else { format!("{percent:.0} %") }
}

#[cfg(test)]
mod tests {
    use tagalong_trials::{ReasonShare, Ridden};

    use super::*;

    fn ride(seed: u64, reasons: &[(&'static str, &'static str, f64)]) -> Followed {
        let reasons = reasons.iter();
        let reasons =
            reasons.map(|&(reason, effect, share)| ReasonShare { reason, effect, share }).collect();
        let ridden = Ridden { seed, reasons, ..Ridden::default() };
        Followed { suite: "turns".into(), pipeline: "low".into(), ridden, ..Followed::default() }
    }

    #[test]
    fn each_ride_has_its_reasons_by_effect_and_many_rides_share_a_line() {
        let busy = [
            ("follow", "drives", 0.6),
            ("near", "slower", 0.2),
            ("blocked", "stands", 0.004),
            ("no-target", "stands", 0.196),
        ];
        let told = lines(&[ride(7, &busy), ride(8, &[("limited", "drives", 1.0)])]);
        assert_eq!(
            told[1..],
            [
                "  turns: low, seed 7: does not drive 20 % (no-target 20 %, blocked <1 %); slower 20 % (near 20 %)",
                "  turns: low, seed 8: drove as asked",
            ]
        );
        let many: Vec<Followed> =
            (0..20).map(|seed| ride(seed, if seed < 10 { &busy } else { &busy[..1] })).collect();
        let told = lines(&many);
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(
            told[1].starts_with("  turns: low, 20 rides: does not drive 10 % (no-target 10 %"),
            "{told:?}"
        );
    }
}
