//! A record of the results of every config, to check a refactoring against.
//!
//! Every config, those of the laboratory included, runs on every real log and on logs of some scenes,
//! and drives through one scene if it has a controller. A line for each run holds the exit code and
//! checksums of the tracks and the report. `cargo xtask record before.txt` before a change and `cargo xtask record after.txt` after
//! it: `diff` names the runs whose bytes changed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use sha2::{Digest as _, Sha256};

use crate::program::Name;
use crate::workspace::{Workspace, output, succeed};

/// Real logs; without the folder those of scenes are all there is.
const REAL_LOGS: &str = "../shared/data/logs";
/// Scenes of each kind of sensor, and for how long each is simulated, s.
const SCENES: [(&str, &str); 4] =
    [("sample", "4"), ("crossing-three", "4"), ("stereo-hall", "3"), ("omni-people", "4")];
/// The scene that configs with a controller drive through.
const RIDE: &str = "configs/scenes/follow-passing.toml";

/// Writes a line for each run to `file`.
pub fn record(workspace: &Workspace, file: &Path, program: Option<PathBuf>) -> Result<()> {
    let papers = match &program {
        // A given program is the product's; the laboratory is left out then.
        Some(_) => None,
        None => Some(release_program(workspace, Name::Papers)?),
    };
    let program = program.map_or_else(|| release_program(workspace, Name::Tagalong), Ok)?;
    let work = workspace.root().join("target/record");
    fs::create_dir_all(&work)?;
    let logs = [real_logs(workspace)?, scene_logs(workspace, &program, &work)?].concat();
    let folders = [(Some(program), "configs"), (papers, "benches/papers/configs")];
    let mut lines = String::new();
    for (program, folder) in folders {
        let Some(program) = program else { continue };
        for config in &files_with(&workspace.root().join(folder), "toml")? {
            for log in &logs {
                lines += &run_line(workspace, &program, config, log, &work)?;
            }
            if fs::read_to_string(config)?.contains("[controller]") {
                lines += &ride_line(workspace, &program, config)?;
            }
            eprintln!("record: {}", stem(config));
        }
    }
    fs::write(file, lines).with_context(|| format!("cannot write {}", file.display()))
}

fn release_program(workspace: &Workspace, name: Name) -> Result<PathBuf> {
    let mut cargo = Command::new("cargo");
    cargo.args(["build", "--quiet", "--release", "--package", name.package()]);
    succeed(cargo.current_dir(workspace.root()))?;
    let mut metadata = Command::new("cargo");
    metadata.args(["metadata", "--no-deps", "--format-version", "1"]);
    let said = output(metadata.current_dir(workspace.root()))?;
    let facts: serde_json::Value = serde_json::from_str(&said)?;
    let target = facts["target_directory"].as_str().context("cargo names no target folder")?;
    Ok(Path::new(target).join("release").join(name.as_str()))
}

fn real_logs(workspace: &Workspace) -> Result<Vec<PathBuf>> {
    let folder = workspace.root().join(REAL_LOGS);
    if folder.is_dir() {
        return files_with(&folder, "mcap");
    }
    eprintln!("record: no {REAL_LOGS}: simulated logs only");
    Ok(Vec::new())
}

fn scene_logs(workspace: &Workspace, program: &Path, work: &Path) -> Result<Vec<PathBuf>> {
    let mut logs = Vec::new();
    for (scene, seconds) in SCENES {
        let log = work.join(format!("{scene}.mcap"));
        let mut command = Command::new(program);
        command.args(["simulate", &format!("configs/scenes/{scene}.toml")]);
        command.args(["--set", &format!("duration_s={seconds}"), "--overwrite", "-o"]);
        output(command.arg(&log).current_dir(workspace.root()))?;
        logs.push(log);
    }
    Ok(logs)
}

fn run_line(
    workspace: &Workspace,
    program: &Path,
    config: &Path,
    log: &Path,
    work: &Path,
) -> Result<String> {
    let folder = work.join("run");
    let mut command = Command::new(program);
    command.arg("run").args([config, log]).args(["--overwrite", "-o"]).arg(&folder);
    let done = command.current_dir(workspace.root()).output()?;
    let code = done.status.code().map_or("killed".into(), |code| code.to_string());
    let mut line = format!("{} {} exit {code}", stem(config), stem(log));
    if folder.is_dir() {
        for name in ["tracks.csv", "tracks-metres.csv"] {
            line += &format!(" {}", checksum(&fs::read(folder.join(name)).unwrap_or_default()));
        }
        line += &format!(" {}", report_checksum(&folder.join("report.json")));
        fs::remove_dir_all(&folder)?;
    }
    Ok(line + "\n")
}

/// Computes the checksum of a report without the text of the config, and of the commands of a ride
/// without its times.
fn report_checksum(report: &Path) -> String {
    let text = fs::read_to_string(report).unwrap_or_default();
    match serde_json::from_str::<serde_json::Value>(&text) {
        Ok(serde_json::Value::Object(mut facts)) => {
            // The report quotes the config, whose comments may change.
            facts.remove("config");
            checksum(serde_json::Value::Object(facts).to_string().as_bytes())
        }
        _ => "-".into(),
    }
}

fn ride_line(workspace: &Workspace, program: &Path, config: &Path) -> Result<String> {
    let mut command = Command::new(program);
    command.arg("follow").arg(config).args([RIDE, "--seeds", "1", "--format", "markdown"]);
    let printed = output(command.current_dir(workspace.root()))?;
    // The last column is the time that a frame takes.
    let lasting: Vec<&str> =
        printed.lines().filter_map(|line| Some(line.rsplit_once(" | ")?.0)).collect();
    Ok(format!("{} ride {}\n", stem(config), checksum(lasting.join("\n").as_bytes())))
}

/// The files of a folder with an extension, sorted.
fn files_with(folder: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| format!("in {}", folder.display()))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    // The order of a folder's entries differs between file systems.
    files.sort();
    Ok(files)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The first bytes of the SHA-256, as hexadecimal digits.
fn checksum(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}
