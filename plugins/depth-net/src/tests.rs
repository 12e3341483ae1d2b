use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2};
use tagalong_config::{NamedTensor, Registry};
use tagalong_conformance::{Suite, context, target};
use tagalong_core::{
    Detection, Detector, EgoMotion, Error, Frame, Funnel, Images, Input, Inputs, Query, Sensors,
    Stamp, Verifier,
};
use tagalong_geometry::Camera;
use tagalong_network::{Limits, Network, RtenNetwork, Tensor};
use tagalong_sim::{Event, Scene, Simulation, Truth};

use crate::{Config, DepthNet, DepthNetVerifier, NAME, Source, VerifierConfig};

/// A room with furniture, seen from a height; two people, if they are there.
fn room(height_m: f64, people: &str) -> (Frame, Vec<Truth>) {
    let text = format!(
        "seed = 5
        duration_s = 0.3
        camera = {{ colour = false, width = 320, height = 240, height_m = {height_m} }}
        faults = {{ dropped = 0.0, late = 0.0 }}
        [[furniture]]
        kind = \"coat-stand\"
        at = [5.0, 4.4]
        [[furniture]]
        kind = \"chair\"
        at = [4.0, 1.8]
        [[furniture]]
        kind = \"shelf\"
        at = [6.5, 2.0]
        {people}"
    );
    let mut simulation = Simulation::new(&Scene::parse(&text).unwrap(), 1);
    let camera = Arc::new(simulation.camera().clone());
    loop {
        if let Some(Event::Shot(shot)) = simulation.next_event() {
            let images = Images { depth: shot.images.depth.clone(), ..Images::default() };
            let motion = EgoMotion::at_rest(0.1);
            return (Frame::new(1, Stamp::default(), camera, motion, images), shot.truth);
        }
    }
}

const NEAR_AND_FAR: &str = "
    [[people]]
    path = [[2.5, 2.6]]
    heading_deg = 180.0
    [[people]]
    path = [[4.6, 3.4]]
    heading_deg = 90.0";

fn detector(config: Config) -> DepthNet {
    DepthNet::new(config, &context()).unwrap()
}

fn found(frame: &Frame) -> Vec<Detection> {
    let query = Query::Discover { occupied: &[] };
    detector(Config::default()).detect(frame, &query, &mut Funnel::default()).unwrap()
}

#[test]
fn it_keeps_the_promises_of_its_kinds() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    let suite = Suite::new(&registry).must_discover(NAME).must_follow(NAME);
    let failures = suite.check_all();
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn people_are_found_from_every_height_and_the_near_one_without_a_head() {
    fn is_near(d: &Detection, person: &Truth) -> bool {
        (d.position.xy() - person.head_in_robot.xy()).norm() < 0.6
    }

    for height_m in [0.4, 0.8, 1.2, 1.6] {
        let (frame, truth) = room(height_m, NEAR_AND_FAR);
        let found = found(&frame);
        assert!(
            found.iter().all(|d| truth.iter().any(|person| is_near(d, person))),
            "{height_m} m: {found:?}"
        );
        for person in &truth {
            let head = person.head_in_robot;
            let apart = found.iter().map(|found| (found.position.xy() - head.xy()).norm());
            let (nearest_m, nearest) =
                apart.zip(&found).min_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap();
            assert!(nearest_m < 0.25, "{height_m} m: {nearest_m}");
            let off_m = (nearest.position.z - head.z).abs();
            assert!(off_m < 0.3, "{height_m} m: height {off_m}");
        }
    }
    let (frame, truth) = room(0.4, NEAR_AND_FAR);
    let near = frame.camera.project(&truth[0].head_in_robot).unwrap();
    assert!(near.y < 0.0, "the head is above the image");
    let sigmas: Vec<f64> = found(&frame).iter().map(|d| d.covariance[(2, 2)].sqrt()).collect();
    let unseen = Config::default().sigma_unseen_height_m;
    assert!(sigmas.iter().any(|sigma| (sigma - unseen).abs() < 1e-9), "{sigmas:?}");
}

/// A frame of a lidar of this pattern in the middle of a room, with people on three sides.
fn around(lidar: &str) -> (Frame, Vec<Truth>) {
    let text = format!(
        "seed = 5
        duration_s = 0.3
        camera = {{ colour = false, width = 32, height = 24 }}
        faults = {{ dropped = 0.0, late = 0.0 }}
        lidar = {{ {lidar} }}
        room = {{ size_m = [9.0, 8.0] }}
        [robot]
        start = [4.5, 4.0]
        [[furniture]]
        kind = \"coat-stand\"
        at = [6.5, 5.5]
        [[people]]
        path = [[6.9, 3.8]]
        [[people]]
        path = [[1.9, 3.4]]
        heading_deg = 90.0
        [[people]]
        path = [[4.8, 1.7]]"
    );
    let mut simulation = Simulation::new(&Scene::parse(&text).unwrap(), 1);
    loop {
        if let Some(Event::Shot(shot)) = simulation.next_event() {
            let cloud = simulation.lidar().unwrap().cloud(&shot.lidar.unwrap());
            let blind = Camera::blind(Isometry3::from(cloud.scanner.coords));
            let sensors = Sensors::default().with(cloud);
            let motion = EgoMotion::at_rest(0.1);
            let frame = Frame::of_sensors(1, Stamp::default(), blind.into(), motion, sensors);
            return (frame, shot.truth);
        }
    }
}

#[test]
fn people_are_found_by_the_points_of_both_kinds_of_lidars_on_all_sides_that_they_see() {
    let rings = "beams = 28800, rings = 32, lowest_deg = -30.0";
    let petals = "pattern = \"rosette\", beams = 10000, field_of_view_deg = 70.0, \
                  lowest_deg = -35.0, highest_deg = 35.0";
    for (pattern, seen) in [(rings, 3), (petals, 1)] {
        let (frame, mut truth) = around(pattern);
        // The first of them is ahead.
        truth.truncate(seen);
        let config = Config { source: Source::Points, ..Config::default() };
        assert!(
            DepthNet::new(config.clone(), &context()).unwrap().capabilities().inputs
                == Inputs::NONE.require(Input::POINTS)
        );
        let query = Query::Discover { occupied: &[] };
        let found = detector(config.clone()).detect(&frame, &query, &mut Funnel::default());
        let found = found.unwrap();
        let heads: Vec<_> = truth.iter().map(|person| person.head_in_robot).collect();
        let places: Vec<_> = found.iter().map(|found| found.position).collect();
        assert_eq!(found.len(), truth.len(), "{pattern}: {places:?} for {heads:?}");
        for person in &truth {
            let apart = found.iter().map(|found| (found.position - person.head_in_robot).norm());
            let (nearest_m, nearest) =
                apart.zip(&found).min_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap();
            assert!(nearest_m < 0.25, "{pattern}: {nearest_m} m");
            assert!(nearest.image.is_none(), "there is no image");
        }
        // A frame without points is an error that names the input.
        let (depth, _) = room(1.2, "");
        let none = detector(config).detect(&depth, &query, &mut Funnel::default());
        assert!(none.is_err(), "{none:?}");
    }
}

#[test]
fn furniture_is_nobody() {
    for height_m in [0.4, 0.8, 1.2, 1.6] {
        assert!(found(&room(height_m, "").0).is_empty(), "{height_m} m");
    }
}

#[test]
fn somebody_known_is_not_discovered_again() {
    let (frame, _) = room(1.2, NEAR_AND_FAR);
    let first = found(&frame);
    let query = Query::Discover { occupied: &first[..1] };
    let rest = detector(Config::default()).detect(&frame, &query, &mut Funnel::default()).unwrap();
    assert_eq!(rest, first[1..]);
}

#[test]
fn the_verifier_believes_people_doubts_furniture_and_says_nothing_out_of_sight() {
    let (frame, truth) = room(1.2, NEAR_AND_FAR);
    let mut verifier = DepthNetVerifier::new(VerifierConfig::default(), &context()).unwrap();
    let candidate = found(&frame).remove(0);
    let shelf = Point3::new(5.5, -1.0, 1.5);
    let unseen = Point3::new(-2.0, 0.0, 1.5);
    let [person, shelf, unseen] = [truth[0].head_in_robot, shelf, unseen].map(|position| {
        verifier.log_odds(&frame, &candidate.clone().with_position(position)).unwrap()
    });
    assert!(person > 1.0, "{person}");
    assert!(shelf < -1.0, "{shelf}");
    assert_eq!(unseen, 0.0);
}

#[test]
fn near_a_confirmed_track_a_lower_score_suffices() {
    let (frame, truth) = room(1.2, NEAR_AND_FAR);
    let config = Config { discover_score: 1e3, track_score: -1e3, ..Config::default() };
    let head = truth[0].head_in_robot;
    for (confirmed, expected) in [(true, 1), (false, 0)] {
        let track = target(head.x, head.y, Vector2::zeros()).with_confirmed(confirmed);
        let query = Query::Track(&track);
        let found = detector(config.clone()).detect(&frame, &query, &mut Funnel::default());
        assert_eq!(found.unwrap().len(), expected);
    }
}

#[test]
fn without_depth_the_detector_complains_and_the_verifier_is_undecided() {
    let (frame, _) = room(1.2, NEAR_AND_FAR);
    let candidate = found(&frame).remove(0);
    let camera = Arc::clone(&frame.camera);
    let motion = EgoMotion::at_rest(0.1);
    let dark = Frame::new(1, Stamp::default(), camera, motion, Images::default());
    let query = Query::Discover { occupied: &[] };
    let answer = detector(Config::default()).detect(&dark, &query, &mut Funnel::default());
    assert!(matches!(answer, Err(Error::MissingImage { .. })));
    let mut verifier = DepthNetVerifier::new(VerifierConfig::default(), &context()).unwrap();
    assert_eq!(verifier.log_odds(&dark, &candidate).unwrap(), 0.0);
}

#[test]
fn settings_that_cannot_work_are_refused_by_name() {
    fn refusal(config: Config) -> String {
        DepthNet::new(config, &context()).err().map_or(String::new(), |error| error.to_string())
    }

    assert!(refusal(Config { sigma_m: 0.0, ..Config::default() }).contains("sigma_m"));
    assert!(
        refusal(Config { model: "nowhere.toml".into(), ..Config::default() })
            .contains("nowhere.toml")
    );
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{AnnotatedPerson, Trainer};

    use super::*;
    use crate::train::DepthNetTrainer;
    use crate::{FloorMap, Model, Net, Pass, Training};

    fn people(truth: &[Truth]) -> Vec<AnnotatedPerson> {
        truth
            .iter()
            .map(|person| {
                AnnotatedPerson::new(person.head_in_robot).with_visible(person.visible_fraction)
            })
            .collect()
    }

    fn trainer(training: Training) -> DepthNetTrainer {
        let mut trainer = DepthNetTrainer::new(training, 3).unwrap();
        for (group, text) in [NEAR_AND_FAR, "", NEAR_AND_FAR].into_iter().enumerate() {
            let (frame, truth) = room(1.2, text);
            let room = (group == 2).then_some("another");
            trainer.add_frame(&frame, &people(&truth), room, group as u64).unwrap();
        }
        trainer
    }

    #[test]
    fn it_learns_the_room_that_it_sees_and_the_same_samples_give_the_same_bytes() {
        let training =
            Training { steps: 60, real_steps: 20, batch: 6, rate: 0.01, ..Training::default() };
        let mut progress = Vec::new();
        let fitted = trainer(training.clone()).fit(&mut |part| progress.push(part)).unwrap();
        assert!(progress.is_sorted() && progress.last() == Some(&1.0), "{progress:?}");
        let model = Model::from_text(&fitted.model).unwrap();
        let (frame, truth) = room(1.2, NEAR_AND_FAR);
        let (views, passes) = model.look(&frame, Source::Depth).unwrap();
        let best = crate::peaks(&views.maps[0].1, &passes[0], -9.0, 0.4)[0];
        let off = truth.iter().map(|person| best.distance_m(&person.head_in_robot.xy()));
        assert!(off.fold(9.0, f64::min) < 0.3, "{best:?}");
        let left_out = fitted.figures["another: left out"].as_table().unwrap();
        assert_eq!(left_out["frames"].as_integer(), Some(1));
        let short = Training { steps: 2, real_steps: 1, ..training };
        let [first, second] = [(); 2].map(|()| trainer(short.clone()).fit(&mut |_| {}).unwrap());
        assert_eq!(first, second);
    }

    #[test]
    fn each_real_room_gets_a_model_that_does_not_depend_on_it() {
        fn net(text: &str) -> Net {
            Model::from_text(text).unwrap().net
        }

        let short = Training { steps: 2, real_steps: 2, batch: 4, ..Training::default() };
        let [before, after] = [NEAR_AND_FAR, ""].map(|other| {
            let mut trainer = trainer(short.clone());
            let (frame, truth) = room(1.2, other);
            trainer.add_frame(&frame, &people(&truth), Some("third"), 0).unwrap();
            trainer.fit(&mut |_| {}).unwrap()
        });
        let rooms: Vec<&str> = before.without.iter().map(|(room, _)| room.as_str()).collect();
        assert_eq!(rooms, ["another", "third"]);
        assert_eq!(net(&before.without[1].1), net(&after.without[1].1), "it has not seen the room");
        assert_ne!(net(&before.without[0].1), net(&after.without[0].1), "this one has");
        assert_ne!(net(&before.model), net(&after.model), "and so has the shipped one");
    }

    /// Each part of the network a little larger and smaller.
    #[test]
    fn the_gradient_is_that_of_small_steps() {
        fn weight(k: usize) -> f32 {
            ((k as f32) * 12.9898).sin() * 0.01
        }

        let (frame, _) = room(1.2, NEAR_AND_FAR);
        let map = FloorMap::new(&frame.camera, frame.depth().unwrap());
        let mut net = crate::train::start(4);
        // Without a bias, empty cells lie on the corner of the rectifier, which has no slope.
        net.parts_mut().into_iter().skip(1).step_by(2).flatten().for_each(|bias| *bias += 0.1);
        let mut pass = Pass::default();
        net.look(&map, &mut pass);
        let mut gradient = Net::default();
        let mut of = Pass::default();
        for (k, slope) in of.answer.values.iter_mut().enumerate() {
            *slope = if map.in_view[k / 4] { weight(k) } else { 0.0 };
        }
        net.learn(&map, &pass, &mut gradient, &mut of);
        for part in 0..Net::PARTS.len() {
            let count = net.parts()[part].len();
            for k in (0..count).step_by(count.div_ceil(5)) {
                let value = net.parts()[part][k];
                let step = 1e-3;
                let [more, less] = [value + step, value - step].map(|value| {
                    net.parts_mut()[part][k] = value;
                    net.look(&map, &mut pass);
                    let values = pass.answer.values.iter().enumerate();
                    values.map(|(k, value)| f64::from(weight(k)) * f64::from(*value)).sum::<f64>()
                });
                let slope = (more - less) / (2.0 * f64::from(step));
                net.parts_mut()[part][k] = value;
                let off = (slope - f64::from(gradient.parts()[part][k])).abs();
                assert!(off < 0.03 * (1.0 + slope.abs()), "{part} {k}: {slope}");
            }
        }
    }

    #[test]
    fn without_simulated_rooms_there_is_nothing_to_begin_with() {
        let training = Training { steps: 1, real_steps: 1, ..Training::default() };
        let mut trainer = DepthNetTrainer::new(training, 1).unwrap();
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("simulated"));
        let (frame, truth) = room(1.2, NEAR_AND_FAR);
        trainer.add_frame(&frame, &people(&truth), Some("another"), 0).unwrap();
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("simulated"));
    }
}

/// The exported network, run by `tagalong-network`, on a map of noise and on that of a room.
#[test]
fn the_exported_network_has_the_same_answers() {
    let network = crate::export::export(Config::default(), &context()).unwrap();
    let mut runtime = RtenNetwork::from_onnx(network.onnx, &Limits::default()).unwrap();
    let names: Vec<&str> = runtime.inputs().iter().map(|port| port.name.as_str()).collect();
    assert_eq!(names, ["fine", "coarse", "in_view"]);
    let (frame, _) = room(1.0, NEAR_AND_FAR);
    let model = crate::Model::from_text(crate::BUILT_IN).unwrap();
    let map = Arc::clone(&model.look(&frame, Source::Depth).unwrap().0.maps[0].1);
    for sample in [network.sample, crate::export::named(&model, &map)] {
        let (inputs, outputs): (Vec<_>, Vec<_>) =
            sample.into_iter().partition(|tensor| tensor.is_input);
        fn tensor(tensor: NamedTensor) -> Tensor {
            Tensor::new(tensor.shape, tensor.values).unwrap()
        }
        let inputs: Vec<Tensor> = inputs.into_iter().map(tensor).collect();
        let found = runtime.run(&inputs).unwrap();
        for (found, expected) in found.iter().zip(outputs) {
            assert_eq!(found.shape(), expected.shape);
            let likely = expected.values.iter().any(|value| *value > 1.0);
            assert!(likely, "{}: nothing to compare", expected.name);
            for (found, expected) in found.values().iter().zip(&expected.values) {
                assert!((found - expected).abs() <= 1e-4 * expected.abs().max(1.0));
            }
        }
    }
}
