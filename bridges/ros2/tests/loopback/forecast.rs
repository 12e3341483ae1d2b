//! The grid of where people will be, as a costmap hears it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use serde::Deserialize;
use tagalong::log::msgs::{Header, People, Pose, Time};

use crate::peers::*;

/// `nav_msgs/MapMetaData`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct MapMetaData {
    #[expect(dead_code, reason = "it is on the wire")]
    map_load_time: Time,
    resolution: f32,
    width: u32,
    height: u32,
    origin: Pose,
}

/// `nav_msgs/OccupancyGrid`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Grid {
    header: Header,
    info: MapMetaData,
    data: Vec<i8>,
}

pub(crate) fn collect(peer: &mut Peer, stop: &Arc<AtomicBool>) -> Collected<Grid> {
    peer.collect_of("/people/forecast", "nav_msgs/msg/OccupancyGrid", stop)
}

impl Grid {
    fn at(&self, x: f64, y: f64) -> i8 {
        let cell_m = f64::from(self.info.resolution);
        let column = ((x - self.info.origin.position.x) / cell_m).floor() as usize;
        let row = ((y - self.info.origin.position.y) / cell_m).floor() as usize;
        self.data[row * self.info.width as usize + column]
    }
}

/// Checks the grids of the one person of the scene against the people that are published beside them.
pub(crate) fn check(grids: &[(Instant, Grid)], people: &[(Instant, People)]) {
    assert!(grids.len() > 10, "{} grids", grids.len());
    let mut shown = 0;
    for (_, grid) in grids {
        assert_eq!((grid.info.width, grid.info.height, grid.data.len()), (120, 120, 14_400));
        assert_eq!(grid.header.frame_id, "odom");
        assert!(grid.data.iter().all(|percent| (-1..=100).contains(percent)));
        let same = people.iter().find(|(_, array)| array.header.stamp == grid.header.stamp);
        let Some(person) = same.and_then(|(_, array)| array.people.first()) else { continue };
        let percent = grid.at(person.position.x, person.position.y);
        assert!(percent > 60, "{percent} % where the person is");
        assert_eq!(grid.at(-3.0, 0.0), -1, "behind the robot");
        shown += 1;
    }
    assert!(shown > 10, "a person in {shown} of {} grids", grids.len());
    let late = people.iter().rev().filter_map(|(_, array)| array.people.first());
    let speed = late.map(|person| person.velocity.x).fold(0.0, f64::max);
    assert!(speed > 0.1, "the person walks away: {speed} m/s");
}
