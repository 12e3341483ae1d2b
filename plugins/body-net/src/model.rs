use tagalong_learn::{Line, NetworkFile};

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

const FILE: NetworkFile<'static> = NetworkFile { format: "body-net 1", parts: &Net::PARTS };

impl Model {
    /// Returns the log-odds that the view is of a person, with even priors.
    pub fn log_odds(&self, view: &NetworkInput, pass: &mut Pass) -> f64 {
        self.slope * f64::from(self.net.look(view, pass)) + self.offset
    }

    /// Returns the model file.
    pub fn to_text(&self) -> String {
        FILE.write(Line { slope: self.slope, offset: self.offset }, &self.net.parts())
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// Text that is no model, in a sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let mut net = Net::default();
        let Line { slope, offset } = FILE.read(text, &mut net.parts_mut())?;
        Ok(Self { net, slope, offset })
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

    /// All other refusals are those of [`NetworkFile`].
    #[test]
    fn a_file_of_another_network_is_refused() {
        let good = model().to_text();
        for (from, to, why) in [
            ("body-net 1", "body-net 9", "body-net 9"),
            ("third = [", "thirst = [", "no `third`"),
            ("last = [\n", "last = [ 1.0,\n", "needs 480"),
        ] {
            assert!(good.contains(from));
            let refusal = Model::from_text(&good.replacen(from, to, 1)).unwrap_err();
            assert!(refusal.contains(why), "{refusal}");
        }
    }

    #[test]
    fn the_line_turns_outputs_into_log_odds() {
        let view = NetworkInput { grey: vec![128; 80 * 36], behind: vec![0; 40 * 18] };
        let net = Net { bias: vec![0.5], ..Net::default() };
        let model = Model { net, slope: 2.0, offset: -0.25 };
        assert_eq!(model.log_odds(&view, &mut Pass::default()), 0.75);
    }
}
