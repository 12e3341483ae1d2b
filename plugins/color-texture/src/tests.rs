use tagalong_conformance::context;
use tagalong_conformance::patch::{candidate, frame, picture};
use tagalong_core::Verifier;

use crate::{ColorTexture, Config};

fn refusal(config: Config) -> String {
    ColorTexture::new(config, &context()).err().map_or(String::new(), |error| error.to_string())
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
    let mut verifier = ColorTexture::new(config, &context()).unwrap();
    for seed in 0..4 {
        let margin = verifier.log_odds(&frame(picture(seed % 2 == 0, seed)), &candidate()).unwrap();
        assert!(margin.abs() <= 0.02, "{margin}");
    }
}

#[test]
fn the_bias_is_added_to_every_answer() {
    let mut margins = [0.0, -3.0].map(|bias| {
        let mut verifier = ColorTexture::new(Config { bias, ..Config::default() }, &context());
        verifier.as_mut().unwrap().log_odds(&frame(picture(true, 3)), &candidate()).unwrap()
    });
    margins[0] -= 3.0;
    assert!((margins[0] - margins[1]).abs() < 1e-12, "{margins:?}");
    assert!(refusal(Config { bias: f64::INFINITY, ..Config::default() }).contains("bias"));
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};

    use super::*;
    use crate::train::TreeTrainer;
    use crate::{Features, Model, Training};

    fn small() -> Training {
        Training { trees: vec![10, 40], ..Training::default() }
    }

    fn trainer(training: Training, count: u32) -> TreeTrainer {
        let mut trainer = TreeTrainer::new(training, 5).unwrap();
        for seed in 0..count {
            let is_person = seed % 2 == 0;
            let example = Example { is_person, group: u64::from(seed / 3) };
            trainer.add(&frame(picture(is_person, seed)), &candidate(), example).unwrap();
        }
        trainer
    }

    #[test]
    fn it_learns_to_tell_heads_from_bars() {
        let fitted = trainer(small(), 60).fit(&mut |_| {}).unwrap();
        let model = Model::from_text(&fitted.model).unwrap();
        let mut features = Features::default();
        for seed in 500..520 {
            features.look(&frame(picture(seed % 2 == 0, seed)), &candidate()).unwrap();
            let log_odds = model.log_odds(&features);
            assert!((log_odds > 1.0) == (seed % 2 == 0), "{seed}: {log_odds}");
        }
        assert_eq!(fitted.figures["people"].as_integer(), Some(30));
        assert_eq!(fitted.figures["others"].as_integer(), Some(30));
        let slope = fitted.figures["slope"].as_float().unwrap();
        assert!((slope - model.slope).abs() < 1e-3 && model.slope > 0.01, "{slope}");
        assert_eq!(fitted.figures["cross_validation"].as_array().unwrap().len(), 2);
    }

    #[test]
    fn the_same_samples_give_the_same_bytes() {
        let [first, second] = [(); 2].map(|()| trainer(small(), 40).fit(&mut |_| {}).unwrap());
        assert_eq!(first, second);
    }

    #[test]
    fn one_class_is_no_training_set() {
        let mut trainer = TreeTrainer::new(small(), 1).unwrap();
        for group in 0..8 {
            let example = Example { is_person: true, group };
            trainer.add(&frame(picture(true, group as u32)), &candidate(), example).unwrap();
        }
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("both are needed"));
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        for training in [
            Training { trees: vec![], ..small() },
            Training { rate: f64::NAN, ..small() },
            Training { rate: 1.1, ..small() },
            Training { features: 1.1, ..small() },
            Training { features: 0.0, ..small() },
            Training { caution: 0.0, ..small() },
            Training { trees: vec![0], ..small() },
            Training { folds: 1, ..small() },
        ] {
            assert!(TreeTrainer::new(training, 1).is_err());
        }
    }
}
