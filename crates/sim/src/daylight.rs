//! Windows, the sky behind them, and the sun.

use nalgebra::{Point3, Rotation3, Vector3};
use tagalong_core::settings;

use crate::material::Material;
use crate::room_settings::RoomSettings;
use crate::shape::{Form, Shape};
use crate::world::{Lamp, Object};

/// Half the width of a window, and the heights of its sill and its top, m.
const HALF_M: f64 = 0.65;
const SILL_M: f64 = 0.85;
const TOP_M: f64 = 2.15;
/// Width of a window with its frame and some wall, m.
const LEAST_PITCH_M: f64 = 1.6;
/// Distance of the sun, m: far enough for parallel rays.
const SUN_M: f64 = 1000.0;

settings! {
    /// Windows along the left wall of a room (at the far end of Y), evenly spaced, and the daylight
    /// in them. They can dazzle the camera, and in sunlight images are white and structured light
    /// measures nothing.
    pub struct Daylight {
        /// Number of windows.
        pub windows: usize = 3,
        /// Brightness of the sky, given as the illuminance of a white surface, lx.
        #[schemars(range(min = 0.0, max = 50_000.0))]
        pub sky_lux: f64 = 3000.0,
        /// Illuminance of a surface that faces the sun, lx; 0 for an overcast day.
        #[schemars(range(min = 0.0, max = 130_000.0))]
        pub sun_lux: f64 = 20_000.0,
        /// Azimuth of the sun, from straight out of the windows towards the far end of the room,
        /// degrees.
        #[schemars(range(min = -80.0, max = 80.0))]
        pub azimuth_deg: f64 = 20.0,
        /// Elevation of the sun above the horizon, degrees.
        #[schemars(range(min = 2.0, max = 80.0))]
        pub elevation_deg: f64 = 30.0,
    }
}

impl Daylight {
    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self, room: &RoomSettings) -> [(bool, &'static str); 1] {
        [(
            self.windows > 0 && self.windows as f64 * LEAST_PITCH_M <= room.size_m[0],
            "light.day.windows must be at least 1, and 1.6 m of wall long each",
        )]
    }

    /// Returns the panes, as bright as the sky, with their frames in front of the wall of a room.
    pub(crate) fn windows(&self, room: &RoomSettings) -> Object {
        let openings = Windows::of(self.windows, room);
        let pane = Material::plain([0.85, 0.93, 1.0]).with_infrared(0.0).glowing(self.sky_lux);
        let frame = Material::plain([0.7; 3]);
        let middle = 0.5 * (SILL_M + openings.top_m);
        let half = 0.5 * (openings.top_m - SILL_M);
        let mut blocks = vec![([0.0, 0.0], [HALF_M, 0.01, half], pane)];
        for along in [-HALF_M, 0.0, HALF_M] {
            blocks.push(([along, 0.0], [0.025, 0.03, half], frame));
        }
        for up in [-half, half] {
            blocks.push(([0.0, up], [HALF_M, 0.03, 0.025], frame));
        }
        let mut shapes = Vec::new();
        for number in 0..self.windows {
            let x = openings.middle(number);
            for &([along, up], sides, of) in &blocks {
                let at = Point3::new(x + along, openings.wall_m, middle + up);
                shapes.push(Shape::new(Form::Block(sides.into()), at, Rotation3::identity(), of));
            }
        }
        Object::new(shapes, None, false)
    }

    /// Returns the sun as a lamp; `None` on an overcast day.
    pub(crate) fn sun(&self, room: &RoomSettings) -> Option<Lamp> {
        let aside = self.azimuth_deg.to_radians();
        let up = self.elevation_deg.to_radians();
        let towards =
            Vector3::new(up.cos() * aside.sin(), up.cos() * aside.cos(), up.sin()) * SUN_M;
        let at = Point3::new(0.5 * room.size_m[0], room.size_m[1], 1.0) + towards;
        let windows = Some(Windows::of(self.windows, room));
        let lux_at_1m = self.sun_lux * SUN_M * SUN_M;
        (self.sun_lux > 0.0).then_some(Lamp { at, lux_at_1m, windows })
    }
}

/// Openings in a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Windows {
    count: usize,
    /// Distance between the middles of neighbouring windows, m.
    pitch_m: f64,
    /// Position of the wall along Y, m.
    wall_m: f64,
    top_m: f64,
}

impl Windows {
    fn of(count: usize, room: &RoomSettings) -> Self {
        let [long, wide] = room.size_m;
        let top_m = TOP_M.min(room.height_m - 0.2);
        Self { count, pitch_m: long / count as f64, wall_m: wide, top_m }
    }

    /// Returns the position of the middle of a window along the wall, m.
    fn middle(&self, number: usize) -> f64 {
        (number as f64 + 0.5) * self.pitch_m
    }

    /// Returns true if a ray from the sun passes through a window.
    #[inline(always)]
    pub fn are_open(&self, sun: &Point3<f64>, way: &Vector3<f64>) -> bool {
        let at = sun + way * ((self.wall_m - sun.y) / way.y);
        let from_middle = (at.x / self.pitch_m).fract() - 0.5;
        let is_along = at.x > 0.0 && at.x < self.count as f64 * self.pitch_m;
        let is_beside = (from_middle * self.pitch_m).abs() < HALF_M;
        is_along && is_beside && at.z > SILL_M && at.z < self.top_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn the_sun_comes_through_the_windows_only() {
        let room = RoomSettings { size_m: [9.0, 6.0], ..RoomSettings::default() };
        let day = Daylight { azimuth_deg: 0.0, elevation_deg: 45.0, ..Daylight::default() };
        let sun = day.sun(&room).unwrap();
        let windows = sun.windows.unwrap();
        // At 45 degrees a sill of 0.85 m is 0.85 m from the wall on the floor.
        for (x, from_wall, is_lit) in [
            (1.5, 0.9, true),
            (4.5, 2.0, true),
            (2.1, 1.5, true),
            (1.5, 0.8, false),
            (1.5, 2.2, false),
            (3.0, 1.5, false),
        ] {
            let way = Point3::new(x, 6.0 - from_wall, 0.0) - sun.at;
            assert_eq!(windows.are_open(&sun.at, &way), is_lit, "{x} {from_wall}");
        }
        assert!(Daylight { sun_lux: 0.0, ..day }.sun(&room).is_none());
    }

    #[test]
    fn windows_that_do_not_fit_are_refused() {
        let text = "[room]\nsize_m = [9.0, 6.0]\n[light.day]\nwindows = ";
        assert!(Scene::parse(&format!("{text}5\n")).is_ok());
        let error = Scene::parse(&format!("{text}6\n")).unwrap_err();
        assert!(error.message.contains("light.day.windows"), "{error:?}");
    }
}
