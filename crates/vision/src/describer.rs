//! Appearances of people, by colours and edges or by the embeddings of a network.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point3;
use tagalong_core::{Derived, Estimate, Frame, Result};
use tagalong_geometry::Rect;

use crate::Appearance;

/// Heights between which a standing person is assumed to be, m.
const HEIGHTS_M: [f64; 2] = [1.0, 2.2];
/// Minimum part of a person that must be inside the image.
const LEAST_INSIDE: f64 = 0.5;
/// Minimum height of a person, pixels: smaller images do not show clothes.
const LEAST_PX: f64 = 24.0;

/// Network that turns the image of a person into an embedding: those of the same person have
/// similar directions.
pub trait Embedder: Send {
    /// Returns the embedding of the person in a box, pixels; `None` if it was not computed in time,
    /// or has no direction.
    ///
    /// # Errors
    /// A frame without an image, or a failure of the network.
    fn embed(&mut self, frame: &Frame, person: &Rect) -> Result<Option<Vec<f32>>>;
}

/// Source of [`Appearance`]s for all stages of a pipeline: the embeddings of an [`Embedder`] if it
/// has one, otherwise colours and edges. Copies share the embedder.
#[derive(Clone, Default)]
pub struct Describer {
    shared: Option<Arc<Shared>>,
}

struct Shared {
    /// Identity of the network and its settings; results are cached under it within a frame.
    mark: String,
    embedder: Mutex<Box<dyn Embedder>>,
    missing: AtomicU64,
}

impl fmt::Debug for Describer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = self.shared.as_ref().map(|shared| &shared.mark);
        f.debug_struct("Describer").field("mark", &mark).finish()
    }
}

/// Embedding of a person, of length 1.
type Vector = Arc<[f32]>;

/// Embeddings of the people in a frame, by network and box, because several stages ask for the same
/// one.
struct Vectors(Mutex<Vec<(String, Rect, Option<Vector>)>>);

impl Derived for Vectors {
    fn derive(_: &Frame) -> Result<Self> {
        Ok(Self(Mutex::default()))
    }
}

impl Describer {
    /// Creates a describer with a network; `mark` distinguishes it from others.
    pub fn new(mark: String, embedder: Box<dyn Embedder>) -> Self {
        let embedder = Mutex::new(embedder);
        let missing = AtomicU64::new(0);
        Self { shared: Some(Arc::new(Shared { mark, embedder, missing })) }
    }

    /// Returns the appearance of a tracked person.
    ///
    /// # Errors
    /// Those of [`Embedder::embed`].
    pub fn of(&self, estimate: &Estimate, frame: &Frame) -> Result<Appearance> {
        self.at(&estimate.region, &estimate.person.position, frame)
    }

    /// Returns the appearance of a person. The upper body, or the whole body, is given as a region
    /// of the image, pixels, and the head as a position in the robot frame, m.
    ///
    /// # Errors
    /// Those of [`Embedder::embed`].
    pub fn at(&self, region: &Rect, head: &Point3<f64>, frame: &Frame) -> Result<Appearance> {
        let Some(shared) = &self.shared else {
            return Ok(Appearance::at(&upper_body(region, head), head, frame));
        };
        let vector = match person_box(region, head, frame) {
            Some(person) => shared.vector(frame, &person)?,
            None => None,
        };
        Ok(Appearance::of_vector(head.z, vector))
    }

    /// Returns the number of people since the last call whose embedding was not computed in time.
    pub fn take_missing(&self) -> u64 {
        self.shared.as_ref().map_or(0, |shared| shared.missing.swap(0, Ordering::Relaxed))
    }
}

impl Shared {
    fn vector(&self, frame: &Frame, person: &Rect) -> Result<Option<Vector>> {
        let vectors = frame.derived::<Vectors>()?;
        let mut known = vectors.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., vector)) =
            known.iter().find(|(mark, at, _)| *mark == self.mark && at == person)
        {
            return Ok(vector.clone());
        }
        let mut embedder = self.embedder.lock().unwrap_or_else(PoisonError::into_inner);
        let vector = embedder.embed(frame, person)?.and_then(|vector| unit(&vector));
        self.missing.fetch_add(u64::from(vector.is_none()), Ordering::Relaxed);
        known.push((self.mark.clone(), *person, vector.clone()));
        Ok(vector)
    }
}

/// Returns the vector scaled to length 1; `None` for a vector without a direction.
fn unit(vector: &[f32]) -> Option<Vector> {
    let length = vector.iter().map(|value| value * value).sum::<f32>().sqrt();
    let has_direction = length.is_finite() && length > f32::MIN_POSITIVE;
    has_direction.then(|| vector.iter().map(|value| value / length).collect())
}

/// Returns the height of a standing person whose head is at this position, m.
fn height_m(head: &Point3<f64>) -> f64 {
    let [least_m, most_m] = HEIGHTS_M;
    head.z.clamp(least_m, most_m)
}

/// Returns the upper body of the person in a region, which encloses an upper body or a whole
/// person.
fn upper_body(region: &Rect, head: &Point3<f64>) -> Rect {
    if region.is_whole_body() { region.upper_body_of_standing(height_m(head)) } else { *region }
}

/// Returns the box of a whole person inside the image; `None` if too little of it is inside.
fn person_box(region: &Rect, head: &Point3<f64>, frame: &Frame) -> Option<Rect> {
    let whole = if region.is_whole_body() {
        *region
    } else {
        region.standing_of_upper_body(height_m(head))
    };
    let inside = whole.clipped(frame.camera.width, frame.camera.height);
    let enough = inside.area() >= LEAST_INSIDE * whole.area() && inside.height >= LEAST_PX;
    enough.then_some(inside)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use tagalong_conformance::target;
    use tagalong_core::{EgoMotion, Error, Images, RgbImage, Stamp};
    use tagalong_geometry::{Camera, Distortion, Pinhole};

    use super::*;

    /// Answers with the corner of the box, and notes the boxes.
    struct Corner(Arc<Mutex<Vec<Rect>>>);

    impl Embedder for Corner {
        fn embed(&mut self, _: &Frame, person: &Rect) -> Result<Option<Vec<f32>>> {
            self.0.lock().unwrap().push(*person);
            match person.x {
                x if x > 250.0 => Err(Error::Other("the network broke".into())),
                x if x > 150.0 => Ok(Some(vec![0.0, 0.0])),
                x if x > 120.0 => Ok(None),
                x => Ok(Some(vec![2.0 * x as f32 + 1.0, 0.0])),
            }
        }
    }

    fn describer(mark: &str) -> (Describer, Arc<Mutex<Vec<Rect>>>) {
        let asked = Arc::new(Mutex::new(Vec::new()));
        (Describer::new(mark.into(), Box::new(Corner(Arc::clone(&asked)))), asked)
    }

    fn frame() -> Frame {
        frame_of(Images::default())
    }

    fn frame_of(images: Images) -> Frame {
        let lens =
            Pinhole { fx: 200.0, fy: 200.0, cx: 160.0, cy: 60.0, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 320, 240, 1.6, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
    }

    /// The upper body of a person of 1.6 m to the centre of the head, 57 pixels wide.
    fn upper(x: f64) -> Rect {
        Rect::new(x, 20.0, 57.0, 57.0)
    }

    fn at(describer: &Describer, region: Rect, frame: &Frame) -> Result<Appearance> {
        describer.at(&region, &Point3::new(2.0, 0.0, 1.6), frame)
    }

    #[test]
    fn the_whole_person_is_described_once_for_all_copies() {
        let ((first, asked), frame) = (describer("a"), frame());
        let seen = at(&first, upper(100.0), &frame).unwrap();
        assert_eq!(at(&first.clone(), upper(100.0), &frame).unwrap(), seen);
        assert_eq!(seen.difference(&seen).vector, Some(0.0));
        assert_eq!(seen.height_m, 1.6);
        // 1.6 m are 160 pixels, and half as much the other way.
        let expected = Rect::new(100.0 + 28.5 - 40.0, 22.5, 80.0, 160.0);
        let boxes = asked.lock().unwrap().clone();
        assert!(boxes.len() == 1 && boxes[0].iou(&expected) > 0.999, "{boxes:?}");
        let (other, others) = describer("b");
        at(&other, upper(100.0), &frame).unwrap();
        assert_eq!(others.lock().unwrap().len(), 1, "another network has other vectors");
    }

    #[test]
    fn a_box_of_a_whole_person_is_taken_as_it_is_and_cut_at_the_image() {
        let ((describer, asked), frame) = (describer("a"), frame());
        at(&describer, Rect::new(-10.0, 60.0, 60.0, 200.0), &frame).unwrap();
        assert_eq!(asked.lock().unwrap()[..], [Rect::new(0.0, 60.0, 50.0, 180.0)]);
        for small in [Rect::new(10.0, 10.0, 10.0, 23.0), Rect::new(-40.0, 60.0, 60.0, 200.0)] {
            let unseen = at(&describer, small, &frame).unwrap();
            assert_eq!(unseen.difference(&unseen).mean(), None);
        }
        assert_eq!((asked.lock().unwrap().len(), describer.take_missing()), (1, 0));
    }

    #[test]
    fn missing_vectors_are_counted_and_failures_are_errors() {
        let ((describer, _), frame) = (describer("a"), frame());
        for x in [140.0, 180.0, 100.0] {
            let seen = at(&describer, upper(x + 11.5), &frame).unwrap();
            assert_eq!(seen.difference(&seen).mean().is_some(), x == 100.0, "{x}");
        }
        assert_eq!((describer.take_missing(), describer.take_missing()), (2, 0));
        let wide = Rect::new(251.0, 40.0, 60.0, 100.0);
        assert!(at(&describer, wide, &frame).unwrap_err().to_string().contains("broke"));
    }

    #[test]
    fn without_a_network_people_are_described_by_colours_and_edges() {
        let describer = Describer::default();
        let track = target(2.0, 0.0, Vector2::zeros());
        let seen = describer.of(&track.estimate, &frame()).unwrap();
        assert_eq!(seen.difference(&seen).vector, None);
    }

    fn shirt_and_trousers(_: usize, row: usize) -> [u8; 3] {
        if row < 85 { [200, 30, 30] } else { [30, 30, 160] }
    }

    #[test]
    fn the_upper_part_of_a_whole_person_has_the_colours_of_the_upper_body() {
        let image = RgbImage::from_fn(320, 240, shirt_and_trousers);
        let describer = Describer::default();
        let frame = frame_of(Images { colour: Some(image.into()), ..Images::default() });
        let upper = upper(100.0);
        let part = at(&describer, upper, &frame).unwrap();
        let whole = at(&describer, upper.standing_of_upper_body(1.6), &frame).unwrap();
        let difference = part.difference(&whole);
        assert_eq!((difference.torso, difference.legs), (Some(0.0), Some(0.0)));
    }
}
