use std::ffi::OsStr;
use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::WriteError;

/// Directory of one run.
///
/// Files are written under `NAME.partial` and renamed together at the end of the run: a file with
/// its final name is complete.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    pending: Vec<String>,
    /// Lock of the directory, which is released when the process ends; `None` if the file system
    /// has no locks.
    _lock: Option<File>,
}

/// Names of the files of a run, and of its page; no others are ever removed.
const OWN_FILES: [&str; 9] = [
    "tracks.mcap",
    "tracks.csv",
    "tracks-metres.csv",
    "tracks-smoothed.csv",
    "joints.csv",
    "report.json",
    "timings.json",
    "origin.json",
    "view.html",
];

/// Folder of overlay pictures.
const OVERLAY: &str = "overlay";

impl RunDir {
    /// Checks a path as [`RunDir::create`] would, without changing anything.
    ///
    /// # Errors
    /// [`WriteError::Exists`] if the directory is not empty and `overwrite` is not set,
    /// [`WriteError::InputInside`] if `input` is inside it, [`WriteError::NotADirectory`],
    /// [`WriteError::Busy`] if another run is writing into it. Partial files left by a killed run
    /// do not count as contents.
    pub fn check(path: &Path, overwrite: bool, input: &Path) -> Result<(), WriteError> {
        Self::check_contents(path, overwrite, input)?;
        if path.exists() { lock(path).map(drop) } else { Ok(()) }
    }

    fn check_contents(path: &Path, overwrite: bool, input: &Path) -> Result<(), WriteError> {
        if path.exists() && !path.is_dir() {
            return Err(WriteError::NotADirectory { path: path.to_owned() });
        }
        // Canonical paths, because links and `..` could hide that the log is inside.
        if let (Ok(output), Ok(log)) = (path.canonicalize(), input.canonicalize())
            && log.starts_with(&output)
        {
            return Err(WriteError::InputInside {
                input: input.to_owned(),
                output: path.to_owned(),
            });
        }
        let is_free = !path.exists() || holds_no_results(path).map_err(WriteError::io(path))?;
        if is_free || overwrite {
            return Ok(());
        }
        Err(WriteError::Exists { path: path.to_owned() })
    }

    /// Creates the directory, or removes the files of an earlier run from it; other files are kept.
    ///
    /// # Errors
    /// As [`RunDir::check`], and [`WriteError::Io`].
    pub fn create(path: &Path, overwrite: bool, input: &Path) -> Result<Self, WriteError> {
        Self::check_contents(path, overwrite, input)?;
        fs::create_dir_all(path).map_err(WriteError::io(path))?;
        let lock = lock(path)?;
        // Checked again under the lock, because another run may have ended there in the meantime.
        Self::check_contents(path, overwrite, input)?;
        for name in OWN_FILES {
            remove(&path.join(name))?;
            remove(&path.join(partial(name)))?;
        }
        clear_overlay(&path.join(OVERLAY))?;
        Ok(Self { path: path.to_owned(), pending: Vec::new(), _lock: lock })
    }

    /// Returns the directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the folder for overlay pictures, created at the first call.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn overlay(&self) -> Result<PathBuf, WriteError> {
        let path = self.path.join(OVERLAY);
        fs::create_dir_all(&path).map_err(WriteError::io(&path))?;
        Ok(path)
    }

    /// Opens `name` under its partial name.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn open(&mut self, name: &str) -> Result<BufWriter<File>, WriteError> {
        let path = self.path.join(partial(name));
        let file = File::create(&path).map_err(WriteError::io(&path))?;
        self.pending.push(name.to_owned());
        Ok(BufWriter::new(file))
    }

    /// Writes a small file as a whole under its partial name.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
        let mut file = self.open(name)?;
        let path = self.path.join(partial(name));
        file.write_all(bytes).and_then(|()| file.flush()).map_err(WriteError::io(&path))
    }

    /// Gives every file its final name.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn publish(self) -> Result<(), WriteError> {
        for name in &self.pending {
            let from = self.path.join(partial(name));
            let to = self.path.join(name);
            fs::rename(&from, &to).map_err(WriteError::io(&to))?;
        }
        Ok(())
    }

    /// Removes the partial files, and the folders if they are empty.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn discard(self) -> Result<(), WriteError> {
        for name in &self.pending {
            remove(&self.path.join(partial(name)))?;
        }
        // A folder with other files in it is kept, which is not an error.
        let _ = fs::remove_dir(self.path.join(OVERLAY));
        let _ = fs::remove_dir(&self.path);
        Ok(())
    }
}

/// Locks a directory against other runs, for the lifetime of the result.
fn lock(path: &Path) -> Result<Option<File>, WriteError> {
    // Some systems cannot open directories, and some file systems have no locks.
    let Ok(folder) = File::open(path) else { return Ok(None) };
    match folder.try_lock() {
        Ok(()) => Ok(Some(folder)),
        Err(TryLockError::WouldBlock) => Err(WriteError::Busy { path: path.to_owned() }),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Returns true for a directory that is empty or contains only files left by a killed run.
fn holds_no_results(path: &Path) -> std::io::Result<bool> {
    let mut has_partial = false;
    let mut has_pictures = false;
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        let name = entry.file_name();
        if OWN_FILES.iter().any(|own| name == partial(own).as_str()) {
            has_partial = true;
        } else if name == OVERLAY && holds_only_pictures(&entry.path())? {
            has_pictures = true;
        } else {
            return Ok(false);
        }
    }
    Ok(has_partial || !has_pictures)
}

fn holds_only_pictures(folder: &Path) -> std::io::Result<bool> {
    for entry in fs::read_dir(folder)? {
        if !is_picture(&entry?.file_name()) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Returns true for the name of a numbered picture.
fn is_picture(name: &OsStr) -> bool {
    let number = name.to_str().and_then(|name| name.strip_suffix(".png"));
    number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
}

pub(super) fn partial(name: &str) -> String {
    format!("{name}.partial")
}

fn remove(path: &Path) -> Result<(), WriteError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(WriteError::Io { path: path.to_owned(), source: error })
        }
        _ => Ok(()),
    }
}

/// Removes the numbered pictures of an earlier run.
fn clear_overlay(folder: &Path) -> Result<(), WriteError> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        if is_picture(&entry.file_name()) {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(dir: &Path, name: &str) {
        fs::write(dir.join(name), "x").unwrap();
    }

    #[test]
    fn files_get_their_names_at_the_end() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("a/b");
        let mut run = RunDir::create(&out, false, &home.path().join("log.mcap")).unwrap();
        run.put("report.json", b"{}").unwrap();
        assert!(out.join("report.json.partial").exists() && !out.join("report.json").exists());
        run.publish().unwrap();
        assert!(!out.join("report.json.partial").exists());
        assert_eq!(fs::read(out.join("report.json")).unwrap(), b"{}");
    }

    #[test]
    fn a_full_directory_is_refused_and_overwriting_removes_only_our_own() {
        let home = tempfile::tempdir().unwrap();
        let log = home.path().join("elsewhere.mcap");
        let out = home.path().join("out");
        fs::create_dir_all(out.join("overlay")).unwrap();
        for name in ["notes.txt", "tracks.csv", "overlay/000001.png", "overlay/mine.png"] {
            write(&out, name);
        }
        let error = RunDir::create(&out, false, &log).unwrap_err();
        assert!(error.is_refusal() && error.to_string().contains("--overwrite"), "{error}");
        assert!(out.join("tracks.csv").exists());
        RunDir::create(&out, true, &log).unwrap();
        assert!(!out.join("tracks.csv").exists() && !out.join("overlay/000001.png").exists());
        assert!(out.join("notes.txt").exists() && out.join("overlay/mine.png").exists());
    }

    #[test]
    fn what_a_killed_run_left_does_not_stop_the_next_one() {
        let home = tempfile::tempdir().unwrap();
        let log = home.path().join("elsewhere.mcap");
        let out = home.path().join("out");
        let run = RunDir::create(&out, false, &log).unwrap();
        write(&out, "tracks.mcap.partial");
        write(&run.overlay().unwrap(), "000001.png");
        // A killed process publishes and discards nothing.
        drop(run);
        RunDir::check(&out, false, &log).unwrap();
        RunDir::create(&out, false, &log).unwrap();
        assert!(!out.join("tracks.mcap.partial").exists());
        assert!(!out.join("overlay/000001.png").exists());
        for name in ["notes.txt.partial", "notes.txt", "overlay/mine.png"] {
            write(&out, "tracks.mcap.partial");
            write(&out, name);
            let error = RunDir::check(&out, false, &log).unwrap_err();
            assert!(matches!(error, WriteError::Exists { .. }), "{error}");
            fs::remove_file(out.join(name)).unwrap();
        }
    }

    #[cfg(unix)]
    #[test]
    fn two_runs_do_not_write_into_one_directory() {
        let home = tempfile::tempdir().unwrap();
        let log = home.path().join("elsewhere.mcap");
        let out = home.path().join("out");
        let mut first = RunDir::create(&out, true, &log).unwrap();
        first.put("report.json", b"{}").unwrap();
        for error in [
            RunDir::check(&out, true, &log).unwrap_err(),
            RunDir::create(&out, true, &log).unwrap_err(),
            RunDir::create(&out, false, &log).unwrap_err(),
        ] {
            assert!(matches!(error, WriteError::Busy { .. }) && error.is_refusal(), "{error}");
        }
        first.publish().unwrap();
        assert_eq!(fs::read(out.join("report.json")).unwrap(), b"{}");
        let error = RunDir::check(&out, false, &log).unwrap_err();
        assert!(matches!(error, WriteError::Exists { .. }), "{error}");
        RunDir::create(&out, true, &log).unwrap();
    }

    #[test]
    fn the_log_is_never_in_danger() {
        let home = tempfile::tempdir().unwrap();
        write(home.path(), "tracks.mcap");
        let log = home.path().join("tracks.mcap");
        for overwrite in [false, true] {
            let error = RunDir::create(home.path(), overwrite, &log).unwrap_err();
            assert!(matches!(error, WriteError::InputInside { .. }), "{error}");
            let error = RunDir::create(&log, overwrite, &log).unwrap_err();
            assert!(matches!(error, WriteError::NotADirectory { .. }), "{error}");
        }
        assert!(log.exists());
    }
}
