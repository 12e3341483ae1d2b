//! The visible world at one moment, and the casting of single rays into it.

use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};

use crate::material::Colour;
use crate::shadow::Shadows;
use crate::shape::Shape;

/// Solids that belong together.
#[derive(Clone, Debug)]
pub struct Object {
    /// The solids.
    pub shapes: Vec<Shape>,
    /// The number of the person, if it is one.
    pub person: Option<u16>,
    /// Walls do not: the lamps hang inside of them.
    pub casts_shadow: bool,
}

impl Object {
    /// Solids that belong together.
    pub fn new(shapes: Vec<Shape>, person: Option<u16>, casts_shadow: bool) -> Self {
        Self { shapes, person, casts_shadow }
    }
}

/// A lamp: a point that shines on all sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Where it hangs, m.
    pub at: Point3<f64>,
    /// Illuminance of a facing surface at one metre, lx.
    pub lux_at_1m: f64,
}

/// Everything at one moment, in the coordinates of the world.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// Room, furniture and people.
    pub objects: Vec<Object>,
    /// Lamps; all of them cast shadows.
    pub lamps: Vec<Lamp>,
    /// Light from everywhere, lx.
    pub ambient_lux: f64,
    /// One for each lamp, made when they are first asked for: the world does not
    /// change after that.
    shadows: OnceLock<Vec<Shadows>>,
}

/// First surface that a ray meets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray; infinite where there is nothing.
    pub t: f64,
    /// Light towards the eye in each colour, lx times reflectance.
    pub light: Colour,
    /// Reflectance in the near infrared.
    pub infrared: f64,
    /// Cosine between the surface's normal and the way back.
    pub facing: f64,
    /// The person, if it is one.
    pub person: Option<u16>,
}

impl World {
    /// A moment's world.
    pub fn new(objects: Vec<Object>, lamps: Vec<Lamp>, ambient_lux: f64) -> Self {
        Self { objects, lamps, ambient_lux, shadows: OnceLock::new() }
    }

    /// All solids with the index of their object.
    pub(crate) fn solids(&self) -> impl Iterator<Item = (usize, &Shape)> + Clone {
        let numbered = self.objects.iter().enumerate();
        numbered.flat_map(|(index, object)| object.shapes.iter().map(move |shape| (index, shape)))
    }

    /// Returns the distance to the first solid in a direction of length one, m; infinite where
    /// there is none.
    pub(crate) fn distance(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> f64 {
        distance(&self.objects, eye, ray)
    }

    /// The first of some solids that a ray meets: for rays that have no eye in
    /// common, and the reference for those that have.
    pub(crate) fn first<'a>(
        &'a self,
        solids: impl Iterator<Item = (usize, &'a Shape)>,
        eye: &Point3<f64>,
        ray: &Vector3<f64>,
    ) -> Hit {
        let per_length = 1.0 / ray.norm_squared();
        let meet = |(object, shape): (usize, &'a Shape)| {
            // The bounding ball is cheap, and most solids miss most rays.
            let near = shape.near(eye, ray, per_length);
            Some((near.then(|| shape.meet(eye, ray)).flatten()?, object, shape))
        };
        let first = solids.filter_map(meet).min_by(|a, b| a.0.total_cmp(&b.0));
        first
            .map_or(Hit::NOTHING, |(t, object, shape)| self.hit(t, object, shape, (eye, ray), true))
    }

    /// Returns the surface of a solid that a ray from an eye meets after `t` lengths of it; without
    /// light on it unless it is to be `lit`.
    pub(crate) fn hit(
        &self,
        t: f64,
        object: usize,
        of: &Shape,
        (eye, ray): (&Point3<f64>, &Vector3<f64>),
        lit: bool,
    ) -> Hit {
        let at = eye + ray * t;
        let own = of.own(&at);
        let normal = of.normal(&own);
        let light =
            if lit { scaled_light(of.material.at(&own), self.lux(&at, &normal)) } else { [0.0; 3] };
        Hit {
            t,
            light,
            infrared: of.material.infrared,
            facing: -normal.dot(ray) / ray.norm(),
            person: self.objects[object].person,
        }
    }

    /// Illuminance of a point with this normal.
    fn lux(&self, at: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        // Floors are lit by the ceiling, undersides by the floor, which is darker.
        let ambient = self.ambient_lux * (0.75 + 0.25 * normal.z);
        let lamps = self.lamps.iter().zip(self.shadows());
        lamps.fold(ambient, |sum, (lamp, shadows)| sum + lamp.on(shadows, at, normal))
    }

    fn shadows(&self) -> &[Shadows] {
        let casters = || self.solids().filter(|(object, _)| self.objects[*object].casts_shadow);
        self.shadows
            .get_or_init(|| self.lamps.iter().map(|l| Shadows::new(l.at, casters())).collect())
    }
}

impl Lamp {
    /// Illuminance of a point with this normal, lx.
    fn on(&self, shadows: &Shadows, at: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        // A start a little off the surface, which would otherwise shade itself.
        let start = at + normal * 1e-3;
        let way = self.at - start;
        let square = way.norm_squared();
        let cosine = normal.dot(&way) / square.sqrt();
        if cosine <= 0.0 || shadows.on(&start) {
            return 0.0;
        }
        // A lamp is not a point: close to it the light does not grow without end.
        self.lux_at_1m * cosine / square.max(0.25)
    }
}

impl Hit {
    /// Result of a ray that meets nothing.
    pub const NOTHING: Self =
        Self { t: f64::INFINITY, light: [0.0; 3], infrared: 0.0, facing: 0.0, person: None };
}

/// Returns the distance to the first solid of some objects in a direction of length one, m;
/// infinite where there is none.
pub(crate) fn distance(objects: &[Object], eye: &Point3<f64>, ray: &Vector3<f64>) -> f64 {
    let solids = objects.iter().flat_map(|object| &object.shapes);
    let met = solids.filter(|shape| shape.near(eye, ray, 1.0)).filter_map(|s| s.meet(eye, ray));
    met.fold(f64::INFINITY, f64::min)
}

fn scaled_light(colour: Colour, lux: f64) -> Colour {
    colour.map(|c| c * lux)
}
