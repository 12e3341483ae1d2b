//! Preprocessing of images for a neural network, tried on frames of the log. With a wrong one the
//! network finds no people, without any error.

use tagalong_config::{Context, Registry};
use tagalong_core::{Detector, DiffDrive, Frame, Funnel, Query};
use tagalong_log::FrameSource;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::args::Trying;
use super::evidence::{Preparations, Prepared};
use super::trial::Spread;
use super::visit::{Scope, Visit};

/// Largest number of frames, spread over the log.
const FRAMES: usize = 8;
/// Number of people in a frame above which they count as noise, because values far outside of the
/// usual range saturate all scores.
const CROWD: usize = 30;
/// Share of frames with people from which a preparation counts as correct.
const ENOUGH: f64 = 0.75;
/// Loss of the score that does not justify a further setting.
const SAME: f64 = 0.02;
/// Means and deviations of ImageNet in red, green and blue, 0 to 255, from torchvision.
const IMAGENET: [[f64; 3]; 2] = [[123.675, 116.28, 103.53], [58.395, 57.12, 57.375]];

/// Settings of the plugin.
type Settings = Vec<(&'static str, Value)>;

/// A detector section with the frames to try it on.
struct Bench<'a> {
    registry: &'a Registry,
    plugin: &'a str,
    context: Context,
    config: Table,
    frames: &'a [Frame],
}

/// Tries the preparations of each network of a config.
pub fn tried(visit: &Visit, when: Trying, scope: Scope, registry: &Registry) -> Vec<Preparations> {
    let sections = visit.pipeline.config().values().get("detectors").and_then(Value::as_array);
    let sections = sections.into_iter().flatten();
    let configs: Vec<(&str, &Table)> =
        sections.filter_map(|section| network_config(section, registry)).collect();
    if configs.is_empty() || when == Trying::Never {
        return Vec::new();
    }
    let frames = sample(visit, scope);
    let tried = configs.into_iter().filter_map(|(plugin, config)| {
        let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
        let context = Context::new(0, visit.config.folder().to_owned(), wheels);
        let bench = Bench { registry, plugin, context, config: config.clone(), frames: &frames };
        bench.preparations(when == Trying::Always)
    });
    tried.collect()
}

/// Returns the plugin and the settings of a section with a network.
fn network_config<'a>(section: &'a Value, registry: &Registry) -> Option<(&'a str, &'a Table)> {
    let plugin = section.get("plugin")?.as_str()?;
    let config = section.get("config")?.as_table()?;
    let is_network = registry.runs_network_of_a_file(plugin);
    (is_network && !config.get("model")?.as_str()?.is_empty()).then_some((plugin, config))
}

/// Returns frames that are spread over the examined part of the log.
fn sample(visit: &Visit, scope: Scope) -> Vec<Frame> {
    let input = &visit.outer.input;
    let limits = &visit.outer.limits;
    let Ok(mut source) = FrameSource::open(scope.log, input, limits, visit.pipeline.inputs())
    else {
        return Vec::new();
    };
    let mut spread = Spread::default();
    for _ in 0..scope.frames {
        let Some(item) = source.next_frame() else { break };
        spread.offer(|| Some(item.frame));
    }
    let kept = spread.into_kept();
    let step = kept.len().div_ceil(FRAMES).max(1);
    kept.into_iter().step_by(step).collect()
}

impl Bench<'_> {
    /// Tries the preparation of the config and, if it finds few people or if `always` is set, all
    /// others. `None` if the network cannot be run.
    fn preparations(&self, always: bool) -> Option<Preparations> {
        if self.frames.is_empty() {
            return None;
        }
        let frames = self.frames.len();
        let now = self.run(&Vec::new())?;
        if now.found as f64 >= ENOUGH * frames as f64 && !always {
            return Some(Preparations { frames, now, best: None });
        }
        let results = combinations().into_iter().filter_map(|settings| {
            let result = self.run(&settings)?;
            Some((settings, result))
        });
        // Of equal ones the first is kept.
        let best = results.reduce(|best, other| {
            let is_better = other.1.score > best.1.score + SAME;
            if is_better { other } else { best }
        });
        let best = best.map(|(settings, best)| self.simplified(settings, best));
        Some(Preparations { frames, now, best })
    }

    /// Removes settings that a result does not need.
    fn simplified(&self, mut settings: Settings, mut best: Prepared) -> Prepared {
        for keys in
            [&["fit"][..], &["colours", "mean", "deviation"], &["colours"], &["mean", "deviation"]]
        {
            let fewer: Settings =
                settings.iter().filter(|(key, _)| !keys.contains(key)).cloned().collect();
            if fewer.len() == settings.len() {
                continue;
            }
            if let Some(result) = self.run(&fewer).filter(|it| it.score >= best.score - SAME) {
                (settings, best) = (fewer, result);
            }
        }
        best
    }

    /// Runs the network on all frames with these settings; `None` if it fails.
    fn run(&self, settings: &Settings) -> Option<Prepared> {
        let mut config = self.config.clone();
        for (key, value) in settings {
            config.insert((*key).to_owned(), value.clone());
        }
        let text = config.to_string();
        let table = DeTable::parse(&text).ok()?;
        let value = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
        let built = self.registry.build_detector(self.plugin, Some(value), &self.context);
        let mut detector = built.ok()?;
        let found = self.frames.iter().map(|frame| likeliest(&mut *detector, frame));
        let found: Vec<f64> = found.collect::<Option<_>>()?;
        Some(Prepared {
            change: line(self.plugin, settings),
            found: found.iter().filter(|probability| **probability > 0.0).count(),
            score: found.iter().sum::<f64>() / found.len() as f64,
        })
    }
}

/// Returns the probability of the likeliest person in a frame; 0 if there is none, or if there are
/// too many.
fn likeliest(detector: &mut dyn Detector, frame: &Frame) -> Option<f64> {
    let everywhere = Query::Discover { occupied: &[] };
    let found = detector.detect(frame, &everywhere, &mut Funnel::default()).ok()?;
    if found.len() > CROWD {
        return Some(0.0);
    }
    let scores = found.iter().map(|detection| 1.0 / (1.0 + (-detection.score).exp()));
    Some(scores.fold(0.0, f64::max))
}

/// Returns all combinations of colour order, scale and placement.
fn combinations() -> Vec<Settings> {
    let mut all = Vec::new();
    for fit in ["centre", "top-left", "stretch"] {
        for colours in ["rgb", "bgr"] {
            let [mut mean, mut deviation] = IMAGENET;
            // Means are in the order of the channels.
            if colours == "bgr" {
                mean.reverse();
                deviation.reverse();
            }
            for (mean, deviation) in
                [([0.0; 3], [255.0; 3]), ([0.0; 3], [1.0; 3]), (mean, deviation)]
            {
                all.push(vec![
                    ("fit", Value::from(fit)),
                    ("colours", Value::from(colours)),
                    ("mean", Value::from(mean.to_vec())),
                    ("deviation", Value::from(deviation.to_vec())),
                ]);
            }
        }
    }
    all
}

/// Returns the line of a config with these settings.
fn line(plugin: &str, settings: &Settings) -> String {
    if settings.is_empty() {
        return String::new();
    }
    let settings: Vec<String> =
        settings.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    format!("[[detectors]] plugin = \"{plugin}\", config = {{ {} }}", settings.join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use tagalong_core::{EgoMotion, Images, RgbImage, Stamp};
    use tagalong_geometry::{Camera, Distortion, Pinhole};

    use super::*;

    /// Folder of the hand-weighted networks.
    fn models() -> PathBuf {
        [env!("CARGO_MANIFEST_DIR"), "..", "network", "tests", "models"].iter().collect()
    }

    /// A frame with an upright blob, yellow on blue, in the middle of the right half.
    fn frame(width: usize, height: usize) -> Frame {
        let lens =
            Pinhole { fx: 300.0, fy: 300.0, cx: 191.5, cy: 191.5, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, width, height, 1.0, 0.0, 0.0));
        let colour = RgbImage::from_fn(width, height, |x, y| {
            let inside = (192..288).contains(&x) && (96..288).contains(&y);
            if inside { [250, 240, 40] } else { [10, 10, 40] }
        });
        let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
    }

    fn preparations(config: &str, frames: &[Frame], always: bool) -> Option<Preparations> {
        let registry = tagalong_catalog::registry();
        let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
        let context = Context::new(0, models(), wheels);
        let config: Table = config.parse().unwrap();
        let bench = Bench { registry: &registry, plugin: "onnx", context, config, frames };
        bench.preparations(always)
    }

    #[test]
    fn the_preparation_that_finds_people_is_named() {
        let frames = [frame(384, 384), frame(384, 384)];
        let found = preparations("model = 'yellow.onnx'", &frames, false).unwrap();
        assert_eq!(
            (found.frames, found.now.found),
            (2, 0),
            "the file was exported for RGB 0 to 255"
        );
        let best = found.best.unwrap();
        assert_eq!(best.found, 2);
        assert!(best.score > 0.9, "{best:?}");
        // The image has the shape of the input, so that its place does not matter, and the colours
        // are those of the family.
        assert!(best.change.contains("deviation = [1.0, 1.0, 1.0]"), "{best:?}");
        assert!(!best.change.contains("fit") && !best.change.contains("colours"), "{best:?}");
        let wrong = "model = 'yellow.onnx'\ncolours = 'bgr'";
        let best = preparations(wrong, &frames, false).unwrap().best.unwrap();
        assert!(best.change.contains("colours = \"rgb\"") && best.found == 2, "{best:?}");
    }

    #[test]
    fn the_place_of_the_image_is_named_where_it_matters() {
        let config = "model = 'yellow.onnx'\ncolours = 'rgb'\nmean = [0.0, 0.0, 0.0]\n\
                      deviation = [1.0, 1.0, 1.0]\nfit = 'centre'\ndiscover_score = 0.9";
        let found = preparations(config, &[frame(384, 288)], false).unwrap();
        assert_eq!(found.now.found, 0, "{found:?}");
        let best = found.best.unwrap();
        assert!(best.found == 1 && best.change.contains("fit = \"top-left\""), "{best:?}");
        assert!(!best.change.contains("colours"), "{best:?}");
    }

    #[test]
    fn a_preparation_that_finds_people_is_left_alone() {
        let config = "model = 'yolox.onnx'\ndiscover_score = 0.1";
        let found = preparations(config, &[frame(384, 384)], false).unwrap();
        assert_eq!((found.now.found, found.best), (1, None));
        assert!(preparations(config, &[frame(384, 384)], true).unwrap().best.is_some());
        assert_eq!(preparations(config, &[], false), None);
    }
}
