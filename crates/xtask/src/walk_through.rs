//! The walk-through of `plugins/README.md`, done as it says.

use anyhow::{Context as _, Result};

use crate::new_plugin::{Kind, create};
use crate::workspace::Workspace;

/// The plugin that the walk-through writes.
pub const NAME: &str = "contrast";

const GUIDE: &str = "plugins/README.md";

/// Generates the plugin and puts in the code of the guide.
pub fn walk(workspace: &Workspace) -> Result<()> {
    create(workspace, Kind::Verifier, NAME)?;
    let guide = workspace.read(GUIDE)?;
    let mut code = fences(&guide, "rust").into_iter();
    let field = code.next().with_context(|| format!("{GUIDE} shows no setting"))?;
    let method = code.next().with_context(|| format!("{GUIDE} shows no method"))?;
    let (_, after) =
        guide.split_once("in `Default` by `").with_context(|| format!("{GUIDE}: no default"))?;
    let default = after.split('`').next().unwrap_or_default();
    edit(workspace, "config.rs", |text| {
        // The guide shows the changed parts only; the template has the rest.
        let text =
            replace_between(text, "    /// Added to all log-odds", "pub bias: f64,\n", &field)?;
        Some(text.replace("bias: 0.0", default))
    })?;
    edit(workspace, "verify.rs", |text| {
        replace_between(text, "    fn log_odds(", "\n    }\n", &method)
    })
}

fn edit(workspace: &Workspace, file: &str, change: impl Fn(&str) -> Option<String>) -> Result<()> {
    let path = format!("plugins/{NAME}/src/{file}");
    let text = workspace.read(&path)?;
    let changed = change(&text).with_context(|| {
        format!("{path} is not as {GUIDE} expects: guide or template has changed")
    })?;
    workspace.write(&path, &changed)
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
}
