use anyhow::Result;

use crate::tidy::plugins;
use crate::workspace::Workspace;

/// Crates that know plugins: the list of all, the fuzzer of their models, and this one.
const KNOWING: &[&str] = &["crates/catalog/", "crates/fuzz/", "crates/xtask/"];

/// Files with names of configs that are those of plugins, too.
const MAY_NAME: &[(&str, &str)] = &[
    ("crates/app/src/installed.rs", "onnx"), // and the ending of files
    ("crates/app/src/suggest.rs", "onnx"),   // the ending alone
    ("crates/network/src/installed.rs", "onnx"), // the ending alone
    ("crates/pipeline/src/config/builtin.rs", "onnx"),
    ("crates/app/src/choice.rs", "laser-legs"),
    ("crates/pipeline/src/config/builtin.rs", "joint-particle"),
    ("crates/pipeline/src/config/builtin.rs", "laser-legs"),
    ("crates/pipeline/src/config/builtin.rs", "omni-appearance"),
];

/// Complains about code of `crates/` that knows a plugin by its name: what a plugin offers is
/// registered by itself.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let plugins = plugins::registered(workspace)?;
    let mut complaints = Vec::new();
    for path in workspace.files()? {
        let file = path.display().to_string().replace('\\', "/");
        if !is_shared_code(&file) {
            continue;
        }
        let text = workspace.read(&path)?;
        for (number, line) in code_lines(&text) {
            let named = plugins.iter().filter(|plugin| names(line, plugin));
            for plugin in named.filter(|plugin| !may_name(&file, plugin)) {
                complaints.push(format!("{file}:{number} knows the plugin `{plugin}` by its name"));
            }
        }
    }
    Ok(complaints)
}

/// Returns true for Rust code and tables of `crates/` that are neither tests nor examples.
fn is_shared_code(file: &str) -> bool {
    let is_code = file.ends_with(".rs") || file.ends_with(".toml");
    let in_source = file.starts_with("crates/") && file.contains("/src/");
    let is_test = file.contains("/tests/") || file.ends_with("/tests.rs");
    is_code && in_source && !is_test && !KNOWING.iter().any(|known| file.starts_with(known))
}

/// Returns the lines before the tests of a file that are no comments, with their numbers.
fn code_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    fn is_code(line: &str) -> bool {
        !line.trim_start().starts_with("//")
    }

    let code = text.lines().take_while(|line| line.trim() != "#[cfg(test)]").enumerate();
    code.filter(move |(_, line)| is_code(line)).map(|(at, line)| (at + 1, line))
}

fn names(line: &str, plugin: &str) -> bool {
    line.contains(&format!("\"{plugin}\"")) || line.contains(&format!("'{plugin}'"))
}

fn may_name(file: &str, plugin: &str) -> bool {
    MAY_NAME.contains(&(file, plugin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_what_stands_before_the_tests_without_comments() {
        let text = "// \"ekf\"\nlet a = \"ekf\";\n/// 'ekf'\n#[cfg(test)]\nmod tests { \"ekf\" }\n";
        let lines: Vec<_> = code_lines(text).filter(|(_, line)| names(line, "ekf")).collect();
        assert_eq!(lines, [(2, "let a = \"ekf\";")]);
        assert!(!names("let a = \"stereo-ekf\";", "ekf"));
    }

    #[test]
    fn tests_and_the_list_of_plugins_may_name_them() {
        assert!(is_shared_code("crates/doctor/src/lib.rs"));
        assert!(is_shared_code("crates/app/src/remedies.toml"));
        for file in [
            "crates/catalog/src/lib.rs",
            "crates/cli/tests/command/run.rs",
            "crates/pipeline/src/config/tests.rs",
            "crates/cli/examples/legs.toml",
            "plugins/filters/src/lib.rs",
        ] {
            assert!(!is_shared_code(file), "{file}");
        }
        assert!(may_name("crates/app/src/choice.rs", "laser-legs"));
        assert!(!may_name("crates/app/src/choice.rs", "ekf"));
    }
}
