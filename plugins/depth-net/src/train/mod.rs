//! Fits a [`Model`] to annotated frames: first to simulated rooms, then to simulated and real
//! ones. The second part is repeated with each real room left out; the answers there give the
//! figures of the card and calibrate the log-odds.

mod sample;
mod score;
mod targets;

use tagalong_config::{AnnotatedPerson, Example, Fitted, Trainer, check_settings};
use tagalong_core::{Detection, Error, Frame, Result};
use tagalong_learn::{Adam, Line, mix, pace, platt, side_by_side};

use self::sample::{Draws, Sample};
use self::score::Score;
use self::targets::Targets;
use crate::net::RARE;
use crate::{FloorMap, Model, Net, Pass, Training};

/// A batch is always summed in so many parts, however many cores there are: the same
/// bytes on all machines.
const PARTS: usize = 4;
/// Weights are kept in so many steps per unit.
const STEPS: f32 = 1e4;
/// One in so many simulated scenes is for testing.
const TEST_SHARE: u64 = 10;

/// Collects annotated frames and fits models to them.
pub struct DepthNetTrainer {
    training: Training,
    seed: u64,
    samples: Vec<Sample>,
}

/// A set of samples, by their indices.
type Chosen = Vec<usize>;

impl DepthNetTrainer {
    /// Creates a trainer without samples.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges.
    pub fn new(training: Training, seed: u64) -> Result<Self> {
        check_settings(&training)?;
        Ok(Self { training, seed, samples: Vec::new() })
    }

    fn chosen(&self, is_chosen: impl Fn(&Sample) -> bool) -> Chosen {
        (0..self.samples.len()).filter(|k| is_chosen(&self.samples[*k])).collect()
    }

    /// Returns the names of the real rooms, in the order in which they came.
    fn rooms(&self) -> Vec<String> {
        let mut rooms: Vec<String> = Vec::new();
        for room in self.samples.iter().filter_map(|sample| sample.room.as_ref()) {
            if !rooms.contains(room) {
                rooms.push(room.clone());
            }
        }
        rooms
    }

    /// Trains a network further: `share` of each batch are samples from `real`.
    fn trained(
        &self,
        mut net: Net,
        steps: usize,
        [simulated, real]: [&Chosen; 2],
        rate: f64,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Net> {
        let mut adam = Adam::default();
        let Training { batch, decay, real_share, .. } = self.training;
        let from_real = match (simulated.is_empty(), real.is_empty()) {
            (_, true) => 0,
            (true, false) => batch,
            _ => (real_share * batch as f64).round() as usize,
        };
        let mut draws = Draws(mix(self.seed ^ 0x5eed));
        for step in 0..steps {
            let few: Vec<(usize, u64)> = (0..batch)
                .map(|k| if k < from_real { real } else { simulated })
                .map(|chosen| (chosen[draws.below(chosen.len())], draws.next()))
                .collect();
            let gradient = self.gradient(&net, &few)?;
            let rate = rate * pace(step as f64 / steps as f64);
            adam.step(net.parts_mut(), &gradient.parts(), rate as f32, decay as f32);
            progress((step + 1) as f64 / steps as f64);
        }
        Ok(net)
    }

    /// Returns how the loss of a batch depends on the weights; each sample comes with the seed of
    /// its variation.
    fn gradient(&self, net: &Net, batch: &[(usize, u64)]) -> Result<Net> {
        let chunks: Vec<&[(usize, u64)]> = batch.chunks(batch.len().div_ceil(PARTS)).collect();
        let of_part = |part: &&[(usize, u64)]| {
            let (mut gradient, mut pass, mut cells) = (Net::default(), Pass::default(), 0.0);
            for (sample, seed) in *part {
                let (map, targets) = self.samples[*sample].varied(&mut Draws(*seed));
                net.look(&map, &mut pass);
                let mut of = Pass::default();
                cells += targets.slopes(&pass, &mut of);
                net.learn(&map, &pass, &mut gradient, &mut of);
            }
            Ok((gradient, cells))
        };
        let (mut sum, mut cells) = (Net::default(), 0.0);
        for (part, of_part) in side_by_side(&chunks, of_part, &mut |_| {})? {
            cells += of_part;
            let pairs =
                sum.parts_mut().into_iter().flatten().zip(part.parts().into_iter().flatten());
            pairs.for_each(|(sum, value)| *sum += value);
        }
        // Batches with few people would otherwise make long steps.
        let scale = 1.0 / f32::max(cells, batch.len() as f32);
        sum.parts_mut().into_iter().flatten().for_each(|value| *value *= scale);
        Ok(sum)
    }

    /// Returns the answers of a network to some samples, unvaried.
    fn scored(&self, net: &Net, chosen: &Chosen) -> Score {
        let (mut score, mut pass) = (Score::default(), Pass::default());
        for sample in chosen {
            let sample = &self.samples[*sample];
            let map = FloorMap::new(&sample.camera, &sample.depth());
            net.look(&map, &mut pass);
            score.add(&map, &pass, sample);
        }
        score
    }
}

impl Trainer for DepthNetTrainer {
    fn add(&mut self, _: &Frame, _: &Detection, _: Example) -> Result<()> {
        Err(Error::Other("depth-net is trained on whole frames, not on candidates".into()))
    }

    fn add_frame(
        &mut self,
        frame: &Frame,
        people: &[AnnotatedPerson],
        room: Option<&str>,
        group: u64,
    ) -> Result<()> {
        self.samples.push(Sample::new(frame, people, room, group)?);
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        let is_test = |sample: &Sample| sample.group % TEST_SHARE == TEST_SHARE - 1;
        let simulated = self.chosen(|sample| sample.room.is_none() && !is_test(sample));
        let test = self.chosen(|sample| sample.room.is_none() && is_test(sample));
        if simulated.is_empty() {
            return Err(Error::Other("there are no simulated rooms to begin with".into()));
        }
        let mut steps = Steps::new(&self.training, self.rooms().len(), progress);
        let begun = self.begun(&simulated, &mut steps)?;
        let in_simulation = self.scored(&begun, &test);
        let mut figures = toml::Table::new();
        figures.insert("simulated, never seen".into(), in_simulation.figures().into());
        let folds = self.folds(&begun, &simulated, &mut steps)?;
        if folds.is_empty() {
            let model = finished(begun, &in_simulation);
            return Ok(Fitted { model: model.to_text(), figures, ..Fitted::default() });
        }
        for fold in &folds {
            let before = self.scored(&begun, &self.in_room(&fold.room));
            figures.insert(format!("{}: simulation only", fold.room), before.figures().into());
            figures.insert(format!("{}: left out", fold.room), fold.score.figures().into());
        }
        let held_out = Score::all(&folds.iter().map(|fold| &fold.score).collect::<Vec<_>>());
        figures.insert("all rooms left out".into(), held_out.figures().into());
        let real = self.chosen(|sample| sample.room.is_some());
        let net = self.further(begun, [&simulated, &real], &mut steps)?;
        let model = finished(net, &held_out).to_text();
        Ok(Fitted { model, figures, without: models_without(folds, &in_simulation) })
    }
}

/// A real room, the network that has seen all other rooms, and its answers in this one.
struct Fold {
    room: String,
    net: Net,
    score: Score,
}

impl DepthNetTrainer {
    fn in_room(&self, room: &str) -> Chosen {
        self.chosen(|sample| sample.room.as_deref() == Some(room))
    }

    /// Trains on simulated rooms alone.
    fn begun(&self, simulated: &Chosen, steps: &mut Steps<'_>) -> Result<Net> {
        let Training { steps: count, rate, .. } = self.training;
        let first = start(self.seed);
        self.trained(first, count, [simulated, &Chosen::new()], rate, &mut |part| {
            steps.tell(count, part);
        })
    }

    /// Trains on simulated and real rooms.
    fn further(&self, net: Net, samples: [&Chosen; 2], steps: &mut Steps<'_>) -> Result<Net> {
        let Training { real_steps: count, rate, .. } = self.training;
        self.trained(net, count, samples, 0.5 * rate, &mut |part| steps.tell(count, part))
    }

    /// Leaves out each real room once.
    fn folds(&self, begun: &Net, simulated: &Chosen, steps: &mut Steps<'_>) -> Result<Vec<Fold>> {
        let mut folds = Vec::new();
        for room in self.rooms() {
            let others =
                self.chosen(|sample| sample.room.as_ref().is_some_and(|other| *other != room));
            let net = self.further(begun.clone(), [simulated, &others], steps)?;
            let score = self.scored(&net, &self.in_room(&room));
            folds.push(Fold { room, net, score });
        }
        Ok(folds)
    }
}

/// Progress over all trainings, in steps.
struct Steps<'a> {
    done: usize,
    all: usize,
    progress: &'a mut dyn FnMut(f64),
}

impl<'a> Steps<'a> {
    fn new(training: &Training, rooms: usize, progress: &'a mut dyn FnMut(f64)) -> Self {
        let further = if rooms == 0 { 0 } else { (rooms + 1) * training.real_steps };
        Self { done: 0, all: training.steps + further, progress }
    }

    /// Tells how much of a training of `count` steps is done; the next one follows after all of it.
    fn tell(&mut self, count: usize, part: f64) {
        (self.progress)((self.done as f64 + part * count as f64) / self.all as f64);
        if part >= 1.0 {
            self.done += count;
        }
    }
}

/// Returns the models of the folds. Each is calibrated by the answers of the other folds, because
/// those in its own room would tell it about that room; a single one by those in simulation.
fn models_without(folds: Vec<Fold>, in_simulation: &Score) -> Vec<(String, String)> {
    let others = |own: usize| {
        let others = folds.iter().enumerate().filter(|(at, _)| *at != own);
        let scores: Vec<&Score> = others.map(|(_, fold)| &fold.score).collect();
        if scores.is_empty() { in_simulation.clone() } else { Score::all(&scores) }
    };
    let calibrations: Vec<Score> = (0..folds.len()).map(others).collect();
    let model = |(fold, score): (Fold, Score)| (fold.room, finished(fold.net, &score).to_text());
    folds.into_iter().zip(calibrations).map(model).collect()
}

/// Rounds the weights as in a file and calibrates the log-odds by answers that were held out.
fn finished(mut net: Net, held_out: &Score) -> Model {
    let Line { slope, offset } = platt(&held_out.answers());
    let thousandths = |value: f64| (value * 1e3).round() / 1e3;
    for value in net.parts_mut().into_iter().flatten() {
        *value = (*value * STEPS).round() / STEPS;
    }
    Model::new(net, thousandths(slope).max(1e-3), thousandths(offset))
}

/// Returns weights by chance, as large as keeps the signal (He, Zhang, Ren and Sun, ICCV 2015).
pub(crate) fn start(seed: u64) -> Net {
    let mut net = Net::default();
    let mut draws = Draws(mix(seed));
    for (part, inputs) in net.parts_mut().into_iter().zip(Net::INPUTS) {
        let limit = if inputs > 0 { (6.0 / inputs as f32).sqrt() } else { 0.0 };
        part.iter_mut().for_each(|value| *value = limit * draws.between(-1.0, 1.0) as f32);
    }
    if let Some([_, .., bias]) = net.parts_mut().get_mut(..) {
        bias[0] = RARE;
    }
    net
}
