//! Scenes for training and for testing: random rooms from a seed, and the suites of all other
//! tests, with separate seeds for training.

use tagalong_config::ConfigError;
use tagalong_math::{RandomSource, SplitMix64};
use tagalong_sim::{
    AtEnd, CameraKind, CameraSettings, FaultSettings, Floor, Furniture, FurnitureKind,
    LightSettings, PersonSettings, RobotSettings, RoomSettings, Scene, Split, Variant,
};

/// Furniture with the silhouette of a person.
const LOOK_ALIKES: [FurnitureKind; 6] = [
    FurnitureKind::CoatStand,
    FurnitureKind::DrapedChair,
    FurnitureKind::FloorLamp,
    FurnitureKind::Plant,
    FurnitureKind::Pillar,
    FurnitureKind::CardboardFigure,
];

/// Suites, which are used in turn.
const SUITES: [&str; 9] = [
    include_str!("../configs/scenes/empty-clutter.toml"),
    include_str!("../configs/scenes/office.toml"),
    include_str!("../configs/scenes/crowd.toml"),
    include_str!("../configs/scenes/full-occlusion.toml"),
    include_str!("../configs/scenes/empty-clutter.toml"),
    include_str!("../configs/scenes/square-walk.toml"),
    include_str!("../configs/scenes/cafeteria.toml"),
    include_str!("../configs/scenes/turntable.toml"),
    include_str!("../configs/scenes/following.toml"),
];

/// Rate and duration of the images of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageTiming {
    /// Images per second.
    pub rate_hz: f64,
    /// Duration, s.
    pub duration_s: f64,
}

/// Returns a scene of a split: a random room or the next suite in turn, half of them as colour and
/// depth, half of them as a stereo pair.
///
/// # Errors
/// An invalid seed.
pub fn scene(split: Split, number: u64, look: ImageTiming) -> Result<Scene, ConfigError> {
    let turn = number / 2;
    let is_room = number.is_multiple_of(2);
    // The camera changes more slowly than the rest, so that every suite gets both kinds.
    let kind = if (turn / 2).is_multiple_of(2) { CameraKind::Rgbd } else { CameraKind::Stereo };
    let seed = split.seed(number)?;
    let mut scene = if is_room {
        room(seed, (turn % 4) as usize)
    } else {
        let text = SUITES[(turn % SUITES.len() as u64) as usize];
        Scene::parse_with(text, &Variant::of_seed(seed))?
    };
    scene.camera.kind = kind;
    (scene.camera.rate_hz, scene.duration_s) = (look.rate_hz, look.duration_s);
    Ok(scene)
}

/// Returns a room with this number of people, all of which is in view. Size, light, camera,
/// furniture and the paths and appearance of the people depend on the seed.
fn room(seed: u64, people: usize) -> Scene {
    let mut chance = SplitMix64::new(seed);
    let length = chance.between(7.0, 12.0);
    let width = chance.between(5.0, 8.0);
    let start = [0.8, width * chance.between(0.3, 0.7)];
    let view = RobotView { start, room: [length, width] };
    Scene {
        about: "candidates for a verifier".into(),
        seed,
        room: RoomSettings {
            size_m: [length, width],
            height_m: chance.between(2.5, 3.2),
            wallpaper: chance.between(0.0, 1.0) < 0.5,
            floor: chance.pick(&[Floor::Planks, Floor::Tiles, Floor::Carpet]),
            ..RoomSettings::default()
        },
        light: LightSettings {
            lux: chance.between(80.0, 700.0),
            lamps: chance.between(1.0, 4.0) as usize,
            ambient: chance.between(0.2, 0.5),
            day: None,
        },
        camera: CameraSettings {
            width: 512,
            height: 384,
            field_of_view_deg: chance.between(56.0, 100.0),
            baseline_m: 0.12,
            height_m: chance.between(0.9, 1.5),
            pitch_down_deg: chance.between(-3.0, 6.0),
            ..CameraSettings::default()
        },
        robot: RobotSettings {
            start,
            path: vec![[chance.between(1.3, 2.0), start[1] + chance.between(-0.3, 0.3)]],
            speed_mps: chance.between(0.2, 0.5),
            ..RobotSettings::default()
        },
        faults: FaultSettings { dropped: 0.0, late: 0.0, ..FaultSettings::default() },
        furniture: (0..6).map(|_| piece(&mut chance, &view)).collect(),
        people: (0..people).map(|_| walker(&mut chance, &view)).collect(),
        ..Scene::default()
    }
}

/// View of the robot from its start.
struct RobotView {
    start: [f64; 2],
    room: [f64; 2],
}

impl RobotView {
    /// Returns a random position in view, within the range of the detector and inside the room.
    fn place(&self, chance: &mut SplitMix64) -> [f64; 2] {
        fn inside(at: f64, size: f64) -> f64 {
            at.clamp(0.5, size - 0.5)
        }

        let distance = chance.between(1.8, 5.5);
        let angle = chance.between(-0.5, 0.5);
        [
            inside(self.start[0] + distance * angle.cos(), self.room[0]),
            inside(self.start[1] + distance * angle.sin(), self.room[1]),
        ]
    }
}

fn piece(chance: &mut SplitMix64, view: &RobotView) -> Furniture {
    Furniture {
        kind: chance.pick(&LOOK_ALIKES),
        at: view.place(chance),
        heading_deg: chance.between(90.0, 270.0),
    }
}

fn walker(chance: &mut SplitMix64, view: &RobotView) -> PersonSettings {
    PersonSettings {
        path: (0..3).map(|_| view.place(chance)).collect(),
        speed_mps: chance.between(0.3, 1.2),
        at_end: AtEnd::Loop,
        ..PersonSettings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOK: ImageTiming = ImageTiming { rate_hz: 2.0, duration_s: 3.0 };

    #[test]
    fn a_scene_depends_on_its_number_and_split_only() {
        for number in 0..40 {
            let train = scene(Split::Train, number, LOOK).unwrap();
            assert_eq!(train, scene(Split::Train, number, LOOK).unwrap());
            assert_eq!(Split::of(train.seed), Split::Train);
            assert_ne!(train, scene(Split::Test, number, LOOK).unwrap());
            let text = toml::to_string(&train).unwrap();
            assert_eq!(Scene::parse(&text).unwrap().seed, train.seed);
        }
    }

    #[test]
    fn every_suite_is_seen_by_both_cameras() {
        fn kinds(kind: CameraKind) -> std::collections::BTreeSet<String> {
            let scenes = (0..72).map(|number| scene(Split::Train, number, LOOK).unwrap());
            let abouts = scenes.filter(|s| s.camera.kind == kind).map(|scene| scene.about);
            abouts.collect::<std::collections::BTreeSet<String>>()
        }
        assert_eq!(kinds(CameraKind::Rgbd), kinds(CameraKind::Stereo));
        assert_eq!(kinds(CameraKind::Rgbd).len(), 9, "eight suites and the rooms");
    }
}
