use serde::{Deserialize, Serialize};
use tagalong_geometry::{Camera, Panorama};

use crate::blob::FEATURES;
use crate::{Blob, Distance, Features, Network};

/// Model of the distance of a person from the measured features.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Camera for which the model was fitted.
    pub geometry: Geometry,
    /// Fit to all people.
    pub general: Head,
    /// Models of known people.
    pub people: Vec<Person>,
}

/// A known person.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Name for the setting `person`.
    pub name: String,
    /// Appearance of the person.
    pub signature: Signature,
    /// Fit to this person.
    pub head: Head,
}

/// Appearance of a person: mean and standard deviation of the colours of the upper body and of the
/// stature (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signature {
    /// Means.
    pub mean: [f64; 4],
    /// Standard deviations.
    pub sigma: [f64; 4],
}

impl Signature {
    /// Returns the root mean square difference of an appearance, in standard deviations.
    pub fn misfit(&self, looks: &[f64; 4]) -> f64 {
        let terms = looks.iter().zip(self.mean).zip(self.sigma);
        let squares = terms.map(|((look, mean), sigma)| ((look - mean) / sigma.max(1e-6)).powi(2));
        (squares.sum::<f64>() / 4.0).sqrt()
    }
}

/// Largest misfit of a known person.
const KNOWN: f64 = 2.0;

/// Returns the person with the closest appearance, if it is close enough to tell the person.
pub fn recognised<'a>(people: &'a [Person], looks: &[f64; 4]) -> Option<&'a Person> {
    let misfits = people.iter().map(|known| (known.signature.misfit(looks), known));
    let best = misfits.min_by(|(a, _), (b, _)| a.total_cmp(b));
    best.filter(|(misfit, _)| *misfit < KNOWN).map(|(_, known)| known)
}

/// Regressions of the distance, each with its standard deviation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    /// Offset that is added to the range of the feet on the floor, m: feet are not below the head.
    pub floor_offset_m: f64,
    /// Standard deviation of the analytic distance.
    pub analytic_sigma: Line,
    /// Standard deviation of the ridge regression.
    pub ridge_sigma: Line,
    /// Standard deviation of the network.
    pub network_sigma: Line,
    /// Standard deviation of the network that was trained by gradient descent.
    pub gradient_sigma: Line,
    /// Standard deviation of the rich network.
    pub rich_sigma: Line,
    /// Ridge regression.
    pub ridge: Ridge,
    /// Network of three features.
    pub network: Network,
    /// The same network, trained by gradient descent.
    pub gradient: Network,
    /// Network of all features.
    pub rich: Network,
}

/// Straight line: its value at 0, and its slope per metre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Value at 0 m, m.
    pub start: f64,
    /// Increase per metre.
    pub slope: f64,
}

impl Line {
    /// Returns the value, at least a centimetre.
    pub fn at(&self, distance_m: f64) -> f64 {
        (self.start + self.slope * distance_m).max(0.01)
    }
}

/// Weights of 1, bottom, its square, its inverse, width and pixels; all but the 1 are scaled to
/// mean 0 and deviation 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ridge {
    /// Mean of each term.
    pub mean: [f64; 5],
    /// Standard deviation of each term.
    pub scale: [f64; 5],
    /// Weights; that of the 1 first.
    pub weights: [f64; 6],
}

impl Ridge {
    /// Returns the unscaled terms, without the 1.
    pub fn terms(f: &Features) -> [f64; 5] {
        [f.bottom, f.bottom * f.bottom, 1.0 / (f.bottom + 1.0), f.width, f.pixels]
    }

    /// Returns the distance, m.
    pub fn answer(&self, features: &Features) -> f64 {
        let terms = Self::terms(features);
        let scaled = (0..5).map(|i| (terms[i] - self.mean[i]) / self.scale[i]);
        self.weights[0] + scaled.zip(&self.weights[1..]).map(|(x, w)| w * x).sum::<f64>()
    }

    fn is_sane(&self) -> bool {
        let numbers = self.mean.iter().chain(&self.scale).chain(&self.weights);
        self.scale.iter().all(|scale| *scale > 0.0) && numbers.copied().all(f64::is_finite)
    }
}

impl Head {
    /// Returns the distance from the axis of the mirror, and its standard deviation, m.
    pub fn distance(
        &self,
        features: &Features,
        camera: &PanoramaGeometry<'_>,
        how: Distance,
    ) -> (f64, f64) {
        let (distance, sigma) = match how {
            Distance::Network => (self.network.answer(&features.values()), self.network_sigma),
            Distance::Gradient => (self.gradient.answer(&features.values()), self.gradient_sigma),
            Distance::Rich => (self.rich.answer(&camera.inputs(features)), self.rich_sigma),
            Distance::Ridge => (self.ridge.answer(features), self.ridge_sigma),
            Distance::Analytic => {
                (camera.floor_m(features) + self.floor_offset_m, self.analytic_sigma)
            }
        };
        (distance, sigma.at(distance))
    }

    fn is_sane(&self) -> bool {
        let lines = [
            self.analytic_sigma,
            self.ridge_sigma,
            self.network_sigma,
            self.gradient_sigma,
            self.rich_sigma,
        ];
        self.network.is_sane(3)
            && self.gradient.is_sane(3)
            && self.rich.is_sane(INPUTS)
            && self.ridge.is_sane()
            && self.floor_offset_m.is_finite()
            && lines.iter().all(|line| line.start.is_finite() && line.slope.is_finite())
    }
}

/// Number of inputs of the rich network: all features, and the range of the feet on the floor.
pub(crate) const INPUTS: usize = FEATURES.len() + 1;
/// Range of the feet if they are not seen on the floor, and the largest range, m.
const FAR_M: f64 = 15.0;

/// Parts of a camera that are needed to compute distances.
#[derive(Clone, Copy, Debug)]
pub struct PanoramaGeometry<'a> {
    /// The panorama.
    pub panorama: &'a Panorama,
    /// Height of the pinhole above the floor, m.
    pub height_m: f64,
}

impl<'a> PanoramaGeometry<'a> {
    /// Returns the view of a camera, if it has a panorama.
    pub fn of(camera: &'a Camera) -> Option<Self> {
        Some(Self { panorama: camera.panorama()?, height_m: camera.height_m() })
    }

    /// Returns the range at which the ray of the lowest row meets the floor, from the axis, m.
    pub fn floor_m(&self, features: &Features) -> f64 {
        let elevation = self.panorama.elevation(features.lowest_row(self.panorama.rows));
        let seen = self.panorama.mirror.floor_range_m(elevation, self.height_m);
        seen.filter(|range| *range > 0.0).map_or(FAR_M, |range| range.min(FAR_M))
    }

    /// Returns the height of the top of the head above the floor for a person at `distance_m`, m.
    pub fn top_m(&self, features: &Features, distance_m: f64) -> f64 {
        let (ring, up) = self.panorama.mirror.ring_m();
        // Rows are numbered by their centres; the top of a person is the upper edge of its first
        // row.
        let slope = self.panorama.elevation(features.top - 0.5).tan();
        self.height_m + up + (distance_m + ring) * slope
    }

    /// Returns the inputs of the rich network.
    pub(crate) fn inputs(&self, features: &Features) -> [f64; INPUTS] {
        let mut inputs = [0.0; INPUTS];
        inputs[..FEATURES.len()].copy_from_slice(&features.values());
        inputs[FEATURES.len()] = self.floor_m(features);
        inputs
    }

    /// Returns the appearance: colours and stature.
    pub fn looks(&self, blob: &Blob, distance_m: f64) -> [f64; 4] {
        let [red, green, blue] = blob.colour;
        [red, green, blue, self.top_m(&blob.features, distance_m)]
    }
}

/// Geometry of the camera on which a fitted model depends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    /// Columns and rows of the panorama.
    pub size: [usize; 2],
    /// Elevation of its upper and lower edge, degrees.
    pub elevations_deg: [f64; 2],
    /// Height of the pinhole above the floor, m.
    pub height_m: f64,
}

impl Geometry {
    /// Returns the geometry of a camera.
    pub fn of(view: &PanoramaGeometry<'_>) -> Self {
        let size = [view.panorama.columns, view.panorama.rows];
        let elevations_deg = view.panorama.elevations().map(f64::to_degrees);
        Self { size, elevations_deg, height_m: view.height_m }
    }

    /// Returns true if a camera is like this one, to within two rows and three centimetres: the
    /// angles of a mirror are not measured more precisely.
    pub fn is_like(&self, other: &Self) -> bool {
        let row_deg = (self.elevations_deg[0] - self.elevations_deg[1]) / self.size[1] as f64;
        let elevations = self.elevations_deg.iter().zip(other.elevations_deg);
        self.size == other.size
            && (self.height_m - other.height_m).abs() < 0.03
            && elevations.into_iter().all(|(a, b)| (a - b).abs() < 2.0 * row_deg.abs())
    }
}

/// A model as TOML.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    features: Vec<String>,
    geometry: Geometry,
    general: Head,
    #[serde(default)]
    people: Vec<Person>,
}

const FORMAT: &str = "omni-distance 3";

impl Model {
    /// Returns the fit for a person: by name, the fit to all people for `general`, and for
    /// `nearest` that of the person with the closest appearance, if it is close enough.
    pub fn head(
        &self,
        person: &str,
        blob: &Blob,
        view: &PanoramaGeometry<'_>,
        how: Distance,
    ) -> &Head {
        if person != "nearest" {
            let named = self.people.iter().find(|known| known.name == person);
            return named.map_or(&self.general, |known| &known.head);
        }
        let (distance_m, _) = self.general.distance(&blob.features, view, how);
        let known = recognised(&self.people, &view.looks(blob, distance_m));
        known.map_or(&self.general, |known| &known.head)
    }

    /// Formats the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot express.
    pub fn to_text(&self) -> Result<String, String> {
        let file = File {
            format: FORMAT.into(),
            features: FEATURES.map(String::from).to_vec(),
            geometry: self.geometry,
            general: self.general.clone(),
            people: self.people.clone(),
        };
        toml::to_string(&file).map_err(|why| format!("the model is no TOML: {why}"))
    }

    /// Parses a model file.
    ///
    /// # Errors
    /// Text that is not a model; the message is one sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        if file.format != FORMAT {
            return Err(format!("the format is `{}`, not `{FORMAT}`", file.format));
        }
        if file.features != FEATURES {
            return Err(format!("it is not made of the features {FEATURES:?}"));
        }
        let heads = file.people.iter().map(|person| &person.head).chain([&file.general]);
        if !heads.into_iter().all(Head::is_sane) {
            return Err("its numbers are not finite or do not fit together".into());
        }
        Ok(Self { geometry: file.geometry, general: file.general, people: file.people })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misfit_is_the_root_of_the_mean_square_in_deviations() {
        let known = Signature { mean: [10.0, 20.0, 30.0, 1.7], sigma: [2.0, 4.0, 5.0, 0.1] };
        let misfit = known.misfit(&[12.0, 16.0, 40.0, 1.5]);
        assert!((misfit - (10.0_f64 / 4.0).sqrt()).abs() < 1e-9, "{misfit}");
        let exact = Signature { sigma: [0.0; 4], ..known };
        assert!((exact.misfit(&[10.0, 20.0, 30.0, 1.7 + 2e-6]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_line_is_never_below_a_centimetre() {
        let line = Line { start: 0.1, slope: -0.02 };
        assert!((line.at(2.0) - 0.06).abs() < 1e-12);
        assert_eq!(line.at(20.0), 0.01);
    }

    #[test]
    fn cameras_are_alike_within_two_rows_and_three_centimetres() {
        // A row is half a degree.
        let one = Geometry { size: [480, 100], elevations_deg: [10.0, -40.0], height_m: 1.5 };
        for (elevations_deg, height_m, expected) in [
            ([10.99, -40.99], 1.529, true),
            ([9.01, -39.01], 1.471, true),
            ([11.01, -40.0], 1.5, false),
            ([10.0, -41.01], 1.5, false),
            ([8.99, -40.0], 1.5, false),
            ([10.0, -38.99], 1.5, false),
            ([10.0, -40.0], 1.531, false),
            ([10.0, -40.0], 1.469, false),
        ] {
            let other = Geometry { elevations_deg, height_m, ..one };
            assert_eq!(one.is_like(&other), expected, "{other:?}");
        }
        assert!(!one.is_like(&Geometry { size: [480, 101], ..one }));
    }

    #[test]
    fn a_ridge_answers_by_its_formula() {
        let ridge = Ridge {
            mean: [1.0, 2.0, 0.25, 4.0, 5.0],
            scale: [2.0, 4.0, 0.5, 2.0, 10.0],
            weights: [3.0, 1.0, -1.0, 2.0, 0.5, -2.0],
        };
        let features = Features {
            width: 8.0,
            bottom: 3.0,
            pixels: 25.0,
            top: 0.0,
            middle: 0.0,
            core: 0.0,
            low: 0.0,
        };
        // Terms 3, 9, 1/4, 8 and 25, which are 1, 7/4, 0, 2 and 2 when scaled.
        assert!((ridge.answer(&features) - (3.0 + 1.0 - 1.75 + 0.0 + 1.0 - 4.0)).abs() < 1e-12);
        assert!(ridge.is_sane());
        let changes: [fn(&mut Ridge); 3] = [
            |ridge| ridge.scale[2] = 0.0,
            |ridge| ridge.weights[5] = f64::NAN,
            |ridge| ridge.mean[0] = f64::INFINITY,
        ];
        for change in changes {
            let mut broken = ridge;
            change(&mut broken);
            assert!(!broken.is_sane());
        }
    }

    #[test]
    fn a_head_with_one_broken_part_is_none() {
        let text = include_str!("../models/omni-distance.toml");
        let head = Model::from_text(text).unwrap().general;
        assert!(head.is_sane());
        let broken: [fn(&mut Head); 9] = [
            |h| h.network.output.clear(),
            |h| h.gradient.output.clear(),
            |h| h.rich.output.clear(),
            |h| h.ridge.scale[0] = -1.0,
            |h| h.floor_offset_m = f64::NAN,
            |h| h.analytic_sigma.start = f64::NAN,
            |h| h.gradient_sigma.slope = f64::INFINITY,
            |h| h.network_sigma.slope = f64::NAN,
            |h| h.rich_sigma.start = f64::INFINITY,
        ];
        for (number, change) in broken.into_iter().enumerate() {
            let mut other = head.clone();
            change(&mut other);
            assert!(!other.is_sane(), "{number}");
        }
    }
}
