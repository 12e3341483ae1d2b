//! Casts a ray through every pixel. The image is divided into tiles; a tile tests only the solids
//! that intersect the pyramid behind it, nearest first. Strips of tiles are independent of each
//! other, so that any number of threads renders the same image.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};
use tagalong_geometry::{Camera, Distortion, Lens, Pinhole};

use crate::hits::{HitGroup, HitImage};
use crate::lanes::{LANES, Vectors, product};
use crate::parallel::in_pieces;
use crate::seen::SolidView;
use crate::shape::Shape;
use crate::sight::{SightedSolid, before, between};
use crate::tile::{Tile, TileParts};
use crate::world::World;

/// Side of a tile, pixels.
const TILE: usize = LANES;

/// Renders the world as seen by a camera, without noise: for each pixel the surface that its ray
/// hits, where `t` is the depth along the optical axis in metres.
pub fn draw(
    world: &World,
    camera: &Camera,
    world_from_robot: &Isometry3<f64>,
    threads: usize,
) -> HitImage {
    WorldCamera { world, camera, pose: &|_| *world_from_robot, lit: true }.draw(threads)
}

/// A camera in a world.
pub struct WorldCamera<'a> {
    /// The visible world.
    pub world: &'a World,
    /// The camera.
    pub camera: &'a Camera,
    /// Pose of the robot in the world when a part of the image is exposed: the upper edge is 0, the
    /// lower 1.
    pub pose: &'a (dyn Fn(f64) -> Isometry3<f64> + Sync),
    /// If false, there are no colours, and the image is rendered several times faster.
    pub lit: bool,
}

impl WorldCamera<'_> {
    /// Renders the surface that the ray of each pixel hits.
    pub fn draw(&self, threads: usize) -> HitImage {
        let mut image = HitImage::nothing(self.camera.width, self.camera.height);
        self.draw_over(&mut image, threads);
        image
    }

    /// Renders the surface that the ray of each pixel hits into an existing image of the same size,
    /// which saves the time for allocating memory.
    pub fn draw_over(&self, image: &mut HitImage, threads: usize) {
        let strip = TILE * image.row_groups();
        in_pieces(image.groups_mut(), strip, threads, |number, groups| {
            self.strip(number * TILE, groups);
        });
    }

    fn strip(&self, top: usize, groups: &mut [HitGroup]) {
        let width = self.camera.width;
        let row_groups = width.div_ceil(TILE);
        let rows = groups.len() / row_groups;
        let eye = self.eye(top);
        let edge = |y: usize| [eye.corner(0, y), eye.corner(width, y)];
        let edges = [edge(top), edge(top + rows)];
        let strip = before(self.world.solids(), &eye.at, &eye.forward(), edges);
        let mut tile = Tile::default();
        for number in 0..row_groups {
            let left = number * TILE;
            let right = width.min(left + TILE);
            let edge = |x: usize| [eye.corner(x, top), eye.corner(x, top + rows)];
            let solids = between(&strip, edge(left), edge(right));
            let rays = |row: usize, to: &mut Vectors| eye.rays([left, 1, top + row], to);
            tile.look(&solids, &eye.at, [right - left, rows], rays);
            let columns = groups.iter_mut().skip(number).step_by(row_groups);
            self.paint(&mut tile, &solids, &eye.at, &mut columns.collect::<Vec<_>>());
        }
    }

    /// Returns the pose of the robot in the world while a row is exposed. The position of a point
    /// depends on the exposure time of its row, and the row on the position, so callers first try
    /// 0.5.
    pub fn pose_at(&self, row: f64) -> Isometry3<f64> {
        (self.pose)((row / self.camera.height as f64).clamp(0.0, 1.0))
    }

    /// Returns the eye while the strip with this row is exposed.
    fn eye(&self, row: usize) -> Eye<'_> {
        let top = row - row % TILE;
        let height = self.camera.height;
        let middle = 0.5 * (top + height.min(top + TILE)) as f64;
        Eye::new(self.camera, &(self.pose)(middle / height as f64))
    }

    /// Compares the visible part of some solids of `person` within an area (left, top, right,
    /// bottom, pixels, clipped to the image by the caller) with the view of these solids alone. At
    /// most some 40 x 40 rays are cast.
    pub fn visibility(
        &self,
        image: &HitImage,
        (person, shapes): (u16, &[Shape]),
        area: [usize; 4],
    ) -> Visibility {
        let [left, top, right, bottom] = area;
        let step = ((right - left).max(bottom - top) / 40).max(1);
        let mut whole = 0u32;
        let mut seen = 0u32;
        let mut bounds: Option<[f64; 4]> = None;
        let mut hiders = std::collections::BTreeMap::<u16, u32>::new();
        let mut strip = top / TILE;
        let mut eye = self.eye(top);
        let mut alone = views(shapes, &eye.at);
        for row in (top..bottom).step_by(step) {
            // All rows of a strip are seen from the same pose.
            if row / TILE != strip {
                strip = row / TILE;
                eye = self.eye(row);
                alone = views(shapes, &eye.at);
            }
            let columns = || (left..right).step_by(step);
            let groups = columns().step_by(LANES);
            let mut rays = Vectors::ZERO;
            let met = groups.flat_map(|first| {
                eye.rays([first, step, row], &mut rays);
                meet_any(&alone, &rays)
            });
            for (column, _) in columns().zip(met).filter(|(_, met)| *met != 0) {
                whole += 1;
                let there = image.person(column, row);
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

    /// Renders the hits of the rays of a tile into the group of each of its rows.
    fn paint(
        &self,
        tile: &mut Tile,
        solids: &[&SightedSolid<'_>],
        eye: &Point3<f64>,
        rows: &mut [&mut HitGroup],
    ) {
        for row in tile.open_rows() {
            *rows[row] = HitGroup::NOTHING;
        }
        let TileParts { tile, shading, group } = tile.parts();
        for same in tile.solids() {
            let SightedSolid { shape, person, .. } = solids[same[0].solid as usize];
            if self.world.has_shadows(self.lit) {
                let [low, high] = tile.bounds_of(same);
                self.world.find_shading(&low, &high, self.lit, shading);
            }
            for entry in same {
                let batch = tile.batch(*entry);
                let to = match batch.whole_row() {
                    Some(row) => &mut *rows[row],
                    None => &mut *group,
                };
                let surface = shape.surface(&batch.points, &batch.rays);
                to.t = batch.t;
                to.facing = surface.facing;
                to.person = [*person; LANES];
                let wanted = batch.wanted();
                let of = &shape.material;
                self.world.shine(of, &batch.points, &surface, &wanted, (shading, self.lit), to);
                // Nearly all surfaces are opaque, so that normals and rays need not be computed.
                if !of.shows_itself() {
                    for lane in 0..batch.count {
                        let view = (eye, &batch.rays.at(lane));
                        let normal = surface.normal.at(lane);
                        to.set(lane, &self.world.beyond(to.at(lane), shape, &normal, view));
                    }
                }
                if batch.whole_row().is_none() {
                    for (lane, [row, column]) in batch.places().iter().enumerate() {
                        rows[usize::from(*row)].set(usize::from(*column), &group.at(lane));
                    }
                }
            }
        }
    }
}

/// Returns the solids as seen from an eye.
fn views(of: &[Shape], eye: &Point3<f64>) -> Vec<SolidView> {
    of.iter().map(|shape| shape.seen_from(eye)).collect()
}

/// Returns one for each ray that hits any of these solids.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn meet_any(solids: &[SolidView], rays: &Vectors) -> [u64; LANES] {
    let mut met = [0; LANES];
    solids.iter().for_each(|solid| solid.bar(rays, f64::INFINITY, &mut met));
    met
}

/// Returns rays of depth one through some columns of a row, for a lens without distortion, rotated
/// by `turn`.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn straight_rays(
    lens: &Pinhole,
    turn: &Matrix3<f64>,
    [left, step, row]: [usize; 3],
    to: &mut Vectors,
) {
    let left = left as f64;
    let step = step as f64;
    let y = (row as f64 - lens.cy) / lens.fy;
    for lane in 0..LANES {
        // Column numbers are integers, so this is exact.
        let column = left + step * lane as f64;
        let ray = Vector3::new((column - lens.cx) / lens.fx, y, 1.0);
        to.set(lane, &product(turn, &ray));
    }
}

/// Position and orientation of a camera.
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

    /// Writes the rays of a row, starting at a column, with this step between columns.
    fn rays(&self, [left, step, row]: [usize; 3], to: &mut Vectors) {
        match &self.camera.lens {
            Lens::Pinhole(lens) if lens.distortion == Distortion::None => {
                straight_rays(lens, &self.world_from_camera, [left, step, row], to);
            }
            _ => {
                for lane in 0..LANES {
                    to.set(lane, &self.ray((left + lane * step) as f64, row as f64));
                }
            }
        }
    }

    /// Returns the ray through the upper left corner of a pixel.
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
    /// Visible fraction of the view without other objects; 0 if that view is empty.
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
            for (at, hit) in image.hits().iter().enumerate() {
                let ray = eye.ray((at % 50) as f64, (at / 50) as f64);
                prop_assert_eq!(*hit, world.first(world.solids(), &eye.at, &ray));
            }
        }
    }
}
