//! The library of onnxruntime on this machine.

use std::env;
use std::path::{Path, PathBuf};

/// Environment variable with the path of the library.
pub const LIBRARY: &str = "ORT_DYLIB_PATH";

/// Where a system keeps libraries.
const SYSTEM: [&str; 5] = [
    "/usr/local/lib",
    "/usr/lib",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
];

/// Returns the path of the library: the one that [`LIBRARY`] names, or else that of the Python package
/// `onnxruntime` in the active environment (`VIRTUAL_ENV`) or of this user, or else one of the system.
pub(crate) fn path() -> Option<PathBuf> {
    if let Some(named) = env::var_os(LIBRARY).filter(|path| !path.is_empty()) {
        return Some(named.into());
    }
    let environment = env::var_os("VIRTUAL_ENV").map(PathBuf::from);
    let home = env::var_os("HOME").map(|home| Path::new(&home).join(".local"));
    let packages = [environment, home].into_iter().flatten().flat_map(|root| packages(&root));
    packages.chain(SYSTEM.map(PathBuf::from)).find_map(|folder| library_in(&folder))
}

/// Returns the folders in which the package `onnxruntime` of each Python has its library.
fn packages(root: &Path) -> Vec<PathBuf> {
    let pythons = names_in(&root.join("lib"), "python3");
    let capi = ["site-packages", "onnxruntime", "capi"];
    pythons
        .into_iter()
        .map(|python| capi.iter().fold(python, |path, part| path.join(part)))
        .collect()
}

/// Returns the library in a folder; of several versions the last one by name.
fn library_in(folder: &Path) -> Option<PathBuf> {
    names_in(folder, "libonnxruntime.so").pop()
}

/// Returns what a folder has whose name begins with some text, by name; nothing of one that is not there.
fn names_in(folder: &Path, start: &str) -> Vec<PathBuf> {
    let Ok(entries) = folder.read_dir() else { return Vec::new() };
    let paths = entries.flatten().map(|entry| entry.path());
    let mut paths: Vec<PathBuf> = paths
        .filter(|path| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(start))
        })
        .collect();
    paths.sort();
    paths
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_library_of_a_python_package_is_found() -> std::io::Result<()> {
        let root = tempfile::tempdir()?;
        assert!(packages(root.path()).is_empty(), "no Python");
        let capi = root.path().join("lib/python3.11/site-packages/onnxruntime/capi");
        fs::create_dir_all(&capi)?;
        let found = packages(root.path());
        assert_eq!(found, std::slice::from_ref(&capi));
        assert_eq!(library_in(&capi), None, "a package without it");
        for name in
            ["libonnxruntime.so.1.20.0", "libonnxruntime_providers_shared.so", "__init__.py"]
        {
            fs::write(capi.join(name), "")?;
        }
        assert_eq!(library_in(&capi), Some(capi.join("libonnxruntime.so.1.20.0")));
        Ok(())
    }
}
