//! Fits the distance to people whose place is known.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Point3};
use tagalong_core::{Detection, Error, Example, Fitted, Frame, Funnel, Result, Trainer};
use tagalong_learn::mix;

use crate::model::INPUTS;
use crate::network::split;
use crate::{
    Blob, Config, Distance, Eyes, Features, Geometry, Head, Line, Model, Network, Person, Ridge,
    Signature, View,
};

/// How networks are fitted: steps along the gradient of the mean square error
/// over all samples, with momentum. What is returned is the best of all steps of
/// all restarts on the samples held out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Training {
    /// Hidden units of the paper's network.
    pub hidden: usize,
    /// Hidden units of the rich network.
    pub rich_hidden: usize,
    /// Rate of learning of the paper's network (P5, section 4.4) ...
    pub rate: f64,
    /// ... and of the rich one, whose inputs resemble each other.
    pub rich_rate: f64,
    /// Part of the last step that is taken again.
    pub momentum: f64,
    /// Most steps of the paper's network ...
    pub epochs: usize,
    /// ... and of the rich one.
    pub rich_epochs: usize,
    /// A fit ends after so many steps without progress on what is held out.
    pub patience: usize,
    /// Fits from other random weights.
    pub restarts: u64,
    /// One block in so many is held out to stop in time.
    pub held_out: u64,
    /// Weight of the squares of the ridge's weights, for each sample.
    pub ridge: f64,
    /// Images of a block: neighbours are near-duplicates and stay together.
    pub block_frames: u64,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            hidden: 4,
            rich_hidden: 8,
            rate: 0.3,
            rich_rate: 0.03,
            momentum: 0.9,
            epochs: 2000,
            rich_epochs: 4000,
            patience: 300,
            restarts: 5,
            held_out: 5,
            ridge: 1e-4,
            block_frames: 15,
        }
    }
}

/// A person whose place is known, as the detector saw them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// What was measured.
    pub features: Features,
    /// Where the ray of the lowest row meets the floor, m.
    pub floor_m: f64,
    /// Colours of the upper body, and the stature at the true distance, m.
    pub looks: [f64; 4],
    /// True distance of the head from the axis, m.
    pub distance_m: f64,
    /// Bearing as measured, in the camera frame, rad.
    pub bearing_rad: f64,
    /// True bearing, rad.
    pub true_bearing_rad: f64,
    /// Who it is.
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

    /// The distance by one way of a head, m.
    pub fn distance(&self, head: &Head, how: Distance) -> f64 {
        match how {
            Distance::Network => head.network.answer(&self.features.values()),
            Distance::Rich => head.rich.answer(&self.inputs()),
            Distance::Ridge => head.ridge.answer(&self.features),
            Distance::Analytic => self.floor_m + head.floor_offset_m,
        }
    }

    /// Difference of the bearings, rad.
    pub fn bearing_error_rad(&self) -> f64 {
        angle(self.bearing_rad - self.true_bearing_rad).abs()
    }
}

fn angle(radians: f64) -> f64 {
    radians.sin().atan2(radians.cos())
}

/// Somebody is the run of columns nearest to their bearing, within this, rad.
const NEAR_RAD: f64 = 0.12;

/// Watches images with people whose places are known.
pub struct Collector {
    eyes: Eyes,
    last: Option<u64>,
    geometry: Option<Geometry>,
    /// What was collected.
    pub samples: Vec<Sample>,
    /// People who were not found.
    pub missed: u64,
}

impl Collector {
    /// Sees with these settings; models are of no importance.
    ///
    /// # Errors
    /// As [`Eyes::new`].
    pub fn new(config: Config) -> Result<Self> {
        let eyes = Eyes::new(config)?;
        Ok(Self { eyes, last: None, geometry: None, samples: Vec::new(), missed: 0 })
    }

    /// Takes in an image with heads of people in it, in the robot frame. The
    /// same image may come again with other people.
    ///
    /// # Errors
    /// As [`Eyes::look`].
    pub fn add(&mut self, frame: &Frame, people: &[(u64, Point3<f64>)]) -> Result<()> {
        let blobs = self.eyes.look(frame, &mut Funnel::default())?;
        if self.last.replace(frame.index) != Some(frame.index) {
            self.eyes.adapt(frame)?;
        }
        let Some(view) = View::of(&frame.camera).filter(|_| self.eyes.is_ready()) else {
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

    /// The camera of the images, once one was seen.
    pub fn geometry(&self) -> Option<Geometry> {
        self.geometry
    }
}

/// Somebody as they are seen.
fn sample(
    frame: &Frame,
    view: &View<'_>,
    blobs: &[Blob],
    person: u64,
    head: &Point3<f64>,
) -> Option<Sample> {
    let head = frame.camera.robot_from_camera.inverse_transform_point(head);
    let (true_bearing_rad, _) = view.panorama.mirror.direction(&head);
    let bearing = |blob: &Blob| view.panorama.bearing(blob.column);
    let off = |blob: &&Blob| angle(bearing(blob) - true_bearing_rad).abs();
    let blob = blobs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
    let distance_m = head.xy().coords.norm();
    (off(&blob) < NEAR_RAD).then(|| Sample {
        features: blob.features,
        floor_m: view.floor_m(&blob.features),
        looks: view.looks(blob, distance_m),
        distance_m,
        bearing_rad: bearing(blob),
        true_bearing_rad,
        person,
        frame: frame.index,
    })
}

/// Fits one head. The same samples and the same seed give the same head.
///
/// # Errors
/// [`Error::Other`] for fewer than ten samples.
pub fn head(samples: &[Sample], training: &Training, seed: u64) -> Result<Head> {
    if samples.len() < 10 {
        return Err(Error::Other(format!("{} samples are too few to fit", samples.len())));
    }
    let block = |s: &Sample| (s.frame / training.block_frames) ^ seed;
    let held = |s: &Sample| mix(block(s)).is_multiple_of(training.held_out);
    let targets: Vec<f64> = samples.iter().map(|s| s.distance_m).collect();
    let held: Vec<bool> = samples.iter().map(held).collect();
    let printed: Vec<Vec<f64>> =
        samples.iter().map(|s| s.features.values()[..3].to_vec()).collect();
    let all: Vec<Vec<f64>> = samples.iter().map(|s| s.inputs().to_vec()).collect();
    let data = |inputs| Data { inputs, targets: &targets, held: &held };
    let long = Training { epochs: training.rich_epochs, ..*training };
    let network = data(&printed).network(training.hidden, training.rate, training, seed);
    let rich = data(&all).network(training.rich_hidden, training.rich_rate, &long, seed);
    let flat = Line { start: 0.0, slope: 0.0 };
    let mut head = Head {
        floor_offset_m: samples.iter().map(|s| s.distance_m - s.floor_m).sum::<f64>()
            / samples.len() as f64,
        analytic_sigma: flat,
        ridge_sigma: flat,
        network_sigma: flat,
        rich_sigma: flat,
        ridge: ridge(samples, training.ridge),
        network,
        rich,
    };
    head.analytic_sigma = spread(samples, &head, Distance::Analytic);
    head.ridge_sigma = spread(samples, &head, Distance::Ridge);
    head.network_sigma = spread(samples, &head, Distance::Network);
    head.rich_sigma = spread(samples, &head, Distance::Rich);
    Ok(head)
}

/// Standard deviation by distance: a line through the absolute errors, which are
/// the standard deviation times the square root of 2 / pi.
fn spread(samples: &[Sample], head: &Head, how: Distance) -> Line {
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for sample in samples {
        let d = sample.distance(head, how);
        let error = (d - sample.distance_m).abs() * (0.5 * std::f64::consts::PI).sqrt();
        (n, x, y, xx, xy) = (n + 1.0, x + d, y + error, xx + d * d, xy + d * error);
    }
    let determinant = n * xx - x * x;
    let slope = if determinant > 1e-9 { (n * xy - x * y) / determinant } else { 0.0 };
    // Nobody is known better for being farther away.
    let slope = slope.max(0.0);
    Line { start: ((y - slope * x) / n).max(0.02), slope }
}

fn ridge(samples: &[Sample], weight: f64) -> Ridge {
    let terms: Vec<[f64; 5]> = samples.iter().map(|s| Ridge::terms(&s.features)).collect();
    let (mean, scale): (Vec<f64>, Vec<f64>) =
        (0..5).map(|i| mean_and_scale(terms.iter().map(|t| t[i]))).unzip();
    let x = DMatrix::from_fn(samples.len(), 6, |row, column| match column {
        0 => 1.0,
        i => (terms[row][i - 1] - mean[i - 1]) / scale[i - 1],
    });
    let y = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.distance_m));
    let mut normal = x.transpose() * &x;
    (1..6).for_each(|i| normal[(i, i)] += weight * samples.len() as f64);
    let solved = normal.cholesky().map(|c| c.solve(&(x.transpose() * y)));
    let array = |values: &[f64]| std::array::from_fn(|i| values[i]);
    Ridge {
        weights: std::array::from_fn(|i| solved.as_ref().map_or(0.0, |w| w[i])),
        mean: array(&mean),
        scale: array(&scale),
    }
}

/// Mean, and standard deviation that is never 0.
fn mean_and_scale(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt().max(1e-9))
}

/// What a network is fitted to.
struct Data<'a> {
    inputs: &'a [Vec<f64>],
    targets: &'a [f64],
    held: &'a [bool],
}

impl Data<'_> {
    fn network(&self, hidden: usize, rate: f64, training: &Training, seed: u64) -> Network {
        let start = |restart: u64| self.random(hidden, mix(seed ^ (restart << 32)));
        let fits = (0..training.restarts.max(1)).map(|r| self.fit(start(r), rate, training));
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| start(0), |(_, network)| network)
    }

    /// Small random weights.
    fn random(&self, hidden: usize, seed: u64) -> Network {
        let count = self.inputs.first().map_or(0, Vec::len);
        let (mean, scale) =
            (0..count).map(|i| mean_and_scale(self.inputs.iter().map(move |x| x[i]))).unzip();
        let (target, deviation) = mean_and_scale(self.targets.iter().copied());
        let mut state = seed;
        let mut weight = |reach: f64| {
            state = mix(state);
            reach * (state as f64 / u64::MAX as f64 * 2.0 - 1.0)
        };
        let reach = 1.0 / (count as f64 + 1.0).sqrt();
        let unit =
            |weight: &mut dyn FnMut(f64) -> f64| (0..=count).map(|_| weight(reach)).collect();
        let hidden_weights = (0..hidden).map(|_| unit(&mut weight)).collect();
        let output = (0..=hidden).map(|_| weight(0.5)).collect();
        Network { mean, scale, target: [target, deviation], hidden: hidden_weights, output }
    }

    /// The best network on what is held out, and its mean square error there.
    fn fit(&self, start: Network, rate: f64, training: &Training) -> (f64, Network) {
        let scaled: Vec<Vec<f64>> = self
            .inputs
            .iter()
            .map(|x| (0..x.len()).map(|i| start.scaled(x, i)).collect())
            .collect();
        let [mean, scale] = start.target;
        let targets: Vec<f64> = self.targets.iter().map(|t| (t - mean) / scale).collect();
        let (mut network, mut best) = (start.clone(), (f64::INFINITY, start));
        let mut step = Weights::of(&network).zeros();
        let mut since = 0;
        for _ in 0..training.epochs {
            let (held_error, gradient) = self.gradient(&network, &scaled, &targets);
            if held_error < best.0 {
                best = (held_error, network.clone());
                since = 0;
            }
            since += 1;
            if since > training.patience || !held_error.is_finite() {
                break;
            }
            step.blend(training.momentum, &gradient, -rate);
            step.add_to(&mut network);
        }
        best
    }

    /// Mean square error on what is held out, and the gradient of half of it on
    /// everything else.
    fn gradient(&self, network: &Network, inputs: &[Vec<f64>], targets: &[f64]) -> (f64, Weights) {
        let mut gradient = Weights::of(network).zeros();
        let (mut held, mut held_count, mut count) = (0.0, 0.0_f64, 0.0_f64);
        let mut units = vec![0.0; network.hidden.len()];
        let (output, bias) = split(&network.output);
        for ((x, target), is_held) in inputs.iter().zip(targets).zip(self.held) {
            for (unit, weights) in units.iter_mut().zip(&network.hidden) {
                let (weights, bias) = split(weights);
                *unit = (weights.iter().zip(x).map(|(w, x)| w * x).sum::<f64>() + bias).tanh();
            }
            let answer = output.iter().zip(&units).map(|(w, u)| w * u).sum::<f64>() + bias;
            let error = answer - target;
            if *is_held {
                (held, held_count) = (held + error * error, held_count + 1.0);
            } else {
                count += 1.0;
                gradient.add_sample(error, output, &units, x);
            }
        }
        gradient.scale(1.0 / count.max(1.0));
        // With nothing held out the last step is the best one.
        (if held_count > 0.0 { held / held_count } else { 0.0 }, gradient)
    }
}

/// The weights of a network, or a step along them.
struct Weights {
    hidden: Vec<Vec<f64>>,
    output: Vec<f64>,
}

impl Weights {
    fn of(network: &Network) -> Self {
        Self { hidden: network.hidden.clone(), output: network.output.clone() }
    }

    fn zeros(mut self) -> Self {
        self.scale(0.0);
        self
    }

    fn all(&mut self) -> impl Iterator<Item = &mut f64> {
        self.hidden.iter_mut().flatten().chain(&mut self.output)
    }

    fn scale(&mut self, by: f64) {
        self.all().for_each(|w| *w *= by);
    }

    /// `self = keep * self + part * other`.
    fn blend(&mut self, keep: f64, other: &Self, part: f64) {
        let others = other.hidden.iter().flatten().chain(&other.output);
        for (w, o) in self.all().zip(others) {
            *w = keep * *w + part * o;
        }
    }

    fn add_to(&self, network: &mut Network) {
        let weights = network.hidden.iter_mut().flatten().chain(&mut network.output);
        for (w, step) in weights.zip(self.hidden.iter().flatten().chain(&self.output)) {
            *w += step;
        }
    }

    /// Adds the gradient of half the squared error of one sample.
    fn add_sample(&mut self, error: f64, output: &[f64], units: &[f64], x: &[f64]) {
        let rows = self.hidden.iter_mut().zip(&mut self.output).zip(output.iter().zip(units));
        for ((row, out), (weight, unit)) in rows {
            *out += error * unit;
            let back = error * weight * (1.0 - unit * unit);
            for (g, x) in row.iter_mut().zip(x.iter().chain(&[1.0])) {
                *g += back * x;
            }
        }
        if let Some(bias) = self.output.last_mut() {
            *bias += error;
        }
    }
}

/// Mean and deviation of what somebody looks like.
fn signature(samples: &[Sample]) -> Signature {
    let of = |i: usize| mean_and_scale(samples.iter().map(move |s| s.looks[i]));
    let all = [of(0), of(1), of(2), of(3)];
    Signature { mean: all.map(|(mean, _)| mean), sigma: all.map(|(_, sigma)| sigma) }
}

/// People with this number and higher ones get no head of their own.
pub const STRANGERS: u64 = 100;

/// Fits everybody's head, and one for each person below [`STRANGERS`].
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
    let person = |(id, own): (&u64, &Vec<Sample>)| {
        Ok(Person {
            name: format!("person-{id}"),
            signature: signature(own),
            head: head(own, training, mix(seed ^ id))?,
        })
    };
    Ok(Model {
        geometry,
        general: head(samples, training, seed)?,
        people: people.iter().map(person).collect::<Result<_>>()?,
    })
}

/// `tagalong train omni-distance`: a candidate is somebody whose place is known;
/// an image without people comes with a candidate that is no person. The group
/// of an example is who it is.
pub struct DistanceTrainer {
    collector: Collector,
    training: Training,
    seed: u64,
}

impl DistanceTrainer {
    /// A trainer with a detector of these settings.
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
        Ok(Fitted {
            model: model.to_text(),
            figures: figures(&self.collector, &self.training, self.seed)?,
        })
    }
}

/// Held-out errors: five folds of blocks.
fn figures(collector: &Collector, training: &Training, seed: u64) -> Result<toml::Table> {
    let mut table = toml::Table::new();
    let mut put = |key: &str, value: f64| {
        table.insert(key.into(), toml::Value::Float((1e4 * value).round() / 1e4));
    };
    let samples = &collector.samples;
    let bearing = samples.iter().map(Sample::bearing_error_rad).sum::<f64>();
    put("bearing_error_deg", (bearing / samples.len().max(1) as f64).to_degrees());
    let mut sums = [0.0; 4];
    const WAYS: [(&str, Distance); 4] = [
        ("network_error_m", Distance::Network),
        ("rich_error_m", Distance::Rich),
        ("ridge_error_m", Distance::Ridge),
        ("analytic_error_m", Distance::Analytic),
    ];
    for fold in 0..5 {
        let block = |s: &&Sample| s.frame / training.block_frames % 5 == fold;
        let (test, rest): (Vec<&Sample>, Vec<&Sample>) = samples.iter().partition(block);
        let rest: Vec<Sample> = rest.into_iter().copied().collect();
        let fitted = head(&rest, training, seed)?;
        for (sum, (_, how)) in sums.iter_mut().zip(WAYS) {
            *sum +=
                test.iter().map(|s| (s.distance(&fitted, how) - s.distance_m).abs()).sum::<f64>();
        }
    }
    for (sum, (key, _)) in sums.iter().zip(WAYS) {
        put(key, sum / samples.len().max(1) as f64);
    }
    put("samples", samples.len() as f64);
    put("missed", collector.missed as f64);
    Ok(table)
}
