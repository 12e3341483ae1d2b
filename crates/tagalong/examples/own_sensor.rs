//! Detects people with a radar: a sensor that Tagalong does not know, and a detector that reads it.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong::nalgebra::Matrix3;
use tagalong::prelude::*;

/// Echo of a radar: position in the robot frame, m, and spread of its speeds, m/s.
struct Echo {
    position: [f64; 2],
    spread_mps: f64,
}

/// Reading of the radar, a sensor that Tagalong does not know.
struct Radar(Vec<Echo>);

impl Sensor for Radar {
    const INPUT: Input = Input::Named("radar");
}

/// Detects people by the echoes of swinging limbs.
struct Swinging;

impl Detector for Swinging {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Radar::INPUT);
        Capabilities::new(inputs).discovering()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> PluginResult<Vec<Detection>> {
        let mut people = Vec::new();
        if let Query::Track(_) = query {
            return Ok(people); // it does not search near tracks
        }
        for echo in &frame.sensor::<Radar>()?.0 {
            let [x, y] = echo.position;
            // The height of the head is not measured: 1.6 m, with a deviation of 0.3 m.
            let covariance = Matrix3::from_diagonal(&[0.01, 0.01, 0.09].into());
            let found = Detection::new("radar", [x, y, 1.6].into(), covariance, 2.0);
            if echo.spread_mps > 0.4 {
                people.push(found);
            } else {
                funnel.drop_detection("spread of speeds", &found);
            }
        }
        Ok(people)
    }
}

const CONFIG: &str = "filter.plugin = 'ekf'\n[[detectors]]\nplugin = 'radar'\n";

fn main() -> Result<()> {
    let mut registry = builtin_registry();
    registry.detector("radar", "people by a radar", |_: NoSettings, _| Ok(Swinging));
    let mut pipeline = Pipeline::builder(&registry).from_toml(CONFIG)?;
    let mut frames = FrameMaker::without_camera();
    let mut found = Vec::new();
    for count in 0..30 {
        let time_s = 0.1 * f64::from(count);
        let moment = frames.at(Stamp::default().plus_seconds(time_s));
        let report = pipeline.step(moment.sensor(echoes(time_s)).frame()?)?;
        found = report.tracks.into_iter().filter(|track| track.confirmed).collect();
        for track in &found {
            println!("{time_s:.1} s: {} at {:.2} m", track.id, track.position.xy().coords.norm());
        }
    }
    assert_eq!(found.len(), 2, "two people walk, and a pillar stands");
    Ok(())
}

/// Returns the echoes at a time: a person comes nearer, another walks past, a pillar stands.
fn echoes(time_s: f64) -> Radar {
    let nearer = Echo { position: [5.0 - time_s, -1.0], spread_mps: 0.9 };
    let past = Echo { position: [3.0, 2.0 - 0.8 * time_s], spread_mps: 0.7 };
    let pillar = Echo { position: [2.0, -2.0], spread_mps: 0.05 };
    Radar(vec![nearer, past, pillar])
}
