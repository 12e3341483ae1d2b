//! Names of classes in the metadata of an ONNX file.
//!
//! Exports of Ultralytics have the entry `names` with a Python dictionary as text
//! (`{0: 'helmet', 1: 'person'}`); other programs write JSON (`{"0": "helmet"}` or `["helmet"]`).

use std::collections::BTreeMap;
use std::iter::Peekable;
use std::str::Chars;

use crate::survey::{Content, Fields};

/// Field numbers of the messages in `onnx.proto`.
const MODEL_METADATA: u64 = 14;
const ENTRY_KEY: u64 = 1;
const ENTRY_VALUE: u64 = 2;
/// Key of the entry with the names.
const KEY: &[u8] = b"names";
/// Maximum number of names that are read.
const MAX_NAMES: usize = 10_000;
/// Maximum number of names in a message, and of characters of each.
const MAX_SHOWN: usize = 20;
const MAX_CHARS: usize = 40;
/// Names for people. The first one excludes the others, which beside it stand for groups.
const PERSON: &str = "person";
const OTHER_PEOPLE: [&str; 2] = ["pedestrian", "people"];

/// Names of the classes of a network by class index; empty if the file has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClassNames(BTreeMap<usize, String>);

impl ClassNames {
    /// Reads the names from the bytes of a file. Damaged bytes and other texts give none.
    pub(crate) fn of(file: &[u8]) -> Self {
        let mut fields = Fields(file);
        while let Some(Ok((number, content))) = fields.next() {
            if let (MODEL_METADATA, Content::Bytes(entry)) = (number, content)
                && let Some(text) = names_of(entry)
            {
                return Self::parse(text).unwrap_or_default();
            }
        }
        Self::default()
    }

    fn parse(text: &str) -> Option<Self> {
        let mut reader = Reader(text.trim().chars().peekable());
        let close = match reader.0.next()? {
            '{' => '}',
            '[' => ']',
            _ => return None,
        };
        let mut names = BTreeMap::new();
        while reader.next_is_not(close)? {
            let class = if close == '}' { reader.class()? } else { names.len() };
            names.insert(class, reader.quoted()?);
            if names.len() > MAX_NAMES {
                return None;
            }
        }
        Some(Self(names))
    }

    /// Returns true if the file has no names.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the name of a class.
    pub fn get(&self, class: usize) -> Option<&str> {
        self.0.get(&class).map(String::as_str)
    }

    /// Returns the classes named person, or otherwise those named pedestrian and people.
    pub(crate) fn people(&self) -> Vec<usize> {
        let people = self.called(&[PERSON]);
        if people.is_empty() { self.called(&OTHER_PEOPLE) } else { people }
    }

    fn called(&self, names: &[&str]) -> Vec<usize> {
        self.0
            .iter()
            .filter(|(_, name)| names.contains(&name.trim().to_lowercase().as_str()))
            .map(|(class, _)| *class)
            .collect()
    }

    /// Returns the first names as a text: `0 helmet, 1 vest`.
    pub(crate) fn shown(&self) -> String {
        let mut shown = Vec::new();
        for (class, name) in self.0.iter().take(MAX_SHOWN) {
            let name: String = name.chars().take(MAX_CHARS).collect();
            shown.push(format!("{class} {}", name.escape_debug()));
        }
        match self.0.len().checked_sub(MAX_SHOWN) {
            Some(others @ 1..) => format!("{} and {others} others", shown.join(", ")),
            _ => shown.join(", "),
        }
    }
}

/// Returns the text of a metadata entry if its key is that of the names.
fn names_of(entry: &[u8]) -> Option<&str> {
    let mut key: &[u8] = &[];
    let mut value: &[u8] = &[];
    for field in Fields(entry) {
        match field.ok()? {
            (ENTRY_KEY, Content::Bytes(bytes)) => key = bytes,
            (ENTRY_VALUE, Content::Bytes(bytes)) => value = bytes,
            _ => {}
        }
    }
    std::str::from_utf8(value).ok().filter(|_| key == KEY)
}

/// Reader of a Python or JSON literal.
struct Reader<'a>(Peekable<Chars<'a>>);

impl Reader<'_> {
    fn skip_space(&mut self) {
        while self.0.next_if(|next| next.is_whitespace()).is_some() {}
    }

    /// Returns true if another entry follows. At the end it consumes the closing character and
    /// returns false. `None` if the text ends early.
    fn next_is_not(&mut self, close: char) -> Option<bool> {
        self.skip_space();
        if self.0.next_if_eq(&',').is_some() {
            self.skip_space();
        }
        self.0.peek()?;
        Some(self.0.next_if_eq(&close).is_none())
    }

    /// Reads a class index, in quotes or not, and the colon after it.
    fn class(&mut self) -> Option<usize> {
        let digits = match self.0.peek()? {
            '"' | '\'' => self.quoted()?,
            _ => {
                let mut digits = String::new();
                while let Some(digit) = self.0.next_if(char::is_ascii_digit) {
                    digits.push(digit);
                }
                digits
            }
        };
        self.skip_space();
        self.0.next_if_eq(&':')?;
        self.skip_space();
        digits.parse().ok()
    }

    /// Reads a text in single or double quotes.
    fn quoted(&mut self) -> Option<String> {
        let quote = self.0.next_if(|next| matches!(next, '"' | '\''))?;
        let mut text = String::new();
        loop {
            match self.0.next()? {
                end if end == quote => return Some(text),
                '\\' => text.push(self.escaped()?),
                other => text.push(other),
            }
        }
    }

    fn escaped(&mut self) -> Option<char> {
        let digits = match self.0.next()? {
            'n' => return Some('\n'),
            't' => return Some('\t'),
            'x' => 2,
            'u' => 4,
            other => return Some(other),
        };
        let mut code = 0;
        for _ in 0..digits {
            code = 16 * code + self.0.next()?.to_digit(16)?;
        }
        char::from_u32(code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn people(text: &str) -> Vec<usize> {
        ClassNames::parse(text).unwrap().people()
    }

    #[test]
    fn literals_of_python_and_of_json_are_read() {
        assert_eq!(people("{0: 'helmet', 1: 'person'}"), [1]);
        assert_eq!(people(r#"{"0": "helmet", "7" : "person"}"#), [7]);
        assert_eq!(people(r#" ["car", "van", "person",] "#), [2]);
        let names = ClassNames::parse(r#"{0: "driver's seat", 1: 'a\'b', 2: '\u00e9'}"#).unwrap();
        let read = [0, 1, 2, 3].map(|class| names.get(class));
        assert_eq!(read, [Some("driver's seat"), Some("a'b"), Some("é"), None]);
        assert!(ClassNames::parse("{}").unwrap().is_empty());
    }

    #[test]
    fn other_texts_have_no_names() {
        for text in
            ["", "person", "{", "{0: 'a'", "{0: 1}", "{a: 'b'}", "{0 'a'}", "['a', 3]", "{0: 'a"]
        {
            assert_eq!(ClassNames::parse(text), None, "{text}");
        }
    }

    #[test]
    fn people_are_called_so_whatever_the_case() {
        assert_eq!(people("['Car', 'Pedestrian', 'PEOPLE']"), [1, 2]);
        assert_eq!(people("['people', 'Person']"), [1], "beside persons, people are a group");
        assert_eq!(people("['no person', 'personal', 'face']"), [0_usize; 0]);
    }

    #[test]
    fn many_names_are_shown_in_part() {
        let text = format!("[{}]", "'x', ".repeat(30));
        let shown = ClassNames::parse(&text).unwrap().shown();
        assert!(
            shown.starts_with("0 x, 1 x, ") && shown.ends_with("19 x and 10 others"),
            "{shown}"
        );
        let few = ClassNames::parse("['helmet', 'vest']").unwrap();
        assert_eq!(few.shown(), "0 helmet, 1 vest");
    }

    #[test]
    fn metadata_stand_beside_the_graph() {
        fn entry(key: &[u8], value: &[u8]) -> Vec<u8> {
            let key = [&[10, key.len() as u8], key].concat();
            let value = [&[18, value.len() as u8], value].concat();
            let entry = [key, value].concat();
            [vec![14 << 3 | 2, entry.len() as u8], entry].concat()
        }
        let file = [entry(b"task", b"detect"), entry(b"names", b"['dog', 'person']")].concat();
        assert_eq!(ClassNames::of(&file).people(), [1]);
        for end in 0..file.len() {
            assert!(ClassNames::of(&file[..end]).is_empty(), "{end}");
        }
    }
}
