//! The people of a scene, before the first image.

use nalgebra::{Point2, Vector2};

use crate::approach::ApproachBy;
use crate::behaviour::Walker;
use crate::obstacle::Obstacle;
use crate::person::Person;
use crate::posture::Posture;
use crate::random::Random;
use crate::scene::{AtEnd, PersonSettings, Scene};
use crate::split::{SUBJECTS, Split};

/// Fraction of a crowd that comes in pairs.
const CROWD_PAIRS: f64 = 0.3;

/// Returns the people of the scene and its crowd, at their starting points.
pub(super) fn walkers(scene: &Scene, obstacles: &[Obstacle], random: &mut Random) -> Vec<Walker> {
    let mut walkers = Vec::new();
    for person in &scene.people {
        let mut person = person.clone();
        for _ in 0..person.wander {
            let point = free_point(scene, &[], obstacles, &ANYWHERE, random);
            person.path.push([point.x, point.y]);
        }
        let companions = person.companions;
        add_group(&mut walkers, person, companions, scene, random);
    }
    let mut left = scene.crowd;
    while left > 0 {
        let companions = usize::from(left > 1 && random.chance(CROWD_PAIRS));
        let person = wanderer(scene, &walkers, obstacles, random);
        add_group(&mut walkers, person, companions, scene, random);
        left -= 1 + companions;
    }
    walkers
}

/// Position far away from the room where an approacher waits, m.
const AWAY_M: [f64; 2] = [-100.0, -100.0];

/// Returns the person of an approach, if the approacher is a person. The steps are those of the
/// approacher.
pub(super) fn approaching_person(scene: &Scene, random: &mut Random) -> Option<Walker> {
    let approach = scene.approach.as_ref().filter(|one| one.by == ApproachBy::Person)?;
    let person = PersonSettings {
        path: vec![AWAY_M],
        speed_mps: approach.speed_mps,
        enters_s: approach.start_s,
        height_m: approach.height_m,
        ..PersonSettings::default()
    };
    Some(somebody(person, scene.split(), random))
}

/// Adds a person with their companions to the left and to the right.
fn add_group(
    walkers: &mut Vec<Walker>,
    person: PersonSettings,
    companions: usize,
    scene: &Scene,
    random: &mut Random,
) {
    let leader = walkers.len();
    let own = PersonSettings { subject: None, look: None, height_m: None, ..person.clone() };
    walkers.push(somebody(person, scene.split(), random));
    let mut aside = [0.0; 2];
    for number in 0..companions {
        let side = number % 2;
        aside[side] += random.between(0.6, 1.0);
        let left = if side == 0 { aside[side] } else { -aside[side] };
        let offset = Vector2::new(random.between(-0.25, 0.15), left);
        let along = somebody(own.clone(), scene.split(), random);
        let along = along.along((leader, &walkers[leader]), offset);
        walkers.push(along);
    }
}

/// Returns one of the people of a split.
fn somebody(settings: PersonSettings, split: Split, random: &mut Random) -> Walker {
    let any = random.below(SUBJECTS);
    let mut person = Person::subject(split.subject(settings.subject.unwrap_or(any)));
    if let Some(look) = settings.look {
        person.look = Person::subject(split.subject(look)).look;
    }
    if let Some(extras) = &settings.extras {
        person.look.extras.clone_from(extras);
    }
    if let Some(height_m) = settings.height_m {
        person.build.height_m = height_m;
    }
    let own = settings.look.or(settings.subject).unwrap_or(any);
    let walker = Walker::new(person, settings);
    if walker.has_coat() {
        return walker.in_coat(Person::subject(split.subject((own + 1) % SUBJECTS)).look.top);
    }
    walker
}

/// Returns a person that walks between random points of the room.
fn wanderer(
    scene: &Scene,
    walkers: &[Walker],
    obstacles: &[Obstacle],
    random: &mut Random,
) -> PersonSettings {
    let mut path = vec![free_point(scene, walkers, obstacles, &MIDDLE, random)];
    path.extend((0..3).map(|_| free_point(scene, &[], obstacles, &MIDDLE, random)));
    let speed_mps = random.between(0.6, 1.3);
    let start_s = random.between(0.0, 2.0);
    let posture = if random.chance(0.15) { Posture::Phone } else { Posture::Upright };
    let at_end = AtEnd::Loop;
    PersonSettings {
        path: path.iter().map(|p| [p.x, p.y]).collect(),
        speed_mps,
        start_s,
        at_end,
        posture,
        ..PersonSettings::default()
    }
}

/// Area for random points.
struct Area {
    /// Fractions of the room's length and width.
    parts: [[f64; 2]; 2],
    /// Minimum distance from the robot's start, m.
    off_robot_m: f64,
}

/// Area in which a crowd walks: ahead of a robot that starts at the near end.
const MIDDLE: Area = Area { parts: [[0.2, 0.92], [0.15, 0.85]], off_robot_m: 1.5 };
/// Area in which a person with `wander` walks.
const ANYWHERE: Area = Area { parts: [[0.06, 0.94], [0.1, 0.9]], off_robot_m: 0.9 };

/// Returns a random point of an area away from the robot's start, furniture and people; after some
/// tries any point.
fn free_point(
    scene: &Scene,
    walkers: &[Walker],
    obstacles: &[Obstacle],
    area: &Area,
    random: &mut Random,
) -> Point2<f64> {
    let [x, y] = scene.room.size_m;
    let robot = Point2::from(scene.robot.start);
    let [along, across] = area.parts;
    // All are drawn, so that the next draw does not depend on which one is free.
    let tries: [Point2<f64>; 30] = std::array::from_fn(|_| {
        let x = random.between(along[0], along[1]) * x;
        Point2::new(x, random.between(across[0], across[1]) * y)
    });
    let free = tries.iter().find(|at| {
        (*at - robot).norm() > area.off_robot_m
            && obstacles.iter().all(|o| (*at - o.at).norm() > o.radius_m + 0.35)
            && walkers.iter().all(|w| (*at - w.stance.place).norm() > 1.0)
    });
    *free.unwrap_or(&tries[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::person::Extra;

    #[test]
    fn a_coat_over_the_same_clothes_is_that_of_another_one() {
        fn first(text: &str) -> Walker {
            let scene = Scene::parse(text).expect("the scene is right");
            let walkers = walkers(&scene, &[], &mut Random::new(scene.seed, 1));
            walkers.into_iter().next().expect("there is a person")
        }

        let plain = "[[people]]\npath = [[2.0, 2.0]]\nlook = 4\nextras = []\n";
        let own = first(plain).person;
        let coat = first(&format!("{plain}coat_off_s = 3.0\n")).person;
        assert_eq!((coat.build, &coat.look.trousers), (own.build, &own.look.trousers));
        assert_eq!(coat.look.extras, [Extra::Coat]);
        let split = Scene::default().split();
        assert_eq!(coat.look.top, Person::subject(split.subject(5)).look.top);
        assert!(first(plain).person.look.extras.is_empty());
    }
}
