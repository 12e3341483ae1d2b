use std::fmt::Write;

use crate::{Net, NetworkInput, Pass};

/// A network, and the straight line that turns its output into log-odds.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The network.
    pub net: Net,
    /// Log-odds per unit of its output ...
    pub slope: f64,
    /// ... and those of the output 0.
    pub offset: f64,
}

const FORMAT: &str = "body-net 1";
/// Numbers in a line of the file.
const LINE: usize = 16;

impl Model {
    /// Log-odds that the view is of a person, with even priors.
    pub fn log_odds(&self, view: &NetworkInput, pass: &mut Pass) -> f64 {
        self.slope * f64::from(self.net.look(view, pass)) + self.offset
    }

    /// The model file.
    pub fn to_text(&self) -> String {
        let Self { slope, offset, net } = self;
        let mut text =
            format!("format = \"{FORMAT}\"\nslope = {slope:?}\noffset = {offset:?}\n\n[net]\n");
        for (name, part) in Net::PARTS.iter().zip(net.parts()) {
            let lines = part.chunks(LINE).map(|line| {
                line.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", ")
            });
            let lines: Vec<String> = lines.collect();
            let _ = writeln!(text, "{name} = [\n  {},\n]", lines.join(",\n  "));
        }
        text
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// Text that is no model, in a sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let table: toml::Table =
            toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        let format = table.get("format").and_then(|format| format.as_str()).unwrap_or_default();
        if format != FORMAT {
            return Err(format!("the format is `{format}`, not `{FORMAT}`"));
        }
        let number = |name: &str| {
            let value = table.get(name).and_then(|value| value.as_float());
            value.filter(|v| v.is_finite()).ok_or_else(|| format!("`{name}` is no finite number"))
        };
        let mut model =
            Self { net: Net::default(), slope: number("slope")?, offset: number("offset")? };
        for (name, part) in Net::PARTS.iter().zip(model.net.parts_mut()) {
            let values = table.get("net").and_then(|net| net.get(name)?.as_array());
            let values = values.ok_or_else(|| format!("it has no `{name}`"))?;
            if values.len() != part.len() {
                let (has, needs) = (values.len(), part.len());
                return Err(format!("`{name}` has {has} numbers and needs {needs}"));
            }
            for (to, value) in part.iter_mut().zip(values) {
                *to = value.as_float().unwrap_or(f64::NAN) as f32;
            }
            if !part.iter().all(|value| value.is_finite()) {
                return Err(format!("`{name}` has numbers that are not finite"));
            }
        }
        Ok(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> Model {
        let mut net = Net::default();
        for (k, value) in net.parts_mut().into_iter().flatten().enumerate() {
            *value = (k % 37) as f32 * 0.01 - 0.15;
        }
        Model { net, slope: 1.5, offset: -0.25 }
    }

    #[test]
    fn a_model_survives_its_file() {
        assert_eq!(Model::from_text(&model().to_text()).unwrap(), model());
    }

    #[test]
    fn broken_files_are_refused_in_a_sentence() {
        let good = model().to_text();
        let refusal = |from: &str, to: &str| {
            assert!(good.contains(from));
            Model::from_text(&good.replacen(from, to, 1)).unwrap_err()
        };
        assert!(refusal("body-net 1", "body-net 9").contains("body-net 9"));
        assert!(refusal("slope = 1.5", "slope = inf").contains("`slope`"));
        assert!(refusal("third = [", "thirst = [").contains("no `third`"));
        assert!(refusal("last = [\n", "last = [ 1.0,\n").contains("needs 480"));
        assert!(refusal("first = [\n  -0.15", "first = [\n  nan").contains("not finite"));
        assert!(Model::from_text("nonsense").is_err());
    }

    #[test]
    fn the_line_turns_outputs_into_log_odds() {
        let view = NetworkInput { grey: vec![128; 80 * 36], behind: vec![0; 40 * 18] };
        let net = Net { bias: vec![0.5], ..Net::default() };
        let model = Model { net, slope: 2.0, offset: -0.25 };
        assert_eq!(model.log_odds(&view, &mut Pass::default()), 0.75);
    }
}
