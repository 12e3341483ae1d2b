//! People as solids: body, clothes, hair and carried objects, on a skeleton.

use nalgebra::{Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use crate::body::{Build, Skeleton};
use crate::material::{Colour, Material, Pattern, scaled};
use crate::posture::Posture;
use crate::random::Random;
use crate::shape::{Form, Shape};

/// Clothes and carried objects of a person.
#[derive(Clone, Debug, PartialEq)]
pub struct Outfit {
    /// Colour of face and hands.
    pub skin: Colour,
    /// Colour of the hair.
    pub hair: Colour,
    /// True if the hair reaches the shoulders.
    pub long_hair: bool,
    /// Material of body and arms.
    pub top: Material,
    /// Material of the legs.
    pub trousers: Material,
    /// Material of the feet.
    pub shoes: Material,
    /// Additional clothes and objects.
    pub extras: Vec<Extra>,
}

/// Object or piece of clothing that changes the silhouette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Extra {
    /// A coat down to the knees, of the cloth of the top.
    Coat,
    /// A backpack.
    Backpack,
    /// A brimmed hat.
    Hat,
    /// A brimmed hat in a green that nothing else has, by which webcams find the person.
    GreenHat,
    /// A bag in the left hand.
    Bag,
    /// A suitcase on wheels, pulled with the right hand.
    Trolley,
    /// A poncho from the shoulders down to the thighs, of the cloth of the top.
    Poncho,
    /// An open laptop in front of the chest.
    Laptop,
}

/// Stream of random numbers that is used for subjects only.
const SUBJECT_STREAM: u64 = 7;
const SKINS: &[Colour] = &[
    [0.62, 0.42, 0.33],
    [0.52, 0.33, 0.25],
    [0.38, 0.22, 0.15],
    [0.22, 0.12, 0.08],
    [0.12, 0.065, 0.045],
];
const HAIRS: &[Colour] =
    &[[0.02, 0.015, 0.012], [0.06, 0.035, 0.02], [0.15, 0.08, 0.04], [0.4, 0.28, 0.13], [0.35; 3]];
const CLOTHS: &[Colour] = &[
    [0.35, 0.05, 0.05],
    [0.05, 0.12, 0.32],
    [0.06, 0.22, 0.1],
    [0.55, 0.5, 0.42],
    [0.05; 3],
    [0.7; 3],
    [0.4, 0.27, 0.08],
    [0.2, 0.08, 0.25],
    [0.12, 0.3, 0.35],
    [0.25; 3],
];
const TROUSERS: &[Colour] =
    &[[0.03, 0.045, 0.1], [0.025; 3], [0.16; 3], [0.3, 0.24, 0.15], [0.08, 0.12, 0.2]];

impl Outfit {
    /// Creates random clothes.
    pub fn random(random: &mut Random) -> Self {
        let cloth = random.pick(CLOTHS);
        let second = random.pick(CLOTHS);
        let pattern = random.pick(&[
            Pattern::Plain,
            Pattern::Plain,
            Pattern::Stripes(0.07),
            Pattern::Checks(0.06),
            Pattern::Mottled(0.05),
        ]);
        let chances = [
            (Extra::Coat, 0.18),
            (Extra::Backpack, 0.2),
            (Extra::Hat, 0.15),
            (Extra::Bag, 0.15),
            (Extra::Trolley, 0.07),
        ];
        // Dyes that look black reflect infrared, but carbon black does not.
        let infrared = if random.chance(0.12) { 0.06 } else { random.between(0.3, 0.8) };
        Self {
            skin: random.pick(SKINS),
            hair: random.pick(HAIRS),
            long_hair: random.chance(0.35),
            top: Material::patterned(cloth, second, pattern).with_infrared(infrared),
            trousers: Material::patterned(random.pick(TROUSERS), [0.1; 3], Pattern::Plain)
                .with_infrared(random.between(0.2, 0.6)),
            shoes: Material::plain(scaled(random.pick(TROUSERS), 0.8)),
            extras: chances.iter().filter(|(_, p)| random.chance(*p)).map(|(e, _)| *e).collect(),
        }
    }
}

/// A person to be rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// The size.
    pub build: Build,
    /// The appearance.
    pub look: Outfit,
}

impl Person {
    /// Returns a person of the population: the same number gives the same person.
    pub fn subject(number: u64) -> Self {
        let mut random = Random::new(number, SUBJECT_STREAM);
        Self { build: Build::random(&mut random), look: Outfit::random(&mut random) }
    }

    /// Returns the solids of the person, those of the upper body (head, trunk above the hips, arms)
    /// first, and the number of these.
    pub fn shapes(&self, skeleton: &Skeleton) -> (Vec<Shape>, usize) {
        let mut drawing = Drawing {
            s: skeleton,
            h: self.build.height_m,
            w: self.build.height_m * self.build.breadth,
            look: &self.look,
            shapes: Vec::with_capacity(32),
        };
        drawing.head();
        drawing.trunk();
        drawing.arms();
        drawing.extras();
        let upper = drawing.shapes.len();
        drawing.legs();
        if drawing.look.extras.contains(&Extra::Trolley) {
            drawing.trolley();
        }
        (drawing.shapes, upper)
    }
}

struct Drawing<'a> {
    s: &'a Skeleton,
    h: f64,
    /// Height times breadth, for widths.
    w: f64,
    look: &'a Outfit,
    shapes: Vec<Shape>,
}

impl Drawing<'_> {
    fn head(&mut self) {
        let h = self.h;
        let turn = self.s.world_from_head;
        let skin = Material::plain(self.look.skin).with_infrared(0.6);
        let hair =
            Material::patterned(self.look.hair, self.look.hair, Pattern::Plain).with_infrared(0.35);
        let half = Vector3::new(0.056, 0.045, 0.065) * h;
        let pattern = Pattern::Head { half, hairline: 0.62 };
        let face = Material { second: self.look.hair, pattern, ..skin };
        self.ellipsoid(self.s.head, turn, half, face);
        let [bridge, tip, jaw, left_ear, right_ear, crown, back] = [
            [0.053, 0.0, 0.008],
            [0.060, 0.0, -0.016],
            [0.016, 0.0, -0.040],
            [-0.003, 0.045, -0.004],
            [-0.003, -0.045, -0.004],
            [-0.008, 0.0, 0.022],
            [-0.026, 0.0, -0.045],
        ]
        .map(|at| self.s.head + turn * (Vector3::from(at) * h));
        self.limb(bridge, tip, 0.0045 * h, 0.0085 * h, skin);
        self.ellipsoid(jaw, turn, Vector3::new(0.036, 0.034, 0.032) * h, skin);
        for ear in [left_ear, right_ear] {
            self.ellipsoid(ear, turn, Vector3::new(0.010, 0.005, 0.017) * h, skin);
        }
        self.ellipsoid(crown, turn, Vector3::new(0.052, 0.049, 0.050) * h, hair);
        if self.look.long_hair {
            self.ellipsoid(back, turn, Vector3::new(0.036, 0.054, 0.085) * h, hair);
        }
        let neck = self.s.chest - Vector3::new(0.0, 0.0, 0.02 * h);
        self.limb(neck, self.s.head, 0.036 * h, 0.030 * h, skin);
    }

    fn trunk(&mut self) {
        let h = self.h;
        let w = self.w;
        let turn = self.s.world_from_thorax;
        let top = self.look.top;
        let [chest, belly] =
            [0.085, 0.185].map(|z: f64| self.s.chest + turn * Vector3::new(0.005 * h, 0.0, -z * h));
        let collar = [0.07, -0.07]
            .map(|y| self.s.chest + turn * Vector3::new(-0.006 * h, y * w, -0.024 * h));
        let slope = [0.012, -0.012]
            .map(|y| self.s.chest + turn * Vector3::new(-0.008 * h, y * w, 0.006 * h));
        self.limb(collar[0], collar[1], 0.046 * h, 0.046 * h, top);
        for (neck, shoulder) in slope.into_iter().zip(self.s.shoulders) {
            self.limb(neck, shoulder, 0.036 * h, 0.030 * h, top);
        }
        self.ellipsoid(chest, turn, Vector3::new(0.068 * h, 0.102 * w, 0.115 * h), top);
        self.ellipsoid(belly, turn, Vector3::new(0.064 * h, 0.090 * w, 0.120 * h), top);
    }

    fn arms(&mut self) {
        let h = self.h;
        let w = self.w;
        let skin = Material::plain(self.look.skin).with_infrared(0.6);
        for side in 0..2 {
            let shoulder = self.s.shoulders[side];
            let elbow = self.s.elbows[side];
            let wrist = self.s.wrists[side];
            let hand = wrist + (wrist - elbow).normalize() * (0.055 * h);
            self.limb(shoulder, elbow, 0.034 * w, 0.026 * w, self.look.top);
            self.limb(elbow, wrist, 0.026 * w, 0.018 * w, self.look.top);
            self.limb(wrist, hand, 0.016 * w, 0.020 * w, skin);
        }
    }

    fn legs(&mut self) {
        let h = self.h;
        let w = self.w;
        let trousers = self.look.trousers;
        let turn = self.s.world_from_pelvis;
        let seat = self.s.pelvis + Vector3::new(0.0, 0.0, 0.015 * h);
        self.ellipsoid(seat, turn, Vector3::new(0.066 * h, 0.098 * w, 0.070 * h), trousers);
        for side in 0..2 {
            let hip = self.s.hips[side];
            let knee = self.s.knees[side];
            let ankle = self.s.ankles[side];
            let calf = knee + (ankle - knee) * 0.35;
            self.limb(hip, knee, 0.054 * w, 0.036 * w, trousers);
            self.limb(knee, calf, 0.036 * w, 0.035 * w, trousers);
            self.limb(calf, ankle, 0.035 * w, 0.026 * w, trousers);
            self.limb(self.s.heels[side], self.s.toes[side], 0.024 * h, 0.018 * h, self.look.shoes);
        }
    }

    fn extras(&mut self) {
        for extra in &self.look.extras {
            match extra {
                Extra::Coat => self.coat(),
                Extra::Backpack => self.backpack(),
                Extra::Hat => self.hat(scaled(self.look.trousers.colour, 1.3)),
                Extra::GreenHat => self.hat([0.02, 0.45, 0.05]),
                Extra::Bag => self.bag(),
                Extra::Poncho => self.poncho(),
                Extra::Laptop => self.laptop(),
                Extra::Trolley => {}
            }
        }
        if self.s.posture == Posture::Phone {
            self.phone();
        }
    }

    fn coat(&mut self) {
        let h = self.h;
        let w = self.w;
        let turn = self.s.world_from_pelvis;
        let upper = self.s.pelvis + Vector3::new(0.0, 0.0, 0.06 * h);
        let hem = self.s.pelvis - Vector3::new(0.0, 0.0, 0.13 * h);
        self.ellipsoid(upper, turn, Vector3::new(0.078 * h, 0.108 * w, 0.16 * h), self.look.top);
        if self.s.seated > 0.5 {
            return;
        }
        for sign in [1.0, -1.0] {
            let out = turn * Vector3::new(0.0, sign * 0.035 * w, 0.0);
            self.limb(upper + out, hem + out, 0.07 * h, 0.078 * h, self.look.top);
        }
    }

    fn poncho(&mut self) {
        let h = self.h;
        let w = self.w;
        let hem = self.s.pelvis - Vector3::new(0.0, 0.0, 0.04 * h);
        let collar = self.s.chest - Vector3::new(0.0, 0.0, 0.03 * h);
        self.limb(collar, hem, 0.085 * w, 0.17 * w, self.look.top);
    }

    /// Adds a laptop: the keyboard in front of the chest, the screen at its far edge.
    fn laptop(&mut self) {
        let turn = self.s.world_from_thorax;
        let [low, high] = [(0.15, -0.14), (0.225, -0.075)]
            .map(|(x, z)| self.s.chest + turn * (Vector3::new(x, 0.0, z) * self.h));
        let shell = Material::plain([0.35; 3]);
        let glass = Material::plain([0.05; 3]);
        let keys = Form::Block(Vector3::new(0.12, 0.17, 0.01));
        let screen = Form::Block(Vector3::new(0.008, 0.17, 0.11));
        self.shapes.push(Shape::new(keys, low, turn, shell));
        // Glass returns almost no projected dots.
        self.shapes.push(Shape::new(screen, high, turn, glass.with_infrared(0.03)));
    }

    fn backpack(&mut self) {
        let turn = self.s.world_from_thorax;
        let at = self.s.chest + turn * (Vector3::new(-0.105, 0.0, -0.11) * self.h);
        let cloth =
            Material::patterned([0.06, 0.07, 0.09], [0.2, 0.05, 0.04], Pattern::Stripes(0.25));
        self.ellipsoid(at, turn, Vector3::new(0.062, 0.085, 0.14) * self.h, cloth);
    }

    fn hat(&mut self, colour: Colour) {
        let h = self.h;
        let turn = self.s.world_from_head;
        let felt = Material::plain(colour);
        for (up, half) in [(0.040, [0.058, 0.052, 0.045]), (0.038, [0.088, 0.078, 0.006])] {
            let at = self.s.head + Vector3::new(0.0, 0.0, up * h);
            self.ellipsoid(at, turn, Vector3::from(half) * h, felt);
        }
    }

    fn bag(&mut self) {
        let leather = Material::plain([0.12, 0.06, 0.03]);
        let at = self.s.wrists[0] - Vector3::new(0.0, 0.0, 0.17 * self.h);
        let half = Vector3::new(0.16, 0.05, 0.12);
        let block = Shape::new(Form::Block(half), at, self.s.world_from_pelvis, leather);
        self.shapes.push(block);
    }

    fn phone(&mut self) {
        let wrist = self.s.wrists[1];
        let elbow = self.s.elbows[1];
        let at = wrist + (wrist - elbow).normalize() * (0.06 * self.h);
        let form = Form::Block(Vector3::new(0.008, 0.037, 0.075));
        let glass = Material::plain([0.02; 3]).with_infrared(0.05);
        self.shapes.push(Shape::new(form, at, self.s.world_from_head, glass));
    }

    /// Adds a trolley that leans behind the right hand, which holds its handle.
    fn trolley(&mut self) {
        let turn = self.s.world_from_pelvis * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.55);
        let hand = self.s.wrists[1];
        let behind = self.s.world_from_pelvis * Vector3::new(-0.5, -0.08, 0.0);
        let at = Point3::new(hand.x + behind.x, hand.y + behind.y, 0.34);
        let shell = Material::plain(scaled(self.look.top.second, 0.8));
        self.shapes.push(Shape::new(Form::Block(Vector3::new(0.11, 0.18, 0.27)), at, turn, shell));
        let rim = at + turn * Vector3::new(0.0, 0.0, 0.27);
        self.limb(rim, hand, 0.012, 0.012, Material::plain([0.1; 3]));
    }

    fn ellipsoid(
        &mut self,
        at: Point3<f64>,
        turn: Rotation3<f64>,
        half: Vector3<f64>,
        of: Material,
    ) {
        self.shapes.push(Shape::new(Form::Ellipsoid(half), at, turn, of));
    }

    fn limb(&mut self, from: Point3<f64>, to: Point3<f64>, first: f64, second: f64, of: Material) {
        let forward = self.s.world_from_thorax * Vector3::x();
        self.shapes.push(Shape::limb((from, to), (first, second), forward, of));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::body::Stance;

    #[test]
    fn the_same_subject_is_the_same_person_and_splits_share_nobody() {
        use crate::split::{SUBJECTS, Split};
        assert_eq!(Person::subject(3), Person::subject(3));
        let sizes: std::collections::BTreeSet<[u64; 2]> = Split::ALL
            .into_iter()
            .flat_map(|split| (0..SUBJECTS).map(move |n| Person::subject(split.subject(n))))
            .map(|p| [p.build.height_m.to_bits(), p.build.breadth.to_bits()])
            .collect();
        assert_eq!(sizes.len() as u64, 3 * SUBJECTS);
    }

    /// Returns the first surface on a ray towards a person, at a height and beside the middle.
    fn met(extras: &[Extra], [aside, height]: [f64; 2]) -> Option<(f64, Shape)> {
        let mut person = Person::subject(3);
        person.look.extras = extras.to_vec();
        let stance = Stance::standing(Point2::origin(), 0.0);
        let (shapes, _) = person.shapes(&Skeleton::new(&person.build, &stance));
        let eye = Point3::new(2.0, aside, height * person.build.height_m);
        let met = shapes.iter().filter_map(|s| Some((s.meet(&eye, &-Vector3::x())?, *s)));
        met.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    #[test]
    fn a_poncho_fills_the_sides_and_a_laptop_is_before_the_chest() {
        fn hip(extras: &[Extra]) -> Option<Material> {
            met(extras, [0.2, 0.5]).map(|(_, shape)| shape.material)
        }

        fn chest(extras: &[Extra]) -> (f64, Shape) {
            met(extras, [0.0, 0.76]).unwrap()
        }

        let top = Person::subject(3).look.top;
        assert_ne!(hip(&[]), Some(top), "hands and trousers");
        assert_eq!(hip(&[Extra::Poncho]), Some(top));
        let ((bare, _), (held, screen)) = (chest(&[]), chest(&[Extra::Laptop]));
        assert!(bare - held > 0.15, "{bare} {held}");
        assert!(screen.material.infrared < 0.05, "glass");
    }

    #[test]
    fn the_top_of_the_head_is_at_the_height_of_the_body() {
        for number in 0..20 {
            let mut person = Person::subject(number);
            person.look.extras.clear();
            let stance = Stance::standing(Point2::origin(), 1.0);
            let (shapes, upper) = person.shapes(&Skeleton::new(&person.build, &stance));
            let down = -Vector3::z();
            let from = Point3::new(0.0, 0.0, 3.0);
            let from = from
                + Rotation3::from_axis_angle(&Vector3::z_axis(), 1.0)
                    * Vector3::new(0.015, 0.0, 0.0);
            let first =
                shapes[..upper].iter().filter_map(|s| s.meet(&from, &down)).fold(9.0, f64::min);
            assert!((3.0 - first - person.build.height_m).abs() < 0.02, "{first}");
        }
    }
}
