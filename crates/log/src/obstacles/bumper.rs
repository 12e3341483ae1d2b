//! Messages of bumpers, and their state between two messages.

use std::collections::BTreeSet;

use tagalong_core::Stamp;

use super::timed::Readings;
use crate::msgs::{
    BoolMsg, BumperEvent, BumperState, CdrError, ContactCount, HazardDetection,
    HazardDetectionVector, decode,
};
use crate::sensors::is_type;

/// Message types of bumpers.
const TYPES: [(&str, Contact); 8] = [
    ("std_msgs/Bool", Contact::Bool),
    ("kobuki_ros_interfaces/BumperEvent", Contact::Event),
    ("kobuki_msgs/BumperEvent", Contact::Event),
    ("irobot_create_msgs/HazardDetectionVector", Contact::Hazards),
    ("turtlebot3_msgs/SensorState", Contact::State),
    ("gazebo_msgs/ContactsState", Contact::Contacts),
    ("ros_gz_interfaces/Contacts", Contact::Fleeting),
    ("ros_ign_interfaces/Contacts", Contact::Fleeting),
];

/// Time after which a contact counts as ended if it is not repeated, for types that are published
/// only during a contact, s.
const FLEETING_S: f64 = 0.5;

/// Meaning of the messages of a bumper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Contact {
    /// True while it is pressed.
    Bool,
    /// Published at each press and each release of one of several bumpers.
    Event,
    /// All hazards of a base, published periodically.
    Hazards,
    /// The state of a base, published periodically.
    State,
    /// All contacts, published periodically, even if there are none.
    Contacts,
    /// All contacts, published only while there are any.
    Fleeting,
}

impl Contact {
    /// Returns the meaning of a message type, if it is one of a bumper.
    pub(super) fn of(schema: &str) -> Option<Self> {
        TYPES.iter().find(|(name, _)| is_type(schema, name)).map(|(_, contact)| *contact)
    }

    /// Returns the names of the message types as text.
    pub(super) fn type_names() -> String {
        let names: Vec<&str> = TYPES.iter().map(|(name, _)| *name).collect();
        names.join(", ")
    }

    /// Returns true if a bumper publishes nothing while it is not pressed, so that its reading does
    /// not age when it is silent.
    pub(super) fn may_be_silent(self) -> bool {
        matches!(self, Self::Event | Self::Fleeting)
    }
}

/// State of the bumpers on a topic.
#[derive(Debug)]
pub(super) struct Bumper {
    contact: Contact,
    /// Bumpers that are pressed according to the events so far.
    pressed: BTreeSet<u8>,
    readings: Readings<bool>,
    /// Index of the last reading that was delivered with a frame.
    delivered: u64,
}

impl Bumper {
    pub(super) fn new(contact: Contact) -> Self {
        Self { contact, pressed: BTreeSet::new(), readings: Readings::default(), delivered: 0 }
    }

    /// Adds a message. If it has no stamp of its own, its arrival is the stamp.
    pub(super) fn take(&mut self, data: &[u8], arrival: Stamp) -> Result<(), CdrError> {
        let (stamp, is_pressed) = match self.contact {
            Contact::Bool => (arrival, decode::<BoolMsg>(data)?.data),
            Contact::Event => (arrival, self.after(decode(data)?)),
            Contact::Hazards => {
                let HazardDetectionVector { header, detections } = decode(data)?;
                let is_bump = detections.iter().any(|hazard| hazard.kind == HazardDetection::BUMP);
                (header.stamp(), is_bump)
            }
            Contact::State => {
                let BumperState { header, bumper } = decode(data)?;
                (header.stamp(), bumper != 0)
            }
            Contact::Contacts | Contact::Fleeting => {
                let ContactCount { header, contacts } = decode(data)?;
                (header.stamp(), contacts > 0)
            }
        };
        self.readings.push(stamp, size_of::<bool>(), is_pressed);
        Ok(())
    }

    /// Returns true if any bumper is pressed after this event.
    fn after(&mut self, event: BumperEvent) -> bool {
        if event.state == BumperEvent::RELEASED {
            self.pressed.remove(&event.bumper);
        } else {
            self.pressed.insert(event.bumper);
        }
        !self.pressed.is_empty()
    }

    /// Returns the state at a frame, with the time of the reading; `None` without one. A press
    /// since the last frame counts even if it has ended.
    pub(super) fn state(&mut self, frame: Stamp, latest: Stamp) -> Option<(Stamp, bool)> {
        let mut was_pressed = false;
        let mut delivered = self.delivered;
        for reading in self.readings.until(latest).filter(|fresh| fresh.number > self.delivered) {
            was_pressed |= reading.value;
            delivered = delivered.max(reading.number);
        }
        self.delivered = delivered;
        let newest = self.readings.newest_until(latest);
        let found = newest.map(|newest| (newest.stamp, newest.value || was_pressed));
        if !self.contact.may_be_silent() {
            return found;
        }
        let Some((stamp, is_pressed)) = found else { return Some((frame, false)) };
        let is_over = self.contact == Contact::Fleeting && frame.seconds_since(stamp) > FLEETING_S;
        // The state is valid until the next message.
        Some((frame, is_pressed && !is_over))
    }

    /// Returns the stamp of the first reading.
    pub(super) fn first_stamp(&self) -> Option<Stamp> {
        self.readings.first_stamp()
    }
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::*;
    use crate::msgs::{Header, encode};

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    fn take<T: Serialize>(bumper: &mut Bumper, arrival: f64, message: &T) {
        assert!(bumper.take(&encode(message), at(arrival)).is_ok());
    }

    fn event(bumper: u8, state: u8) -> BumperEvent {
        BumperEvent { bumper, state }
    }

    fn state(bumper: &mut Bumper, seconds: f64) -> Option<bool> {
        bumper.state(at(seconds), at(seconds + 0.25)).map(|(_, is_pressed)| is_pressed)
    }

    #[test]
    fn an_event_holds_until_the_same_bumper_is_released() {
        let mut bumper = Bumper::new(Contact::Event);
        assert_eq!(bumper.state(at(0.5), at(0.75)), Some((at(0.5), false)));
        take(&mut bumper, 1.0, &event(0, 1));
        take(&mut bumper, 1.1, &event(2, 1));
        assert_eq!([state(&mut bumper, 1.0), state(&mut bumper, 100.0)], [Some(true); 2]);
        take(&mut bumper, 100.5, &event(0, 0));
        // Its reading has no age, because the state holds.
        assert_eq!(bumper.state(at(101.0), at(101.25)), Some((at(101.0), true)));
        take(&mut bumper, 101.5, &event(2, 0));
        assert_eq!(state(&mut bumper, 101.5), Some(false));
    }

    #[test]
    fn a_press_between_two_frames_is_told_once() {
        let mut bumper = Bumper::new(Contact::Bool);
        assert_eq!(state(&mut bumper, 1.0), None);
        for (arrival, data) in [(1.0, false), (1.1, true), (1.1, false)] {
            take(&mut bumper, arrival, &BoolMsg { data });
        }
        assert_eq!(bumper.state(at(1.2), at(1.45)), Some((at(1.1), true)));
        assert_eq!(bumper.state(at(1.3), at(1.55)), Some((at(1.1), false)));
    }

    #[test]
    fn a_pressed_bool_holds_and_grows_old() {
        let mut bumper = Bumper::new(Contact::Bool);
        take(&mut bumper, 1.0, &BoolMsg { data: true });
        assert_eq!(bumper.state(at(1.0), at(1.25)), Some((at(1.0), true)));
        assert_eq!(bumper.state(at(9.0), at(9.25)), Some((at(1.0), true)));
    }

    #[test]
    fn of_the_hazards_only_bumps_are_contacts() {
        fn hazard(kind: u8) -> HazardDetection {
            HazardDetection { header: Header::new(at(1.0), "bumper"), kind }
        }

        for (kinds, expected) in [(vec![], false), (vec![2, 5], false), (vec![2, 1], true)] {
            let mut bumper = Bumper::new(Contact::Hazards);
            let header = Header::new(at(1.0), "base_link");
            let detections = kinds.into_iter().map(hazard).collect();
            take(&mut bumper, 7.0, &HazardDetectionVector { header, detections });
            assert_eq!(bumper.state(at(1.1), at(1.35)), Some((at(1.0), expected)));
        }
    }

    #[test]
    fn contacts_that_are_only_sent_while_there_are_any_end_by_silence() {
        let mut bumper = Bumper::new(Contact::of("ros_gz_interfaces/msg/Contacts").unwrap());
        assert_eq!(state(&mut bumper, 0.5), Some(false));
        let header = Header::new(at(1.0), "bumper");
        take(&mut bumper, 1.0, &ContactCount { header, contacts: 3 });
        assert_eq!([state(&mut bumper, 1.4), state(&mut bumper, 1.6)], [Some(true), Some(false)]);
    }

    #[test]
    fn states_and_contacts_say_what_is_pressed() {
        fn header() -> Header {
            Header::new(at(1.0), "base_link")
        }

        let mut bumper = Bumper::new(Contact::of("turtlebot3_msgs/msg/SensorState").unwrap());
        take(&mut bumper, 1.0, &BumperState { header: header(), bumper: 2 });
        assert_eq!(state(&mut bumper, 1.0), Some(true));
        let mut bumper = Bumper::new(Contact::of("gazebo_msgs/ContactsState").unwrap());
        take(&mut bumper, 1.0, &ContactCount { header: header(), contacts: 0 });
        assert_eq!(bumper.state(at(3.0), at(3.25)), Some((at(1.0), false)));
        assert_eq!(Contact::of("sensor_msgs/msg/Range"), None);
    }
}
