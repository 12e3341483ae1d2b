//! The visible world at one moment, and the casting of single rays into it.

use std::ptr;
use std::sync::{Arc, OnceLock};

use nalgebra::{Point3, Vector3};

use crate::daylight::Windows;
use crate::hits::HitGroup;
use crate::lanes::{LANES, Lanes, Vectors, dot};
use crate::material::{Colour, Material};
use crate::shadow::{self, Bundle, Shadows, bits};
use crate::shape::{Shape, Surface};
use crate::slice::Slice;

/// Solids that belong together.
#[derive(Clone, Debug)]
pub struct Object {
    /// The solids.
    pub shapes: Vec<Shape>,
    /// ID of the person, if it is one.
    pub person: Option<u16>,
    /// True if it casts a shadow. Walls do not, because the lamps hang inside of them.
    pub casts_shadow: bool,
}

impl Object {
    /// Creates an object.
    pub fn new(shapes: Vec<Shape>, person: Option<u16>, casts_shadow: bool) -> Self {
        Self { shapes, person, casts_shadow }
    }

    /// Returns the object raised by `by_m`, m.
    pub fn raised(mut self, by_m: f64) -> Self {
        self.shapes.iter_mut().for_each(|shape| *shape = shape.raised(by_m));
        self
    }

    /// Yields the solids with the person that they belong to.
    fn solids(&self) -> impl Iterator<Item = (Option<u16>, &Shape)> + Clone {
        self.shapes.iter().map(|shape| (self.person, shape))
    }
}

/// Sunlight at which half of the contrast of projected dots is left, lx: a light wall in 20 000 lx
/// has depth up to 1.3 m. This is a choice and not a measurement: no table of depth by illuminance
/// was found, only the statement that such cameras hardly measure anything outdoors.
const WASHED_OUT_LUX: f64 = 200.0;

/// Minimum cosine between the direction of sound and the normal of a large smooth surface that
/// reflects it back: that of 30 degrees.
const ECHO_COSINE: f64 = 0.866;

/// Distance from a surface at which rays to lamps begin, m; otherwise the surface would shade
/// itself.
const OFF_SURFACE_M: f64 = 1e-3;

/// A lamp: a point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Position, m.
    pub at: Point3<f64>,
    /// Illuminance of a facing surface at one metre, lx.
    pub lux_at_1m: f64,
    /// Openings through which the sun shines; `None` for a lamp in the room.
    pub windows: Option<Windows>,
}

/// Everything that never moves, in world coordinates.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// Room and furniture.
    pub objects: Vec<Object>,
    /// Lamps, all of which cast shadows.
    pub lamps: Vec<Lamp>,
    /// Ambient light, lx.
    pub ambient_lux: f64,
    /// Shadows of each lamp, computed when they are first needed.
    shadows: OnceLock<Vec<Shadows>>,
}

impl Stage {
    /// Creates a stage of objects that never move.
    pub fn new(objects: Vec<Object>, lamps: Vec<Lamp>, ambient_lux: f64) -> Self {
        Self { objects, lamps, ambient_lux, shadows: OnceLock::new() }
    }

    fn shadows(&self) -> &[Shadows] {
        self.shadows.get_or_init(|| {
            let mut shadows = Vec::new();
            for lamp in &self.lamps {
                let casters = casters(&self.objects).flatten().map(|solid| (None, solid));
                shadows.push(Shadows::still(shadow::SIDE, lamp.at, casters));
            }
            shadows
        })
    }
}

/// Everything at one moment, in world coordinates.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// Everything that never moves, the same at every moment.
    pub stage: Arc<Stage>,
    /// The people.
    pub people: Vec<Object>,
    /// Shadows of people for each lamp, computed when they are first needed; the world does not
    /// change after that.
    shadows: OnceLock<Vec<Shadows>>,
}

/// First surface that a ray hits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hit {
    /// Distance in ray lengths; infinite if there is nothing.
    pub t: f64,
    /// Light towards the eye in each colour, lx times reflectance.
    pub light: Colour,
    /// Reflectance in the near infrared, reduced by sunlight.
    pub infrared: f64,
    /// Cosine between the surface's normal and the ray back.
    pub facing: f64,
    /// The person, if it is one.
    pub person: Option<u16>,
}

impl World {
    /// Creates the world of some people on a stage.
    pub fn new(stage: &Arc<Stage>, people: Vec<Object>) -> Self {
        Self { stage: Arc::clone(stage), people, shadows: OnceLock::new() }
    }

    /// Yields all solids with the person that they belong to, if any.
    pub(crate) fn solids(&self) -> impl Iterator<Item = (Option<u16>, &Shape)> + Clone {
        self.stage.objects.iter().chain(&self.people).flat_map(Object::solids)
    }

    /// Returns the solids that may reflect the beam of a laser whose rays are in the plane through
    /// an eye with this unit normal; glass is excluded, because the beam passes through it.
    pub(crate) fn slice(&self, eye: Point3<f64>, normal: &Vector3<f64>) -> Slice<'_> {
        Slice::new(self.opaque().map(|(_, solid)| solid), eye, normal)
    }

    /// Returns the solids that may reflect the beam of a laser in any direction from an eye.
    pub(crate) fn around(&self, eye: Point3<f64>) -> Slice<'_> {
        Slice::around(self.opaque().map(|(_, solid)| solid), eye)
    }

    /// Returns the range of a laser in a direction of length one in the plane of a slice, m;
    /// infinite if it hits nothing. Mirrors reflect it.
    pub(crate) fn distance(&self, slice: &Slice<'_>, ray: &Vector3<f64>) -> f64 {
        let Some((t, solid)) = slice.first(ray) else { return f64::INFINITY };
        if solid.material.reflects == 0.0 {
            return t;
        }
        let at = slice.eye + ray * t;
        let on = mirrored(ray, &solid.normal(&solid.own(&at)));
        let others = self.opaque().filter(|(_, other)| !ptr::eq(*other, solid));
        meet(others, &at, &on).map_or(f64::INFINITY, |(further, ..)| t + further)
    }

    /// Yields all solids except those of glass.
    fn opaque(&self) -> impl Iterator<Item = (Option<u16>, &Shape)> + Clone {
        self.solids().filter(|(_, solid)| solid.material.passes == 0.0)
    }

    /// Returns the range of a sound echo in a direction of length one, m; infinite without one.
    /// Glass and mirrors are ordinary surfaces. A large smooth surface reflects the sound away
    /// unless it is hit almost perpendicularly; edges and rough, small and round objects scatter
    /// it.
    pub(crate) fn echo(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> f64 {
        let Some((t, _, solid)) = meet(self.solids(), eye, ray) else { return f64::INFINITY };
        let normal = solid.normal(&solid.own(&(eye + ray * t)));
        let is_oblique = -normal.dot(ray) < ECHO_COSINE;
        if is_oblique && solid.is_slab() { f64::INFINITY } else { t }
    }

    /// Returns the first of some solids that a ray hits, through glass and via mirrors: for rays
    /// without a common eye, and as the reference for those with one.
    pub(crate) fn first<'a>(
        &'a self,
        solids: impl Iterator<Item = (Option<u16>, &'a Shape)>,
        eye: &Point3<f64>,
        ray: &Vector3<f64>,
    ) -> Hit {
        meet(solids, eye, ray).map_or(Hit::NOTHING, |(t, person, shape)| {
            let (hit, normal) = self.hit(t, person, shape, (eye, ray));
            if shape.material.shows_itself() {
                hit
            } else {
                self.beyond(hit, shape, &normal, (eye, ray))
            }
        })
    }

    /// Returns the view in a mirror or through glass; glass also reflects a little. Mirrors that
    /// are seen in mirrors or through glass show only their own surface.
    pub(crate) fn beyond(
        &self,
        seen: Hit,
        of: &Shape,
        normal: &Vector3<f64>,
        (eye, ray): (&Point3<f64>, &Vector3<f64>),
    ) -> Hit {
        let Material { reflects, passes, .. } = of.material;
        let at = eye + ray * seen.t;
        let image = Hit { person: None, ..self.look_from(of, &at, &mirrored(ray, normal)) };
        let behind = if passes > 0.0 { self.look_from(of, &at, ray) } else { Hit::NOTHING };
        let own = 1.0 - reflects - passes;
        let light = std::array::from_fn(|c| {
            own * seen.light[c] + reflects * image.light[c] + passes * behind.light[c]
        });
        // Projected dots take the path of most of the light, in both directions.
        let (share, main) = if passes > reflects { (passes, behind) } else { (reflects, image) };
        Hit { t: seen.t + main.t, light, infrared: share * share * main.infrared, ..main }
    }

    /// Returns the first hit of a ray from a point of a shape.
    fn look_from(&self, of: &Shape, at: &Point3<f64>, ray: &Vector3<f64>) -> Hit {
        let others = self.solids().filter(|(_, other)| !ptr::eq(*other, of));
        meet(others, at, ray)
            .map_or(Hit::NOTHING, |(t, person, shape)| self.hit(t, person, shape, (at, ray)).0)
    }

    /// Returns the surface of a solid that a ray from an eye hits at `t` ray lengths, and its
    /// normal.
    fn hit(
        &self,
        t: f64,
        person: Option<u16>,
        of: &Shape,
        (eye, ray): (&Point3<f64>, &Vector3<f64>),
    ) -> (Hit, Vector3<f64>) {
        let at = eye + ray * t;
        let own = of.own(&at);
        let normal = of.normal(&own);
        let [lux, sun] = self.lux(&at, &normal);
        let light = of.material.at(&own).map(|colour| colour * (lux + of.material.glow_lux));
        let facing = -normal.dot(ray) / ray.norm();
        (Hit { t, light, infrared: left_over(of.material.infrared, sun), facing, person }, normal)
    }

    /// Returns the illuminance of a point with this normal, and the part of it from the sun, lx.
    fn lux(&self, at: &Point3<f64>, normal: &Vector3<f64>) -> [f64; 2] {
        // Floors are lit by the ceiling, undersides by the floor, which is darker.
        let mut lux = [self.stage.ambient_lux * (0.75 + 0.25 * normal.z), 0.0];
        for (lamp, shadows) in self.stage.lamps.iter().zip(self.shadows()) {
            let on = lamp.on(shadows, at, normal);
            lux[0] += on;
            lux[1] += if lamp.is_sun() { on } else { 0.0 };
        }
        lux
    }

    /// Finds the solids that may shade points in a box, given by two of its corners.
    pub(crate) fn find_shading(
        &self,
        low: &Vector3<f64>,
        high: &Vector3<f64>,
        lit: bool,
        found: &mut Shading,
    ) {
        found.0.resize_with(self.stage.lamps.len(), Default::default);
        // Rays begin slightly off the surface.
        let off = Vector3::repeat(2.0 * OFF_SURFACE_M);
        for ((lamp, shadows), found) in
            self.stage.lamps.iter().zip(self.shadows()).zip(&mut found.0)
        {
            if lit || lamp.is_sun() {
                let bundle = Bundle::new(low - off - lamp.at.coords, high + off - lamp.at.coords);
                for (shadows, found) in shadows.into_iter().zip(found) {
                    shadows.find(&bundle, found);
                }
            }
        }
    }

    /// Returns true if the appearance of a surface depends on shadows.
    pub(crate) fn has_shadows(&self, lit: bool) -> bool {
        lit || self.stage.lamps.iter().any(Lamp::is_sun)
    }

    /// Writes light and infrared of points on the surface of a solid; only the `wanted` ones count.
    /// There are no colours if it is not `lit`. `shading` are the solids that may shade the points.
    pub(crate) fn shine(
        &self,
        of: &Material,
        points: &Vectors,
        surface: &Surface,
        wanted: &[bool; LANES],
        (shading, lit): (&Shading, bool),
        to: &mut HitGroup,
    ) {
        let is_sunny = self.stage.lamps.iter().any(Lamp::is_sun);
        to.infrared = [of.infrared; LANES];
        if !lit {
            to.light = [[0.0; LANES]; 3];
        }
        if !lit && !is_sunny {
            return;
        }
        let mut lux = ambient(self.stage.ambient_lux, &surface.normal);
        let mut sun = [0.0; LANES];
        let lamps = self.stage.lamps.iter().zip(self.shadows()).zip(&shading.0);
        for ((lamp, shadows), found) in lamps.filter(|((lamp, _), _)| lit || lamp.is_sun()) {
            let beams = beams(lamp, points, &surface.normal);
            let facing = std::array::from_fn(|lane| wanted[lane] && beams.lux[lane] != 0.0);
            let mut open = bits(&facing);
            for (shadows, numbers) in shadows.into_iter().zip(found) {
                open &= !shadows.bar(numbers, &beams.ways, open);
            }
            add_light(&beams.lux, open, &mut lux);
            if lamp.is_sun() {
                add_light(&beams.lux, open, &mut sun);
            }
        }
        if is_sunny {
            to.infrared = sun.map(|sun| left_over(of.infrared, sun));
        }
        if lit {
            let colours = of.colours(&surface.own, wanted);
            reflect(&colours, &lux, of.glow_lux, &mut to.light);
        }
    }

    /// Returns the shadows around each lamp: those of the stage, and those of people.
    fn shadows(&self) -> impl Iterator<Item = [&Shadows; 2]> {
        let people = self.shadows.get_or_init(|| {
            let lamps = self.stage.lamps.iter();
            lamps.map(|lamp| Shadows::moving(lamp.at, casters(&self.people))).collect()
        });
        self.stage.shadows().iter().zip(people).map(|(stage, people)| [stage, people])
    }
}

/// Solids that may be between each lamp and some points: indices of those of the stage and of those
/// of people.
#[derive(Debug, Default)]
pub(crate) struct Shading(Vec<[Vec<u32>; 2]>);

/// Returns the first of some solids that a ray hits, and its distance in ray lengths.
fn meet<'a>(
    solids: impl Iterator<Item = (Option<u16>, &'a Shape)>,
    eye: &Point3<f64>,
    ray: &Vector3<f64>,
) -> Option<(f64, Option<u16>, &'a Shape)> {
    let per_length = 1.0 / ray.norm_squared();
    solids
        .filter_map(|(person, shape)| {
            // The bounding ball is cheap, and most solids miss most rays.
            let near = shape.near(eye, ray, per_length);
            Some((near.then(|| shape.meet(eye, ray)).flatten()?, person, shape))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Returns the direction of a ray after reflection in a mirror with this normal.
fn mirrored(ray: &Vector3<f64>, normal: &Vector3<f64>) -> Vector3<f64> {
    ray - normal * (2.0 * normal.dot(ray))
}

/// Returns the part of a reflectance that is left for projected dots in this sunlight, lx.
fn left_over(infrared: f64, sun_lux: f64) -> f64 {
    infrared / (1.0 + sun_lux / WASHED_OUT_LUX)
}

/// Returns the solids of each object that cast shadows; glass casts none.
fn casters(
    objects: &[Object],
) -> impl Iterator<Item = impl Iterator<Item = &Shape> + Clone> + Clone {
    let casters = objects.iter().filter(|object| object.casts_shadow);
    casters.map(|object| object.shapes.iter().filter(|solid| solid.material.passes == 0.0))
}

/// Returns the ambient illuminance of surfaces with these normals.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn ambient(lux: f64, normals: &Vectors) -> Lanes {
    let mut ambient = [0.0; LANES];
    for lane in 0..LANES {
        ambient[lane] = lux * (0.75 + 0.25 * normals.z[lane]);
    }
    ambient
}

/// Adds the light of a lamp in the lanes whose bits are set, where the ray from it is not blocked.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_light(of: &Lanes, open: u32, to: &mut Lanes) {
    for lane in 0..LANES {
        to[lane] += if open >> lane & 1 == 1 { of[lane] } else { 0.0 };
    }
}

/// Writes the light that surfaces of some colours reflect, plus the light that they emit.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn reflect(colours: &[Lanes; 3], lux: &Lanes, glow_lux: f64, light: &mut [Lanes; 3]) {
    for channel in 0..3 {
        for lane in 0..LANES {
            light[channel][lane] = colours[channel][lane] * (lux[lane] + glow_lux);
        }
    }
}

/// Rays from a lamp to some points, and the illuminance there if nothing is in between.
struct Beams {
    ways: Vectors,
    lux: Lanes,
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn beams(lamp: &Lamp, points: &Vectors, normals: &Vectors) -> Beams {
    let mut beams = Beams { ways: Vectors::ZERO, lux: [0.0; LANES] };
    for lane in 0..LANES {
        let (way, lux) = lamp.beam(&points.at(lane), &normals.at(lane));
        beams.ways.set(lane, &way);
        beams.lux[lane] = lux;
    }
    if let Some(windows) = &lamp.windows {
        for lane in 0..LANES {
            let open = windows.are_open(&lamp.at, &beams.ways.at(lane));
            beams.lux[lane] = if open { beams.lux[lane] } else { 0.0 };
        }
    }
    beams
}

impl Lamp {
    /// Creates a lamp in the room.
    pub fn hanging(at: Point3<f64>, lux_at_1m: f64) -> Self {
        Self { at, lux_at_1m, windows: None }
    }

    /// Returns true for the sun, whose light contains infrared, unlike that of lamps.
    fn is_sun(&self) -> bool {
        self.windows.is_some()
    }

    /// Returns the illuminance of a point with this normal, lx.
    fn on(&self, shadows: [&Shadows; 2], at: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        let (way, lux) = self.beam(&at.coords, normal);
        let dark = lux == 0.0
            || self.windows.as_ref().is_some_and(|windows| !windows.are_open(&self.at, &way))
            || shadows.iter().any(|shadows| shadows.on(&way));
        if dark { 0.0 } else { lux }
    }

    /// Returns the ray to a point with this normal, and its illuminance if nothing is in between,
    /// lx; zero if the point faces away. Without branches, for loops over lanes.
    #[inline(always)]
    fn beam(&self, at: &Vector3<f64>, normal: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let start = at + normal * OFF_SURFACE_M;
        let way = self.at.coords - start;
        let square = dot(&way, &way);
        let cosine = dot(normal, &way) / square.sqrt();
        // A real lamp is not a point: close to it the light does not grow without limit.
        let square = if square > 0.25 { square } else { 0.25 };
        let lux = self.lux_at_1m * cosine / square;
        (start - self.at.coords, if cosine > 0.0 { lux } else { 0.0 })
    }
}

impl Hit {
    /// Result of a ray that hits nothing.
    pub const NOTHING: Self =
        Self { t: f64::INFINITY, light: [0.0; 3], infrared: 0.0, facing: 0.0, person: None };
}

/// Returns the distance to the first solid of some objects in a direction of length one, m;
/// infinite if there is none.
pub(crate) fn distance<'a>(
    objects: impl IntoIterator<Item = &'a Object>,
    eye: &Point3<f64>,
    ray: &Vector3<f64>,
) -> f64 {
    let solids = objects.into_iter().flat_map(|object| &object.shapes);
    let met = solids.filter(|shape| shape.near(eye, ray, 1.0)).filter_map(|s| s.meet(eye, ray));
    met.fold(f64::INFINITY, f64::min)
}
