use std::sync::{Arc, Mutex, PoisonError};

use tagalong_core::{Derived, Frame, PointCloud, Result};
use tagalong_learn::{Line, NetworkFile, fingerprint};

use crate::{Beams, FloorMap, Net, Pass, Quarter, Source};

/// A network, and the straight line that calibrates its log-odds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// The network.
    pub net: Net,
    /// Log-odds per unit of its answer ...
    pub slope: f64,
    /// ... and those of the answer 0.
    pub offset: f64,
    /// Fingerprint of the weights.
    mark: u64,
}

const FILE: NetworkFile<'static> = NetworkFile { format: "depth-net 1", parts: &Net::PARTS };

/// Maps of a frame: one of a depth image, or those of a lidar.
pub(crate) struct Views {
    pub(crate) maps: Vec<(Quarter, Arc<FloorMap>)>,
    /// Beams of the lidar.
    pub(crate) beams: Option<Beams>,
}

impl Derived for Views {
    fn derive(frame: &Frame) -> Result<Self> {
        let map = frame.derived::<FloorMap>()?;
        Ok(Self { maps: vec![(Quarter::AHEAD, map)], beams: None })
    }
}

/// Maps of the points of a lidar.
struct ViewsOfPoints(Arc<Views>);

impl Derived for ViewsOfPoints {
    fn derive(frame: &Frame) -> Result<Self> {
        let beams = Beams::new(frame.sensor::<PointCloud>()?);
        let maps = Quarter::ALL
            .into_iter()
            .filter_map(|quarter| Some((quarter, Arc::new(FloorMap::of_beams(&beams, quarter)?))));
        let maps = maps.collect();
        Ok(Self(Arc::new(Views { maps, beams: Some(beams) })))
    }
}

/// Answers of a network to the views of a frame.
type Passes = Arc<Vec<Pass>>;

/// Answers of networks to a frame, by the fingerprint of the model and the sensor: several plugins
/// and several queries ask for the same one.
struct Answers(Mutex<Vec<(u64, Source, Passes)>>);

impl Derived for Answers {
    fn derive(_: &Frame) -> Result<Self> {
        Ok(Self(Mutex::default()))
    }
}

impl Model {
    /// Creates a model.
    pub fn new(net: Net, slope: f64, offset: f64) -> Self {
        let weights = net.parts().into_iter().flatten();
        let mark = fingerprint(weights.flat_map(|value| value.to_le_bytes()));
        Self { net, slope, offset, mark }
    }

    /// Returns the maps of what a sensor sees in a frame, and the network's answers to them.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without readings of the sensor.
    pub(crate) fn look(&self, frame: &Frame, source: Source) -> Result<(Arc<Views>, Passes)> {
        let views = match source {
            Source::Depth => frame.derived::<Views>()?,
            Source::Points => Arc::clone(&frame.derived::<ViewsOfPoints>()?.0),
        };
        let answers = frame.derived::<Answers>()?;
        let mut known = answers.0.lock().unwrap_or_else(PoisonError::into_inner);
        let same = known.iter().find(|(mark, of, _)| *mark == self.mark && *of == source);
        if let Some((.., passes)) = same {
            return Ok((views, Arc::clone(passes)));
        }
        let passes = views.maps.iter().map(|(_, map)| {
            let mut pass = Pass::default();
            self.net.look(map, &mut pass);
            pass
        });
        let passes = Arc::new(passes.collect());
        known.push((self.mark, source, Arc::clone(&passes)));
        Ok((views, passes))
    }

    /// Calibrates an answer of the network: log-odds of a person.
    pub fn log_odds(&self, logit: f64) -> f64 {
        self.slope * logit + self.offset
    }

    /// Returns the answer of the network that has these calibrated log-odds.
    pub fn logit(&self, log_odds: f64) -> f64 {
        (log_odds - self.offset) / self.slope
    }

    /// Returns the model file.
    pub fn to_text(&self) -> String {
        FILE.write(Line { slope: self.slope, offset: self.offset }, &self.net.parts())
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// Text that is no model, in a sentence.
    pub fn from_text(text: &str) -> std::result::Result<Self, String> {
        let mut net = Net::default();
        let Line { slope, offset } = FILE.read(text, &mut net.parts_mut())?;
        if slope <= 0.0 {
            return Err("`slope` is not above zero".into());
        }
        Ok(Self::new(net, slope, offset))
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
        Model::new(net, 1.5, -0.25)
    }

    #[test]
    fn a_model_survives_its_file_and_another_has_another_fingerprint() {
        let again = Model::from_text(&model().to_text()).unwrap();
        assert_eq!(again, model());
        let mut other = model().net;
        other.parts_mut()[3][2] += 0.5;
        assert_ne!(Model::new(other, 1.5, -0.25).mark, model().mark);
    }

    /// All other refusals are those of [`NetworkFile`].
    #[test]
    fn a_file_of_another_network_is_refused() {
        let good = model().to_text();
        for (from, to, why) in [
            ("depth-net 1", "depth-net 9", "depth-net 9"),
            ("slope = 1.5", "slope = -1.5", "above zero"),
            ("third = [", "thirst = [", "no `third`"),
            ("last = [\n", "last = [ 1.0,\n", "needs 64"),
        ] {
            assert!(good.contains(from), "{from}");
            let refusal = Model::from_text(&good.replacen(from, to, 1)).unwrap_err();
            assert!(refusal.contains(why), "{refusal}");
        }
    }

    #[test]
    fn calibration_and_its_inverse() {
        assert_eq!(model().log_odds(2.0), 2.75);
        assert_eq!(model().logit(2.75), 2.0);
    }
}
