use std::sync::Arc;

use tagalong_conformance::context;
use tagalong_conformance::patch::{candidate, frame, picture};
use tagalong_core::{DepthImage, Frame, Verifier};

use crate::{BodyNet, Config};

/// The picture, and a wall behind the candidate.
fn seen(is_person: bool, seed: u32) -> Frame {
    let depth = DepthImage::from_fn(64, 64, |x, _| if x < 60 { 2.0 } else { 2.6 });
    frame(picture(is_person, seed)).with_depth(Arc::new(depth))
}

fn verifier(config: Config) -> BodyNet {
    BodyNet::new(config, &context()).unwrap()
}

fn refusal(config: Config) -> String {
    BodyNet::new(config, &context()).err().map_or(String::new(), |error| error.to_string())
}

#[test]
fn it_keeps_the_promises_of_its_kind() {
    tagalong_conformance::assert_conforms(crate::register);
}

#[test]
fn without_depth_it_says_nothing() {
    let config = Config { bias: -3.0, ..Config::default() };
    let margin = verifier(config).log_odds(&frame(picture(true, 1)), &candidate()).unwrap();
    assert_eq!(margin, 0.0);
}

#[test]
fn the_limit_holds_and_the_bias_is_added() {
    let config = Config { limit: 0.01, weight: 2.0, bias: -3.0, ..Config::default() };
    for seed in 0..4 {
        let said = verifier(config.clone()).log_odds(&seen(seed % 2 == 0, seed), &candidate());
        assert!((said.unwrap() + 3.0).abs() <= 0.02 + 1e-12);
    }
}

#[test]
fn settings_that_cannot_work_are_refused_by_name() {
    let wrong = Config { model: "nowhere.toml".into(), ..Config::default() };
    assert!(refusal(wrong).contains("nowhere.toml"));
    assert!(refusal(Config { weight: f64::NAN, ..Config::default() }).contains("weight"));
    assert!(refusal(Config { bias: f64::INFINITY, ..Config::default() }).contains("bias"));
}

mod network {
    use proptest::prelude::*;
    use tagalong_learn::conv::{Conv, Map};

    use super::*;
    use crate::{Net, NetworkInput, Pass};

    fn conv<const IN: usize, const OUT: usize, const SIZE: usize>(
        numbers: &[f32],
    ) -> Conv<IN, OUT, SIZE> {
        let mut conv = Conv::<IN, OUT, SIZE>::default();
        let all = conv.weights.iter_mut().chain(&mut conv.bias);
        all.zip(numbers.iter().cycle()).for_each(|(to, number)| *to = *number);
        conv
    }

    /// The definition, cell by cell.
    fn slow<const IN: usize, const OUT: usize, const SIZE: usize>(
        conv: &Conv<IN, OUT, SIZE>,
        input: &Map<IN>,
        [row, column, out]: [usize; 3],
    ) -> f32 {
        let mut sum = f64::from(conv.bias[out]);
        for up in 0..SIZE {
            for across in 0..SIZE {
                let y = (2 * row + up) as i64 - SIZE as i64 / 2;
                let x = (2 * column + across) as i64 - SIZE as i64 / 2;
                if y < 0 || x < 0 || y >= input.rows as i64 || x >= input.columns as i64 {
                    continue;
                }
                for i in 0..IN {
                    let weight = conv.weights[((up * SIZE + across) * IN + i) * OUT + out];
                    let at = (y as usize * input.columns + x as usize) * IN + i;
                    sum += f64::from(weight) * f64::from(input.values[at]);
                }
            }
        }
        sum.max(0.0) as f32
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn a_layer_is_what_its_definition_says(
            numbers in prop::collection::vec(-1.0f32..1.0, 97),
            rows in 1usize..9, columns in 1usize..9,
        ) {
            let conv = conv::<3, 8, 5>(&numbers);
            let mut input = Map::<3>::new(rows, columns);
            for (k, value) in input.values.iter_mut().enumerate() {
                *value = numbers[(k * 7) % 97].max(-0.3) + 0.3;
            }
            let mut out = Map::<8>::new(rows.div_ceil(2), columns.div_ceil(2));
            conv.forward(&input, &mut out);
            for k in 0..out.values.len() {
                let at = [k / 8 / out.columns, k / 8 % out.columns, k % 8];
                prop_assert!((out.values[k] - slow(&conv, &input, at)).abs() < 1e-4);
            }
        }
    }

    fn view(seed: u32) -> NetworkInput {
        NetworkInput::new(&seen(seed.is_multiple_of(2), seed), &candidate(), true).unwrap().unwrap()
    }

    fn net() -> Net {
        let mut net = Net::default();
        for (k, value) in net.parts_mut().into_iter().flatten().enumerate() {
            *value = ((k as f32 * 12.9898).sin() * 43_758.547).fract() * 0.3;
        }
        net
    }

    #[test]
    fn the_same_view_gets_the_same_answer() {
        let net = net();
        let mut pass = Pass::default();
        let first = net.look(&view(1), &mut pass);
        net.look(&view(2), &mut pass);
        assert_eq!(net.look(&view(1), &mut pass), first);
    }

    /// Each number of the network a little larger and smaller.
    #[cfg(feature = "train")]
    #[test]
    fn the_gradient_is_that_of_small_steps() {
        let mut net = net();
        let mut pass = Pass::default();
        let view = view(3);
        let mut gradient = Net::default();
        net.look(&view, &mut pass);
        net.learn(&pass, 1.0, &mut gradient);
        for part in 0..Net::PARTS.len() {
            let count = net.parts()[part].len();
            for k in (0..count).step_by(count.div_ceil(7)) {
                let value = net.parts()[part][k];
                let step = 1e-4;
                let [more, less] = [value + step, value - step].map(|value| {
                    net.parts_mut()[part][k] = value;
                    f64::from(net.look(&view, &mut pass))
                });
                let slope = (more - less) / (2.0 * f64::from(step));
                net.parts_mut()[part][k] = value;
                let found = f64::from(gradient.parts()[part][k]);
                let off = (slope - found).abs();
                assert!(off < 0.03 * (1.0 + slope.abs()), "{part} {k}: {slope} {found}");
            }
        }
    }
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};

    use super::*;
    use crate::train::NetTrainer;
    use crate::{Model, NetworkInput, Pass, Training};

    fn small() -> Training {
        Training { epochs: 6, rate: 0.005, batch: 8, ..Training::default() }
    }

    fn with(training: Training) -> Config {
        Config { training, ..Config::default() }
    }

    fn trainer(training: Training, count: u32) -> NetTrainer {
        let mut trainer = NetTrainer::new(with(training), 5).unwrap();
        for seed in 0..count {
            let is_person = seed % 2 == 0;
            let example = Example { is_person, group: u64::from(seed / 3) };
            trainer.add(&seen(is_person, seed), &candidate(), example).unwrap();
        }
        trainer
            .add(&frame(picture(true, 1)), &candidate(), Example { is_person: true, group: 0 })
            .unwrap();
        trainer
    }

    #[test]
    fn it_learns_to_tell_heads_from_bars() {
        let mut progress = Vec::new();
        let fitted = trainer(small(), 60).fit(&mut |part| progress.push(part)).unwrap();
        assert!(progress.is_sorted() && progress.last() == Some(&1.0), "{progress:?}");
        let model = Model::from_text(&fitted.model).unwrap();
        let mut pass = Pass::default();
        for seed in 500..520 {
            let view =
                NetworkInput::new(&seen(seed % 2 == 0, seed), &candidate(), true).unwrap().unwrap();
            let log_odds = model.log_odds(&view, &mut pass);
            assert!((log_odds > 0.0) == (seed % 2 == 0), "{seed}: {log_odds}");
        }
        let [area, people, others] = ["area_under_roc", "people_accepted", "others_accepted"]
            .map(|name| fitted.figures[name].as_float().expect("a number"));
        assert!((0.9..=1.0).contains(&area), "{:?}", fitted.figures);
        assert!(people > 0.8 && others < 0.2, "{:?}", fitted.figures);
        assert!((0.05..50.0).contains(&model.slope), "{}", model.slope);
        for (name, expected) in [("people", 30), ("others", 30), ("without_depth", 1)] {
            assert_eq!(fitted.figures[name].as_integer(), Some(expected), "{name}");
        }
    }

    #[test]
    fn the_same_samples_give_the_same_bytes() {
        let [first, second] = [(); 2]
            .map(|()| trainer(Training { epochs: 1, ..small() }, 24).fit(&mut |_| {}).unwrap());
        assert_eq!(first, second);
    }

    #[test]
    fn one_class_is_no_training_set() {
        let mut trainer = NetTrainer::new(with(small()), 1).unwrap();
        for group in 0..8 {
            let example = Example { is_person: true, group };
            trainer.add(&seen(true, group as u32), &candidate(), example).unwrap();
        }
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("both are needed"));
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        for training in [
            Training { epochs: 0, ..small() },
            Training { rate: f64::NAN, ..small() },
            Training { batch: 0, ..small() },
            Training { folds: 1, ..small() },
        ] {
            assert!(NetTrainer::new(with(training), 1).is_err());
        }
    }
}
