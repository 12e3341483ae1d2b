use anyhow::Result;

use crate::workspace::Workspace;

/// Papers by their numbers, as the laboratory calls them.
const PAPERS: &[&str] = &["P1", "P2", "P3", "P4", "P5"];

/// Complains about descriptions and settings of the product that name a paper by its number, or a
/// form as printed: those are of `benches/papers`.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let mut complaints = Vec::new();
    for path in workspace.files()? {
        let file = path.display().to_string().replace('\\', "/");
        if !is_product(&file) {
            continue;
        }
        let text = workspace.read(&path)?;
        let code = text.lines().take_while(|line| line.trim() != "#[cfg(test)]");
        for (at, line) in code.enumerate() {
            if describes_paper(line) || is_settings(&file) && documents_paper(line) {
                complaints.push(format!("{file}:{} describes by the number of a paper", at + 1));
            }
            if names_printed(line) {
                complaints.push(format!("{file}:{} names a setting `printed`", at + 1));
            }
        }
    }
    Ok(complaints)
}

/// Returns true for Rust code of crates and plugins that is neither a test nor of this program.
fn is_product(file: &str) -> bool {
    let is_there = file.starts_with("crates/") || file.starts_with("plugins/");
    let is_test = file.contains("/tests/") || file.ends_with("/tests.rs");
    let is_own = file.starts_with("crates/xtask/");
    file.ends_with(".rs") && file.contains("/src/") && is_there && !is_test && !is_own
}

/// Returns true for a file whose doc comments are printed as descriptions of keys.
fn is_settings(file: &str) -> bool {
    let name = file.rsplit('/').next().unwrap_or_default();
    name == "config.rs" || name.ends_with("settings.rs")
}

/// Returns true if a string has the number of a paper in brackets.
fn describes_paper(line: &str) -> bool {
    let strings = line.split('"').skip(1).step_by(2);
    let mut brackets = strings.flat_map(|string| string.split('(').skip(1));
    !is_comment(line) && brackets.any(|inside| PAPERS.iter().any(|paper| inside.starts_with(paper)))
}

/// Returns true if a doc comment has the number of a paper.
fn documents_paper(line: &str) -> bool {
    let is_doc = line.trim_start().starts_with("///");
    is_doc && line.split(|c: char| !c.is_ascii_alphanumeric()).any(|word| PAPERS.contains(&word))
}

/// Returns true if a field, a variant or a value is called `printed`.
fn names_printed(line: &str) -> bool {
    let code = line.trim_start();
    let name = code.trim_start_matches("pub ").split(|c: char| !is_of_name(c)).next();
    let name = name.unwrap_or_default().to_ascii_lowercase();
    let is_name = name.split('_').any(|word| word == "printed");
    let is_declared =
        code.starts_with("pub ") && code.contains(':') || code.trim_end() == "Printed,";
    let is_value = line.contains("\"printed\"") || line.contains("-as-printed\"");
    !is_comment(line) && (is_name && is_declared || is_value)
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with("//")
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_have_no_number_of_a_paper() {
        assert!(describes_paper("registry.verifier(NAME, \"grey patches (P4)\", SvmPatch::new);"));
        assert!(describes_paper("\"silhouettes (P1, P3)\","));
        assert!(!describes_paper("projection(&text, path, \"P2:\")"));
        assert!(!describes_paper("/// Weighs scenes \"of\" silhouettes (P3)."));
        assert!(documents_paper("    /// Number of particles (P3: 100)."));
        assert!(!documents_paper("    /// Number of particles."));
    }

    #[test]
    fn settings_are_not_called_printed() {
        for line in ["    Printed,", "    pub printed_sigma: Line,", "    \"printed\" => 1,"] {
            assert!(names_printed(line), "{line}");
        }
        assert!(names_printed("pub const NAME: &str = \"ekf-as-printed\";"));
        for line in ["// \"printed\"", "let printed = 1;", "    pub fn printed(self) {"] {
            assert!(!names_printed(line), "{line}");
        }
    }

    #[test]
    fn the_laboratory_and_tests_may_name_papers() {
        assert!(is_product("plugins/filters/src/ekf/config.rs"));
        for file in [
            "benches/papers/src/printed/ekf.rs",
            "crates/xtask/src/tidy/papers.rs",
            "crates/log/src/tests.rs",
            "plugins/depth-template/tests/scene.rs",
        ] {
            assert!(!is_product(file), "{file}");
        }
        assert!(
            is_settings("crates/sim/src/room_settings.rs") && !is_settings("crates/a/src/b.rs")
        );
    }
}
