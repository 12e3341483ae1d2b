use tagalong_conformance::context;
use tagalong_conformance::patch::{candidate, frame, picture};
use tagalong_core::Verifier;

use crate::{Config, SvmPatch};

fn refusal(config: Config) -> String {
    SvmPatch::new(config, &context()).err().map_or(String::new(), |error| error.to_string())
}

#[test]
fn it_keeps_the_promises_of_its_kind() {
    tagalong_conformance::assert_conforms(crate::register);
}

#[test]
fn a_model_that_is_not_there_is_named() {
    let refusal = refusal(Config { model: "nowhere.toml".into(), ..Config::default() });
    assert!(refusal.contains("nowhere.toml"), "{refusal}");
}

#[test]
fn a_weight_that_is_none_is_refused() {
    assert!(refusal(Config { weight: f64::NAN, ..Config::default() }).contains("weight"));
}

#[test]
fn the_limit_holds() {
    let config = Config { limit: 0.01, weight: 2.0, ..Config::default() };
    let mut verifier = SvmPatch::new(config, &context()).unwrap();
    for seed in 0..4 {
        let margin = verifier.log_odds(&frame(picture(seed % 2 == 0, seed)), &candidate()).unwrap();
        assert!(margin.abs() <= 0.02, "{margin}");
    }
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};

    use super::*;
    use crate::train::{PatchTrainer, Trial};
    use crate::{Model, Sampler, Scaling, Training};

    fn small() -> Training {
        Training { gammas: vec![1.0, 8.0], penalties: vec![1.0, 10.0], ..Training::default() }
    }

    fn trainer(training: Training, count: u32) -> PatchTrainer {
        let mut trainer = PatchTrainer::new(training, 5).unwrap();
        for seed in 0..count {
            let is_person = seed % 2 == 0;
            let example = Example { is_person, group: u64::from(seed / 3) };
            trainer.add(&frame(picture(is_person, seed)), &candidate(), example).unwrap();
        }
        trainer
    }

    #[test]
    fn it_learns_to_tell_heads_from_bars() {
        for scaling in [Scaling::Unit, Scaling::Gradients] {
            let training = Training { scaling, ..small() };
            let fitted = trainer(training, 60).fit(&mut |_| {}).unwrap();
            let model = Model::from_text(&fitted.model).unwrap();
            assert_eq!(model.sampler, Sampler { grow: 0.1, scaling });
            for seed in 500..520 {
                let picture = picture(seed % 2 == 0, seed);
                let log_odds =
                    model.log_odds(&model.sampler.patch(&picture, &candidate().rect().unwrap()));
                assert!((log_odds > 1.0) == (seed % 2 == 0), "{scaling:?}, {seed}: {log_odds}");
            }
            assert_eq!(fitted.figures["people"].as_integer(), Some(30));
            assert_eq!(fitted.figures["cross_validation"].as_array().unwrap().len(), 4);
        }
    }

    #[test]
    fn the_card_holds_the_rounded_line_and_progress_rises_to_one() {
        let mut parts = vec![0.0];
        let fitted = trainer(small(), 40).fit(&mut |part| parts.push(part)).unwrap();
        assert!(parts.is_sorted() && parts.last() == Some(&1.0), "{parts:?}");
        let model = Model::from_text(&fitted.model).unwrap();
        for (key, value) in [("slope", model.slope), ("offset", model.offset)] {
            let written = fitted.figures[key].as_float().unwrap();
            assert!(value.abs() > 1e-3 && (written - value).abs() <= 5e-5, "{written} {value}");
            assert!((written * 1e4 - (written * 1e4).round()).abs() < 1e-6, "{written}");
        }
    }

    #[test]
    fn the_same_samples_give_the_same_bytes() {
        let [first, second] = [(); 2].map(|()| trainer(small(), 40).fit(&mut |_| {}).unwrap());
        assert_eq!(first, second);
    }

    #[test]
    fn the_model_is_as_small_as_asked_for() {
        let fitted = trainer(Training { max_vectors: 8, ..small() }, 60).fit(&mut |_| {}).unwrap();
        assert!(Model::from_text(&fitted.model).unwrap().len() <= 8);
    }

    #[test]
    fn one_class_is_no_training_set() {
        let mut trainer = PatchTrainer::new(small(), 1).unwrap();
        for group in 0..8 {
            let example = Example { is_person: true, group };
            trainer.add(&frame(picture(true, group as u32)), &candidate(), example).unwrap();
        }
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("both are needed"));
    }

    #[test]
    fn settings_that_cannot_work_are_refused_and_those_at_the_bounds_are_not() {
        type Change = fn(&mut Training, bool);
        let changes: [(&str, Change); 7] = [
            ("gammas", |t, ok| t.gammas = if ok { vec![0.1] } else { vec![1.0, 0.0] }),
            ("penalties", |t, ok| t.penalties = if ok { vec![0.1] } else { vec![] }),
            ("folds", |t, ok| t.folds = if ok { 2 } else { 1 }),
            ("max_samples", |t, ok| t.max_samples = if ok { 5000 } else { 5001 }),
            ("max_tried", |t, ok| t.max_tried = if ok { 5000 } else { 5001 }),
            ("max_vectors", |t, ok| t.max_vectors = if ok { 2 } else { 1 }),
            ("grow", |t, ok| t.grow = if ok { 2.0 } else { 2.01 }),
        ];
        for (key, change) in changes {
            let [right, wrong] = [true, false].map(|ok| {
                let mut training = small();
                change(&mut training, ok);
                PatchTrainer::new(training, 1).err().map(|error| error.to_string())
            });
            assert_eq!(right, None);
            assert!(wrong.unwrap().contains(&format!("`{key}`")), "{key}");
        }
    }

    #[test]
    fn as_many_examples_are_used_as_asked_for() {
        let training = Training { people: 12, others: 8, ..small() };
        let fitted = trainer(training, 60).fit(&mut |_| {}).unwrap();
        assert_eq!(fitted.figures["people"].as_integer(), Some(12));
        assert_eq!(fitted.figures["others"].as_integer(), Some(8));
        assert_eq!(fitted.figures["fitted"].as_integer(), Some(20));
    }

    fn spread(trial: &Trial) -> f64 {
        let values: Vec<f64> = trial.held_out.iter().map(|(f, _)| *f).collect();
        let most = values.iter().copied().fold(f64::MIN, f64::max);
        most - values.iter().copied().fold(f64::MAX, f64::min)
    }

    /// As printed: gamma = 8 on grey values from 0 to 255. All patches are so far from each other
    /// that the answer no longer depends on the patch.
    #[test]
    fn the_printed_width_on_unscaled_patches_is_constant() {
        fn first(training: Training) -> Trial {
            trainer(training, 60).trials(&mut |_| {}).unwrap().remove(0)
        }

        let printed = Training {
            scaling: Scaling::Raw,
            gammas: vec![8.0],
            penalties: vec![1.0],
            folds: 2,
            ..Training::default()
        };
        let scaled = Training { scaling: Scaling::Unit, ..printed.clone() };
        let raw = first(printed);
        let unit = first(scaled);
        // Each of the two folds has its own constant.
        let mut distinct: Vec<f64> = raw.held_out.iter().map(|(f, _)| *f).collect();
        distinct.dedup();
        assert!(distinct.len() <= 2, "{distinct:?}");
        assert!(spread(&unit) > 0.5, "{}", spread(&unit));
        assert!(unit.area() > 0.99, "{}", unit.area());
    }
}
