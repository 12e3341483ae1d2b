//! Scenes for training a detector in depth: rooms and corridors of any size, cameras from knee to
//! above head height, any furniture anywhere, and people near and far, cut off by the image border,
//! or seated.

use tagalong_config::ConfigError;
use tagalong_math::{RandomSource, SplitMix64};
use tagalong_sim::{
    AtEnd, CameraSettings, FaultSettings, Furniture, FurnitureKind, PersonSettings, Posture,
    RobotSettings, RoomSettings, Scene, Split,
};

use super::rooms::ImageTiming;

const FURNITURE: [FurnitureKind; 13] = [
    FurnitureKind::CoatStand,
    FurnitureKind::DrapedChair,
    FurnitureKind::FloorLamp,
    FurnitureKind::Plant,
    FurnitureKind::Pillar,
    FurnitureKind::Poster,
    FurnitureKind::CardboardFigure,
    FurnitureKind::Desk,
    FurnitureKind::Shelf,
    FurnitureKind::Chair,
    FurnitureKind::BinOnTable,
    FurnitureKind::Doorway,
    FurnitureKind::Partition,
];

/// Postures, each as often as it is listed.
const POSTURES: [Posture; 12] = [
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Upright,
    Posture::Phone,
    Posture::Bending,
    Posture::Seated,
    Posture::Seated,
];

/// Numbers of people, each as often as it is listed.
const PEOPLE: [usize; 8] = [0, 1, 1, 2, 2, 3, 4, 5];

/// Returns a scene of a split, with depth only.
///
/// # Errors
/// An invalid seed.
pub fn wide_scene(split: Split, number: u64, look: ImageTiming) -> Result<Scene, ConfigError> {
    let seed = split.seed(number)?;
    let mut chance = SplitMix64::new(seed);
    let is_corridor = chance.between(0.0, 1.0) < 0.2;
    let breadth = if is_corridor { [1.5, 2.4] } else { [3.5, 9.0] };
    let size_m = [chance.between(5.0, 12.0), chance.between(breadth[0], breadth[1])];
    let start = [chance.between(0.5, 1.2), size_m[1] * chance.between(0.35, 0.65)];
    let camera = camera(&mut chance);
    let view = View { start, size_m, half_rad: 0.525 * camera.field_of_view_deg.to_radians() };
    let furniture = if is_corridor { 0.0..3.0 } else { 1.0..9.0 };
    let furniture = chance.between(furniture.start, furniture.end) as usize;
    let clutter = if is_corridor { 0 } else { chance.between(0.0, 15.0) as usize };
    let mut furniture: Vec<Furniture> = (0..furniture).map(|_| piece(&mut chance, &view)).collect();
    let people: Vec<PersonSettings> =
        (0..chance.pick(&PEOPLE)).map(|_| person(&mut chance, &view)).collect();
    furniture.extend(people.iter().filter_map(|person| in_front(&mut chance, &view, person)));
    Ok(Scene {
        about: "whole frames for a detector in depth".into(),
        seed,
        duration_s: look.duration_s,
        room: RoomSettings {
            size_m,
            height_m: chance.between(2.3, 3.4),
            clutter,
            open_door: chance.between(0.0, 1.0) < 0.3,
            ..RoomSettings::default()
        },
        camera: CameraSettings { rate_hz: look.rate_hz, ..camera },
        robot: RobotSettings {
            start,
            heading_deg: chance.between(-15.0, 15.0),
            ..RobotSettings::default()
        },
        faults: FaultSettings { dropped: 0.0, late: 0.0, ..FaultSettings::default() },
        furniture,
        people,
        ..Scene::default()
    })
}

fn camera(chance: &mut SplitMix64) -> CameraSettings {
    let highest = chance.pick(&[1.3, 2.5]);
    let height_m = chance.between(0.3, highest);
    // High cameras look down, and those near the floor look up.
    let pitch = match height_m {
        m if m < 0.8 => [-12.0, 8.0],
        m if m < 1.5 => [-4.0, 10.0],
        _ => [5.0, 32.0],
    };
    let any_deg = chance.between(50.0, 100.0);
    CameraSettings {
        colour: false,
        width: 320,
        height: 240,
        field_of_view_deg: chance.pick(&[58.0, 58.0, 70.0, 87.0, any_deg]),
        height_m,
        pitch_down_deg: chance.between(pitch[0], pitch[1]),
        baseline_m: chance.pick(&[0.05, 0.075, 0.095]),
        min_depth_m: chance.pick(&[0.2, 0.3, 0.5, 0.6]),
        max_depth_m: chance.pick(&[4.5, 6.0, 8.0, 10.0]),
        mount_error_deg: chance.pick(&[0.3, 1.0]),
        ..CameraSettings::default()
    }
}

/// View of the robot from its start.
struct View {
    start: [f64; 2],
    size_m: [f64; 2],
    half_rad: f64,
}

impl View {
    /// Returns a random position in view or just beside it, inside the room.
    fn place(&self, chance: &mut SplitMix64, [near_m, far_m]: [f64; 2]) -> [f64; 2] {
        fn inside(at: f64, size: f64) -> f64 {
            at.clamp(0.35, size - 0.35)
        }

        let distance = chance.between(near_m, far_m);
        let angle = chance.between(-self.half_rad, self.half_rad);
        [
            inside(self.start[0] + distance * angle.cos(), self.size_m[0]),
            inside(self.start[1] + distance * angle.sin(), self.size_m[1]),
        ]
    }
}

fn piece(chance: &mut SplitMix64, view: &View) -> Furniture {
    Furniture {
        kind: chance.pick(&FURNITURE),
        at: view.place(chance, [1.2, 6.0]),
        heading_deg: chance.between(0.0, 360.0),
    }
}

/// Returns, for one in four people, a piece of furniture in front of them.
fn in_front(chance: &mut SplitMix64, view: &View, person: &PersonSettings) -> Option<Furniture> {
    let is_behind = chance.between(0.0, 1.0) < 0.25;
    let off_m = chance.between(0.5, 1.0);
    let kind = chance.pick(&[FurnitureKind::Desk, FurnitureKind::Desk, FurnitureKind::Chair]);
    let heading_deg = chance.between(150.0, 210.0);
    let [x, y] = *person.path.first()?;
    let [dx, dy] = [x - view.start[0], y - view.start[1]];
    let nearer = 1.0 - off_m / dx.hypot(dy);
    let at = [view.start[0] + nearer * dx, view.start[1] + nearer * dy];
    (is_behind && nearer > 0.3).then_some(Furniture { kind, at, heading_deg })
}

/// Returns a person, near the camera in nearly half of all cases.
fn person(chance: &mut SplitMix64, view: &View) -> PersonSettings {
    let posture = chance.pick(&POSTURES);
    let reach_m = if chance.between(0.0, 1.0) < 0.45 { [0.6, 2.6] } else { [1.2, 5.6] };
    let stays = posture == Posture::Seated || chance.between(0.0, 1.0) < 0.3;
    let points = if stays { 1 } else { 3 };
    let has_company = posture == Posture::Upright && chance.between(0.0, 1.0) < 0.15;
    PersonSettings {
        path: (0..points).map(|_| view.place(chance, reach_m)).collect(),
        speed_mps: chance.between(0.3, 1.3),
        posture,
        at_end: AtEnd::Loop,
        heading_deg: Some(chance.between(0.0, 360.0)),
        companions: usize::from(has_company),
        ..PersonSettings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_valid_and_of_every_kind() {
        let look = ImageTiming { rate_hz: 1.0, duration_s: 3.6 };
        let scenes: Vec<Scene> =
            (0..200).map(|number| wide_scene(Split::Train, number, look).unwrap()).collect();
        for scene in &scenes {
            let text = toml::to_string(scene).unwrap();
            assert_eq!(Scene::parse(&text).unwrap().seed, scene.seed, "{text}");
        }
        let corridors = scenes.iter().filter(|scene| scene.room.size_m[1] < 2.5).count();
        let low = scenes.iter().filter(|scene| scene.camera.height_m < 0.8).count();
        let high = scenes.iter().filter(|scene| scene.camera.height_m > 1.6).count();
        let empty = scenes.iter().filter(|scene| scene.people.is_empty()).count();
        let mut seated = 0;
        for scene in &scenes {
            seated += usize::from(scene.people.iter().any(|p| p.posture == Posture::Seated));
        }
        for (count, least, kind) in [
            (corridors, 20, "corridors"),
            (low, 50, "small robots"),
            (high, 30, "cameras under the ceiling"),
            (empty, 10, "empty rooms"),
            (seated, 30, "seated people"),
        ] {
            assert!(count > least, "{kind}: {count}");
        }
    }
}
