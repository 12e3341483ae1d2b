//! Fits a [`Model`] to annotated frames: first to simulated rooms, then to simulated and real ones.
//! The second part is repeated with each real room left out; the outputs on that room give the
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
        let from_real =
            if real.is_empty() { 0 } else { (real_share * batch as f64).round() as usize };
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
        let parts = side_by_side(
            &chunks,
            |part| {
                let mut gradient = Net::default();
                let mut pass = Pass::default();
                let mut cells = 0.0;
                for (sample, seed) in *part {
                    let (map, targets) = self.samples[*sample].varied(&mut Draws(*seed));
                    net.look(&map, &mut pass);
                    let mut of = Pass::default();
                    cells += targets.slopes(&pass, &mut of);
                    net.learn(&map, &pass, &mut gradient, &mut of);
                }
                Ok((gradient, cells))
            },
            &mut |_| {},
        )?;
        let mut sum = Net::default();
        let mut cells = 0.0;
        for (part, of_part) in parts {
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
        let mut score = Score::default();
        let mut pass = Pass::default();
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
        fn is_test(sample: &Sample) -> bool {
            sample.group % TEST_SHARE == TEST_SHARE - 1
        }

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
            return Ok(Fitted::new(model.to_text(), figures));
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
        Ok(Fitted::new(model, figures).with_rooms_left_out(models_without(folds, &in_simulation)))
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
    let mut calibrations = Vec::with_capacity(folds.len());
    for own in 0..folds.len() {
        let others = folds.iter().enumerate().filter(|(at, _)| *at != own);
        let scores: Vec<&Score> = others.map(|(_, fold)| &fold.score).collect();
        calibrations.push(if scores.is_empty() {
            in_simulation.clone()
        } else {
            Score::all(&scores)
        });
    }
    folds
        .into_iter()
        .zip(calibrations)
        .map(|(fold, score)| (fold.room, finished(fold.net, &score).to_text()))
        .collect()
}

/// Rounds the weights as in a file and calibrates the log-odds by answers that were held out.
fn finished(mut net: Net, held_out: &Score) -> Model {
    fn thousandths(value: f64) -> f64 {
        (value * 1e3).round() / 1e3
    }

    let Line { slope, offset } = platt(&held_out.answers());
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point3;
    use tagalong_conformance::figure::{Figure, World};
    use tagalong_core::{EgoMotion, Stamp};
    use tagalong_geometry::{Camera, Pinhole};

    use super::*;

    /// Adds a frame with a person 2.5 m away, or with none.
    fn add(trainer: &mut DepthNetTrainer, is_person: bool, room: Option<&str>, group: u64) {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(125.0, 160, 120), 160, 120, 1.2, 0.0, 0.0));
        let figures = if is_person { vec![Figure::at(2.5, 0.4)] } else { Vec::new() };
        let images = World::with(&figures).draw(&camera);
        let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images);
        let head = Point3::new(2.5, 0.4, 1.6);
        let person = AnnotatedPerson::new(head);
        trainer.add_frame(&frame, &vec![person; figures.len()], room, group).unwrap();
    }

    fn trainer(training: Training) -> DepthNetTrainer {
        DepthNetTrainer::new(training, 3).unwrap()
    }

    fn values(net: &Net) -> Vec<f32> {
        net.parts().into_iter().flatten().copied().collect()
    }

    /// Returns the largest difference of two networks relative to the largest value.
    fn apart(a: &[f32], b: &[f32]) -> f32 {
        fn largest(values: &mut dyn Iterator<Item = f32>) -> f32 {
            values.fold(0.0, f32::max)
        }

        let most = largest(&mut a.iter().map(|value| value.abs()));
        largest(&mut a.iter().zip(b).map(|(a, b)| (a - b).abs())) / most
    }

    #[test]
    fn the_gradient_of_a_batch_is_a_mean_over_cells_of_people_or_over_frames() {
        let mut trainer = trainer(Training::default());
        add(&mut trainer, true, None, 0);
        add(&mut trainer, false, None, 1);
        let net = start(5);
        let person = (0, 11);
        let empty = (1, 12);
        let batches =
            [vec![person], vec![empty], vec![person; 2], vec![empty; 5], vec![person, empty]];
        let [of_person, of_empty, twice, five_times, both] =
            batches.map(|batch| values(&trainer.gradient(&net, &batch).unwrap()));
        assert!(apart(&of_person, &twice) < 1e-4);
        assert!(apart(&of_empty, &five_times) < 1e-4, "in four parts of unlike size");
        // Both together: the sum of their slopes over the cells of the person.
        let (_, targets) = trainer.samples[0].varied(&mut Draws(person.1));
        let cells = targets.places().len() as f32;
        assert!(cells > 2.0, "{cells}");
        let sum: Vec<f32> =
            of_person.iter().zip(&of_empty).map(|(person, empty)| person + empty / cells).collect();
        assert!(apart(&sum, &both) < 1e-3);
    }

    #[test]
    fn a_batch_has_the_share_of_real_frames_that_is_set() {
        fn training(real_share: f64) -> Training {
            Training { batch: 5, real_share, ..Training::default() }
        }

        // Real frames are empty, simulated ones have a person, so the networks differ.
        fn of(real_share: f64, real: bool) -> Vec<f32> {
            let mut trainer = trainer(training(real_share));
            add(&mut trainer, true, None, 0);
            add(&mut trainer, false, real.then_some("a room"), 1);
            let (simulated, real): (Chosen, Chosen) = (vec![0], vec![1; usize::from(real)]);
            values(&trainer.trained(start(1), 3, [&simulated, &real], 0.01, &mut |_| {}).unwrap())
        }

        assert_eq!(of(0.0, true), of(1.0, false), "without real frames the share is nothing");
        assert_ne!(of(0.0, true), of(0.2, true));
        assert_ne!(of(0.2, true), of(1.0, true));
        assert_eq!(of(0.2, true), of(0.22, true), "both are one frame of five");
    }

    /// The first step has the rate 0, and the second of two the largest one.
    #[test]
    fn further_training_goes_by_half_the_rate() {
        let mut trainer = trainer(Training { real_steps: 2, batch: 1, ..Training::default() });
        add(&mut trainer, true, None, 0);
        let rate = trainer.training.rate;
        let begun = start(2);
        let all = vec![0];
        let none = Chosen::new();
        let whole = trainer.trained(begun.clone(), 2, [&all, &none], rate, &mut |_| {}).unwrap();
        let further = trainer.further(
            begun.clone(),
            [&all, &none],
            &mut Steps::new(&trainer.training, 0, &mut |_| {}),
        );
        let [half, whole] =
            [further.unwrap(), whole].map(|net| apart_by(&values(&begun), &values(&net)));
        let ratio = half / whole;
        assert!((ratio - 0.5).abs() < 0.01, "{ratio}");
    }

    fn apart_by(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_tenth_of_the_simulated_scenes_is_for_testing() {
        let short = Training { steps: 1, real_steps: 1, batch: 1, ..Training::default() };
        let mut trainer = trainer(short);
        for group in 0..20 {
            add(&mut trainer, true, None, group);
        }
        let fitted = trainer.fit(&mut |_| {}).unwrap();
        let test = fitted.figures["simulated, never seen"].as_table().unwrap();
        assert_eq!(test["frames"].as_integer(), Some(2));
        assert_eq!(test["people"].as_integer(), Some(2));
        // Those of group 9 and 19 never enter a batch.
        let seen = trainer.chosen(|sample| sample.group % 10 != 9);
        assert_eq!(seen.len(), 18);
        let begun = trainer.begun(&seen, &mut Steps::new(&trainer.training, 0, &mut |_| {}));
        let weights = values(&finished(begun.unwrap(), &Score::default()).net);
        assert_eq!(weights, values(&Model::from_text(&fitted.model).unwrap().net));
    }

    #[test]
    fn weights_are_rounded_and_the_slope_is_above_zero() {
        let model = finished(start(7), &Score::default());
        let steps = values(&model.net).into_iter().map(|value| value * STEPS);
        assert!(steps.into_iter().all(|step| (step - step.round()).abs() < 1e-2));
        assert!(apart_by(&values(&model.net), &values(&start(7))) <= 0.51 / STEPS);
        assert!(model.slope >= 1e-3);
        // A network with answers that are wrong is not turned round.
        let wrong: Vec<(f64, bool, f64)> =
            (0..40).map(|k| (f64::from(k) - 20.0, k < 20, 0.0)).collect();
        assert_eq!(finished(start(7), &Score::of(wrong)).slope, 1e-3);
    }

    #[test]
    fn a_model_without_a_room_is_calibrated_by_the_others() {
        // Answers that are spread more need a smaller slope.
        fn answers(scale: f64) -> Score {
            Score::of((0..40).map(|k| (scale * f64::from(k - 20), k * 7 % 40 < k, 0.0)).collect())
        }

        fn fold(room: &str, scale: f64) -> Fold {
            Fold { room: room.into(), net: start(1), score: answers(scale) }
        }

        fn slope(text: &str) -> f64 {
            Model::from_text(text).unwrap().slope
        }

        fn of(scale: f64) -> f64 {
            finished(start(1), &answers(scale)).slope
        }

        let both = models_without(vec![fold("a", 0.1), fold("b", 0.3)], &answers(0.5));
        assert_eq!([slope(&both[0].1), slope(&both[1].1)], [of(0.3), of(0.1)]);
        assert!(of(0.1) > 2.0 * of(0.3), "{} {}", of(0.1), of(0.3));
        let single = models_without(vec![fold("a", 0.1)], &answers(0.5));
        assert_eq!(slope(&single[0].1), of(0.5), "by those in simulation");
    }

    #[test]
    fn the_first_weights_keep_the_signal_and_expect_few_people() {
        let net = start(3);
        for ((part, inputs), name) in net.parts().into_iter().zip(Net::INPUTS).zip(Net::PARTS) {
            if inputs == 0 {
                let expected = if name == "last_bias" { RARE } else { 0.0 };
                assert_eq!(part[0], expected, "{name}");
                assert!(part[1..].iter().all(|value| *value == 0.0), "{name}");
                continue;
            }
            let squares = part.iter().map(|value| value * value).sum::<f32>() / part.len() as f32;
            assert!((squares * inputs as f32 / 2.0 - 1.0).abs() < 0.3, "{name}: {squares}");
        }
        assert_ne!(values(&net), values(&start(4)));
    }

    #[test]
    fn progress_counts_the_steps_of_every_training() {
        fn tell_steps(progress: &mut dyn FnMut(f64)) {
            let training = Training { steps: 6, real_steps: 2, ..Training::default() };
            let mut steps = Steps::new(&training, 2, progress);
            for (count, part) in [(6, 0.5), (6, 1.0), (2, 1.0), (2, 0.5), (2, 1.0), (2, 1.0)] {
                steps.tell(count, part);
            }
        }

        let mut told = Vec::new();
        tell_steps(&mut |part| told.push(part));
        let twelfths: Vec<f64> = told.iter().map(|part| (part * 12.0).round()).collect();
        assert_eq!(twelfths, [3.0, 6.0, 8.0, 9.0, 10.0, 12.0]);
    }
}
