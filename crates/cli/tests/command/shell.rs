//! Completions for shells, and pages for `man`.

use std::fs;

use crate::common::{code, tagalong, text};

#[test]
fn every_shell_learns_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = tagalong().args(["completions", shell]).output().unwrap();
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        for command in ["doctor", "follow", "trials"] {
            assert!(text(&output.stdout).contains(command), "{shell}: {command}");
        }
    }
    let unknown = tagalong().args(["completions", "cmd"]).output().unwrap();
    assert_eq!(code(&unknown), 2);
}

#[test]
fn every_command_has_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man1");
    let output = tagalong().args(["man", "-o"]).arg(&pages).output().unwrap();
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    for page in ["tagalong", "tagalong-run", "tagalong-doctor", "tagalong-bench-plan"] {
        let page = fs::read_to_string(pages.join(page).with_extension("1")).unwrap();
        assert!(page.contains(".TH") && page.contains(".SH SYNOPSIS"), "{page}");
    }
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let refused = tagalong().args(["man", "-o"]).arg(&file).output().unwrap();
    assert_eq!(code(&refused), 2, "{}", text(&refused.stderr));
}
