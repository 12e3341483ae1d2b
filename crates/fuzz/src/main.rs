//! `tagalong-fuzz`: parsers under random mutations of valid files.
//!
//! ```text
//! cargo run --release -p tagalong-fuzz -- --files 1000000        # all parsers: some minutes
//! cargo run --release -p tagalong-fuzz -- mcap --seed 7
//! cargo run --release -p tagalong-fuzz -- mcap --file finding-mcap.bin
//! ```

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::Parser;
use indicatif::ProgressBar;
use tagalong_config::{FileLimit, read_bytes};
use tagalong_fuzz::{Finding, Outcome, Target, run, targets, tried};

/// Parses mutated files; a panic or a second for one of them is a finding (exit code 1).
#[derive(Parser)]
#[command(version)]
struct Args {
    /// The parsers [default: all].
    targets: Vec<String>,
    /// Number of files for each.
    #[arg(long, default_value_t = 100_000)]
    files: u64,
    /// Seed of the mutations.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Parses this file once instead.
    #[arg(long)]
    file: Option<PathBuf>,
}

fn main() -> Result<ExitCode> {
    let args = Args::parse();
    let chosen = chosen(&args.targets)?;
    // A panic is told in the table, once.
    std::panic::set_hook(Box::new(|_| {}));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mutated");
    let mut out = std::io::stdout();
    writeln!(out, "| parser | reads | files | longest, ms | findings |\n|---|---|---|---|---|")?;
    let mut found = false;
    for target in &chosen {
        let outcome = work(&args, target, &path)?;
        found |= outcome.finding.is_some();
        let longest = 1e3 * outcome.slowest.as_secs_f64();
        let said = told(target, &outcome)?;
        let Target { name, about, .. } = target;
        writeln!(out, "| {name} | {about} | {} | {longest:.1} | {said} |", outcome.files)?;
    }
    Ok(ExitCode::from(u8::from(found)))
}

fn work(args: &Args, target: &Target, path: &Path) -> Result<Outcome> {
    let Some(file) = &args.file else {
        let bar = ProgressBar::new(args.files);
        let outcome = run(target, args.files, args.seed, path, || bar.inc(1));
        bar.finish_and_clear();
        return Ok(outcome);
    };
    let bytes = read_bytes(file, FileLimit::Image)
        .with_context(|| format!("cannot read {}", file.display()))?;
    let (slowest, why) = tried(target, &bytes, path);
    Ok(Outcome { files: 1, slowest, finding: why.map(|why| Finding { bytes, why }) })
}

/// Returns the last cell of a row; the bytes of a finding go to a file.
fn told(target: &Target, outcome: &Outcome) -> Result<String> {
    let Some(finding) = &outcome.finding else { return Ok("none".into()) };
    let name = format!("finding-{}.bin", target.name);
    std::fs::write(&name, &finding.bytes)?;
    Ok(format!("{}; {name}", finding.why))
}

fn chosen(names: &[String]) -> Result<Vec<Target>> {
    let all = targets();
    let known: Vec<&str> = all.iter().map(|target| target.name).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("no parser `{unknown}`; there are {}", known.join(", "));
    }
    Ok(all.into_iter().filter(|t| names.is_empty() || names.iter().any(|n| n == t.name)).collect())
}
