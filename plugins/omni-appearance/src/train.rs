//! Fits the distance model to people at known positions.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector, Point3};
use tagalong_config::{Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, Funnel, Result};
use tagalong_learn::dense::NormalEquations;
use tagalong_learn::mix;

use crate::fit::mean_and_scale;
pub use crate::fit::{Descent, Fit};
use crate::model::INPUTS;
use crate::{
    Blob, Config, Distance, Eyes, Features, Geometry, Head, Line, Model, PanoramaGeometry, Person,
    Ridge, Signature,
};

/// Settings of the fit of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// The paper's network: three inputs, four hidden units (P5, section 4.4).
    pub network: Fit,
    /// The same network, by back-propagation.
    pub gradient: Fit,
    /// Network of all features.
    pub rich: Fit,
    /// Weight of the squared weights of the ridge regression, per sample.
    pub ridge: f64,
    /// Number of images in a block: neighbours are near-duplicates and stay together.
    pub block_frames: u64,
}

impl Default for Training {
    fn default() -> Self {
        let descent = Descent::Marquardt;
        let network = Fit { hidden: 4, decay: 1e-2, restarts: 3, steps: 150, descent };
        // P5, section 4.4, states the rate and nothing else.
        let descent = Descent::BackPropagation { rate: 0.3 };
        Self {
            network,
            gradient: Fit { decay: 0.0, steps: 2000, descent, ..network },
            rich: Fit { hidden: 8, decay: 3e-2, ..network },
            ridge: 1e-4,
            block_frames: 15,
        }
    }
}

/// Part of the samples that is held out to measure the errors of a model: whole blocks of images,
/// or whole people where there are several, because most people that the detector meets are
/// strangers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOut {
    /// Blocks of images.
    Blocks,
    /// People.
    People,
}

/// Number of parts, each of which is held out once.
const FOLDS: u64 = 5;

/// Features of a person at a known place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Measured features.
    pub features: Features,
    /// Range at which the ray of the lowest row meets the floor, m.
    pub floor_m: f64,
    /// Colours of the upper body, and the stature at the true distance, m.
    pub looks: [f64; 4],
    /// True distance of the head from the axis, m.
    pub distance_m: f64,
    /// Measured bearing, in the camera frame, rad.
    pub bearing_rad: f64,
    /// True bearing, rad.
    pub true_bearing_rad: f64,
    /// Number of the person.
    pub person: u64,
    /// Number of the image.
    pub frame: u64,
}

impl Sample {
    fn inputs(&self) -> [f64; INPUTS] {
        let mut inputs = [self.floor_m; INPUTS];
        let values = self.features.values();
        inputs[..values.len()].copy_from_slice(&values);
        inputs
    }

    /// Returns the distance by one method of a head, m.
    pub fn distance(&self, head: &Head, how: Distance) -> f64 {
        match how {
            Distance::Network => head.network.answer(&self.features.values()),
            Distance::Gradient => head.gradient.answer(&self.features.values()),
            Distance::Rich => head.rich.answer(&self.inputs()),
            Distance::Ridge => head.ridge.answer(&self.features),
            Distance::Analytic => self.floor_m + head.floor_offset_m,
        }
    }

    /// Returns the absolute difference of the bearings, rad.
    pub fn bearing_error_rad(&self) -> f64 {
        angle(self.bearing_rad - self.true_bearing_rad).abs()
    }
}

fn angle(radians: f64) -> f64 {
    radians.sin().atan2(radians.cos())
}

/// Largest difference of the bearings of a person and of the nearest blob, rad.
const NEAR_RAD: f64 = 0.12;

/// Collector of samples from images with people at known places.
pub struct Collector {
    eyes: Eyes,
    last: Option<u64>,
    geometry: Option<Geometry>,
    /// Collected samples.
    pub samples: Vec<Sample>,
    /// Number of people that were not found.
    pub missed: u64,
}

impl Collector {
    /// Creates a collector with these settings; their model is not used.
    ///
    /// # Errors
    /// As [`Eyes::new`].
    pub fn new(config: Config) -> Result<Self> {
        let eyes = Eyes::new(config)?;
        Ok(Self { eyes, last: None, geometry: None, samples: Vec::new(), missed: 0 })
    }

    /// Adds an image with the heads of people in it, in the robot frame. The same image may come
    /// again with other people.
    ///
    /// # Errors
    /// As [`Eyes::look`].
    pub fn add(&mut self, frame: &Frame, people: &[(u64, Point3<f64>)]) -> Result<()> {
        let blobs = self.eyes.look(frame, &mut Funnel::default())?;
        // The background must not take in an image twice.
        if self.last.replace(frame.index) != Some(frame.index) {
            self.eyes.adapt(frame, &[])?;
        }
        let Some(view) = PanoramaGeometry::of(&frame.camera).filter(|_| self.eyes.is_ready())
        else {
            return Ok(());
        };
        self.geometry = Some(Geometry::of(&view));
        for (person, head) in people {
            match sample(frame, &view, &blobs, *person, head) {
                Some(sample) => self.samples.push(sample),
                None => self.missed += 1,
            }
        }
        Ok(())
    }

    /// Returns the camera geometry of the images, once there was one.
    pub fn geometry(&self) -> Option<Geometry> {
        self.geometry
    }
}

/// Returns the sample of a person: the blob with the nearest bearing.
fn sample(
    frame: &Frame,
    view: &PanoramaGeometry<'_>,
    blobs: &[Blob],
    person: u64,
    head: &Point3<f64>,
) -> Option<Sample> {
    let head = frame.camera.robot_from_camera.inverse_transform_point(head);
    let (true_bearing_rad, _) = view.panorama.mirror.direction(&head);
    let bearings = blobs.iter().map(|blob| {
        let bearing_rad = view.panorama.bearing(blob.column);
        (angle(bearing_rad - true_bearing_rad).abs(), bearing_rad, blob)
    });
    let (off_rad, bearing_rad, blob) = bearings.min_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
    let distance_m = head.xy().coords.norm();
    (off_rad < NEAR_RAD).then(|| Sample {
        features: blob.features,
        floor_m: view.floor_m(&blob.features),
        looks: view.looks(blob, distance_m),
        distance_m,
        bearing_rad,
        true_bearing_rad,
        person,
        frame: frame.index,
    })
}

/// Fits one head. The same samples and the same seed give the same head. Its standard deviations
/// are those of the errors on the samples themselves.
///
/// # Errors
/// [`Error::Other`] for fewer than ten samples.
pub fn head(samples: &[Sample], training: &Training, seed: u64) -> Result<Head> {
    if samples.len() < 10 {
        return Err(Error::Other(format!("{} samples are too few to fit", samples.len())));
    }
    let targets: Vec<f64> = samples.iter().map(|s| s.distance_m).collect();
    let three: Vec<Vec<f64>> = samples.iter().map(|s| s.features.values()[..3].to_vec()).collect();
    let all: Vec<Vec<f64>> = samples.iter().map(|s| s.inputs().to_vec()).collect();
    let flat = Line { start: 0.0, slope: 0.0 };
    let mut head = Head {
        floor_offset_m: samples.iter().map(|s| s.distance_m - s.floor_m).sum::<f64>()
            / samples.len() as f64,
        analytic_sigma: flat,
        ridge_sigma: flat,
        network_sigma: flat,
        gradient_sigma: flat,
        rich_sigma: flat,
        ridge: ridge(samples, training.ridge),
        network: training.network.network(&three, &targets, seed),
        gradient: training.gradient.network(&three, &targets, seed),
        rich: training.rich.network(&all, &targets, seed),
    };
    let answers: Vec<Answers> = samples.iter().map(|sample| sample.answers(&head)).collect();
    head.believe(samples, &answers);
    Ok(head)
}

/// Distances by all methods, in the order of [`WAYS`].
pub type Answers = [f64; WAYS.len()];

/// All methods for the distance.
pub const WAYS: [Distance; 5] =
    [Distance::Network, Distance::Gradient, Distance::Rich, Distance::Ridge, Distance::Analytic];

/// Returns for each sample the distances by a head that was fitted without the sample's part.
///
/// # Errors
/// As [`head`].
pub fn held_out(
    samples: &[Sample],
    held: HeldOut,
    training: &Training,
    seed: u64,
) -> Result<Vec<Answers>> {
    let people: BTreeSet<u64> = samples.iter().map(|s| s.person).collect();
    let mut keys = Vec::with_capacity(samples.len());
    for sample in samples {
        keys.push(match held {
            // The rank of a person, not the number, spreads few people evenly over the parts.
            HeldOut::People if people.len() > 1 => people.range(..sample.person).count() as u64,
            _ => sample.frame / training.block_frames,
        });
    }
    let mut answers = vec![[0.0; WAYS.len()]; samples.len()];
    for fold in 0..FOLDS {
        let rest = samples.iter().zip(&keys).filter(|(_, key)| **key % FOLDS != fold);
        let rest: Vec<Sample> = rest.map(|(sample, _)| *sample).collect();
        if rest.len() == samples.len() {
            continue;
        }
        let fitted = head(&rest, training, seed)?;
        for ((sample, key), answers) in samples.iter().zip(&keys).zip(&mut answers) {
            if key % FOLDS == fold {
                *answers = sample.answers(&fitted);
            }
        }
    }
    Ok(answers)
}

impl Sample {
    fn answers(&self, head: &Head) -> Answers {
        WAYS.map(|how| self.distance(head, how))
    }
}

impl Head {
    /// Sets the standard deviations from the errors of these distances.
    fn believe(&mut self, samples: &[Sample], answers: &[Answers]) {
        [
            self.network_sigma,
            self.gradient_sigma,
            self.rich_sigma,
            self.ridge_sigma,
            self.analytic_sigma,
        ] = std::array::from_fn(|way: usize| {
            spread(samples.iter().zip(answers).map(|(s, said)| (said[way], s.distance_m)))
        });
    }
}

/// Fits the standard deviation as a straight line in the distance, through the absolute errors:
/// their mean is the standard deviation times the square root of 2 / pi. Each pair is the computed
/// distance, then the true one.
fn spread(pairs: impl Iterator<Item = (f64, f64)>) -> Line {
    let mut n = 0.0;
    let mut x = 0.0;
    let mut y = 0.0;
    let mut xx = 0.0;
    let mut xy = 0.0;
    for (said, truth) in pairs {
        let error = (said - truth).abs() * (0.5 * std::f64::consts::PI).sqrt();
        (n, x, y) = (n + 1.0, x + said, y + error);
        (xx, xy) = (xx + said * said, xy + said * error);
    }
    let determinant = n * xx - x * x;
    let slope = if determinant > 1e-9 { (n * xy - x * y) / determinant } else { 0.0 };
    // A distance is not known better for being larger.
    let slope = slope.max(0.0);
    Line { start: ((y - slope * x) / n).max(0.02), slope }
}

fn ridge(samples: &[Sample], weight: f64) -> Ridge {
    fn array(values: &[f64]) -> [f64; 5] {
        std::array::from_fn(|i| values[i])
    }

    let terms: Vec<[f64; 5]> = samples.iter().map(|s| Ridge::terms(&s.features)).collect();
    let (mean, scale): (Vec<f64>, Vec<f64>) =
        (0..5).map(|i| mean_and_scale(terms.iter().map(|t| t[i]))).unzip();
    let x = DMatrix::from_fn(samples.len(), 6, |row, column| match column {
        0 => 1.0,
        i => (terms[row][i - 1] - mean[i - 1]) / scale[i - 1],
    });
    let y = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.distance_m));
    // The constant term is not shrunk: it is the mean distance.
    let mut penalties = [weight * samples.len() as f64; 6];
    penalties[0] = 0.0;
    let equations = NormalEquations::new(&x, &y);
    let solved = equations.solve(&penalties, equations.right_side());
    Ridge {
        weights: std::array::from_fn(|i| solved.as_ref().map_or(0.0, |w| w[i])),
        mean: array(&mean),
        scale: array(&scale),
    }
}

/// Returns mean and standard deviation of the appearance in some samples.
pub fn signature(samples: &[Sample]) -> Signature {
    let all = [0, 1, 2, 3].map(|i| mean_and_scale(samples.iter().map(move |s| s.looks[i])));
    Signature { mean: all.map(|(mean, _)| mean), sigma: all.map(|(_, sigma)| sigma) }
}

/// Number from which people get no head of their own.
pub const STRANGERS: u64 = 100;

/// Fits the head for all people, and one for each person below [`STRANGERS`]. Their standard
/// deviations are those of held-out samples.
///
/// # Errors
/// As [`head`].
pub fn model(
    samples: &[Sample],
    geometry: Geometry,
    training: &Training,
    seed: u64,
) -> Result<Model> {
    let mut people: BTreeMap<u64, Vec<Sample>> = BTreeMap::new();
    for sample in samples.iter().filter(|sample| sample.person < STRANGERS) {
        people.entry(sample.person).or_default().push(*sample);
    }
    let mut known = Vec::with_capacity(people.len());
    let general = believed_head(samples, HeldOut::People, training, seed)?;
    for (id, own) in &people {
        known.push(Person {
            name: format!("person-{id}"),
            signature: signature(own),
            head: believed_head(own, HeldOut::Blocks, training, mix(seed ^ id))?,
        });
    }
    Ok(Model { geometry, general, people: known })
}

/// Fits a head, with standard deviations of held-out samples.
fn believed_head(
    samples: &[Sample],
    held: HeldOut,
    training: &Training,
    seed: u64,
) -> Result<Head> {
    let mut head = head(samples, training, seed)?;
    head.believe(samples, &held_out(samples, held, training, seed)?);
    Ok(head)
}

/// `tagalong train omni-distance`: a candidate is a person at a known place; an image without
/// people comes with a candidate that is no person. The group of an example is the number of the
/// person.
pub struct DistanceTrainer {
    collector: Collector,
    training: Training,
    seed: u64,
}

impl DistanceTrainer {
    /// Creates a trainer with a detector of these settings.
    ///
    /// # Errors
    /// As [`Collector::new`].
    pub fn new(config: Config, seed: u64) -> Result<Self> {
        let collector = Collector::new(config)?;
        Ok(Self { collector, training: Training::default(), seed })
    }
}

impl Trainer for DistanceTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        let people: &[(u64, Point3<f64>)] =
            if example.is_person { &[(example.group, candidate.position)] } else { &[] };
        self.collector.add(frame, people)
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        let Some(geometry) = self.collector.geometry() else {
            return Err(Error::Other("no panorama was seen".into()));
        };
        let model = model(&self.collector.samples, geometry, &self.training, self.seed)?;
        progress(1.0);
        Ok(Fitted::new(
            model.to_text().map_err(Error::Other)?,
            figures(&self.collector, &self.training, self.seed)?,
        ))
    }
}

/// Returns the errors on held-out samples: five folds of blocks, and of people.
fn figures(collector: &Collector, training: &Training, seed: u64) -> Result<toml::Table> {
    let samples = &collector.samples;
    let count = samples.len().max(1) as f64;
    let bearing = samples.iter().map(Sample::bearing_error_rad).sum::<f64>() / count;
    let mut table = toml::Table::new();
    table.insert("samples".into(), (samples.len() as i64).into());
    table.insert("missed".into(), (collector.missed as i64).into());
    table.insert("bearing_error_deg".into(), rounded(bearing.to_degrees()));
    for (name, held) in
        [("five_folds_of_blocks", HeldOut::Blocks), ("five_folds_of_people", HeldOut::People)]
    {
        let answers = held_out(samples, held, training, seed)?;
        let errors = WAYS.iter().enumerate().map(|(way, how)| {
            let off =
                samples.iter().zip(&answers).map(|(s, said)| (said[way] - s.distance_m).abs());
            (format!("{how:?}_error_m").to_lowercase(), rounded(off.sum::<f64>() / count))
        });
        table.insert(name.into(), toml::Table::from_iter(errors).into());
    }
    Ok(table)
}

fn rounded(value: f64) -> toml::Value {
    toml::Value::Float((1e4 * value).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A person at a distance that follows from lower edge and width without noise.
    fn sample(number: u64) -> Sample {
        let distance_m = 1.0 + 0.04 * ((number * 37) % 100) as f64;
        let features = Features {
            width: 60.0 / distance_m,
            bottom: 12.0 * distance_m,
            pixels: 900.0 / distance_m + (number % 7) as f64,
            top: 9.0,
            middle: 50.0,
            core: 30.0 / distance_m,
            low: 90.0,
        };
        Sample {
            features,
            floor_m: distance_m - 0.1,
            looks: [10.0 + (number % 3) as f64, 20.0, 30.0, 1.7],
            distance_m,
            bearing_rad: 0.1,
            true_bearing_rad: 0.15,
            person: number % 10,
            frame: number,
        }
    }

    fn samples(count: u64) -> Vec<Sample> {
        (0..count).map(sample).collect()
    }

    #[test]
    fn the_spread_is_the_line_through_absolute_errors() {
        // Errors with the mean absolute value of a normal distribution of deviation 0.1 + 0.05 x.
        let half_normal = (2.0 / std::f64::consts::PI).sqrt();
        let [rising, falling] = [0.05, -0.01].map(|slope| {
            let said = (1..=40).map(|i| 0.2 * f64::from(i));
            spread(said.map(|x| (x, x + (0.1 + slope * x) * half_normal)))
        });
        let off = [rising.start - 0.1, rising.slope - 0.05];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "{rising:?}");
        // A spread that falls with the distance is replaced by its value at the mean, 4.1 m.
        assert!((falling.start - 0.059).abs() < 1e-9 && falling.slope == 0.0, "{falling:?}");
        let exact = spread([(1.0, 1.0), (2.0, 2.0)].into_iter());
        assert_eq!((exact.start, exact.slope), (0.02, 0.0));
        let one = spread([(1.0, 1.5)].into_iter());
        assert!((one.start - 0.5 / half_normal).abs() < 1e-9 && one.slope == 0.0);
    }

    #[test]
    fn the_ridge_finds_a_straight_line_and_shrinks_with_its_weight() {
        fn norm(ridge: &Ridge) -> f64 {
            ridge.weights[1..].iter().map(|w| w * w).sum::<f64>()
        }

        let mut all = samples(60);
        for sample in &mut all {
            let f = sample.features;
            sample.distance_m = 0.5 + 0.07 * f.bottom - 0.01 * f.width + 0.001 * f.pixels;
        }
        let free = ridge(&all, 0.0);
        for sample in &all {
            assert!((free.answer(&sample.features) - sample.distance_m).abs() < 1e-4);
        }
        let held = ridge(&all, 10.0);
        assert!(norm(&held) < 0.1 * norm(&free));
        assert!((held.weights[0] - free.weights[0]).abs() < 1e-6, "the mean is not held");
        // One weight of one term, by hand: x'y / (x'x + n w), with x of deviation 1.
        let only = samples(40)
            .iter()
            .map(|s| Sample { features: Features { width: 1.0, pixels: 1.0, ..s.features }, ..*s })
            .collect::<Vec<_>>();
        let heavy = ridge(&only, 1e6);
        let (mean, scale) = mean_and_scale(only.iter().map(|s| s.features.bottom));
        let product: f64 =
            only.iter().map(|s| (s.features.bottom - mean) / scale * s.distance_m).sum();
        let expected = product / (40.0 * 1e6);
        assert!((heavy.weights[1] / expected - 1.0).abs() < 1e-3, "{heavy:?} {expected}");
    }

    #[test]
    fn a_signature_is_mean_and_deviation_of_looks() {
        let of = signature(&samples(30));
        let off = of.mean.iter().zip([11.0, 20.0, 30.0, 1.7]).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{:?}", of.mean);
        assert!((of.sigma[0] - (2.0_f64 / 3.0).sqrt()).abs() < 1e-9, "{:?}", of.sigma);
        assert!(of.sigma[1] < 1e-6);
    }

    /// The analytic method of a head is the range on the floor plus a mean offset: its answer for a
    /// sample reveals the samples it was fitted to.
    #[test]
    fn answers_come_from_everybody_else() {
        fn key(held: HeldOut, sample: &Sample) -> u64 {
            match held {
                HeldOut::Blocks => sample.frame / 4 % 5,
                HeldOut::People => sample.person % 5,
            }
        }

        let mut all = samples(60);
        for (number, sample) in all.iter_mut().enumerate() {
            sample.floor_m = sample.distance_m - 0.1 * ((number * number) % 17) as f64;
        }
        let training = Training { block_frames: 4, ..quick() };
        let analytic = WAYS.iter().position(|way| *way == Distance::Analytic).unwrap();
        for held in [HeldOut::Blocks, HeldOut::People] {
            let answers = held_out(&all, held, &training, 1).unwrap();
            for (sample, said) in all.iter().zip(&answers) {
                let others = all.iter().filter(|other| key(held, other) != key(held, sample));
                let off: Vec<f64> = others.map(|other| other.distance_m - other.floor_m).collect();
                let mean = off.iter().sum::<f64>() / off.len() as f64;
                assert!((said[analytic] - sample.floor_m - mean).abs() < 1e-9, "{held:?}");
            }
        }
        // With one person alone, blocks are held out in both cases.
        let alone: Vec<Sample> = all.iter().map(|s| Sample { person: 3, ..*s }).collect();
        let [by_people, by_blocks] = [HeldOut::People, HeldOut::Blocks]
            .map(|held| held_out(&alone, held, &training, 1).unwrap());
        assert_eq!(by_people, by_blocks);
    }

    fn quick() -> Training {
        fn few(fit: Fit) -> Fit {
            Fit { restarts: 1, steps: 5, ..fit }
        }

        let training = Training::default();
        Training {
            network: few(training.network),
            gradient: few(training.gradient),
            rich: few(training.rich),
            ..training
        }
    }

    #[test]
    fn a_model_knows_people_and_no_strangers_and_doubts_itself_by_what_it_was_not_fitted_to() {
        let mut all = samples(60);
        for (number, sample) in all.iter_mut().enumerate() {
            sample.person = [3, 7, STRANGERS][number % 3];
            sample.floor_m -= 0.01 * ((number * 7) % 5) as f64;
        }
        let geometry = Geometry { size: [480, 120], elevations_deg: [8.0, -43.0], height_m: 1.5 };
        let model = model(&all, geometry, &quick(), 1).unwrap();
        let names: Vec<&str> = model.people.iter().map(|person| person.name.as_str()).collect();
        assert_eq!(names, ["person-3", "person-7"]);
        let own: Vec<Sample> = all.iter().filter(|s| s.person == 3).copied().collect();
        let mean = own.iter().map(|s| s.distance_m - s.floor_m).sum::<f64>() / own.len() as f64;
        assert!((model.people[0].head.floor_offset_m - mean).abs() < 1e-12);
        assert_eq!(model.people[0].signature, signature(&own));
        for (held, samples, head) in [
            (HeldOut::People, &all, &model.general),
            (HeldOut::Blocks, &own, &model.people[0].head),
        ] {
            let seed = if held == HeldOut::People { 1 } else { mix(1 ^ 3) };
            let said = held_out(samples, held, &quick(), seed).unwrap();
            let lines = [
                head.network_sigma,
                head.gradient_sigma,
                head.rich_sigma,
                head.ridge_sigma,
                head.analytic_sigma,
            ];
            for (way, line) in lines.into_iter().enumerate() {
                let pairs = samples.iter().zip(&said).map(|(s, said)| (said[way], s.distance_m));
                assert_eq!(line, spread(pairs), "{way}");
            }
        }
    }

    #[test]
    fn a_card_has_the_means_of_what_is_off() {
        let collector = Collector {
            samples: samples(40),
            missed: 3,
            ..Collector::new(Config::default()).unwrap()
        };
        let card = figures(&collector, &quick(), 1).unwrap();
        assert_eq!(card["samples"].as_integer(), Some(40));
        assert_eq!(card["missed"].as_integer(), Some(3));
        assert_eq!(card["bearing_error_deg"].as_float(), Some(2.8648));
        let folds = card["five_folds_of_people"].as_table().unwrap();
        assert_eq!(folds.len(), WAYS.len());
        // The floor is 0.1 m short for all samples, so the held-out mean corrects it.
        assert_eq!(folds["analytic_error_m"].as_float(), Some(0.0));
        assert!(folds.contains_key("gradient_error_m"));
        assert_eq!(rounded(0.123_449), toml::Value::Float(0.1234));
    }

    #[test]
    fn bearings_differ_by_the_shorter_way_round() {
        fn off(a: f64, b: f64) -> f64 {
            Sample { bearing_rad: a, true_bearing_rad: b, ..sample(0) }.bearing_error_rad()
        }

        assert!((off(3.1, -3.1) - (std::f64::consts::TAU - 6.2)).abs() < 1e-12);
        assert!((off(-0.2, 0.1) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn ten_samples_are_enough_and_nine_are_not() {
        assert!(head(&samples(10), &quick(), 1).is_ok() && head(&samples(9), &quick(), 1).is_err());
    }
}
