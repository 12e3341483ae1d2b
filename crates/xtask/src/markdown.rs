use std::path::PathBuf;

use anyhow::Result;

use crate::workspace::Workspace;

/// A Markdown file of the workspace.
pub struct Document {
    /// Relative to the root.
    pub path: PathBuf,
    /// Line numbers with the text outside of fences.
    pub prose: Vec<(usize, String)>,
    /// Line numbers with the text inside of fences for the shell; a line that ends
    /// with a backslash goes on.
    pub shell: Vec<(usize, String)>,
}

/// Fences with these words hold command lines; those without a word may.
const SHELL: &[&str] = &["sh", "bash", "console", "shell", ""];

/// All Markdown files that git knows or would know.
pub fn documents(workspace: &Workspace) -> Result<Vec<Document>> {
    let files = workspace.files()?.into_iter();
    let markdown = files.filter(|path| path.extension().is_some_and(|e| e == "md"));
    markdown.map(|path| Ok(parse(path.clone(), &workspace.read(&path)?))).collect()
}

fn parse(path: PathBuf, text: &str) -> Document {
    let mut document = Document { path, prose: Vec::new(), shell: Vec::new() };
    let mut fence: Option<String> = None;
    for (number, line) in (1..).zip(text.lines()) {
        if let Some(word) = line.trim_start().strip_prefix("```") {
            fence = if fence.is_some() { None } else { Some(word.trim().to_owned()) };
            continue;
        }
        match &fence {
            None => document.prose.push((number, line.to_owned())),
            Some(word) if SHELL.contains(&word.as_str()) => document.add_shell(number, line),
            Some(_) => {}
        }
    }
    document
}

impl Document {
    fn add_shell(&mut self, number: usize, line: &str) {
        match self.shell.last_mut() {
            // A backslash at the end of a line continues the command.
            Some((_, before)) if before.ends_with('\\') => {
                before.pop();
                before.push_str(line.trim_start());
            }
            _ => self.shell.push((number, line.to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prose_and_shell_are_told_apart() {
        let text = "a\n```toml\nb\n```\n```sh\ncargo c \\\n  --e\n```\nd\n";
        let document = parse(PathBuf::from("x.md"), text);
        assert_eq!(document.prose, [(1, "a".to_owned()), (9, "d".to_owned())]);
        assert_eq!(document.shell, [(6, "cargo c --e".to_owned())]);
    }
}
