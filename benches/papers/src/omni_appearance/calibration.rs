//! Section 3: four webcams that observe a hat, calibrated by known positions.

use std::collections::BTreeMap;

use crate::triangulate::{Cameras, HatColour, Known, Sight, Station, calibrate, find_hat};
use nalgebra::{Point2, Vector2, Vector3};
use tagalong_geometry::{Camera, Lens};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{Event, Scene, Simulation};

use crate::draws::over_draws;
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Number of rooms, each with its own webcams.
const ROOMS: u64 = 6;
/// Duration of the observation, s.
const SEEN_S: &str = "30.0";
/// Errors of the first guess of a webcam: m, rad, and part of the focal length.
const GUESS: (f64, f64, f64) = (0.3, 0.08, 0.1);

/// Returns the webcams, and the known positions of the hat with the observations of the webcams.
fn hats(lab: &Lab, scene: &Scene) -> (Vec<Station>, Vec<Known>) {
    let mut simulation = Simulation::new(scene, lab.jobs);
    let stations: Vec<Station> = simulation.webcams().filter_map(station).collect();
    let (mut known, mut sights): (Vec<Known>, BTreeMap<u64, Vec<Sight>>) =
        (Vec::new(), BTreeMap::new());
    let mut places: BTreeMap<u64, Point2<f64>> = BTreeMap::new();
    while let Some(event) = simulation.next_event() {
        match event {
            Event::Shot(shot) => {
                if let [person] = &shot.truth[..] {
                    let place = shot.world_from_robot * person.head_in_robot.xy();
                    places.insert(shot.captured_ns, place);
                }
            }
            Event::Webcam(shot) => {
                // The centre of a hat that the border of the image cuts would be off.
                let hat = find_hat(&shot.image, &HatColour::default()).filter(|hat| !hat.cut);
                let sight = hat.map(|hat| Sight { station: shot.webcam, pixel: hat.centre });
                sights.entry(shot.captured_ns).or_default().extend(sight);
            }
            Event::Odometry(_) | Event::NoOdometry { .. } | Event::Sensor(_) => {}
        }
    }
    // The position is known only at the capture times of the robot's camera.
    for (at, sights) in sights {
        known.extend(places.get(&at).map(|place| Known { place: *place, sights }));
    }
    (stations, known)
}

fn station(camera: &Camera) -> Option<Station> {
    let Lens::Pinhole(lens) = &camera.lens else { return None };
    let looks = camera.robot_from_camera.rotation * Vector3::z();
    Some(Station {
        at: camera.robot_from_camera.translation.vector.xy().into(),
        heading_rad: looks.y.atan2(looks.x),
        pitch_down_rad: -looks.z.asin(),
        focal_px: lens.fx,
        centre_px: Point2::new(lens.cx, lens.cy),
    })
}

/// Returns a guess with other errors for each webcam.
fn guessed(truth: &[Station]) -> Vec<Station> {
    // The bits of the number give each of the four webcams other signs.
    fn sign(number: usize, bit: usize) -> f64 {
        if (number >> bit) & 1 == 0 { 1.0 } else { -1.0 }
    }

    let (metres, radians, part) = GUESS;
    truth
        .iter()
        .enumerate()
        .map(|(number, station)| Station {
            at: station.at + Vector2::new(sign(number, 0), sign(number, 1)) * metres,
            heading_rad: station.heading_rad + sign(number, 1) * radians,
            pitch_down_rad: station.pitch_down_rad + sign(number, 0) * radians,
            focal_px: station.focal_px * (1.0 + sign(number, 0) * part),
            ..*station
        })
        .collect()
}

/// Returns the distances between measured and known positions, cm.
fn distances_to(stations: &[Station], known: &[Known]) -> Vec<f64> {
    let cameras = Cameras::new(stations.to_vec());
    cameras.distances_m(known).iter().map(|m| 100.0 * m).collect()
}

/// Returns the distances of one room: by the cameras as guessed, as calibrated, and as they are; at
/// positions used for the calibration, and at those held out.
fn of_room(lab: &Lab, scene: &Scene) -> [[Vec<f64>; 2]; 3] {
    let mut scene = scene.clone();
    // The robot's own camera is not used here, so a small image saves time.
    (scene.camera.width, scene.camera.height) = (16, 16);
    let (truth, known) = hats(lab, &scene);
    lab.progress.step();
    // Every second position, so that both halves cover the whole walk.
    let [used, held]: [Vec<Known>; 2] =
        [0, 1].map(|part| known.iter().skip(part).step_by(2).cloned().collect());
    let guess = guessed(&truth);
    let found = calibrate(&guess, &used).stations;
    [guess, found, truth].map(|stations| [&used, &held].map(|known| distances_to(&stations, known)))
}

/// Builds the table of section 3.
pub(super) fn calibration(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("omni-hat", &[("duration_s", SEEN_S)], lab.seeds(ROOMS))?;
    lab.progress.begin(scenes.len(), "looking at a hat");
    let rooms: Vec<_> = scenes.iter().map(|scene| of_room(lab, scene)).collect();
    let ours =
        ["first guess", "calibrated", "true cameras"].into_iter().enumerate().map(|(at, name)| {
            let draws =
                [0, 1].map(|part| rooms.iter().map(|room| room[at][part].clone()).collect());
            Row::ours(name, draws.map(|draws: Vec<_>| over_draws(&draws, 1)).to_vec())
        });
    let published =
        Row::published("\"in the order of\"", vec![Cell::number(1.0, 0), Cell::default()]);
    let places = rooms.iter().flat_map(|room| &room[1]).map(Vec::len).sum::<usize>();
    let table = Table {
        title: "Measured from known places of the hat, cm (P5, section 3)".into(),
        columns: ["calibrated with", "held out"].map(String::from).to_vec(),
        rows: std::iter::once(published).chain(ours).collect(),
        notes: vec![format!(
            "{places} places of a person who walks in {} rooms; four webcams of 320x240, which \
             hang and look otherwise in each; the first guess is off by {} m each way, {:.0} \
             degrees and {:.0} % of the focal length. Intervals are over rooms.",
            rooms.len(),
            GUESS.0,
            GUESS.1.to_degrees(),
            100.0 * GUESS.2
        )],
    };
    Ok(table.into())
}
