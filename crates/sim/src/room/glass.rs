//! Furniture of glass: doors, mirrors and walls.

use super::{DOOR_M, METAL, Maker, door_frame};
use crate::material::Material;

/// Half the width and the height of a wall of glass, m.
const WALL_M: [f64; 2] = [1.0, 2.1];

impl Maker {
    pub(super) fn glass_door(&mut self) {
        let [side, top] = DOOR_M;
        let pane = Material::plain([0.45, 0.50, 0.50]).with_infrared(0.0);
        self.block([0.0, 0.0, 0.5 * top], [0.01, side, 0.5 * top], pane);
        self.shapes.extend(door_frame(self.at, &self.turn));
    }

    /// Adds a mirror as tall as a person, so that whole people are seen in it.
    pub(super) fn mirror(&mut self) {
        let wide = self.between(0.35, 0.6);
        let top = self.between(1.75, 2.0);
        let low = 0.08;
        let wood = Material::plain(self.wood);
        let middle = 0.5 * (low + top);
        self.block([0.0, 0.0, middle], [0.005, wide, middle - low], Material::mirror());
        // The back is of wood, because a mirror reflects on one side only.
        self.block([-0.02, 0.0, middle], [0.014, wide + 0.04, middle - low + 0.04], wood);
        for y in [-1.0, 1.0] {
            self.block([0.0, y * (wide + 0.02), middle], [0.02, 0.02, middle - low], wood);
        }
    }

    pub(super) fn glass_wall(&mut self) {
        let ([side, top], metal) = (WALL_M, Material::plain(METAL));
        self.block([0.0, 0.0, 0.5 * top], [0.006, side, 0.5 * top], Material::glass());
        for y in [-side, side] {
            self.block([0.0, y, 0.5 * top], [0.03, 0.03, 0.5 * top], metal);
        }
        for z in [0.03, top] {
            self.block([0.0, 0.0, z], [0.03, side, 0.03], metal);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, Rotation3, Vector3};

    use crate::furniture::{Furniture, FurnitureKind};
    use crate::material::Material;
    use crate::random::Random;
    use crate::room::furniture;
    use crate::shape::{Form, Shape};
    use crate::world::{Hit, Object, Stage, World};

    /// A piece at (3, 0) that looks back along X, and a ball, which counts as a person, at a place.
    fn world(kind: FurnitureKind, ball_m: f64) -> World {
        let piece = Furniture { kind, at: [3.0, 0.0], heading_deg: 180.0 };
        let made = furniture(&piece, 2.8, &mut Random::new(1, 8));
        let form = Form::Ellipsoid(Vector3::repeat(0.2));
        let at = Point3::new(ball_m, 0.0, 1.0);
        let ball = Shape::new(form, at, Rotation3::identity(), Material::plain([0.5, 0.1, 0.1]));
        let stage = Stage::new(vec![made], Vec::new(), 100.0);
        World::new(&Arc::new(stage), vec![Object::new(vec![ball], Some(1), true)])
    }

    fn looked_at(world: &World) -> Hit {
        world.first(world.solids(), &Point3::new(1.0, 0.0, 1.0), &Vector3::x())
    }

    #[test]
    fn a_mirror_shows_what_is_behind_the_camera_as_far_behind_itself() {
        let world = world(FurnitureKind::Mirror, -2.0);
        let image = looked_at(&world);
        // Two metres to the mirror, and from there back to the ball: both ways without its 5 mm.
        assert!((image.t - (2.0 + 5.0 - 0.2)).abs() < 0.02, "{}", image.t);
        assert!(image.light[0] > 3.0 * image.light[1], "red: {:?}", image.light);
        assert!(image.person.is_none(), "an image of a person is nobody");
        assert!(image.facing > 0.9 && image.infrared > 0.2);
        let range =
            world.distance(&world.slice(Point3::new(1.0, 0.0, 1.0), &Vector3::z()), &Vector3::x());
        assert!((range - image.t).abs() < 1e-9, "{range}");
    }

    #[test]
    fn who_stands_behind_glass_is_seen_and_measured() {
        let world = world(FurnitureKind::GlassWall, 5.0);
        let seen = looked_at(&world);
        assert!((seen.t - 3.8).abs() < 0.01 && seen.person == Some(1), "{seen:?}");
        let range =
            world.distance(&world.slice(Point3::new(1.0, 0.0, 1.0), &Vector3::z()), &Vector3::x());
        assert!((range - 3.8).abs() < 0.01, "the laser goes through as well: {range}");
    }

    /// A ray through the middle of the pane meets glass, and one beside it the frame.
    #[test]
    fn frosted_glass_returns_no_dots_and_its_frame_does() {
        let piece =
            Furniture { kind: FurnitureKind::GlassDoor, at: [3.0, 2.0], heading_deg: 180.0 };
        let made = furniture(&piece, 2.8, &mut Random::new(1, 8));
        let [pane, frame] = [2.0, 2.48].map(|y| {
            let eye = Point3::new(1.0, y, 1.0);
            let met = made.shapes.iter().filter_map(|s| Some((s.meet(&eye, &Vector3::x())?, s)));
            met.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, shape)| shape.material.infrared)
        });
        assert_eq!(pane, Some(0.0));
        assert!(frame.is_some_and(|infrared| infrared > 0.3));
    }
}
