use std::fmt::Write;

use crate::Line;

/// Number of values in a line of the file.
const COLUMNS: usize = 16;

/// Text file of a network: the weights of its parts by name, and the linear calibration of its
/// output.
///
/// ```
/// # use tagalong_learn::{Line, NetworkFile};
/// const FILE: NetworkFile<'_> = NetworkFile { format: "my-net 1", parts: &["first", "bias"] };
///
/// let line = Line { slope: 1.5, offset: -0.25 };
/// let text = FILE.write(line, &[&[0.5, 2.0], &[1.0]]);
/// let (mut first, mut bias) = ([0.0; 2], [0.0; 1]);
/// assert_eq!(FILE.read(&text, &mut [&mut first, &mut bias]), Ok(line));
/// assert_eq!((first, bias), ([0.5, 2.0], [1.0]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct NetworkFile<'a> {
    /// Name and version of the format.
    pub format: &'a str,
    /// Names of the parts, in the order of the weights.
    pub parts: &'a [&'a str],
}

impl NetworkFile<'_> {
    /// Returns the text of a network with these weights, part by part.
    pub fn write(&self, line: Line, weights: &[&[f32]]) -> String {
        let (format, Line { slope, offset }) = (self.format, line);
        let mut text =
            format!("format = \"{format}\"\nslope = {slope:?}\noffset = {offset:?}\n\n[net]\n");
        for (name, part) in self.parts.iter().zip(weights) {
            let lines: Vec<String> = part.chunks(COLUMNS).map(comma_separated).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name} = [\n  {},\n]", lines.join(",\n  "));
        }
        text
    }

    /// Reads the weights, part by part, and returns the calibration.
    ///
    /// # Errors
    /// Text of another format, parts that are missing or of another size, and numbers that are not
    /// finite; the message is one sentence. Some weights may have been read by then.
    pub fn read(&self, text: &str, weights: &mut [&mut [f32]]) -> Result<Line, String> {
        let table: toml::Table =
            toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        let format = table.get("format").and_then(|format| format.as_str()).unwrap_or_default();
        if format != self.format {
            return Err(format!("the format is `{format}`, not `{}`", self.format));
        }
        let line = Line { slope: number(&table, "slope")?, offset: number(&table, "offset")? };
        let net = table.get("net").and_then(toml::Value::as_table);
        for (name, part) in self.parts.iter().zip(weights) {
            let values = net.and_then(|net| net.get(*name)?.as_array());
            read_part(name, values.ok_or_else(|| format!("it has no `{name}`"))?, part)?;
        }
        Ok(line)
    }
}

fn comma_separated(values: &[f32]) -> String {
    values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", ")
}

fn number(table: &toml::Table, name: &str) -> Result<f64, String> {
    let value = table.get(name).and_then(toml::Value::as_float);
    value.filter(|v| v.is_finite()).ok_or_else(|| format!("`{name}` is no finite number"))
}

fn read_part(name: &str, values: &[toml::Value], part: &mut [f32]) -> Result<(), String> {
    if values.len() != part.len() {
        let has = values.len();
        let needs = part.len();
        return Err(format!("`{name}` has {has} numbers and needs {needs}"));
    }
    for (to, value) in part.iter_mut().zip(values) {
        *to = value.as_float().unwrap_or(f64::NAN) as f32;
    }
    if part.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(format!("`{name}` has numbers that are not finite"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: NetworkFile<'_> = NetworkFile { format: "test-net 1", parts: &["first", "last"] };
    const LINE: Line = Line { slope: 1.5, offset: -0.25 };

    fn text() -> String {
        let first: Vec<f32> = (0..20).map(|k| k as f32 * 0.1 - 0.3).collect();
        FILE.write(LINE, &[&first, &[1e-20, f32::MAX]])
    }

    fn read(text: &str) -> Result<(Line, Vec<f32>), String> {
        let mut first = [0.0; 20];
        let mut last = [0.0; 2];
        let line = FILE.read(text, &mut [&mut first, &mut last])?;
        Ok((line, [&first[..], &last].concat()))
    }

    #[test]
    fn a_network_survives_its_file_to_the_bit() {
        let (line, weights) = read(&text()).unwrap();
        assert_eq!(line, LINE);
        let first = (0..20).map(|k| k as f32 * 0.1 - 0.3);
        let expected: Vec<f32> = first.chain([1e-20, f32::MAX]).collect();
        assert_eq!(weights, expected);
    }

    #[test]
    fn a_line_holds_sixteen_numbers() {
        let text = text();
        let longest = text.lines().map(|line| line.matches(',').count()).max();
        assert_eq!(longest, Some(16), "{text}");
    }

    #[test]
    fn broken_files_are_refused_in_a_sentence() {
        let good = text();
        for (from, to, told) in [
            ("test-net 1", "test-net 9", "`test-net 9`, not `test-net 1`"),
            ("slope = 1.5", "slope = inf", "`slope`"),
            ("offset = -0.25", "offset = \"no\"", "`offset`"),
            ("last = [", "lost = [", "no `last`"),
            ("[net]", "[not]", "no `first`"),
            ("last = [\n", "last = [ 1.0,\n", "has 3 numbers and needs 2"),
            ("first = [\n  -0.3", "first = [\n  nan", "not finite"),
            ("first = [\n  -0.3", "first = [\n  \"a\"", "not finite"),
        ] {
            assert!(good.contains(from), "{from}");
            let refusal = read(&good.replacen(from, to, 1)).expect_err(to);
            assert!(refusal.contains(told), "{to}: {refusal}");
        }
        assert!(read("nonsense").is_err());
    }
}
