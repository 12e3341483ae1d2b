use nalgebra::{Matrix3, Point2, Point3, Vector3};
use tagalong_config::{Registry, Remedy};
use tagalong_core::{
    Capabilities, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Likelihood, Person,
    Query, Result, Track,
};
use tagalong_geometry::{HEAD_RADIUS_M, ImageBox};

use super::{mood, register_with_fault};

pub fn register(registry: &mut Registry, name: &'static str) {
    let plugin = move || Heads { fault: name, mood: mood(), remembered: Vec::new() };
    register_with_fault!(registry, detector, name, plugin);
    if name == "advises-on-others" {
        const ADVICE: &[Remedy] = &[Remedy { test: "gate", settings: &[], look: "the gate" }];
        registry.remedies(name, ADVICE);
    }
}

/// Detector that takes every cluster of points at head height and before the wall for a head.
struct Heads {
    fault: &'static str,
    mood: f64,
    remembered: Vec<Point3<f64>>,
}

/// Returns the points at the height of the simulated heads, in the robot frame.
fn points(frame: &Frame) -> Result<Vec<Point3<f64>>> {
    let depth = frame.depth()?;
    let mut points = Vec::new();
    for y in 0..depth.height() {
        for (x, d) in depth.row(y).iter().enumerate().filter(|(_, d)| **d > 0.3 && **d < 9.0) {
            let pixel = Point2::new(x as f64, y as f64);
            let point = frame.camera.back_project(pixel, f64::from(*d));
            if (1.5..1.8).contains(&point.z) && point.x < 4.5 {
                points.push(point);
            }
        }
    }
    Ok(points)
}

/// Returns the means of clusters of more than 50 points, moved to the centre of the head.
fn heads(frame: &Frame) -> Result<Vec<Point3<f64>>> {
    let mut lumps: Vec<(Vector3<f64>, f64)> = Vec::new();
    for point in points(frame)? {
        match lumps.iter_mut().find(|(sum, n)| (*sum / *n - point.coords).norm() < 0.4) {
            Some((sum, n)) => {
                *sum += point.coords;
                *n += 1.0;
            }
            None => lumps.push((point.coords, 1.0)),
        }
    }
    let eye = frame.camera.robot_from_camera.translation.vector;
    // The points lie on the visible side of the head, on average 0.6 radii before its centre.
    let deeper = |mean: Vector3<f64>| mean + (mean - eye).normalize() * (0.6 * HEAD_RADIUS_M);
    let large = lumps.into_iter().filter(|(_, n)| *n > 50.0);
    Ok(large.map(|(sum, n)| deeper(sum / n).into()).collect())
}

impl Heads {
    fn detection(&self, frame: &Frame, position: Point3<f64>) -> Detection {
        let mut region = frame.camera.upper_body(&position);
        let mut covariance = Matrix3::identity() * 0.01;
        match self.fault {
            "beside-the-image" => region.x += 1e4,
            "lopsided" => covariance[(0, 1)] = 0.5,
            _ => {}
        }
        let score = if self.fault == "moody" { self.mood } else { 2.0 };
        Detection::new("heads", position, covariance, score)
            .with_image(ImageBox::upper_body(region))
    }

    fn places(&self, frame: &Frame, query: &Query<'_>) -> Result<Vec<Point3<f64>>> {
        let mut found = heads(frame)?;
        match (query, self.fault) {
            (Query::Discover { .. }, "blind") | (Query::Track(_), "short-sighted") => {
                found.clear();
            }
            (Query::Discover { .. }, "ghosts") => found.push(Point3::new(3.0, 0.0, 1.6)),
            (Query::Discover { .. }, _) => found.extend(&self.remembered),
            (Query::Track(_), "wanders") => {}
            (Query::Track(track), _) => {
                let expected = track.estimate.person.position;
                found.retain(|head| (head.xy() - expected.xy()).norm() < 0.6);
            }
        }
        Ok(found)
    }
}

impl Detector for Heads {
    fn capabilities(&self) -> Capabilities {
        let inputs = match self.fault {
            "secretive" => Inputs::NONE,
            "easy-going" => Inputs::NONE.accept(Input::Depth),
            _ => Inputs::NONE.require(Input::Depth),
        };
        let mut capabilities = Capabilities::new(inputs).discovering().weighing();
        capabilities.tracks = self.fault != "modest";
        capabilities
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let test = if self.fault == "borrows-a-name" { "score" } else { "heads: score" };
        funnel.drop_many(test, 1);
        assert!(self.fault != "panics" || frame.camera.width > 1, "cannot see");
        if self.fault == "vague" && frame.depth().is_err() {
            return Err(Error::Other("something is missing".into()));
        }
        let places = self.places(frame, query)?;
        Ok(places.into_iter().map(|place| self.detection(frame, place)).collect())
    }

    fn learn(&mut self, _: &Frame, tracks: &[Track]) -> Result<()> {
        if ["remembers", "denies"].contains(&self.fault) {
            self.remembered.extend(tracks.iter().map(|t| t.estimate.person.position));
        }
        Ok(())
    }

    fn remembers(&self) -> bool {
        self.fault == "remembers"
    }

    fn likelihood(&self) -> Option<&dyn Likelihood> {
        Some(self)
    }
}

impl Likelihood for Heads {
    fn log_likelihood(&self, frame: &Frame, scene: &[Person]) -> Result<f64> {
        if self.fault == "imagines" && frame.depth().is_err() {
            return Ok(0.0);
        }
        let heads = heads(frame)?;
        let worst = if self.fault == "infinite" { f64::INFINITY } else { 25.0 };
        let weight = |person: &Person| {
            let d2 = heads.iter().map(|head| (head - person.position).norm_squared() / 0.0625);
            let biased = if self.fault == "likes-left" { 20.0 * person.position.y } else { 0.0 };
            1.0 - d2.fold(worst, f64::min) + biased
        };
        let counted = if self.fault == "first-only" { scene.len().min(1) } else { scene.len() };
        Ok(scene[..counted].iter().map(weight).sum())
    }

    fn log_likelihoods(
        &self,
        frame: &Frame,
        people: &[Person],
        people_per_scene: usize,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        out.clear();
        for scene in people.chunks(people_per_scene.max(1)) {
            let weighed = if self.fault == "hurries" { &people[..scene.len()] } else { scene };
            out.push(self.log_likelihood(frame, weighed)?);
        }
        Ok(())
    }
}
