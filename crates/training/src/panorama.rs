//! Distances in the panorama of a conical mirror, from people in
//! simulated rooms with known positions.

use nalgebra::Matrix3;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say, write_file};
use tagalong_app::threads::threads;
use tagalong_config::{Example, Trainer};
use tagalong_core::{Detection, Frame};
use tagalong_sim::{Scene, Split, Truth, Variant};
use tagalong_trials::Draw;

use super::args::TrainArgs;
use super::session::Session;

/// Scene with two people, one after the other; each seed gives another room, other people and
/// another mirror.
const ROOM: &str = include_str!("../configs/scenes/omni-room.toml");
/// First group number of the people in other rooms.
const STRANGER: u64 = 100;
/// Time for which each person of the first room is seen, s: each gets a regression head of their
/// own.
const KNOWN_S: f64 = 40.0;
/// Number of other rooms, for the general head, and the time for which each of their people is
/// seen, s.
const STRANGE: (u64, f64) = (15, 10.0);
/// Time per person in a quick training, which has the first room only, s.
const QUICK_S: f64 = 12.0;

/// Room to simulate.
struct Room {
    seed: u64,
    each_s: f64,
}

fn rooms(quick: bool, seed: u64) -> Vec<Room> {
    if quick {
        return vec![Room { seed, each_s: QUICK_S }];
    }
    let (rooms, each_s) = STRANGE;
    let strange = (1..=rooms).map(|number| Room { seed: seed + number, each_s });
    std::iter::once(Room { seed, each_s: KNOWN_S }).chain(strange).collect()
}

impl Room {
    /// Returns the scene: the empty room, the first person, then the second.
    fn scene(&self) -> Result<Scene, Failure> {
        let variant = Variant::of_split(Split::Train, self.seed);
        // The webcams would cost time, and nothing is trained on their images.
        let scene = Scene::parse_with(ROOM, &variant).map_err(Failure::failed)?;
        Ok(Scene { webcams: Vec::new(), ..scene.in_turn(self.each_s) })
    }
}

/// Simulates, fits, and writes the model and the card.
///
/// # Errors
/// Scenes that do not parse, too few samples, files that cannot be written.
pub fn train(session: &Session<'_>, args: &TrainArgs) -> Outcome {
    let mut trainer = session.trainer()?;
    let rooms = rooms(args.quick, args.seed);
    for (number, room) in rooms.iter().enumerate() {
        session.tell(number, "drawing rooms");
        show(session, room, trainer.as_mut())?;
    }
    session.tell(rooms.len() - 1, "fitting");
    let fitted = trainer.fit(&mut |_| ()).map_err(Failure::failed)?;
    session.bar.finish_and_clear();
    write_file(&session.model, &fitted.model)?;
    let card = card(args, &rooms, &fitted.figures);
    write_file(&session.model.with_extension("card.toml"), &card)?;
    print(&card)?;
    say(&format!("{}", session.model.display()));
    Ok(Ended::Well)
}

fn card(args: &TrainArgs, rooms: &[Room], figures: &toml::Table) -> String {
    fn scene(room: &Room) -> toml::Value {
        let Room { seed, each_s } = room;
        toml::Value::from(format!("omni-room, split train, seed {seed}, {each_s} s of each person"))
    }
    let mut card = toml::Table::new();
    card.insert("model".into(), args.plugin.clone().into());
    card.insert("quick".into(), args.quick.into());
    card.insert("seed".into(), (args.seed as i64).into());
    card.insert("trained_on".into(), rooms.iter().map(scene).collect::<Vec<_>>().into());
    card.extend(figures.clone());
    format!(
        "# Made by `tagalong train {}` with this seed. Mean absolute errors on blocks\n\
         # of images, and on people in other rooms, that nothing was fitted to.\n{card}",
        args.plugin
    )
}

/// Passes every person in a room to the trainer.
fn show(session: &Session<'_>, room: &Room, trainer: &mut dyn Trainer) -> Result<(), Failure> {
    let scene = room.scene()?;
    session.bar.set_length((scene.duration_s * scene.camera.rate_hz) as u64);
    // Each room has its own range of group numbers, because the IDs of people start again.
    let first = if room.seed == session.args.seed { 0 } else { STRANGER * (1 + room.seed) };
    let mut draw = Draw::new(&scene, threads(None));
    while let Some(simulated) = draw.next_frame() {
        take(&simulated.frame, &simulated.truth, first, trainer)?;
        session.bar.inc(1);
    }
    Ok(())
}

fn take(
    frame: &Frame,
    truth: &[Truth],
    first: u64,
    trainer: &mut dyn Trainer,
) -> Result<(), Failure> {
    // Frames without people are needed, too: the trainer learns the background from them.
    let mut shown = vec![(nalgebra::Point3::origin(), Example { is_person: false, group: first })];
    for person in truth.iter().filter(|person| !person.ignore) {
        let group = first + u64::from(person.id);
        shown.push((person.head_in_robot, Example { is_person: true, group }));
    }
    for (at, example) in shown {
        let candidate = Detection::new("truth", at, Matrix3::zeros(), 0.0);
        trainer.add(frame, &candidate, example).map_err(Failure::failed)?;
    }
    Ok(())
}
