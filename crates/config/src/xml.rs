//! Limits on XML files that a user names. The parser compares each attribute of an element with all
//! attributes before it, and each namespace with all those around it: a file of one megabyte could
//! keep it busy for hours.

/// Most attributes of an element.
const MOST_ATTRIBUTES: usize = 1000;

/// Most declarations of namespaces in a file.
const MOST_NAMESPACES: usize = 16;

/// Refuses a text that an XML parser would take much longer for than for others of its length.
///
/// # Errors
/// A sentence with the line.
pub fn check_xml(text: &str) -> Result<(), String> {
    if let Some((at, _)) = text.match_indices("xmlns").nth(MOST_NAMESPACES) {
        let line = line_of(text, at);
        return Err(format!("line {line}: more than {MOST_NAMESPACES} namespaces; none are read"));
    }
    for (at, _) in text.match_indices('<') {
        if attributes_of(&text[at..]) > MOST_ATTRIBUTES {
            let line = line_of(text, at);
            return Err(format!(
                "line {line}: an element with more than {MOST_ATTRIBUTES} attributes"
            ));
        }
    }
    Ok(())
}

/// Returns the number of values in quotes in the tag at the start of a text.
fn attributes_of(text: &str) -> usize {
    let mut count = 0;
    let mut quote = None;
    // A value may hold the end of a tag, but not the start of one.
    for byte in text.bytes().skip(1).take_while(|byte| *byte != b'<') {
        match (quote, byte) {
            (None, b'>') => break,
            (None, b'"' | b'\'') => {
                quote = Some(byte);
                count += 1;
            }
            (Some(open), byte) if open == byte => quote = None,
            _ => {}
        }
    }
    count
}

fn line_of(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(attributes: usize) -> String {
        let all: String = (0..attributes).map(|n| format!(" a{n}=\"b > '\"")).collect();
        format!("<?xml version='1.0'?>\n<x>\n<!-- a=\"b\" -->\n<y{all}>1 = \"2\"</y></x>")
    }

    #[test]
    fn elements_with_many_attributes_are_refused_with_their_line() {
        assert_eq!(check_xml(&element(MOST_ATTRIBUTES)), Ok(()));
        let error = check_xml(&element(MOST_ATTRIBUTES + 1)).unwrap_err();
        assert!(error.starts_with("line 4: ") && error.contains("1000 attributes"), "{error}");
        assert!(check_xml(&element(200_000)).is_err());
    }

    #[test]
    fn many_namespaces_are_refused() {
        fn nested(depth: usize) -> String {
            (0..depth).map(|n| format!("<a{n}:b xmlns:a{n}=\"c{n}\">\n")).collect()
        }

        assert_eq!(check_xml(&nested(MOST_NAMESPACES)), Ok(()));
        let error = check_xml(&nested(60_000)).unwrap_err();
        assert!(error.starts_with("line 17: ") && error.contains("namespaces"), "{error}");
    }
}
