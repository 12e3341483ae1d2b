use std::collections::BTreeMap;
use std::fmt;

use anyhow::Result;

use crate::workspace::Workspace;

/// Words that begin a doc comment without naming its subject. A function's comment opens with a
/// verb, a type's with a noun.
const FUSED: &[&str] = &[
    "What", "Whatever", "Who", "Whoever", "Whom", "Whose", "How", "Somebody", "Nobody", "Someone",
];

/// Words for persons where the field has nouns: track, target, detection, person.
const PERSONS: &[&str] = &["somebody", "nobody", "who", "whoever", "whom", "whomever"];

/// Most of [`PERSONS`] in 1,000 words of comments.
const MOST_PERSONS: f64 = 0.3;

/// Most of the word "what" in 1,000 words of comments.
const MOST_WHATS: f64 = 2.0;

/// Least share of lines with a `//` comment, which gives a reason, in per cent.
const LEAST_REASONS: f64 = 1.0;

/// Counts of the habits in the comments of some sources.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Habits {
    lines: usize,
    words: usize,
    openings: usize,
    persons: usize,
    whats: usize,
    reasons: usize,
}

impl Habits {
    /// Counts the habits in a source. Code in doc comments does not count.
    fn of(source: &str) -> Self {
        let mut habits = Self { lines: source.lines().count(), ..Self::default() };
        let mut is_code = false;
        let mut goes_on = false;
        for line in source.lines() {
            let Some((is_doc, text)) = comment(line) else {
                (is_code, goes_on) = (false, false);
                continue;
            };
            if is_doc && text.starts_with("```") {
                is_code = !is_code;
            } else if !is_code {
                habits.openings += usize::from(is_doc && !goes_on && is_fused(text));
                habits.reasons += usize::from(!is_doc);
                habits.count_words(text);
            }
            goes_on = is_doc;
        }
        habits
    }

    fn count_words(&mut self, text: &str) {
        fn is_part(c: char) -> bool {
            c.is_alphabetic() || c == '-'
        }

        for word in text.split(|c| !is_part(c)).filter(|word| word.contains(char::is_alphabetic)) {
            let word = word.to_lowercase();
            self.words += 1;
            self.persons += usize::from(PERSONS.contains(&word.as_str()));
            self.whats += usize::from(word == "what");
        }
    }

    fn add(&mut self, other: Self) {
        self.lines += other.lines;
        self.words += other.words;
        self.openings += other.openings;
        self.persons += other.persons;
        self.whats += other.whats;
        self.reasons += other.reasons;
    }

    fn per_thousand(&self, count: usize) -> f64 {
        1e3 * count as f64 / self.words.max(1) as f64
    }

    fn reasons_percent(&self) -> f64 {
        1e2 * self.reasons as f64 / self.lines.max(1) as f64
    }

    /// Returns a complaint for each limit that is not kept.
    fn complaints(&self) -> Vec<String> {
        let persons = self.per_thousand(self.persons);
        let whats = self.per_thousand(self.whats);
        let reasons = self.reasons_percent();
        let rules = [
            (self.openings == 0, format!("{} openings like `What ...`, not 0", self.openings)),
            (persons <= MOST_PERSONS, format!("{persons:.2} who-words, not {MOST_PERSONS}")),
            (whats <= MOST_WHATS, format!("{whats:.2} `what`, not {MOST_WHATS}")),
            (reasons >= LEAST_REASONS, format!("{reasons:.2} % `//`, not {LEAST_REASONS} %")),
        ];
        rules.into_iter().filter(|(holds, _)| !holds).map(|(_, complaint)| complaint).collect()
    }
}

impl fmt::Display for Habits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let persons = self.per_thousand(self.persons);
        let whats = self.per_thousand(self.whats);
        write!(f, "{} openings, {persons:.2} who-words and {whats:.2} `what` ", self.openings)?;
        write!(f, "in 1,000 words, {:.2} % of lines `//`", self.reasons_percent())
    }
}

/// Complains if the comments of all sources together break a limit, with the files that most of
/// it comes from.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    fn bad(habits: &Habits) -> usize {
        habits.openings + habits.persons + habits.whats
    }

    let mut total = Habits::default();
    let mut of_files = BTreeMap::new();
    for file in workspace.files()? {
        if file.extension().is_some_and(|extension| extension == "rs") {
            let habits = Habits::of(&workspace.read(&file)?);
            total.add(habits);
            of_files.insert(file, habits);
        }
    }
    eprintln!("tidy: comments: {total}");
    let mut complaints: Vec<String> =
        total.complaints().into_iter().map(|text| format!("comments: {text}")).collect();
    if !complaints.is_empty() {
        let mut worst: Vec<_> = of_files.iter().filter(|(_, habits)| bad(habits) > 0).collect();
        worst.sort_by_key(|(_, habits)| std::cmp::Reverse(bad(habits)));
        complaints.extend(worst.iter().take(10).map(|(f, h)| format!("{}: {h}", f.display())));
    }
    Ok(complaints)
}

/// Returns true and the text for a line of a doc comment, false and the text for one of another
/// comment.
fn comment(line: &str) -> Option<(bool, &str)> {
    let text = line.trim_start().strip_prefix("//")?;
    let doc = text.strip_prefix('/').or_else(|| text.strip_prefix('!'));
    Some((doc.is_some(), doc.unwrap_or(text).trim()))
}

fn is_fused(text: &str) -> bool {
    text.split_whitespace().next().is_some_and(|word| FUSED.contains(&word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn habits_are_counted_in_comments_only() {
        let source = [
            "/// What somebody says.",
            "/// Who else?",
            "fn what() {} // what",
            "    // Because of the lens, whatever nobody knows.",
            "//! ```",
            "//! who(what);",
            "//! ```",
            "let who = \"/// What\";",
        ];
        let habits = Habits::of(&source.join("\n"));
        let expected =
            Habits { lines: 8, words: 12, openings: 1, persons: 3, whats: 1, reasons: 1 };
        assert_eq!(habits, expected);
    }

    #[test]
    fn each_limit_has_a_complaint() {
        let good =
            Habits { lines: 100, words: 10_000, openings: 0, persons: 3, whats: 20, reasons: 1 };
        assert_eq!(good.complaints(), Vec::<String>::new());
        let worse = [
            Habits { openings: 1, ..good },
            Habits { persons: 4, ..good },
            Habits { whats: 21, ..good },
            Habits { reasons: 0, ..good },
        ];
        for habits in worse {
            assert_eq!(habits.complaints().len(), 1, "{habits}");
        }
    }
}
