use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use tagalong_core::{Frame, Likelihood, Person, Result, Visualisation};

/// Cost of the scene likelihood in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weighing {
    /// Hypothetical scenes that were compared with the image.
    pub scenes: u64,
    /// Time of the comparison, ms; a part of the stage `update`. Differs between runs.
    pub ms: f64,
}

/// A likelihood that counts the scenes and measures the time.
pub(crate) struct Metered<'a> {
    inner: &'a dyn Likelihood,
    scenes: AtomicU64,
    nanos: AtomicU64,
}

impl<'a> Metered<'a> {
    pub(crate) fn new(inner: &'a dyn Likelihood) -> Self {
        Self { inner, scenes: AtomicU64::new(0), nanos: AtomicU64::new(0) }
    }

    pub(crate) fn weighing(&self) -> Weighing {
        let ms = self.nanos.load(Ordering::Relaxed) as f64 / 1e6;
        Weighing { scenes: self.scenes.load(Ordering::Relaxed), ms }
    }

    fn timed<T>(&self, scenes: usize, ask: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let answer = ask();
        let nanos = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanos.fetch_add(nanos, Ordering::Relaxed);
        self.scenes.fetch_add(scenes as u64, Ordering::Relaxed);
        answer
    }
}

impl Likelihood for Metered<'_> {
    fn log_likelihood(&self, frame: &Frame, scene: &[Person]) -> Result<f64> {
        self.timed(1, || self.inner.log_likelihood(frame, scene))
    }

    fn log_likelihoods(
        &self,
        frame: &Frame,
        people: &[Person],
        people_per_scene: usize,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        let scenes = people.len().div_ceil(people_per_scene.max(1));
        self.timed(scenes, || self.inner.log_likelihoods(frame, people, people_per_scene, out))
    }

    fn visualise(&self, frame: &Frame, scene: &[Person]) -> Result<Option<Visualisation>> {
        self.inner.visualise(frame, scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use nalgebra::Point3;
    use tagalong_core::{EgoMotion, Images, Stamp};
    use tagalong_geometry::{Camera, Pinhole};

    fn frame() -> Frame {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
    }

    fn standing() -> Person {
        Person { position: Point3::new(3.0, 0.0, 1.6), velocity: nalgebra::Vector2::zeros() }
    }

    struct Size;

    impl Likelihood for Size {
        fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
            Ok(scene.len() as f64)
        }
    }

    #[test]
    fn scenes_are_counted_and_the_answers_stay() {
        let metered = Metered::new(&Size);
        let frame = frame();
        let people = [standing(); 5];
        let mut out = Vec::new();
        metered.log_likelihoods(&frame, &people, 2, &mut out).unwrap();
        assert_eq!(out, [2.0, 2.0, 1.0]);
        assert_eq!(metered.log_likelihood(&frame, &people), Ok(5.0));
        assert_eq!(metered.weighing().scenes, 4);
    }

    #[test]
    fn the_picture_is_that_of_the_likelihood() {
        struct Round;
        impl Likelihood for Round {
            fn log_likelihood(&self, _: &Frame, _: &[Person]) -> Result<f64> {
                Ok(0.0)
            }

            fn visualise(&self, _: &Frame, scene: &[Person]) -> Result<Option<Visualisation>> {
                Ok(Some(Arc::new(scene.len())))
            }
        }
        let people = [standing(); 2];
        let shown = Metered::new(&Round).visualise(&frame(), &people).unwrap().unwrap();
        assert_eq!(shown.downcast_ref(), Some(&2_usize));
    }
}
