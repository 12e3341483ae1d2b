//! Registers the program's own detector in addition to the built-in plugins, and tracks with it.
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong::nalgebra::Matrix3;
use tagalong::prelude::*;

/// Takes the nearest point of the laser scan for a person.
struct Nearest;

impl Detector for Nearest {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Input::Laser);
        Capabilities::new(inputs).discovering()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        _: &mut Funnel,
    ) -> PluginResult<Vec<Detection>> {
        if let Query::Track(_) = query {
            return Ok(Vec::new()); // it does not search near tracks
        }
        let points = frame.scan()?.points.iter();
        let nearest = points.min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
        let covariance = Matrix3::from_diagonal_element(0.01);
        let found = nearest.map(|at| Detection::new("nearest", *at, covariance, 2.0));
        Ok(found.into_iter().collect())
    }
}

const CONFIG: &str = "filter.plugin = 'ekf'\n[[detectors]]\nplugin = 'nearest'\n";

fn main() -> Result<()> {
    let mut registry = builtin_registry();
    registry.detector("nearest", "the nearest laser point", |_: NoSettings, _| Ok(Nearest));
    let mut pipeline = Pipeline::builder(&registry).from_toml(CONFIG)?;
    let mut frames = FrameMaker::without_camera();
    for count in 0..20 {
        let stamp = Stamp::default().plus_seconds(0.1 * f64::from(count));
        let scan = LaserScan::of_points([[3.0 - 0.05 * f64::from(count), 0.5, 0.3].into()]);
        for track in pipeline.step(frames.at(stamp).laser(scan).frame()?)?.tracks {
            println!("{stamp} s: {} at {:.2} m", track.id, track.position.xy().coords.norm());
        }
    }
    Ok(())
}
