//! Times of other programs are summed up as ours are.
#![allow(clippy::unwrap_used, missing_docs, reason = "a broken test may stop loudly")]

use std::process::Command;

use tagalong_benches::timing::{Plan, statistic_us};

/// Runs lines of Python beside `timing.py`; `None` where there is no Python.
fn python(lines: &str) -> Option<String> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/peers");
    let output = Command::new("python3").args(["-B", "-c", lines]).current_dir(folder).output();
    let output = output.ok()?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap().trim().to_owned())
}

#[test]
fn both_sides_have_the_same_statistic() {
    for samples in [&[3.0, 1.0, 2.0][..], &[9.0, 0.1, 4.0, 2.0], &[5.0]] {
        let Some(theirs) = python(&format!("import timing; print(timing.statistic({samples:?}))"))
        else {
            return;
        };
        assert_eq!(theirs.parse::<f64>().unwrap(), statistic_us(samples), "{samples:?}");
    }
}

#[test]
fn both_sides_take_as_many_samples() {
    for call_us in [0.3, 7.0, 100.5, 15_000.0, 1e6] {
        let Some(theirs) = python(&format!("import timing; print(*timing.plan({call_us} * 1e-6))"))
        else {
            return;
        };
        let Plan { samples, calls } = Plan::of(call_us);
        assert_eq!(theirs, format!("{samples} {calls}"), "{call_us} us");
    }
}

#[test]
fn a_row_has_medians_over_rounds_and_the_median_of_ratios() {
    let rounds = "{'job': [(1.0, 2.0), (2.0, 8.0), (9.0, 9.0)]}";
    let Some(row) = python(&format!("import timing; print(timing.rows({rounds})['job'])")) else {
        return;
    };
    assert_eq!(row, "(2.0, 8.0, 2.0)");
}

/// Every time of the table comes from the statistic: nothing else in the scripts asks a clock or
/// takes the least of several.
#[test]
fn scripts_of_the_table_have_no_statistic_of_their_own() {
    for name in ["kernels.py", "mot17_trackeval.py", "stereo_opencv.py"] {
        let path = format!("{}/peers/{name}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        for word in ["import time\n", "perf_counter", "process_time", "statistics.", "fastest"] {
            assert!(!text.contains(word), "{name} has {word:?}");
        }
    }
}
