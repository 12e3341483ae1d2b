//! What there is to see at one moment, and the casting of single rays into it.

use nalgebra::{Point3, Vector3};

use crate::material::Colour;
use crate::shape::Shape;

/// Solids that belong together, with a ball around them.
#[derive(Clone, Debug)]
pub struct Object {
    /// The solids.
    pub shapes: Vec<Shape>,
    /// The number of the person, if it is one.
    pub person: Option<u16>,
    /// Walls do not: the lamps hang inside of them.
    pub casts_shadow: bool,
    centre: Point3<f64>,
    radius: f64,
}

impl Object {
    /// Solids that belong together.
    pub fn new(shapes: Vec<Shape>, person: Option<u16>, casts_shadow: bool) -> Self {
        let bounds: Vec<_> = shapes.iter().map(Shape::bound).collect();
        let sum: Vector3<f64> = bounds.iter().map(|b| b.0.coords).sum();
        let centre = Point3::from(sum / bounds.len().max(1) as f64);
        let radius = bounds.iter().map(|b| (b.0 - centre).norm() + b.1).fold(0.0, f64::max);
        Self { shapes, person, casts_shadow, centre, radius }
    }

    /// True if the segment of `length` from `eye` along the unit vector passes
    /// through the ball around the object.
    fn near(&self, eye: &Point3<f64>, along: &Vector3<f64>, length: f64) -> bool {
        let to = self.centre - eye;
        let t = to.dot(along).clamp(0.0, length);
        (to - along * t).norm_squared() < self.radius * self.radius
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
}

/// What a ray meets first.
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
    /// All solids with the index of their object.
    pub(crate) fn solids(&self) -> impl Iterator<Item = (usize, &Shape)> {
        let numbered = self.objects.iter().enumerate();
        numbered.flat_map(|(index, object)| object.shapes.iter().map(move |shape| (index, shape)))
    }

    /// The first of some solids that a ray meets.
    pub(crate) fn first<'a>(
        &'a self,
        solids: impl Iterator<Item = (usize, &'a Shape)>,
        eye: &Point3<f64>,
        ray: &Vector3<f64>,
    ) -> Hit {
        let mut best: Option<(f64, usize, &Shape)> = None;
        let per_length = 1.0 / ray.norm_squared();
        for (object, shape) in solids {
            if shape.near(eye, ray, per_length)
                && let Some(t) = shape.meet(eye, ray)
                && best.is_none_or(|(nearest, ..)| t < nearest)
            {
                best = Some((t, object, shape));
            }
        }
        best.map_or(Hit { t: f64::INFINITY, ..Hit::default() }, |(t, object, shape)| {
            self.shade(t, &self.objects[object], shape, &(eye + ray * t), ray)
        })
    }

    fn shade(
        &self,
        t: f64,
        object: &Object,
        of: &Shape,
        at: &Point3<f64>,
        ray: &Vector3<f64>,
    ) -> Hit {
        let own = of.own(at);
        let normal = of.normal(&own);
        // Floors are lit by the ceiling, undersides by the floor, which is darker.
        let ambient = self.ambient_lux * (0.75 + 0.25 * normal.z);
        let lamps: f64 = self.lamps.iter().map(|lamp| self.lit(lamp, at, &normal)).sum();
        Hit {
            t,
            light: scaled_light(of.material.at(&own), ambient + lamps),
            infrared: of.material.infrared,
            facing: -normal.dot(ray) / ray.norm(),
            person: object.person,
        }
    }

    fn lit(&self, lamp: &Lamp, at: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        let start = at + normal * 1e-3;
        let way = lamp.at - start;
        let length = way.norm();
        let along = way / length;
        let cosine = normal.dot(&along);
        if cosine <= 0.0 || self.shadowed(&start, &along, length) {
            return 0.0;
        }
        // A lamp is not a point: close to it the light does not grow without end.
        lamp.lux_at_1m * cosine / (length * length).max(0.25)
    }

    fn shadowed(&self, start: &Point3<f64>, along: &Vector3<f64>, length: f64) -> bool {
        let objects =
            self.objects.iter().filter(|o| o.casts_shadow && o.near(start, along, length));
        let mut near = objects.flat_map(|o| &o.shapes).filter(|s| s.near(start, along, 1.0));
        near.any(|s| s.meet(start, along).is_some_and(|t| t < length))
    }
}

fn scaled_light(colour: Colour, lux: f64) -> Colour {
    colour.map(|c| c * lux)
}
