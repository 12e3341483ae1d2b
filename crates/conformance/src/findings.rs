//! Findings of a detector in a scene of one person, in words for its author.

use std::fmt::Write as _;

use tagalong_core::{Detection, Detector, Error, Frame, Funnel, Input, Query};
use tagalong_geometry::Rect;
use tagalong_math::counted;

use crate::figure::Figure;

/// Distance on the floor within which a detection is one of the person, m.
const NEAR_M: f64 = 0.3;
/// Detections and tests that are listed.
const LISTED: usize = 3;

/// Answer of a detector to a question about a scene of one person.
pub(crate) struct Findings {
    /// The detections.
    pub(crate) found: Vec<Detection>,
    funnel: Funnel,
    /// Input that the detector asked for and the scene does not have.
    lacks: Option<Input>,
    /// The question in words.
    question: String,
    figure: Figure,
    /// Upper body of the person in the image, px.
    upper_body: Rect,
    size: (usize, usize),
}

impl Findings {
    /// Asks the detector.
    ///
    /// # Errors
    /// The detector fails on the frame.
    pub(crate) fn ask(
        detector: &mut dyn Detector,
        frame: &Frame,
        query: &Query<'_>,
        figure: Figure,
    ) -> Result<Self, String> {
        let mut funnel = Funnel::default();
        let (found, lacks) = match detector.detect(frame, query, &mut funnel) {
            Ok(found) => (found, None),
            Err(Error::MissingImage { input }) => (Vec::new(), Some(input)),
            Err(error) => return Err(format!("it fails on a simulated frame: {error}")),
        };
        let camera = &frame.camera;
        let question = match query {
            Query::Track(track) => {
                let place = track.estimate.person.position;
                format!("`Query::Track` asked for the person near {place:.2}")
            }
            Query::Discover { .. } => "`Query::Discover` asked for everyone".to_owned(),
        };
        Ok(Self {
            found,
            funnel,
            lacks,
            question,
            figure,
            upper_body: camera.upper_body(&figure.head),
            size: (camera.width, camera.height),
        })
    }

    /// Returns the detections that are more likely a person than not.
    pub(crate) fn believed(&self) -> Vec<&Detection> {
        self.found.iter().filter(|detection| detection.score > 0.0).collect()
    }

    /// Returns what was asked, where the person stands, what was found instead, and what to look at
    /// first.
    pub(crate) fn words(&self) -> String {
        let Self { question, figure, upper_body, size: (width, height), .. } = self;
        format!(
            "{question}; one person stands with the head at {:.2} (robot frame, m), the upper body is {} of \
             {width}x{height} pixels; found instead: {}; look first at {}",
            figure.head,
            corners(upper_body),
            self.instead(),
            self.hint()
        )
    }

    fn instead(&self) -> String {
        if let Some(input) = self.lacks {
            return format!("nothing, but an error that the frame has no {input}");
        }
        let mut words = match self.found.len() {
            0 => "nothing".to_owned(),
            count => {
                let count = counted(count, "detection");
                format!("{count}, {} with a score above 0:", self.believed().len())
            }
        };
        for detection in self.found.iter().take(LISTED) {
            let Detection { position, score, .. } = detection;
            let away_m = self.away_m(detection);
            let _ = write!(words, " {position:.2} ({away_m:.2} m off, score {score:.2})");
        }
        if self.found.len() > LISTED {
            words += " and more";
        }
        match self.dropped().as_slice() {
            [] => words += ", and the funnel is empty",
            tests => {
                let tests: Vec<String> = tests
                    .iter()
                    .take(LISTED)
                    .map(|(test, count)| format!("`{test}` {count}"))
                    .collect();
                let _ = write!(words, ", and its tests dropped: {}", tests.join(", "));
            }
        }
        words
    }

    fn hint(&self) -> String {
        if self.lacks.is_some() {
            return "the inputs that `capabilities` declares: a simulated frame has colour, depth and a laser scan"
                .to_owned();
        }
        let near = self.found.iter().filter(|detection| self.away_m(detection) < NEAR_M);
        let near: Vec<&Detection> = near.collect();
        if near.len() > 1 && self.believed().len() > 1 {
            return "how several detections of one person become one".to_owned();
        }
        if !self.believed().is_empty() {
            return "its positions: x is ahead of the robot, y to the left, z up from the floor, in m".to_owned();
        }
        if !near.is_empty() {
            return "its score: the log-odds of a person, which are above 0 for one".to_owned();
        }
        match self.dropped().first() {
            Some((test, _)) => format!("the test `{test}`, which dropped most candidates"),
            None => {
                "whether `detect` looks at all for this kind of `Query`, and what it makes of the \
                     pixels of the person before its first test"
                    .to_owned()
            }
        }
    }

    /// Returns the distance of a detection from the person on the floor, m.
    fn away_m(&self, detection: &Detection) -> f64 {
        (detection.position - self.figure.head).xy().norm()
    }

    /// Returns the tests that dropped candidates, the one that dropped most first.
    fn dropped(&self) -> Vec<(&'static str, u64)> {
        let entries = self.funnel.entries().iter();
        let mut tests: Vec<_> = entries.map(|entry| (entry.test, entry.count)).collect();
        tests.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        tests
    }
}

/// Returns a region in words, px.
pub(crate) fn corners(region: &Rect) -> String {
    let Rect { x, y, .. } = region;
    format!("x {x:.0} to {:.0}, y {y:.0} to {:.0}", region.right(), region.bottom())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_config::{NoSettings, Registry};
    use tagalong_core::{Capabilities, Inputs, Result};

    use super::*;
    use crate::Suite;
    use crate::scenes::{drawn, level};

    /// A detector with a given answer.
    struct Says(Result<Vec<Detection>>, &'static [(&'static str, u64)]);

    impl Detector for Says {
        fn capabilities(&self) -> Capabilities {
            Capabilities::new(Inputs::NONE).discovering()
        }

        fn detect(
            &mut self,
            _: &Frame,
            _: &Query<'_>,
            funnel: &mut Funnel,
        ) -> Result<Vec<Detection>> {
            for (test, count) in self.1 {
                funnel.drop_many(test, *count);
            }
            self.0.clone()
        }
    }

    fn detection(x: f64, y: f64, score: f64) -> Detection {
        Detection::new("says", Point3::new(x, y, 1.6), Matrix3::identity() * 0.01, score)
    }

    /// Returns the words about an answer on the scene of a person at 2 m.
    fn words(answer: Result<Vec<Detection>>, dropped: &'static [(&'static str, u64)]) -> String {
        let figure = Figure::at(2.0, 0.1);
        let frame = drawn(1, &level(), &[figure]);
        let query = Query::Discover { occupied: &[] };
        Findings::ask(&mut Says(answer, dropped), &frame, &query, figure).unwrap().words()
    }

    #[test]
    fn a_detector_that_finds_nothing_learns_where_the_person_is_and_where_to_look() {
        let silent = words(Ok(Vec::new()), &[]);
        for part in [
            "`Query::Discover` asked for everyone; one person stands with the head at {2.00, 0.10, 1.60}",
            "of 640x480 pixels; found instead: nothing, and the funnel is empty; look first at whether",
        ] {
            assert!(silent.contains(part), "{silent}");
        }
        let dropped = words(Ok(Vec::new()), &[("says: width", 2), ("says: peak", 7)]);
        let tests = "nothing, and its tests dropped: `says: peak` 7, `says: width` 2; look first at the test \
                     `says: peak`";
        assert!(dropped.contains(tests), "{dropped}");
        let lacking = words(Err(Error::MissingImage { input: Input::Right }), &[]);
        assert!(lacking.contains("no right images of a stereo pair; look first at the inputs"));
    }

    #[test]
    fn the_checks_of_a_detector_that_finds_nothing_say_it() {
        let mut registry = Registry::default();
        registry.detector("says", "says nothing", |_: NoSettings, _| Ok(Says(Ok(Vec::new()), &[])));
        let suite = Suite::new(&registry).must_discover("says").must_follow("says");
        for (check, words) in [
            ("one person at 2 m is found", "turned by 0.0 rad: 0 found: `Query::Discover` asked"),
            (
                "a person is found near their track",
                "0 found: `Query::Track` asked for the person near",
            ),
        ] {
            let failures = suite.check_one("says", check);
            assert!(failures[0].what.contains(words), "{failures:?}");
            assert!(failures[0].what.contains("one person stands with the head at"));
        }
    }

    #[test]
    fn what_was_found_instead_decides_what_to_look_at_first() {
        let doubted = words(Ok(vec![detection(2.0, 0.1, -1.5)]), &[]);
        let said = "1 detection, 0 with a score above 0: {2.00, 0.10, 1.60} (0.00 m off, score -1.50), and";
        assert!(doubted.contains(said), "{doubted}");
        assert!(doubted.contains("look first at its score"), "{doubted}");
        let twice = words(Ok(vec![detection(2.0, 0.1, 1.0), detection(2.1, 0.1, 0.5)]), &[]);
        assert!(twice.contains("look first at how several detections"), "{twice}");
        let turned = words(Ok(vec![detection(2.0, 0.1, 1.0), detection(-0.1, 2.0, 1.0)]), &[]);
        assert!(turned.contains("look first at its positions"), "{turned}");
    }
}
