//! Images in a conical mirror: the ray of each pixel hits the cone and is reflected there, even if
//! the mirror is slightly tilted.

use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};
use tagalong_core::settings;
use tagalong_geometry::{Camera, ConicalMirror, Distortion, Lens, Panorama, Pinhole, Rect};

use crate::camera_settings::CameraSettings;
use crate::hits::{HitGroup, HitImage};
use crate::lanes::LANES;
use crate::parallel::in_pieces;
use crate::random::Random;
use crate::render::Visibility;
use crate::shape::Shape;
use crate::world::World;

/// Side of a tile, pixels.
const TILE: usize = LANES;
/// Fraction of half the smaller image side that the mirror fills.
const FILLED: f64 = 0.97;

settings! {
    /// The mirror of a panorama camera.
    pub struct MirrorSettings {
        /// Angle between the axis and the surface, degrees.
        #[schemars(range(min = 50.0, max = 85.0))]
        pub half_angle_deg: f64 = 67.5,
        /// Height of the apex above the pinhole, m.
        #[schemars(range(min = 0.005, max = 1.0))]
        pub apex_m: f64 = 0.05,
        /// Minimum and maximum useful angle from the axis in the log, degrees; the rim of the
        /// mirror is at the larger one. An angle `phi` looks `2 * half_angle_deg - 90 - phi`
        /// degrees below the horizon.
        pub view_deg: [f64; 2] = [2.0, 53.0],
        /// Columns and rows of the unwrapped panorama in which the truth gives regions.
        #[schemars(inner(range(min = 8, max = 4096)))]
        pub panorama: [usize; 2] = [480, 120],
        /// Position of the axis relative to the middle of the image, pixels; known in the log.
        pub centre_px: [f64; 2] = [0.0, 0.0],
        /// Standard deviation of the log's error in that position, pixels.
        pub centre_error_px: f64 = 0.3,
        /// Standard deviation of the log's error in `half_angle_deg`, degrees.
        pub angle_error_deg: f64 = 0.1,
        /// Standard deviation of the tilt of the mirror relative to the camera, degrees; not known
        /// in the log.
        pub tilt_error_deg: f64 = 0.2,
    }
}

impl MirrorSettings {
    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self) -> [(bool, &'static str); 1] {
        let [from, to] = self.view_deg;
        [(
            from >= 0.0 && from < to && to < self.half_angle_deg - 1.0,
            "camera.mirror.view_deg must grow, from 0 to less than half_angle_deg - 1",
        )]
    }
}

/// A ray that leaves the mirror: group and lane of its pixel, its start and its direction.
type MirrorRay = ((usize, usize), Point3<f64>, Vector3<f64>);

/// A panorama camera.
#[derive(Clone, Debug)]
pub struct MirrorCamera {
    /// The mirror and its unwrapped image as the log describes them.
    pub panorama: Panorama,
    size: (usize, usize),
    /// The mirror as it really is.
    mirror: ConicalMirror,
    mirror_from_camera: Isometry3<f64>,
    rim_m: f64,
}

impl MirrorCamera {
    /// Creates a camera with random errors in its calibration.
    pub fn new(settings: &CameraSettings, random: &mut Random) -> Self {
        let mirror = mirror(settings);
        let of = &settings.mirror;
        // A calibration with errors beyond two standard deviations would have been repeated.
        let mut error = |sigma: f64| sigma * random.normal().clamp(-2.0, 2.0);
        let logged = Point2::new(
            mirror.centre_px.x + error(of.centre_error_px),
            mirror.centre_px.y + error(of.centre_error_px),
        );
        let tilt = Vector3::new(error(of.tilt_error_deg), error(of.tilt_error_deg), 0.0);
        let tilt = UnitQuaternion::from_scaled_axis(tilt.map(f64::to_radians));
        let mistaken = mirror.half_angle_rad + error(of.angle_error_deg).to_radians();
        let apex = Vector3::new(0.0, 0.0, of.apex_m);
        let [columns, rows] = of.panorama;
        Self {
            panorama: Panorama {
                mirror: ConicalMirror { centre_px: logged, half_angle_rad: mistaken, ..mirror },
                columns,
                rows,
            },
            size: (settings.width, settings.height),
            mirror,
            mirror_from_camera: Isometry3::from_parts(apex.into(), tilt).inverse(),
            rim_m: rim_m(&mirror),
        }
    }

    /// Returns it as an ordinary camera: the lens below the mirror, looking up from the middle of
    /// the robot.
    pub fn camera(&self, height_m: f64) -> Camera {
        let ConicalMirror { focal_px, centre_px, .. } = self.panorama.mirror;
        let lens = Pinhole {
            fx: focal_px,
            fy: focal_px,
            cx: centre_px.x,
            cy: centre_px.y,
            distortion: Distortion::None,
        };
        Camera {
            lens: Lens::Pinhole(lens),
            width: self.size.0,
            height: self.size.1,
            robot_from_camera: ConicalMirror::upright(height_m),
        }
    }

    /// Returns the point at which a pixel's ray leaves the mirror, and its unit direction, in the
    /// camera frame; `None` beside the mirror, where the housing is black.
    pub fn ray(&self, column: f64, row: f64) -> Option<(Point3<f64>, Vector3<f64>)> {
        let x = column - self.mirror.centre_px.x;
        let y = row - self.mirror.centre_px.y;
        let sight = Vector3::new(x, y, self.mirror.focal_px).normalize();
        let pinhole = self.mirror_from_camera * Point3::origin();
        let sight = self.mirror_from_camera.rotation * sight;
        let at = pinhole + sight * self.meet(&pinhole, &sight)?;
        let outward = Vector3::new(at.x, at.y, 0.0).try_normalize(1e-9)?;
        let (sine, cosine) = self.mirror.half_angle_rad.sin_cos();
        let normal = outward * cosine - Vector3::new(0.0, 0.0, sine);
        let leaves = sight - normal * (2.0 * sight.dot(&normal));
        let back = self.mirror_from_camera.inverse();
        Some((back * at, back.rotation * leaves))
    }

    /// Returns the distance along a ray to the cone `x² + y² = (z tan)²` with its apex at the
    /// origin. The cone opens upwards; below the apex the equation has another cone, through which
    /// the ray passes first.
    fn meet(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<f64> {
        let square = self.mirror.half_angle_rad.tan().powi(2);
        let form = |a: &Vector3<f64>, b: &Vector3<f64>| a.x * b.x + a.y * b.y - square * a.z * b.z;
        let a = form(along, along);
        let b = form(&from.coords, along);
        let c = form(&from.coords, &from.coords);
        let root = b * b - a * c;
        if a >= 0.0 || root < 0.0 {
            return None;
        }
        let t = (-b - root.sqrt()) / a;
        let at = from + along * t;
        (at.z > 0.0 && at.xy().coords.norm() < self.rim_m).then_some(t)
    }

    /// Renders the view in the mirror without noise; `t` is the distance from the mirror in metres.
    /// The image is the same for any number of threads.
    pub fn draw(
        &self,
        world: &World,
        world_from_camera: &Isometry3<f64>,
        threads: usize,
    ) -> HitImage {
        let (width, height) = self.size;
        let mut image = HitImage::nothing(width, height);
        let strip = TILE * image.row_groups();
        in_pieces(image.groups_mut(), strip, threads, |number, groups| {
            self.strip(world, world_from_camera, number * TILE, groups);
        });
        image
    }

    fn strip(&self, world: &World, pose: &Isometry3<f64>, top: usize, groups: &mut [HitGroup]) {
        let width = self.size.0;
        let row_groups = width.div_ceil(LANES);
        let mut rays = Vec::with_capacity(TILE * TILE);
        for tile in 0..row_groups {
            rays.clear();
            for row in 0..groups.len() / row_groups {
                for lane in 0..LANES.min(width - tile * LANES) {
                    let column = (tile * LANES + lane) as f64;
                    if let Some((from, along)) = self.ray(column, (top + row) as f64) {
                        let at = (row * row_groups + tile, lane);
                        rays.push((at, pose * from, pose.rotation * along));
                    }
                }
            }
            let seen = within_reach(world, &rays);
            for ((group, lane), from, along) in &rays {
                groups[*group].set(*lane, &world.first(seen.iter().copied(), from, along));
            }
        }
    }

    /// Returns the appearance of a person's upper body, in pixels of the unwrapped panorama. The
    /// first region follows from the position of the head; the others are those that the raw image
    /// shows, unwrapped with the calibration in the log.
    pub fn sight(
        &self,
        raw: &HitImage,
        world_from_camera: &Isometry3<f64>,
        (person, shapes): (u16, &[Shape]),
        head_in_world: &Point3<f64>,
    ) -> (Option<Rect>, Visibility) {
        let head = world_from_camera.inverse_transform_point(head_in_world);
        let whole = self.panorama.upper_body(&head);
        let rows = Rect::new(whole.x, 0.0, whole.width, self.panorama.rows as f64);
        let region = whole.intersection(&rows);
        if region.width < 2.0 || region.height < 2.0 {
            return (None, Visibility::default());
        }
        let mut seen = self.visibility(raw, world_from_camera, (person, shapes), &region);
        seen.fraction *= (region.area() / whole.area()).min(1.0);
        (Some(region), seen)
    }

    /// Compares the visible part of a person with the view without other objects; casts at most
    /// some 40 x 40 rays.
    fn visibility(
        &self,
        raw: &HitImage,
        pose: &Isometry3<f64>,
        (person, shapes): (u16, &[Shape]),
        region: &Rect,
    ) -> Visibility {
        // At most some 40 x 40 rays, as with a lens.
        let step = (region.width.max(region.height) / 40.0).ceil();
        let mut count = Count::default();
        for row in 0..(region.height / step) as usize {
            for column in 0..(region.width / step) as usize {
                let x = region.x + step * column as f64;
                let y = region.y + step * row as f64;
                // The truth comes from the raw image, where the pixels were measured.
                let pixel = self.panorama.raw_pixel(x, y).map(f64::round);
                let there = raw.get(pixel.x as i64, pixel.y as i64);
                let (Some(there), Some((from, along))) = (there, self.ray(pixel.x, pixel.y)) else {
                    continue;
                };
                let from = pose * from;
                let along = pose.rotation * along;
                if shapes.iter().any(|shape| shape.meet(&from, &along).is_some()) {
                    count.add(person, there.person, [x, y, x + step, y + step]);
                }
            }
        }
        count.visibility()
    }
}

/// Numbers of visible pixels of a person, and of others in front.
#[derive(Default)]
struct Count {
    whole: u32,
    seen: u32,
    bounds: Option<[f64; 4]>,
    hiders: std::collections::BTreeMap<u16, u32>,
}

impl Count {
    fn add(&mut self, person: u16, there: Option<u16>, area: [f64; 4]) {
        self.whole += 1;
        if there == Some(person) {
            self.seen += 1;
            let b = self.bounds.unwrap_or(area);
            let [x, y, right, bottom] = area;
            self.bounds = Some([b[0].min(x), b[1].min(y), b[2].max(right), b[3].max(bottom)]);
        } else if let Some(other) = there {
            *self.hiders.entry(other).or_default() += 1;
        }
    }

    fn visibility(self) -> Visibility {
        let fraction = f64::from(self.seen) / f64::from(self.whole.max(1));
        let occluder = self.hiders.into_iter().max_by_key(|(_, n)| *n).map(|(id, _)| id);
        Visibility { fraction, bounds_px: self.bounds, occluder }
    }
}

/// Returns the solids that any of these rays may hit: those whose bounding ball intersects a cone
/// around all rays.
fn within_reach<'a>(world: &'a World, rays: &[MirrorRay]) -> Vec<(Option<u16>, &'a Shape)> {
    let Some((_, eye, _)) = rays.get(rays.len() / 2) else { return Vec::new() };
    let axis = rays.iter().map(|ray| ray.2).sum::<Vector3<f64>>();
    let Some(axis) = axis.try_normalize(1e-3) else { return world.solids().collect() };
    // A margin for rounding: a solid must not vanish at the edge of a tile.
    let opening = rays.iter().map(|ray| axis.angle(&ray.2)).fold(0.0, f64::max) + 1e-6;
    let apart = rays.iter().map(|ray| (ray.1 - eye).norm()).fold(0.0, f64::max);
    let reaches = |shape: &Shape| {
        // The rays of a tile start at different points of the cone.
        let (centre, radius) = shape.bound();
        let way = centre - eye;
        let radius = radius + apart;
        let distance = way.norm();
        distance <= radius || axis.angle(&way) <= opening + (radius / distance).asin()
    };
    world.solids().filter(|(_, shape)| reaches(shape)).collect()
}

fn mirror(settings: &CameraSettings) -> ConicalMirror {
    let of = &settings.mirror;
    let width = settings.width as f64;
    let height = settings.height as f64;
    let [inner, outer] = of.view_deg.map(|angle| angle.to_radians().tan());
    let outer_px = 0.5 * FILLED * width.min(height);
    let focal_px = outer_px / outer;
    let middle = [0.5 * (width - 1.0), 0.5 * (height - 1.0)];
    ConicalMirror {
        focal_px,
        centre_px: Point2::new(middle[0] + of.centre_px[0], middle[1] + of.centre_px[1]),
        half_angle_rad: of.half_angle_deg.to_radians(),
        apex_m: of.apex_m,
        inner_px: inner * focal_px,
        outer_px,
    }
}

/// Returns the radius of the mirror, which is slightly larger than the useful part.
fn rim_m(mirror: &ConicalMirror) -> f64 {
    let slope = mirror.outer_px / mirror.focal_px;
    let surface = mirror.half_angle_rad.tan();
    // One per cent more than the image shows, so that its edge has no gaps.
    1.01 * mirror.apex_m * surface * slope / (surface - slope)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::material::Material;
    use crate::shape::Form;
    use crate::world::{Object, Stage};

    fn settings() -> CameraSettings {
        let mirror = MirrorSettings {
            centre_px: [2.0, -1.5],
            centre_error_px: 0.0,
            angle_error_deg: 0.0,
            tilt_error_deg: 0.0,
            ..MirrorSettings::default()
        };
        CameraSettings { width: 96, height: 96, mirror, ..CameraSettings::default() }
    }

    fn camera() -> MirrorCamera {
        MirrorCamera::new(&settings(), &mut Random::new(1, 1))
    }

    /// A mirror that hangs askew by some degrees.
    fn askew() -> MirrorCamera {
        let mirror = MirrorSettings { tilt_error_deg: 2.0, ..settings().mirror };
        MirrorCamera::new(&CameraSettings { mirror, ..settings() }, &mut Random::new(1, 1))
    }

    /// A ball of some radius in the camera frame.
    fn ball(at: Point3<f64>, radius: f64) -> Shape {
        let form = Form::Ellipsoid(Vector3::repeat(radius));
        Shape::new(form, at, Rotation3::identity(), Material::plain([0.5; 3]))
    }

    #[test]
    fn beside_the_mirror_there_is_nothing() {
        assert!(camera().ray(0.0, 0.0).is_none() && camera().ray(0.0, 50.0).is_none());
        assert!(camera().ray(60.0, 50.0).is_some());
    }

    #[test]
    fn a_tilted_mirror_moves_what_is_seen() {
        let straight = camera();
        let askew = askew();
        let moved = |row: f64| {
            let a = straight.ray(49.0, row).unwrap().1;
            let b = askew.ray(49.0, row).unwrap().1;
            a.angle(&b).to_degrees()
        };
        assert!(moved(20.0) > 0.3 && moved(20.0) < 9.0, "{}", moved(20.0));
    }

    #[test]
    fn the_log_is_mistaken_about_the_cone_by_little_and_otherwise_for_each_seed() {
        let all: Vec<f64> = (0..400)
            .map(|seed| {
                let settings = CameraSettings { mirror: MirrorSettings::default(), ..settings() };
                let camera = MirrorCamera::new(&settings, &mut Random::new(seed, 1));
                (camera.panorama.mirror.half_angle_rad - camera.mirror.half_angle_rad).to_degrees()
            })
            .collect();
        let deviation = (all.iter().map(|off| off * off).sum::<f64>() / 400.0).sqrt();
        assert!((0.08..0.11).contains(&deviation), "{deviation}");
        assert!(all.iter().all(|off| off.abs() < 0.201));
        let of_log = camera().panorama.mirror;
        assert_eq!(of_log, ConicalMirror { centre_px: of_log.centre_px, ..camera().mirror });
    }

    #[test]
    fn tiles_hide_nothing() {
        let camera = askew();
        let balls: Vec<Shape> = (0..24)
            .map(|i| {
                let (sine, cosine) = (f64::from(i) * 0.7).sin_cos();
                let range = 0.4 + 0.2 * f64::from(i);
                ball(Point3::new(range * sine, range * cosine, -0.04 * f64::from(i)), 0.2)
            })
            .collect();
        let people = vec![Object::new(balls.clone(), Some(3), true)];
        let world = World::new(&Arc::new(Stage::new(Vec::new(), Vec::new(), 100.0)), people);
        let image = camera.draw(&world, &Isometry3::identity(), 2);
        let mut met = 0;
        for (at, hit) in image.hits().iter().enumerate() {
            let ray = camera.ray((at % 96) as f64, (at / 96) as f64);
            let meets = ray.is_some_and(|(from, along)| {
                balls.iter().any(|ball| ball.meet(&from, &along).is_some())
            });
            assert_eq!(hit.person.is_some(), meets);
            met += usize::from(meets);
        }
        assert!(met > 300, "{met}");
    }

    proptest! {
        /// The closed form: elevation, and the ring of viewpoints.
        #[test]
        fn a_traced_ray_comes_from_the_ring(x in 8.0..88.0f64, y in 8.0..88.0f64) {
            let camera = camera();
            let mirror = camera.mirror;
            let from_centre = Point2::new(x, y) - mirror.centre_px;
            prop_assume!(from_centre.norm() > 0.5 && from_centre.norm() < mirror.outer_px);
            let (at, leaves) = camera.ray(x, y).unwrap();
            let elevation = mirror.elevation(from_centre.norm());
            let (viewpoint, along) = mirror.ray(from_centre.x.atan2(-from_centre.y), elevation);
            prop_assert!((leaves - along).norm() < 1e-9, "{leaves} {along}");
            prop_assert!((at - viewpoint).cross(&along).norm() < 1e-9);
        }

        #[test]
        fn a_ball_is_seen_where_the_lens_says(bearing in -3.1..3.1f64, range in 0.5..4.0f64, z in -1.2..0.1f64) {
            let camera = camera();
            let place = Point3::new(range * bearing.sin(), -range * bearing.cos(), z);
            let (bearing, elevation) = camera.mirror.direction(&place);
            let pixel = camera.mirror.raw_pixel(bearing, elevation);
            let radius = camera.mirror.radius_px(elevation);
            prop_assume!(radius > camera.mirror.inner_px + 1.0 && radius < camera.mirror.outer_px - 1.0);
            let (from, along) = camera.ray(pixel.x, pixel.y).unwrap();
            prop_assert!(ball(place, 1e-3).meet(&from, &along).is_some());
        }
    }
}
