//! Paths in JSON. On most systems a path may have any bytes, but JSON is text: serde refuses a path
//! that is not UTF-8.
//!
//! Such a path becomes `{"escaped": "/data/n\\xff.mcap"}`, in which `\xff` is a byte and `\\` a
//! backslash; every other path is plain text. Both forms are read back as the same path.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Path that is written as text.
#[derive(Clone, Copy, Debug)]
pub struct PathText<'a>(pub &'a Path);

impl Serialize for PathText<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize(self.0, serializer)
    }
}

/// Text of a path.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Plain(String),
    Escaped { escaped: String },
}

impl Written {
    fn of(path: &Path) -> Self {
        match path.to_str() {
            Some(text) => Self::Plain(text.to_owned()),
            None => Self::Escaped { escaped: escaped(path) },
        }
    }

    fn into_path(self) -> PathBuf {
        match self {
            Self::Plain(text) => text.into(),
            Self::Escaped { escaped } => unescaped(&escaped),
        }
    }
}

/// Serializes a path, for `#[serde(with = "path_text")]`.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    Written::of(path).serialize(serializer)
}

/// Deserializes a path that [`serialize`] wrote.
///
/// # Errors
/// Those of the deserializer.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
    Written::deserialize(deserializer).map(Written::into_path)
}

/// The same for a path that may be left out, for `#[serde(with = "path_text::optional")]`.
pub mod optional {
    use super::{Deserialize, Deserializer, Path, PathBuf, Serialize, Serializer, Written};

    /// Serializes a path, or nothing.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(
        path: &Option<PathBuf>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        path.as_deref().map(|path: &Path| Written::of(path)).serialize(serializer)
    }

    /// Deserializes a path, or nothing.
    ///
    /// # Errors
    /// Those of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<PathBuf>, D::Error> {
        Ok(Option::<Written>::deserialize(deserializer)?.map(Written::into_path))
    }
}

fn escaped(path: &Path) -> String {
    let mut text = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        text += &chunk.valid().replace('\\', "\\\\");
        for byte in chunk.invalid() {
            // Writing to a text cannot fail.
            let _ = write!(text, "\\x{byte:02x}");
        }
    }
    text
}

fn unescaped(text: &str) -> PathBuf {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find('\\') {
        bytes.extend_from_slice(&rest.as_bytes()[..at]);
        let behind = &rest[at + 1..];
        let code = behind.strip_prefix('x').and_then(|code| code.get(..2));
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &behind[3..];
            }
            None => {
                bytes.push(b'\\');
                rest = behind.strip_prefix('\\').unwrap_or(behind);
            }
        }
    }
    bytes.extend_from_slice(rest.as_bytes());
    of_bytes(bytes).into()
}

#[cfg(unix)]
fn of_bytes(bytes: Vec<u8>) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes)
}

#[cfg(not(unix))]
fn of_bytes(bytes: Vec<u8>) -> OsString {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

#[cfg(all(test, unix))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Paths {
        #[serde(with = "super")]
        one: PathBuf,
        #[serde(with = "super::optional")]
        other: Option<PathBuf>,
    }

    fn path(bytes: &[u8]) -> PathBuf {
        of_bytes(bytes.to_vec()).into()
    }

    #[test]
    fn text_stays_as_it_is_and_other_bytes_are_escaped() {
        let plain = Paths { one: "a\\x41/ü".into(), other: None };
        let json = serde_json::to_string(&plain).unwrap();
        assert_eq!(json, r#"{"one":"a\\x41/ü","other":null}"#);
        assert_eq!(serde_json::from_str::<Paths>(&json).unwrap(), plain);
        let odd = Paths { one: path(b"a\\/n\xff.mcap"), other: Some(path(b"\xc3")) };
        let json = serde_json::to_string(&odd).unwrap();
        assert_eq!(json, r#"{"one":{"escaped":"a\\\\/n\\xff.mcap"},"other":{"escaped":"\\xc3"}}"#);
        assert_eq!(serde_json::from_str::<Paths>(&json).unwrap(), odd);
    }

    proptest! {
        #[test]
        fn every_path_is_read_back(bytes in prop::collection::vec(any::<u8>(), 0..20)) {
            let paths = Paths { one: path(&bytes), other: Some(path(&bytes)) };
            let json = serde_json::to_string(&paths).unwrap();
            prop_assert_eq!(serde_json::from_str::<Paths>(&json).unwrap(), paths);
        }

        #[test]
        fn no_text_makes_the_reader_panic(text in "[\\\\x0-9a-fü]{0,20}") {
            let _ = unescaped(&text);
        }
    }
}
