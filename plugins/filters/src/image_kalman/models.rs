//! Motion models of one person: one, or two that interact (H. Blom and Y. Bar-Shalom, *The
//! interacting multiple model algorithm for systems with Markovian switching coefficients*, IEEE
//! Transactions on Automatic Control 33(8), 1988).
//!
//! A person walks steadily most of the time. A filter with little process noise averages the
//! detections then, but loses a person that stops; a filter with much process noise follows that
//! person, but also every error of a detector. Two filters, weighted by the likelihoods of the
//! detections, do both.

use tagalong_core::{Detection, EgoMotion, Estimate, Update};
use tagalong_geometry::Camera;

use crate::image_kalman::reupdate::Gap;
use crate::image_kalman::{Config, State};

/// Least probability of a model, so that one that did not fit for long can still take over.
const LEAST: f64 = 1e-4;

/// Settings of each model: the config itself, and with `manoeuvre_factor` that of a manoeuvre.
pub(crate) fn configs_of(config: &Config) -> Vec<Config> {
    let acceleration_noise = config.acceleration_noise * config.manoeuvre_factor;
    let manoeuvre = Config { acceleration_noise, ..config.clone() };
    let has_second = config.manoeuvre_factor > 0.0;
    std::iter::once(config.clone()).chain(has_second.then_some(manoeuvre)).collect()
}

/// Filter of one person by one model.
#[derive(Clone, Debug)]
struct Model {
    state: State,
    /// Probability of the model.
    weight: f64,
    /// State to filter anew from the last observation on.
    gap: Option<Gap>,
}

/// Filters of one person by all models.
#[derive(Clone, Debug)]
pub(crate) struct Models(Vec<Model>);

impl Models {
    /// Initialises the models, all alike probable, from the first detection.
    pub(crate) fn start(configs: &[Config], seen: &Detection, camera: &Camera) -> Self {
        let weight = 1.0 / configs.len() as f64;
        Self(
            configs
                .iter()
                .map(|config| {
                    let state = State::start(config, seen, camera);
                    let gap = config.reupdate.then(|| Gap::new(&state, seen));
                    Model { state, weight, gap }
                })
                .collect(),
        )
    }

    /// Predicts all models, after each has taken over the states of the others by the probability
    /// that the person changed over.
    pub(crate) fn predict(&mut self, configs: &[Config], motion: &EgoMotion, camera: &Camera) {
        if let [first, ..] = configs {
            self.interact(1.0 - (-first.manoeuvre_rate_hz * motion.dt).exp());
        }
        for (model, config) in self.0.iter_mut().zip(configs) {
            model.state.predict(config, motion, camera);
            model.gap.iter_mut().for_each(|gap| gap.add(motion, camera));
        }
    }

    /// Mixes the states: `change` is the probability that the person changed over to another model.
    fn interact(&mut self, change: f64) {
        let others = self.0.len().saturating_sub(1);
        // The box of a person behind the camera means nothing, and one model has no other.
        if others == 0 || self.0.iter().any(|model| model.state.is_behind()) {
            return;
        }
        let old: Vec<(f64, State)> =
            self.0.iter().map(|model| (model.weight, model.state.clone())).collect();
        for (to, model) in self.0.iter_mut().enumerate() {
            let joint = old.iter().enumerate().map(|(from, (weight, _))| {
                weight * if from == to { 1.0 - change } else { change / others as f64 }
            });
            model.weight = joint.clone().sum();
            let parts = joint.map(|joint| joint / model.weight);
            model.state.take_mixture(parts.zip(old.iter().map(|(_, state)| state)));
        }
    }

    /// Updates all models with a detection, and their probabilities with its likelihoods. Returns
    /// the result of the most probable model.
    pub(crate) fn correct(
        &mut self,
        configs: &[Config],
        seen: &Detection,
        camera: &Camera,
    ) -> Update {
        self.weigh(configs, seen, camera);
        let mut best = (0.0, Update::default());
        for (model, config) in self.0.iter_mut().zip(configs) {
            let bridged = model.gap.as_ref().and_then(|gap| gap.bridged(config, seen, camera));
            // The consistency of a track is that of its prediction, so it is updated in any case.
            let update = model.state.correct(config, seen, camera);
            if model.weight > best.0 {
                best = (model.weight, update);
            }
            if let Some(bridged) = bridged {
                model.state = bridged;
            }
            model.gap = config.reupdate.then(|| Gap::new(&model.state, seen));
        }
        best.1
    }

    /// Updates the probabilities of the models by Bayes' rule.
    fn weigh(&mut self, configs: &[Config], seen: &Detection, camera: &Camera) {
        if self.0.len() < 2 || self.0.iter().any(|model| model.state.is_behind()) {
            return;
        }
        let models = self.0.iter().zip(configs);
        let logs = models.map(|(model, config)| model.state.log_likelihood(config, seen, camera));
        let Some(logs) = logs.collect::<Option<Vec<f64>>>() else { return };
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (model, log) in self.0.iter_mut().zip(&logs) {
            model.weight = (model.weight * (log - most).exp()).max(LEAST);
        }
        let sum: f64 = self.0.iter().map(|model| model.weight).sum();
        self.0.iter_mut().for_each(|model| model.weight /= sum);
    }

    /// Returns the mixture of all models in the common form.
    pub(crate) fn estimate(&self, camera: &Camera) -> Option<Estimate> {
        let best = self.0.iter().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        if self.0.len() == 1 || best.state.is_behind() {
            return Some(best.state.estimate(camera));
        }
        let mut mixture = best.state.clone();
        mixture.take_mixture(self.0.iter().map(|model| (model.weight, &model.state)));
        Some(mixture.estimate(camera))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_geometry::{ImageBox, Pinhole};

    use super::*;

    const DT_S: f64 = 0.1;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.3, 0.0, 0.0)
    }

    fn seen(y_m: f64) -> Detection {
        let position = Point3::new(5.0, y_m, 1.5);
        let image = Some(ImageBox::upper_body(camera().upper_body(&position)));
        let covariance = Matrix3::identity() * 1e-4;
        Detection::new("test", position, covariance, 3.0).with_image(image)
    }

    fn config(manoeuvre_factor: f64) -> Config {
        Config { acceleration_noise: 0.1, manoeuvre_factor, ..Config::default() }
    }

    /// A person walks to the left for 3 s, and back for 1 s.
    fn way(step: usize) -> f64 {
        let turned = step.saturating_sub(30) as f64;
        0.12 * (step as f64 - 2.0 * turned) - 1.5
    }

    /// Returns the probability of the last model in each frame, and the errors of the predictions
    /// in the three frames after the turn, px.
    fn walked(config: &Config) -> (Vec<f64>, f64) {
        let configs = configs_of(config);
        let camera = camera();
        let mut models = Models::start(&configs, &seen(way(0)), &camera);
        let mut weights = Vec::new();
        let mut off = 0.0;
        for step in 1..40 {
            models.predict(&configs, &EgoMotion::at_rest(DT_S), &camera);
            let found = models.estimate(&camera).unwrap().region.centre();
            if (32..35).contains(&step) {
                off += (found - seen(way(step)).rect().unwrap().centre()).norm();
            }
            models.correct(&configs, &seen(way(step)), &camera);
            let sum: f64 = models.0.iter().map(|model| model.weight).sum();
            assert!((sum - 1.0).abs() < 1e-9);
            weights.push(models.0.last().unwrap().weight);
        }
        (weights, off)
    }

    #[test]
    fn a_person_who_turns_back_is_followed_by_the_model_of_a_manoeuvre() {
        let (weights, off) = walked(&config(100.0));
        assert!(weights[20..29].iter().all(|weight| *weight < 0.3), "steady: {weights:?}");
        assert!(weights[30..33].iter().any(|weight| *weight > 0.9), "the turn: {weights:?}");
        let (_, alone) = walked(&config(0.0));
        assert!(off < 0.6 * alone, "{off} {alone} px");
    }

    #[test]
    fn one_model_is_the_plain_filter() {
        let config = config(0.0);
        let camera = camera();
        let configs = configs_of(&config);
        let mut models = Models::start(&configs, &seen(0.0), &camera);
        let mut plain = State::start(&config, &seen(0.0), &camera);
        for step in 1..9 {
            models.predict(&configs, &EgoMotion::at_rest(DT_S), &camera);
            plain.predict(&config, &EgoMotion::at_rest(DT_S), &camera);
            let seen = seen(0.1 * f64::from(step));
            let found = models.correct(&configs, &seen, &camera);
            assert_eq!(found, plain.correct(&config, &seen, &camera));
            assert_eq!(models.estimate(&camera), Some(plain.estimate(&camera)));
        }
    }

    #[test]
    fn without_changes_each_model_keeps_its_state() {
        let config = Config { manoeuvre_rate_hz: 0.0, ..config(100.0) };
        let configs = configs_of(&config);
        let camera = camera();
        let mut models = Models::start(&configs, &seen(0.0), &camera);
        let mut second = State::start(&configs[1], &seen(0.0), &camera);
        for step in 1..9 {
            models.predict(&configs, &EgoMotion::at_rest(DT_S), &camera);
            second.predict(&configs[1], &EgoMotion::at_rest(DT_S), &camera);
            models.correct(&configs, &seen(0.1 * f64::from(step)), &camera);
            second.correct(&configs[1], &seen(0.1 * f64::from(step)), &camera);
        }
        let off = models.0[1].state.image - second.image;
        assert!(off.norm() < 1e-9 && models.0[0].state.image != second.image, "{off}");
    }

    /// Half and half of two states that are 10 px apart: the spread is that of both, and 5² more.
    #[test]
    fn the_mixture_has_the_moments_of_its_parts() {
        let configs = configs_of(&config(100.0));
        let camera = camera();
        let mut models = Models::start(&configs, &seen(0.0), &camera);
        let before = models.0[0].state.image_covariance[(0, 0)];
        models.0[1].state.image[0] += 10.0;
        models.interact(0.5);
        for model in &models.0 {
            assert!((model.weight - 0.5).abs() < 1e-12);
            assert!((model.state.image[0] - models.0[0].state.image[0]).abs() < 1e-9);
            assert!((model.state.image_covariance[(0, 0)] - before - 25.0).abs() < 1e-9);
        }
    }
}
