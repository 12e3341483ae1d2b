//! Comparison with an earlier benchmark.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;
use tagalong_app::outcome::Failure;
use tagalong_app::scoring::read_text;
use tagalong_config::nearest;
use tagalong_eval::Scores;
use tagalong_report::{Benchmark, Outcome, TaskResult, figures};

use super::args::GateArgs;

/// Rule for a change of a figure that is not accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    text: String,
    on_floor: bool,
    figure: String,
    /// True if changes below the bound are not accepted; otherwise those above it.
    below: bool,
    bound: f64,
}

impl Rule {
    /// Reads a rule such as `HOTA<-0.01` or `metres.IDSW>0`.
    ///
    /// # Errors
    /// The mistake, with a correct example.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        let Some(at) = text.find(['<', '>']) else {
            let why = "expected FIGURE<CHANGE or FIGURE>CHANGE, as in HOTA<-0.01";
            return Err(refused_gate(text, why));
        };
        let name = text[..at].trim();
        let bound = text[at + 1..].trim();
        let (on_floor, figure) = match name.split_once('.') {
            Some(("metres", figure)) => (true, figure),
            Some(("image", figure)) => (false, figure),
            _ => (false, name),
        };
        // A default result has every figure, so it lists the valid names.
        let known = figures(&Scores::default());
        if !known.contains_key(figure) {
            let hint = nearest(figure, known.keys().map(String::as_str));
            let hint = hint.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
            return Err(refused_gate(text, &format!("no figure `{figure}`{hint}")));
        }
        let bound = match bound.parse::<f64>() {
            Ok(bound) if bound.is_finite() => bound,
            _ => return Err(refused_gate(text, &format!("`{bound}` is no number"))),
        };
        let below = text[at..].starts_with('<');
        Ok(Self { text: text.to_owned(), on_floor, figure: figure.to_owned(), below, bound })
    }

    /// Returns a description of the deterioration of a task, if there is one.
    fn judge(&self, old: &TaskResult, new: &TaskResult) -> Option<String> {
        let [old, new] = [old, new].map(|task| {
            let scores = if self.on_floor { task.metres } else { task.image };
            figures(&scores?).get(&self.figure).and_then(Value::as_f64)
        });
        match (old, new) {
            (None, _) => None,
            // A figure that disappeared is a deterioration; one that never existed cannot be
            // judged.
            (Some(old), None) => Some(format!("{}: was {old:.4}, is not there", self.text)),
            (Some(old), Some(new)) => {
                let change = new - old;
                let worse = if self.below { change < self.bound } else { change > self.bound };
                worse.then(|| format!("{}: {old:.4} -> {new:.4} ({change:+.4})", self.text))
            }
        }
    }
}

/// Returns the error for an invalid argument of `--fail-if`.
fn refused_gate(text: &str, why: &str) -> Failure {
    Failure::usage(format!("--fail-if {text}: {why}"))
}

/// Baseline and rules of a comparison.
pub struct Gate {
    baseline: Benchmark,
    rules: Vec<Rule>,
}

impl Gate {
    /// Reads the baseline and the rules; `None` if no baseline is given.
    ///
    /// # Errors
    /// A file or a rule that cannot be read.
    pub fn read(args: &GateArgs) -> Result<Option<Self>, Failure> {
        let Some(path) = &args.baseline else { return Ok(None) };
        let rules = args.fail_if.iter().map(|text| Rule::parse(text)).collect::<Result<_, _>>()?;
        Ok(Some(Self { baseline: baseline(path)?, rules }))
    }

    /// Returns a table of the deteriorations, if there are any. Tasks are the same if pipeline, log
    /// and seed agree.
    pub fn worse(&self, now: &Benchmark) -> Option<String> {
        let mut new: BTreeMap<_, _> = now.tasks.iter().map(|task| (key(task), task)).collect();
        let mut table = String::new();
        // A task that failed in the baseline cannot get worse.
        for old in self.baseline.tasks.iter().filter(|task| task.outcome == Outcome::Done) {
            let (pipeline, log, seed) = key(old);
            for line in self.complaints(old, new.remove(&key(old))) {
                let _ = writeln!(table, "  {pipeline}  {log}  {seed}  {line}");
            }
        }
        (!table.is_empty()).then(|| format!("worse than the baseline:\n{table}"))
    }

    fn complaints(&self, old: &TaskResult, new: Option<&TaskResult>) -> Vec<String> {
        match new.map(|task| (&task.outcome, task)) {
            None => vec!["is no longer run".into()],
            Some((Outcome::Failed { why }, _)) => vec![format!("failed: {why}")],
            Some((Outcome::Skipped { why }, _)) => vec![format!("skipped: {why}")],
            Some((Outcome::Done, new)) => {
                self.rules.iter().filter_map(|rule| rule.judge(old, new)).collect()
            }
        }
    }
}

fn key(task: &TaskResult) -> (&str, &str, u64) {
    (&task.pipeline, &task.log, task.seed)
}

fn baseline(path: &Path) -> Result<Benchmark, Failure> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|error| {
        Failure::usage(format!("{}: {error}; give the report.json of a benchmark", path.display()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(hota: Option<f64>, idsw: u64) -> TaskResult {
        let image = Some(Scores { hota, idsw, ..Scores::default() });
        TaskResult { pipeline: "a".into(), log: "b".into(), image, ..TaskResult::default() }
    }

    fn gate(old: TaskResult, rules: &[&str]) -> Gate {
        let rules = rules.iter().map(|rule| Rule::parse(rule).ok().unwrap()).collect();
        Gate { baseline: Benchmark { tasks: vec![old], ..Benchmark::default() }, rules }
    }

    fn now(tasks: Vec<TaskResult>) -> Benchmark {
        Benchmark { tasks, ..Benchmark::default() }
    }

    #[test]
    fn only_changes_beyond_the_bound_count() {
        let gate = gate(task(Some(0.5), 1), &["HOTA<-0.01", "IDSW>0"]);
        assert_eq!(gate.worse(&now(vec![task(Some(0.495), 1)])), None);
        assert_eq!(gate.worse(&now(vec![task(Some(0.9), 0)])), None);
        let told = gate.worse(&now(vec![task(Some(0.4), 2)])).unwrap();
        assert!(told.contains("HOTA<-0.01: 0.5000 -> 0.4000 (-0.1000)"), "{told}");
        assert!(told.contains("IDSW>0: 1.0000 -> 2.0000"), "{told}");
    }

    #[test]
    fn what_is_gone_or_fails_is_worse() {
        let gate = gate(task(Some(0.5), 1), &["HOTA<-0.01"]);
        assert!(gate.worse(&now(vec![])).unwrap().contains("no longer run"));
        assert!(gate.worse(&now(vec![task(None, 1)])).unwrap().contains("is not there"));
        let outcome = Outcome::Failed { why: "oh".into() };
        let failed = TaskResult { outcome, ..task(None, 0) };
        assert!(gate.worse(&now(vec![failed])).unwrap().contains("failed: oh"));
    }

    #[test]
    fn wrong_rules_are_told_what_is_right() {
        for (rule, expected) in [
            ("HOTTA<0", "did you mean `HOTA`?"),
            ("HOTA=0", "FIGURE<CHANGE"),
            ("HOTA<little", "`little` is no number"),
        ] {
            let message = Rule::parse(rule).err().unwrap().message;
            assert!(message.contains(expected), "{message}");
        }
        assert!(Rule::parse("metres.MOTA<-0.1").is_ok_and(|rule| rule.on_floor));
    }
}
