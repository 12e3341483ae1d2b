use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

/// The checkout that is worked on.
pub struct Workspace {
    root: PathBuf,
}

impl Workspace {
    /// Finds the workspace in which cargo runs this program. The folder it was built in may be
    /// another one: copies of a workspace can share built crates.
    pub fn find() -> Result<Self> {
        let here = env::var("CARGO_MANIFEST_DIR").context("start this with `cargo xtask`")?;
        let root = Path::new(&here).ancestors().nth(2).context("xtask does not lie in crates/")?;
        Ok(Self::at(root))
    }

    /// The workspace at `root`.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Its root folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The text of a file, named relative to the root.
    pub fn read(&self, path: impl AsRef<Path>) -> Result<String> {
        let path = path.as_ref();
        fs::read_to_string(self.root.join(path))
            .with_context(|| format!("cannot read {}", path.display()))
    }

    /// Writes a file, named relative to the root, and the folders above it.
    pub fn write(&self, path: impl AsRef<Path>, text: &str) -> Result<()> {
        let path = path.as_ref();
        let full = self.root.join(path);
        if let Some(folder) = full.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(full, text).with_context(|| format!("cannot write {}", path.display()))
    }

    /// The names of the folders in a folder, sorted.
    pub fn folders(&self, under: &str) -> Result<Vec<String>> {
        let entries = fs::read_dir(self.root.join(under))
            .with_context(|| format!("cannot list the folder {under}"))?;
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// All files that git tracks or would track, relative to the root, sorted.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let mut files = self.listed()?;
        // Git still lists files that were removed, and links to folders.
        files.retain(|path| self.root.join(path).is_file());
        Ok(files)
    }

    /// All paths that git tracks or would track, relative to the root, sorted.
    fn listed(&self) -> Result<Vec<PathBuf>> {
        let mut git = Command::new("git");
        // New files count, too; ignored ones do not.
        git.args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]);
        let listed = output(git.current_dir(&self.root))?;
        let names = listed.split('\0').filter(|name| !name.is_empty());
        let mut files: Vec<PathBuf> = names.map(PathBuf::from).collect();
        files.sort();
        files.dedup();
        Ok(files)
    }

    /// Copies those of its files that are wanted into a folder.
    pub fn copy_to(&self, folder: &Path, is_wanted: impl Fn(&Path) -> bool) -> Result<()> {
        for path in self.listed()?.into_iter().filter(|path| is_wanted(path)) {
            let from = self.root.join(&path);
            if from.is_file() {
                copy_file(&from, &folder.join(&path))?;
            } else if from.is_dir() {
                // A link to a folder, whose files the crate embeds: those that are added to the copy, too.
                let target = fs::read_link(&from)
                    .with_context(|| format!("{} is no link", from.display()))?;
                link(&target, &folder.join(&path))?;
            }
        }
        Ok(())
    }
}

/// Makes a link to a folder, with the folders above it.
fn link(target: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    std::os::unix::fs::symlink(target, to).with_context(|| format!("cannot link {}", to.display()))
}

/// Copies a file, and makes the folders above it.
pub fn copy_file(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
    Ok(())
}

/// Removes a folder, if there is one.
pub fn remove_folder(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)
            .with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    Ok(())
}

/// Returns the output of a command; an error if it fails.
pub fn output(command: &mut Command) -> Result<String> {
    let shown = shown(command);
    let output = command.output().with_context(|| format!("cannot start `{shown}`"))?;
    if !output.status.success() {
        bail!("`{shown}` failed:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    String::from_utf8(output.stdout).with_context(|| format!("`{shown}` prints no UTF-8"))
}

/// Runs a command in sight of the user; an error if it fails.
pub fn succeed(command: &mut Command) -> Result<()> {
    let shown = shown(command);
    let status = command.status().with_context(|| format!("cannot start `{shown}`"))?;
    ensure!(status.success(), "`{shown}` failed with {status}");
    Ok(())
}

fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
