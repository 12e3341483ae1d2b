//! The walk-throughs of `plugins`, done as they say.

use anyhow::{Context as _, Result};

use crate::new_plugin::{Kind, create};
use crate::workspace::Workspace;

/// Page that writes a plugin.
pub struct Guide {
    page: &'static str,
    kind: Kind,
    /// Name of the plugin.
    pub name: &'static str,
    edits: &'static [Edit],
}

/// Change of a source file by the next code block of the page.
enum Edit {
    /// Replaces the part from one text to another, both included: the page shows the changed parts
    /// only, and the template has the rest.
    Replace { file: &'static str, from: &'static str, to: &'static str },
    /// Adds the block at the end.
    Append { file: &'static str },
}

/// End of a function of an `impl`.
const END_OF_FN: &str = "\n    }\n";

/// All walk-throughs.
pub const GUIDES: [Guide; 4] = [
    Guide {
        page: "plugins/README.md",
        kind: Kind::Verifier,
        name: "contrast",
        edits: &[
            Edit::Replace {
                file: "config.rs",
                from: "        /// Added to all log-odds",
                to: "pub bias: f64 = 0.0,\n",
            },
            Edit::Replace { file: "verify.rs", from: "    fn log_odds(", to: END_OF_FN },
        ],
    },
    Guide {
        page: "plugins/walk-through-filter.md",
        kind: Kind::Filter,
        name: "steady",
        edits: &[
            Edit::Replace {
                file: "config.rs",
                from: "        /// How fast the height of a head wanders",
                to: "pub height_wander: f64 = 0.07,\n",
            },
            Edit::Replace { file: "filter.rs", from: "    fn correct(", to: END_OF_FN },
            Edit::Append { file: "filter.rs" },
        ],
    },
    Guide {
        page: "plugins/walk-through-detector.md",
        kind: Kind::Detector,
        name: "shoulders",
        edits: &[
            Edit::Replace {
                file: "config.rs",
                from: "        /// Candidates with a lower score",
                to: "pub min_score: f64 = 0.0,\n",
            },
            Edit::Replace { file: "detect.rs", from: "use tagalong_core::{", to: "LOW_SCORE};\n" },
            Edit::Replace { file: "detect.rs", from: "    config: Config,\n", to: END_OF_FN },
            Edit::Replace {
                file: "detect.rs",
                from: "    /// Everything that could",
                to: END_OF_FN,
            },
            Edit::Replace { file: "detect.rs", from: "    fn detect(", to: END_OF_FN },
            Edit::Replace {
                file: "lib.rs",
                from: "        // Once it finds people",
                to: "check_all(&registry);\n",
            },
            Edit::Append { file: "detect.rs" },
        ],
    },
    Guide {
        page: "plugins/walk-through-associator.md",
        kind: Kind::Associator,
        name: "seniority",
        edits: &[
            Edit::Replace { file: "config.rs", from: "        pub gate_m: f64", to: " = 0.7,\n" },
            Edit::Replace { file: "associate.rs", from: "    fn associate(", to: END_OF_FN },
            Edit::Append { file: "associate.rs" },
        ],
    },
];

impl Guide {
    /// Generates the plugin and puts in the code of the page.
    pub fn walk(&self, workspace: &Workspace) -> Result<()> {
        create(workspace, self.kind, self.name)?;
        let text = workspace.read(self.page)?;
        let mut blocks = fences(&text, "rust").into_iter();
        for edit in self.edits {
            let file = edit.file();
            let path = format!("plugins/{}/src/{file}", self.name);
            let source = workspace.read(&path)?;
            let changed = edit.apply(&source, &mut blocks).with_context(|| {
                format!("{path} is not as {} expects: page or template has changed", self.page)
            })?;
            workspace.write(&path, &changed)?;
        }
        Ok(())
    }
}

impl Edit {
    fn file(&self) -> &'static str {
        match self {
            Self::Replace { file, .. } | Self::Append { file } => file,
        }
    }

    /// Returns the changed source; none if page and source do not fit together.
    fn apply(&self, source: &str, blocks: &mut impl Iterator<Item = String>) -> Option<String> {
        match self {
            Self::Replace { from, to, .. } => replace_between(source, from, to, &blocks.next()?),
            Self::Append { .. } => Some(format!("{source}\n{}", blocks.next()?)),
        }
    }
}

/// The contents of the fences with that word.
fn fences(text: &str, word: &str) -> Vec<String> {
    let begin = format!("```{word}\n");
    let parts = text.split(begin.as_str()).skip(1);
    parts.filter_map(|part| part.split("```").next()).map(str::to_owned).collect()
}

/// Replaces the part from one text to another, both included.
fn replace_between(text: &str, from: &str, to: &str, by: &str) -> Option<String> {
    let start = text.find(from)?;
    let end = start + text[start..].find(to)? + to.len();
    Some(format!("{}{by}{}", &text[..start], &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_taken_from_fences() {
        let text = "a\n```rust\none\n```\n```sh\nx\n```\n```rust\ntwo\n```\n";
        assert_eq!(fences(text, "rust"), ["one\n", "two\n"]);
    }

    #[test]
    fn a_part_is_replaced_with_its_ends() {
        assert_eq!(replace_between("a<b>c", "<", ">", "-").unwrap(), "a-c");
        assert_eq!(replace_between("abc", "<", ">", "-"), None);
    }

    #[test]
    fn a_page_that_does_not_fit_its_template_is_refused() {
        let replace = Edit::Replace { file: "", from: "bias", to: "," };
        let mut blocks = ["even = 1.0,".to_owned(), "even = 1.0,".to_owned()].into_iter();
        assert_eq!(replace.apply("bias = 0.0, other", &mut blocks).unwrap(), "even = 1.0, other");
        assert_eq!(replace.apply("Self {}", &mut blocks), None);
        assert_eq!(Edit::Append { file: "" }.apply("a", &mut blocks), None, "no block left");
    }
}
