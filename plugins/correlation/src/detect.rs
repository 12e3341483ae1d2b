use std::collections::BTreeMap;

use nalgebra::Vector3;
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, GreyImage, Input, Inputs, Query,
    Result, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, ImageBox, Rect, UPPER_BODY_SIDE_M};

use crate::picture::{Distance, SIDE};
use crate::strip::Lattice;
use crate::{Config, Fit, NAME, Picture, Strip};

/// Upper bodies are at least and at most so wide, pixels.
const SIDES_PX: std::ops::RangeInclusive<f64> = 12.0..=1000.0;
/// From cell to cell, m.
const CELL_M: f64 = UPPER_BODY_SIDE_M / SIDE as f64;

/// Something, or the test that it failed.
type TestResult<T> = std::result::Result<T, &'static str>;

/// Remembers the appearance of people, and finds them by it.
pub struct Correlation {
    config: Config,
    pictures: BTreeMap<TrackId, (Stamp, Picture)>,
    strip: Strip,
    fits: Vec<Placed>,
}

/// A picture laid somewhere, in cells from the expected place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) aside: i64,
    pub(crate) down: i64,
    pub(crate) fit: Fit,
}

/// The images of a frame that this detector looks at.
struct FrameImages<'a> {
    stamp: Stamp,
    grey: &'a GreyImage,
    depth: &'a DepthImage,
    camera: &'a Camera,
}

impl<'a> FrameImages<'a> {
    fn of(frame: &'a Frame) -> Result<Self> {
        let stamp = frame.stamp;
        Ok(Self { stamp, grey: frame.grey()?, depth: frame.depth()?, camera: &frame.camera })
    }
}

impl Correlation {
    /// A detector with these settings.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        let pictures = BTreeMap::new();
        let strip = Strip::default();
        Ok(Self { config, pictures, strip, fits: Vec::new() })
    }

    /// Where a person is, or the test that failed.
    fn near(&mut self, view: &FrameImages<'_>, track: &Track) -> TestResult<Detection> {
        let Self { config, pictures, strip, fits } = self;
        let (taken, picture) = pictures.get(&track.id).ok_or("correlation: not seen well yet")?;
        if view.stamp.seconds_since(*taken) > config.memory_s {
            return Err("correlation: forgotten");
        }
        let square = square(track).ok_or("correlation: too small or too large")?;
        let distance = distance(config, view.camera, track);
        if picture.part_known(view.depth, &square, &distance) > config.max_known {
            return Err("correlation: depth shows the person");
        }
        let (aside, down) = reach(config, view.camera, track);
        let lattice = Lattice::around(&square, aside, down);
        strip.read(view.grey, view.depth, &lattice, &distance);
        place(strip, picture, (aside, down), fits);
        let best = choose(config, fits)?;
        Ok(sighting(config, view.camera, track, &square, best))
    }

    /// Remembers the appearance of a person in plain view.
    fn remember(&mut self, view: &FrameImages<'_>, track: &Track) {
        let Some(square) = square(track).filter(|_| track.seen && !track.occluded) else { return };
        let distance = distance(&self.config, view.camera, track);
        let least = self.config.min_body;
        if let Some(picture) = Picture::take(view.grey, view.depth, &square, &distance, least) {
            self.pictures.insert(track.id, (view.stamp, picture));
        }
    }
}

/// The upper-body square in which a person is expected, if it can be looked at.
fn square(track: &Track) -> Option<Rect> {
    Some(track.estimate.region).filter(|square| SIDES_PX.contains(&square.width))
}

fn distance(config: &Config, camera: &Camera, track: &Track) -> Distance {
    let ahead_m = camera.depth_of(&track.estimate.person.position);
    Distance { ahead_m, tolerance_m: config.depth_tolerance_m }
}

/// Returns the extent of the search around the expected place, in cells aside and down.
pub(crate) fn reach(config: &Config, camera: &Camera, track: &Track) -> (i64, i64) {
    let estimate = &track.estimate;
    let ray = estimate.person.position.coords - camera.robot_from_camera.translation.vector;
    let across = Vector3::new(-ray.y, ray.x, 0.0).try_normalize(1e-9).unwrap_or_default();
    let covariance = estimate.covariance.fixed_view::<3, 3>(0, 0);
    let axes = [(across, config.search_aside_m), (Vector3::z(), config.search_up_m)];
    let [aside, up] = axes.map(|(axis, most_m)| {
        let sigma = (axis.transpose() * covariance * axis).x.max(0.0).sqrt();
        ((config.search_sigmas * sigma).min(most_m) / CELL_M).ceil() as i64
    });
    (aside, up)
}

/// Lays a picture everywhere.
fn place(strip: &Strip, picture: &Picture, (aside, down): (i64, i64), fits: &mut Vec<Placed>) {
    let (columns, rows) = strip.places();
    fits.clear();
    for row in 0..rows {
        for column in 0..columns {
            let fit = strip.fit(picture, column, row);
            fits.push(Placed { aside: column as i64 - aside, down: row as i64 - down, fit });
        }
    }
}

/// Returns the places where enough of the picture is shown.
fn shown_places(config: &Config, fits: &[Placed]) -> impl Iterator<Item = Placed> {
    fits.iter().copied().filter(|at| at.fit.shown >= config.min_shown)
}

/// The best place, or the test that it failed.
pub(crate) fn choose(config: &Config, fits: &[Placed]) -> TestResult<Placed> {
    fn by_correlation(a: &Placed, b: &Placed) -> std::cmp::Ordering {
        a.fit.correlation.total_cmp(&b.fit.correlation)
    }
    let best = shown_places(config, fits).max_by(by_correlation).ok_or("correlation: hidden")?;
    let elsewhere = shown_places(config, fits).filter(|at| {
        let cells = ((at.aside - best.aside) as f64).hypot((at.down - best.down) as f64);
        CELL_M * cells >= config.elsewhere_m
    });
    let elsewhere = elsewhere.max_by(by_correlation);
    let lead = elsewhere.map_or(f64::INFINITY, |at| best.fit.correlation - at.fit.correlation);
    match best.fit {
        fit if fit.correlation < config.min_correlation => Err("correlation: too low"),
        fit if fit.known > config.max_known => Err("correlation: depth knows better"),
        _ if lead < config.min_lead => Err("correlation: two places"),
        _ => Ok(best),
    }
}

/// The head moves in the image with its square, at the distance that was expected.
pub(crate) fn sighting(
    config: &Config,
    camera: &Camera,
    track: &Track,
    square: &Rect,
    best: Placed,
) -> Detection {
    let head_m = camera.depth_of(&track.estimate.person.position);
    let step = square.width / SIDE as f64;
    let aside = step * best.aside as f64;
    let down = step * best.down as f64;
    let region = Rect { x: square.x + aside, y: square.y + down, ..*square };
    let position = camera.head_of(&region, head_m - HEAD_RADIUS_M);
    let sigma_px = config.sigma_place_m * camera.focal_px() / head_m;
    // Not `Camera::locate_head`: its covariance is that of a point in the middle of the square, and
    // here it is that of the head.
    let pixel = camera.project(&position).unwrap_or(region.centre());
    let covariance = camera.covariance(pixel, head_m, sigma_px, config.sigma_distance_m);
    Detection::new(NAME, position, covariance, config.score)
        .with_image(ImageBox::upper_body(region))
}

impl Detector for Correlation {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Colour).require(Input::Depth)).tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let Query::Track(track) = query else { return Ok(Vec::new()) };
        match self.near(&FrameImages::of(frame)?, track) {
            Ok(found) => Ok(vec![found]),
            Err(test) => {
                funnel.drop_at(test, track.estimate.region);
                Ok(Vec::new())
            }
        }
    }

    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        let view = FrameImages::of(frame)?;
        self.pictures.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        tracks.iter().for_each(|track| self.remember(&view, track));
        Ok(())
    }
}
