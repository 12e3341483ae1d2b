//! Walks of simulated people as a filter tracks them, with their true places later on.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Matrix4, Point2, Point3, Vector2};
use tagalong_controllers::{Forecast, ForecastSettings};
use tagalong_core::{Detection, EgoMotion, PersonFilter};
use tagalong_filters::ekf::{Config, Ekf, State};
use tagalong_geometry::Camera;
use tagalong_math::{ChaCha, RandomSource};
use tagalong_sim::{Event, Scene, Simulation, Split, Variant};

/// Times ahead, s.
pub const AHEAD_S: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Shares of the ellipses.
pub const SHARES: [f64; 3] = [0.5, 0.9, 0.95];
/// Scenes, by the values that make each: settings of Follow-Bench, and people who walk, stand and turn
/// without minding each other.
const SCENES: [&[(&str, &str)]; 6] = [
    &[("follow_bench.setting", "circular"), ("follow_bench.people", "10")],
    &[("follow_bench.setting", "corridor"), ("follow_bench.people", "10")],
    &[("follow_bench.setting", "crossing"), ("follow_bench.people", "10")],
    &[("follow_bench.setting", "doorway"), ("follow_bench.people", "6")],
    &[("follow_bench.setting", "clutter"), ("follow_bench.people", "10")],
    &[("crowd", "8"), ("room.size_m", "[12.0, 9.0]")],
];
const CAMERA: &str = "[camera]\nwidth = 8\nheight = 8\n";
/// Standard deviation of a measured place, m.
const NOISE_M: f64 = 0.06;
/// Time between two samples of a walk, s, and time before the first: the filter has settled then.
const EVERY_S: f64 = 1.0;
const SETTLED_S: f64 = 1.0;

/// Track of a person at one time, and the true places of that person later on.
pub struct Sample {
    at: Point2<f64>,
    velocity: Vector2<f64>,
    covariance: Matrix4<f64>,
    later: [Option<Point2<f64>>; AHEAD_S.len()],
}

impl Sample {
    /// Returns the forecast by these settings.
    pub fn forecast(&self, settings: &ForecastSettings) -> Forecast {
        let forecast = Forecast::new(settings, self.at, self.velocity, self.covariance);
        forecast.expect("a simulated place is a number")
    }

    /// Returns times ahead with the true places.
    pub fn truths(&self) -> impl Iterator<Item = (usize, f64, Point2<f64>)> {
        let places = AHEAD_S.into_iter().zip(self.later).enumerate();
        places.filter_map(|(number, (seconds, place))| Some((number, seconds, place?)))
    }
}

/// Returns the samples of all scenes with so many seeds of a split.
pub fn samples(split: Split, seeds: u64) -> Vec<Sample> {
    let mut samples = Vec::new();
    for values in SCENES {
        for number in 0..seeds {
            let mut variant = Variant::of_split(split, number).with("duration_s", 24.0);
            for (key, value) in values {
                variant = variant.with(key, *value);
            }
            let scene = Scene::parse_with(CAMERA, &variant).expect("the scene is a valid one");
            add_walks(&scene, &mut samples);
        }
    }
    samples
}

/// Track of one person, and what is known of them so far.
struct Walk {
    state: State,
    since_s: f64,
    places: Vec<(f64, Point2<f64>)>,
    tracked: Vec<(f64, State)>,
}

fn add_walks(scene: &Scene, samples: &mut Vec<Sample>) {
    let filter = Ekf::new(Config::default()).expect("the defaults are valid");
    let camera = Camera::blind(Isometry3::identity());
    let mut noise = ChaCha::new(scene.seed, 77);
    let mut simulation = Simulation::new(scene, 1);
    let mut walks: BTreeMap<u16, Walk> = BTreeMap::new();
    let mut before_s = 0.0;
    while let Some(event) = simulation.next_event() {
        let Event::Shot(shot) = event else { continue };
        let now_s = shot.captured_ns as f64 * 1e-9;
        for person in &shot.truth {
            let head = shot.world_from_robot * person.head_in_robot.xy();
            let seen = detection(&head, &mut noise);
            let walk = walks.entry(person.id).or_insert_with(|| Walk {
                state: filter.start(&seen),
                since_s: now_s,
                places: Vec::new(),
                tracked: Vec::new(),
            });
            if !walk.places.is_empty() {
                filter.predict(&mut walk.state, &EgoMotion::at_rest(now_s - before_s));
                filter.correct(&mut walk.state, &seen, &camera);
            }
            walk.places.push((now_s, head));
            let last_s = walk.tracked.last().map_or(walk.since_s + SETTLED_S - EVERY_S, |t| t.0);
            if now_s >= last_s + EVERY_S {
                walk.tracked.push((now_s, walk.state.clone()));
            }
        }
        before_s = now_s;
    }
    samples.extend(walks.values().flat_map(samples_of));
}

fn detection(head: &Point2<f64>, noise: &mut ChaCha) -> Detection {
    let x = head.x + NOISE_M * noise.normal();
    let y = head.y + NOISE_M * noise.normal();
    let covariance = Matrix3::identity() * (NOISE_M * NOISE_M);
    Detection::new("told", Point3::new(x, y, 1.6), covariance, 6.0)
}

fn samples_of(walk: &Walk) -> Vec<Sample> {
    const ROWS: [usize; 4] = [0, 1, 3, 4];
    let mut samples = Vec::new();
    for (at_s, state) in &walk.tracked {
        let later = AHEAD_S.map(|ahead_s| {
            let after = walk.places.iter().find(|(time_s, _)| *time_s >= at_s + ahead_s - 1e-6);
            after.map(|(_, place)| *place)
        });
        samples.push(Sample {
            at: Point2::new(state.mean[0], state.mean[1]),
            velocity: Vector2::new(state.mean[3], state.mean[4]),
            covariance: Matrix4::from_fn(|row, column| state.covariance[(ROWS[row], ROWS[column])]),
            later,
        });
    }
    samples
}

/// Returns the shares of true places within the ellipses: a row for each time ahead, a column for each
/// share.
pub fn held(
    samples: &[Sample],
    settings: &ForecastSettings,
) -> [[f64; SHARES.len()]; AHEAD_S.len()] {
    let mut counts = [[0.0; SHARES.len()]; AHEAD_S.len()];
    let mut all = [0.0; AHEAD_S.len()];
    for sample in samples {
        let forecast = sample.forecast(settings);
        for (row, seconds, truth) in sample.truths() {
            all[row] += 1.0;
            for (column, share) in SHARES.into_iter().enumerate() {
                counts[row][column] += f64::from(u8::from(forecast.holds(seconds, share, &truth)));
            }
        }
    }
    for (row, count) in counts.iter_mut().zip(all) {
        for share in row {
            *share /= f64::max(count, 1.0);
        }
    }
    counts
}

/// Returns the root of the mean squared distance between forecast and truth for each time ahead, m.
#[allow(dead_code, reason = "the table prints it, the test does not need it")]
pub fn errors_m(samples: &[Sample], settings: &ForecastSettings) -> [f64; AHEAD_S.len()] {
    let mut sums = [0.0; AHEAD_S.len()];
    let mut all = [0.0; AHEAD_S.len()];
    for sample in samples {
        let forecast = sample.forecast(settings);
        for (row, seconds, truth) in sample.truths() {
            all[row] += 1.0;
            sums[row] += (truth - forecast.place(seconds)).norm_squared();
        }
    }
    for (sum, count) in sums.iter_mut().zip(all) {
        *sum = (*sum / f64::max(count, 1.0)).sqrt();
    }
    sums
}
