//! Simulated laser scans for the trainer of `laser-legs`: rooms with people standing and walking among
//! furniture, seen by scanners of many heights, resolutions and amounts of noise.

use std::sync::Arc;

use nalgebra::Isometry3;
use tagalong_app::outcome::Failure;
use tagalong_config::{AnnotatedPerson, Trainer};
use tagalong_core::{EgoMotion, Frame, Images, LaserScan, Stamp};
use tagalong_geometry::Camera;
use tagalong_math::{RandomSource, SplitMix64};
use tagalong_sim::{
    AtEnd, CameraSettings, Event, FaultSettings, Furniture, FurnitureKind, LaserSettings,
    PersonSettings, RobotSettings, RoomSettings, Scene, Shot, Simulation, Split,
};

/// Furniture that has thin parts at the height of legs.
const PIECES: [FurnitureKind; 8] = [
    FurnitureKind::Chair,
    FurnitureKind::DrapedChair,
    FurnitureKind::Desk,
    FurnitureKind::BinOnTable,
    FurnitureKind::FloorLamp,
    FurnitureKind::Plant,
    FurnitureKind::Pillar,
    FurnitureKind::CoatStand,
];

/// Scans per second: consecutive scans are similar.
const RATE_HZ: f64 = 1.0;
const DURATION_S: f64 = 8.0;

/// Passes the scans of a simulated scene to the trainer, and returns their number.
///
/// # Errors
/// An invalid seed, or a trainer that refuses a scan.
pub fn add(number: u64, trainer: &mut dyn Trainer) -> Result<usize, Failure> {
    let scene = scene(Split::Train.seed(number).map_err(Failure::failed)?);
    let mut simulation = Simulation::new(&scene, 1);
    let mut scans = 0;
    while let Some(event) = simulation.next_event() {
        let Event::Shot(shot) = event else { continue };
        let Some(scan) = scan(&simulation, &shot) else { continue };
        let people: Vec<AnnotatedPerson> = shot
            .truth
            .iter()
            .map(|person| {
                AnnotatedPerson::new(person.head_in_robot).with_visible(person.visible_fraction)
            })
            .collect();
        trainer.add_frame(&frame(scan), &people, None, number).map_err(Failure::failed)?;
        scans += 1;
    }
    Ok(scans)
}

fn scan(simulation: &Simulation, shot: &Shot) -> Option<LaserScan> {
    Some(simulation.laser()?.scan(shot.laser.as_ref()?))
}

/// Returns a frame that only has a scan.
pub fn frame(scan: LaserScan) -> Frame {
    let camera = Arc::new(Camera::blind(Isometry3::identity()));
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.0), Images::default())
        .with_laser(Some(scan))
}

/// Returns the random scene of a seed.
fn scene(seed: u64) -> Scene {
    let mut chance = SplitMix64::new(seed);
    let size_m = [chance.between(5.0, 16.0), chance.between(3.0, 10.0)];
    let start = place_in(size_m, &mut chance);
    let end = place_in(size_m, &mut chance);
    let places: Vec<[f64; 2]> = (0..24).map(|_| place_in(size_m, &mut chance)).collect();
    let (standing, rest) = places.split_at(3);
    let (walking, things) = rest.split_at(9);
    let pieces = 4 + (chance.uniform() * 8.0) as usize;
    let furniture = things.iter().take(pieces).map(|at| Furniture {
        kind: chance.pick(&PIECES),
        at: *at,
        heading_deg: chance.between(0.0, 360.0),
    });
    let furniture = furniture.collect();
    let mut people: Vec<PersonSettings> = standing.iter().map(|at| person(&[*at], 0.5)).collect();
    let speeds: [f64; 3] = std::array::from_fn(|_| chance.between(0.4, 1.5));
    people.extend(walking.chunks(3).zip(speeds).map(|(path, speed)| person(path, speed)));
    Scene {
        seed,
        duration_s: DURATION_S,
        room: RoomSettings { size_m, clutter: 6, ..RoomSettings::default() },
        // The image is not used, so it is as small as the simulation allows.
        camera: CameraSettings {
            colour: false,
            width: 8,
            height: 8,
            rate_hz: RATE_HZ,
            ..CameraSettings::default()
        },
        robot: RobotSettings {
            start,
            path: vec![end],
            speed_mps: chance.between(0.2, 0.8),
            ..RobotSettings::default()
        },
        faults: FaultSettings { dropped: 0.0, late: 0.0, ..FaultSettings::default() },
        laser: Some(scanner(&mut chance)),
        furniture,
        people,
        ..Scene::default()
    }
}

/// Samples a position away from the walls.
fn place_in([length, width]: [f64; 2], chance: &mut SplitMix64) -> [f64; 2] {
    [chance.between(0.5, length - 0.5), chance.between(0.5, width - 0.5)]
}

fn person(path: &[[f64; 2]], speed_mps: f64) -> PersonSettings {
    let path = path.to_vec();
    PersonSettings { path, speed_mps, at_end: AtEnd::Loop, ..PersonSettings::default() }
}

/// Returns a random scanner, from a cheap one to a safety scanner.
fn scanner(chance: &mut SplitMix64) -> LaserSettings {
    let field_of_view_deg = chance.pick(&[180.0, 240.0, 270.0, 360.0]);
    let step_deg = chance.between(0.2, 1.1);
    LaserSettings {
        rays: (field_of_view_deg / step_deg) as usize,
        field_of_view_deg,
        height_m: chance.between(0.12, 0.55),
        min_range_m: 0.05,
        max_range_m: chance.between(6.0, 15.0),
        sigma_m: chance.between(0.003, 0.03),
        sigma_per_m: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_vary_and_depend_on_their_seed_alone() {
        let seeds = (0..20).map(|number| Split::Train.seed(number).unwrap());
        let lasers: Vec<_> = seeds.map(|seed| (scene(seed), scene(seed))).collect();
        assert!(lasers.iter().all(|(a, b)| a == b));
        let heights = lasers.iter().map(|(scene, _)| scene.laser.as_ref().unwrap().height_m);
        let (low, high) = heights.fold((1.0_f64, 0.0_f64), |(a, b), h| (a.min(h), b.max(h)));
        assert!(low < 0.25 && high > 0.4, "{low} to {high}");
        for (scene, _) in lasers {
            let text = toml::to_string(&scene).unwrap();
            assert_eq!(Scene::parse(&text).unwrap(), scene);
        }
    }
}
