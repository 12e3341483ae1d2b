//! Commands of the program.

use std::ffi::OsString;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use tagalong_app::format::Format;
use tagalong_app::input_args::InputArgs;
use tagalong_app::outcome::{Ended, Failure, Outcome};
use tagalong_app::signals::Signals;
use tagalong_cli::{
    EvalArgs, Overlaid, RunArgs, SimilarityChoice, eval_json, main_from, run_until,
};

use crate::errors::{failed, raised, wrong};

/// Time between two checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(10);
/// Maximum time to wait for a run to finish its files after Ctrl-C.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs the program with these arguments, without its name, and returns its exit code: 0 also for
/// `--help`, and 2 for wrong usage.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let all = [OsString::from("tagalong")].into_iter().chain(arguments);
    let all: Vec<OsString> = all.collect();
    py.detach(|| main_from(all, tagalong::pipeline::register_plugins))
}

/// Runs a pipeline over a log and writes the files of `tagalong run`; returns true if part of the
/// log was lost.
#[pyfunction]
#[pyo3(signature = (config, log, out, *, overlay, with_images, smoothed, overwrite, strict, seed, camera))]
#[allow(clippy::too_many_arguments, reason = "they are the keywords of a Python function")]
pub fn run(
    py: Python<'_>,
    config: Option<PathBuf>,
    log: PathBuf,
    out: PathBuf,
    overlay: bool,
    with_images: bool,
    smoothed: bool,
    overwrite: bool,
    strict: bool,
    seed: Option<u64>,
    camera: Option<String>,
) -> PyResult<bool> {
    // A single path is that of a log or of a config, as on the command line.
    let (config, log) = match config {
        Some(config) => (config, Some(log)),
        None => (log, None),
    };
    let args = RunArgs {
        log,
        overlay: overlay.then_some(Overlaid::People),
        with_images,
        smoothed,
        overwrite,
        strict,
        seed,
        input: InputArgs { camera, ..InputArgs::default() },
        ..RunArgs::quiet(Some(config), out)
    };

    match interruptible(py, args)?.map_err(in_python)? {
        Ended::Well => Ok(false),
        Ended::WithLoss | Ended::WithFindings => Ok(true),
        Ended::BySignal(_) => {
            Err(PyKeyboardInterrupt::new_err("the run was stopped; its files are whole"))
        }
    }
}

/// Runs in a thread, and checks for Ctrl-C meanwhile.
fn interruptible(py: Python<'_>, args: RunArgs) -> PyResult<Outcome> {
    let signals = Signals::default();
    let asked = signals.clone();
    let running =
        thread::spawn(move || run_until(&args, &tagalong::builtin_registry(), || Ok(asked)));
    while !running.is_finished() {
        py.detach(|| thread::sleep(LOOK));
        if let Err(interrupt) = py.check_signals() {
            signals.interrupt();
            // A run that is still in its first pass over the log has written nothing, and will not.
            let since = Instant::now();
            while !running.is_finished() && since.elapsed() < PATIENCE {
                py.detach(|| thread::sleep(LOOK));
            }
            return Err(interrupt);
        }
    }
    running.join().map_err(|_| failed("the run failed; please report this with the log"))
}

/// Compares tracks with truth; returns the figures of `tagalong eval` as JSON.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "they are the keywords of a Python function")]
#[pyo3(signature = (truth, tracks, *, similarity, log, rate, upper_body, repairs, drop_doubled_ids))]
pub fn scores(
    py: Python<'_>,
    truth: PathBuf,
    tracks: PathBuf,
    similarity: &str,
    log: Option<PathBuf>,
    rate: Option<f64>,
    upper_body: bool,
    repairs: bool,
    drop_doubled_ids: bool,
) -> PyResult<String> {
    let similarity = match similarity {
        "iou" => SimilarityChoice::Iou,
        "metres" => SimilarityChoice::Metres,
        other => {
            return Err(wrong(format!("no similarity {other:?}; there are \"iou\", \"metres\"")));
        }
    };
    let args = EvalArgs {
        truth,
        tracks,
        similarity,
        log,
        config: None,
        rules: Default::default(),
        upper_body,
        repairs,
        drop_doubled_ids,
        rate,
        format: Format::default(),
    };
    py.detach(|| eval_json(&args)).map_err(in_python)
}

/// Options of the program in its messages, with the corresponding arguments of the functions here.
const ARGUMENTS: [(&str, &str); 13] = [
    ("--overwrite", "overwrite=True"),
    ("--strict", "strict=True"),
    ("--with-images", "with_images=True"),
    ("--camera", "camera"),
    ("--similarity metres", "similarity=\"metres\""),
    ("--similarity iou", "similarity=\"iou\""),
    ("--log LOG", "log=LOG"),
    ("--rate HZ", "rate=HZ"),
    ("--rate is", "rate is"),
    ("--truth", "truth"),
    ("--tracks", "tracks"),
    ("--upper-body", "upper_body=True"),
    ("--drop-doubled-ids", "drop_doubled_ids=True"),
];

/// Returns the exception for a failed command, with the names of Python arguments in its message.
fn in_python(mut failure: Failure) -> PyErr {
    for (option, argument) in ARGUMENTS {
        failure.message = failure.message.replace(option, argument);
    }
    raised(failure)
}
