//! Casts a ray through every pixel. The image is divided into tiles; a tile
//! looks only at the solids that reach into the pyramid behind it, nearest first.
//! Strips of tiles do not depend on each other, so that any number of threads
//! draws the same image.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};
use tagalong_core::Image;
use tagalong_geometry::{Camera, Distortion, Lens, Pinhole};

use crate::lanes::{LANES, Lanes, Vectors, points, product};
use crate::parallel::in_pieces;
use crate::seen::{Met, SolidView};
use crate::shape::Shape;
use crate::sight::{SightedSolid, before, between};
use crate::world::{Hit, Shine, World};

/// Side of a tile, pixels.
const TILE: usize = LANES;

/// Renders the world as seen by a camera without any noise: for each pixel the surface that its ray
/// meets, where `t` is the depth along the optical axis in metres.
pub fn draw(
    world: &World,
    camera: &Camera,
    world_from_robot: &Isometry3<f64>,
    threads: usize,
) -> Image<Hit> {
    WorldCamera { world, camera, pose: &|_| *world_from_robot, lit: true }.draw(threads)
}

/// A camera in a world.
pub struct WorldCamera<'a> {
    /// The visible world.
    pub world: &'a World,
    /// The camera.
    pub camera: &'a Camera,
    /// The robot in the world when a part of the image is taken: the upper edge
    /// is 0, the lower 1.
    pub pose: &'a (dyn Fn(f64) -> Isometry3<f64> + Sync),
    /// Without it there are no colours, and the image is drawn several times
    /// faster.
    pub lit: bool,
}

impl WorldCamera<'_> {
    /// Renders the surface that the ray of each pixel meets.
    pub fn draw(&self, threads: usize) -> Image<Hit> {
        let mut image = Image::filled(self.camera.width, self.camera.height, Hit::NOTHING);
        in_pieces(image.pixels_mut(), TILE * self.camera.width, threads, |number, pixels| {
            self.strip(number * TILE, pixels);
        });
        image
    }

    fn strip(&self, top: usize, pixels: &mut [Hit]) {
        let width = self.camera.width;
        let rows = pixels.len() / width;
        let eye = self.eye(top);
        let sights = before(self.world.solids(), &eye.at, &eye.forward());
        let edge = |y: usize| [eye.corner(0, y), eye.corner(width, y)];
        let strip = between(&sights, edge(top), edge(top + rows));
        for left in (0..width).step_by(TILE) {
            let right = width.min(left + TILE);
            let edge = |x: usize| [eye.corner(x, top), eye.corner(x, top + rows)];
            let tile = between(strip.iter().copied(), edge(left), edge(right));
            for row in 0..rows {
                let rays = eye.rays(left, 1, top + row);
                let pixels = &mut pixels[row * width..][left..right];
                self.look(&tile, &eye.at, &rays, pixels);
            }
        }
    }

    /// Returns the robot in the world while a row is taken: where a point appears depends on when
    /// its row is taken, and the other way round, so that callers look for it at 0.5 first.
    pub fn pose_at(&self, row: f64) -> Isometry3<f64> {
        (self.pose)((row / self.camera.height as f64).clamp(0.0, 1.0))
    }

    /// The eye while the strip with a row is taken.
    fn eye(&self, row: usize) -> Eye<'_> {
        let top = row - row % TILE;
        let height = self.camera.height;
        let middle = 0.5 * (top + height.min(top + TILE)) as f64;
        Eye::new(self.camera, &(self.pose)(middle / height as f64))
    }

    /// Compares the visible part of some solids of `person` within an area (left, top, right,
    /// bottom, pixels, clipped to the image by the caller) with the view of them alone. At most
    /// some 40 x 40 rays are cast.
    pub fn visibility(
        &self,
        image: &Image<Hit>,
        (person, shapes): (u16, &[Shape]),
        area: [usize; 4],
    ) -> Visibility {
        let [left, top, right, bottom] = area;
        let step = ((right - left).max(bottom - top) / 40).max(1);
        let mut whole = 0u32;
        let mut seen = 0u32;
        let mut bounds: Option<[f64; 4]> = None;
        let mut hiders = std::collections::BTreeMap::<u16, u32>::new();
        for row in (top..bottom).step_by(step) {
            let eye = self.eye(row);
            let alone: Vec<_> = shapes.iter().map(|shape| shape.seen_from(&eye.at)).collect();
            let columns = || (left..right).step_by(step);
            let groups = columns().step_by(LANES);
            let met = groups.flat_map(|first| meet_any(&alone, &eye.rays(first, step, row)));
            for (column, _) in columns().zip(met).filter(|(_, met)| *met != 0) {
                whole += 1;
                let there = image.pixels()[row * image.width() + column].person;
                if there == Some(person) {
                    seen += 1;
                    let x = column as f64;
                    let y = row as f64;
                    let s = step as f64;
                    bounds = Some(bounds.map_or([x, y, x + s, y + s], |b| {
                        [b[0].min(x), b[1].min(y), b[2].max(x + s), b[3].max(y + s)]
                    }));
                } else if let Some(other) = there {
                    *hiders.entry(other).or_default() += 1;
                }
            }
        }
        let occluder = hiders.into_iter().max_by_key(|(_, count)| *count).map(|(id, _)| id);
        let fraction = if whole == 0 { 0.0 } else { f64::from(seen) / f64::from(whole) };
        Visibility { fraction, bounds_px: bounds, occluder }
    }

    /// Renders neighbouring pixels of a row.
    fn look(
        &self,
        tile: &[&SightedSolid<'_>],
        eye: &Point3<f64>,
        rays: &Vectors,
        pixels: &mut [Hit],
    ) {
        let met = first(tile, rays);
        let points = points(eye, rays, &met.t);
        let mut left: [bool; LANES] =
            std::array::from_fn(|lane| lane < pixels.len() && met.number[lane] != Met::NONE);
        // All pixels of a solid together, which are most of the row.
        while let Some(lane) = left.iter().position(|left| *left) {
            let number = met.number[lane];
            let wanted = std::array::from_fn(|lane| left[lane] && met.number[lane] == number);
            self.shade(tile[number as usize], eye, (&points, rays, &met.t), &wanted, pixels);
            left.iter_mut().zip(wanted).for_each(|(left, done)| *left &= !done);
        }
    }

    /// Renders the `wanted` ones of some pixels, whose rays meet a solid at these points.
    fn shade(
        &self,
        SightedSolid { shape, person, .. }: &SightedSolid<'_>,
        eye: &Point3<f64>,
        (points, rays, t): (&Vectors, &Vectors, &Lanes),
        wanted: &[bool; LANES],
        pixels: &mut [Hit],
    ) {
        let surface = shape.surface(points, rays);
        let Shine { light, infrared } =
            self.world.shine(&shape.material, points, &surface, wanted, self.lit);
        // Nearly all surfaces show themselves, without a look at normals and rays.
        let shows_itself = shape.material.shows_itself();
        for (lane, pixel) in pixels.iter_mut().enumerate().filter(|(lane, _)| wanted[*lane]) {
            let own = Hit {
                t: t[lane],
                light: [light[0][lane], light[1][lane], light[2][lane]],
                infrared: infrared[lane],
                facing: surface.facing[lane],
                person: *person,
            };
            *pixel = if shows_itself {
                own
            } else {
                let normal = surface.normal.at(lane);
                self.world.beyond(own, shape, &normal, (eye, &rays.at(lane)))
            };
        }
    }
}

/// The first solid that each ray of depth one meets, by its place among solids that are sorted.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn first(sights: &[&SightedSolid<'_>], rays: &Vectors) -> Met {
    let mut met = Met::NOTHING;
    for (number, sight) in (0..).zip(sights) {
        if !met.reaches(sight.nearest) {
            break;
        }
        sight.seen.shorten(rays, sight.nearest, number, &mut met);
    }
    met
}

/// One for each ray that meets some of these solids.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn meet_any(solids: &[SolidView], rays: &Vectors) -> [u64; LANES] {
    let mut met = [0; LANES];
    solids.iter().for_each(|solid| solid.bar(rays, f64::INFINITY, &mut met));
    met
}

/// Rays of depth one of a lens without distortion, in the axes that `turn` leads to, from a column
/// on, some columns apart, of a row.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn straight_rays(lens: &Pinhole, turn: &Matrix3<f64>, [left, step, row]: [usize; 3]) -> Vectors {
    let mut rays = Vectors::ZERO;
    let left = left as f64;
    let step = step as f64;
    let y = (row as f64 - lens.cy) / lens.fy;
    for lane in 0..LANES {
        // Columns are whole numbers, so that this is exact.
        let column = left + step * lane as f64;
        let ray = Vector3::new((column - lens.cx) / lens.fx, y, 1.0);
        rays.set(lane, &product(turn, &ray));
    }
    rays
}

/// Where a camera stands and looks.
struct Eye<'a> {
    camera: &'a Camera,
    at: Point3<f64>,
    world_from_camera: Matrix3<f64>,
}

impl<'a> Eye<'a> {
    fn new(camera: &'a Camera, world_from_robot: &Isometry3<f64>) -> Self {
        let pose = world_from_robot * camera.robot_from_camera;
        let world_from_camera = pose.rotation.to_rotation_matrix().into_inner();
        Self { camera, at: Point3::from(pose.translation.vector), world_from_camera }
    }

    fn ray(&self, column: f64, row: f64) -> Vector3<f64> {
        self.world_from_camera * self.camera.ray(Point2::new(column, row))
    }

    /// Rays of a row, from this column on, `step` columns apart.
    fn rays(&self, left: usize, step: usize, row: usize) -> Vectors {
        match &self.camera.lens {
            Lens::Pinhole(lens) if lens.distortion == Distortion::None => {
                straight_rays(lens, &self.world_from_camera, [left, step, row])
            }
            _ => {
                let mut rays = Vectors::ZERO;
                for lane in 0..LANES {
                    rays.set(lane, &self.ray((left + lane * step) as f64, row as f64));
                }
                rays
            }
        }
    }

    /// The ray through the upper left corner of a pixel.
    fn corner(&self, column: usize, row: usize) -> Vector3<f64> {
        self.ray(column as f64 - 0.5, row as f64 - 0.5)
    }

    fn forward(&self) -> Vector3<f64> {
        self.world_from_camera.column(2).into()
    }
}

/// Visible part of some solids of a person in an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Visibility {
    /// Visible fraction of the view without other objects; 0 where that is empty.
    pub fraction: f64,
    /// Left, upper, right and lower edge of the visible part, pixels.
    pub bounds_px: Option<[f64; 4]>,
    /// The person that hides most of the rest.
    pub occluder: Option<u16>,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::daylight::Daylight;
    use crate::material::{Material, Pattern};
    use crate::room_settings::RoomSettings;
    use crate::shape::samples;
    use crate::world::{Lamp, Object, Stage};

    fn shape(form: usize, at: [f64; 3], turn: f64) -> Shape {
        let form = samples::form(form);
        let turn = samples::turn(turn);
        let patterns = [
            Pattern::Plain,
            Pattern::Stripes(0.1),
            Pattern::Checks(0.13),
            Pattern::Mottled(0.05),
            Pattern::Planks(0.12),
            Pattern::Print(0.3, 0.8),
        ];
        let pattern = patterns[(turn.angle() * 100.0) as usize % patterns.len()];
        let material = Material::patterned([0.1 * turn.angle(); 3], [0.7, 0.3, 0.2], pattern);
        Shape::new(form, Point3::from(at), turn, material)
    }

    #[test]
    fn every_strip_is_seen_from_where_the_robot_is_then() {
        fn pose(part: f64) -> Isometry3<f64> {
            Isometry3::rotation(Vector3::z() * 0.2 * part)
        }

        let lens = Pinhole { fx: 30.0, fy: 30.0, cx: 23.5, cy: 17.0, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 50, 40, 0.2, 0.0, 0.0);
        let balls = [-0.4, 0.5].map(|y| shape(0, [1.2, y, 0.2], 0.3));
        let balls = vec![Object::new(balls.to_vec(), None, true)];
        let world = World::new(&Arc::new(Stage::new(balls, vec![], 100.0)), vec![]);
        let rolling =
            WorldCamera { world: &world, camera: &camera, pose: &pose, lit: true }.draw(2);
        for (rows, part) in [(0..16, 0.2), (16..32, 0.6), (32..40, 0.9)] {
            let at_once = draw(&world, &camera, &pose(part), 1);
            rows.for_each(|row| assert_eq!(rolling.row(row), at_once.row(row), "{row}"));
        }
        assert_ne!(rolling.row(10), draw(&world, &camera, &pose(0.9), 1).row(10));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn tiles_lose_nothing_that_a_ray_meets(
            solids in prop::collection::vec(
                (0..9usize, prop::array::uniform3(-3.0..3.0f64), -3.0..3.0f64), 0..20),
            pitch in -0.5..0.5f64, yaw in -3.0..3.0f64,
        ) {
            let lens = Pinhole { fx: 30.0, fy: 30.0, cx: 23.5, cy: 17.0, distortion: Distortion::None };
            let camera = Camera::mounted(lens, 50, 37, 0.2, pitch, 0.1);
            let objects = solids.into_iter().enumerate().map(|(i, (form, at, turn))| {
                let mut solid = shape(form % 3, at, turn);
                // One in nine is a mirror, one is glass.
                solid.material = match form {
                    4 => Material::mirror(),
                    7 => Material::glass(),
                    _ => solid.material,
                };
                Object::new(vec![solid], Some(i as u16), true)
            });
            let lamp = Lamp::hanging(Point3::new(0.0, 1.0, 2.5), 500.0);
            let sun = Daylight::default().sun(&RoomSettings::default()).unwrap();
            let mut objects: Vec<Object> = objects.collect();
            let people = objects.split_off(objects.len() / 2);
            let world = World::new(&Arc::new(Stage::new(objects, vec![lamp, sun], 100.0)), people);
            let pose = Isometry3::rotation(Vector3::z() * yaw);
            let image = draw(&world, &camera, &pose, 2);
            let eye = Eye::new(&camera, &pose);
            for (at, hit) in image.pixels().iter().enumerate() {
                let ray = eye.ray((at % 50) as f64, (at / 50) as f64);
                prop_assert_eq!(*hit, world.first(world.solids(), &eye.at, &ray));
            }
        }
    }
}
