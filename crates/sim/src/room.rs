//! Rooms and what stands in them.

use nalgebra::{Point3, Rotation3, Vector3};

use crate::material::{Colour, Material, Pattern, scaled};
use crate::random::Random;
use crate::scene::{Floor, Furniture, FurnitureKind, LightSettings, RoomSettings};
use crate::shape::{Form, Shape};
use crate::world::{Lamp, Object};

const WOOD: Colour = [0.30, 0.17, 0.08];
const METAL: Colour = [0.10, 0.10, 0.11];
/// Thickness of walls and panels, m.
const WALL_M: f64 = 0.1;

/// Floor, ceiling, walls and a door.
pub fn room(settings: &RoomSettings) -> Object {
    let [x, y] = settings.size_m;
    let z = settings.height_m;
    let paint = Material::plain([0.62, 0.60, 0.55]);
    let wall = if settings.wallpaper {
        Material::patterned([0.62, 0.58, 0.50], [0.38, 0.36, 0.34], Pattern::Mottled(0.09))
    } else {
        paint
    };
    let half = 0.5 * WALL_M;
    let slab = |centre: [f64; 3], sides: [f64; 3], of| {
        let sides = Vector3::from(sides) * 0.5 + Vector3::repeat(half);
        Shape::new(Form::Block(sides), Point3::from(centre), Rotation3::identity(), of)
    };
    let (cx, cy, cz) = (0.5 * x, 0.5 * y, 0.5 * z);
    let mut shapes = vec![
        slab([cx, cy, -half], [x, y, 0.0], floor(settings.floor)),
        slab([cx, cy, z + half], [x, y, 0.0], Material::plain([0.75; 3])),
        slab([-half, cy, cz], [0.0, y, z], wall),
        slab([x + half, cy, cz], [0.0, y, z], wall),
        slab([cx, -half, cz], [x, 0.0, z], wall),
        slab([cx, y + half, cz], [x, 0.0, z], wall),
    ];
    shapes.extend(door(x, 0.3 * y));
    Object::new(shapes, None, false)
}

fn floor(kind: Floor) -> Material {
    match kind {
        Floor::Planks => {
            Material::patterned([0.34, 0.21, 0.11], [0.22, 0.12, 0.06], Pattern::Planks(0.12))
        }
        Floor::Tiles => Material::patterned([0.45; 3], [0.36, 0.37, 0.38], Pattern::Checks(0.33)),
        Floor::Carpet => {
            Material::patterned([0.14, 0.15, 0.19], [0.10, 0.11, 0.14], Pattern::Mottled(0.03))
        }
    }
}

/// A door with its frame on the wall at the far end.
fn door(x: f64, y: f64) -> Vec<Shape> {
    let block = |dy: f64, z: f64, half: [f64; 3], colour| {
        let at = Point3::new(x, y + dy, z);
        Shape::new(
            Form::Block(Vector3::from(half)),
            at,
            Rotation3::identity(),
            Material::plain(colour),
        )
    };
    vec![
        block(0.0, 1.0, [0.03, 0.45, 1.0], [0.36, 0.30, 0.22]),
        block(0.49, 1.02, [0.06, 0.04, 1.02], WOOD),
        block(-0.49, 1.02, [0.06, 0.04, 1.02], WOOD),
        block(0.0, 2.06, [0.06, 0.53, 0.04], WOOD),
        block(0.35, 1.05, [0.07, 0.05, 0.012], [0.5; 3]),
    ]
}

/// Lamps in a row below the ceiling, bright enough together.
pub fn lamps(room: &RoomSettings, light: &LightSettings) -> Vec<Lamp> {
    let [x, y] = room.size_m;
    let z = room.height_m - 0.15;
    let direct = light.lux * (1.0 - light.ambient);
    let place = |i: usize| (i as f64 + 0.5) / light.lamps as f64;
    let hang = |i: usize| Point3::new(x * place(i), y * (0.35 + 0.3 * (i % 2) as f64), z);
    (0..light.lamps).map(|i| Lamp { at: hang(i), lux_at_1m: direct * z * z }).collect()
}

/// Random pieces along the walls.
pub fn clutter(room: &RoomSettings, random: &mut Random) -> Vec<Furniture> {
    use FurnitureKind as K;
    let kinds = [
        K::CoatStand,
        K::DrapedChair,
        K::FloorLamp,
        K::Plant,
        K::Pillar,
        K::Poster,
        K::CardboardFigure,
        K::Desk,
        K::Shelf,
    ];
    let [x, y] = room.size_m;
    let piece = |random: &mut Random| {
        let (along, side) = (random.between(0.35, 0.97), random.chance(0.5));
        let off = random.between(0.45, 0.8);
        let at = if random.chance(0.25) {
            [x - off, y * random.between(0.1, 0.9)]
        } else {
            [x * along, if side { off } else { y - off }]
        };
        let heading_deg = random.between(150.0, 210.0);
        Furniture { kind: random.pick(&kinds), at, heading_deg }
    };
    (0..room.clutter).map(|_| piece(random)).collect()
}

/// The solids of a piece of furniture.
pub fn furniture(piece: &Furniture, ceiling_m: f64) -> Object {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), piece.heading_deg.to_radians());
    let mut maker = Maker { at: piece.at, turn, shapes: Vec::new() };
    match piece.kind {
        FurnitureKind::CoatStand => maker.coat_stand(),
        FurnitureKind::DrapedChair => maker.draped_chair(),
        FurnitureKind::FloorLamp => maker.floor_lamp(),
        FurnitureKind::Plant => maker.plant(),
        FurnitureKind::Pillar => {
            maker.limb(
                [0.0, 0.0, -0.1],
                [0.0, 0.0, ceiling_m],
                [0.21, 0.21],
                Material::plain([0.55; 3]),
            );
        }
        FurnitureKind::Poster => maker.poster(),
        FurnitureKind::CardboardFigure => maker.cardboard_figure(),
        FurnitureKind::Desk => maker.desk(),
        FurnitureKind::Shelf => maker.shelf(),
    }
    Object::new(maker.shapes, None, true)
}

/// Puts solids together in the axes of a piece of furniture: X is its front.
struct Maker {
    at: [f64; 2],
    turn: Rotation3<f64>,
    shapes: Vec<Shape>,
}

impl Maker {
    fn place(&self, p: [f64; 3]) -> Point3<f64> {
        Point3::new(self.at[0], self.at[1], 0.0) + self.turn * Vector3::from(p)
    }

    fn block(&mut self, at: [f64; 3], half: [f64; 3], of: Material) {
        let form = Form::Block(Vector3::from(half));
        self.shapes.push(Shape::new(form, self.place(at), self.turn, of));
    }

    fn ellipsoid(&mut self, at: [f64; 3], half: [f64; 3], of: Material) {
        let form = Form::Ellipsoid(Vector3::from(half));
        self.shapes.push(Shape::new(form, self.place(at), self.turn, of));
    }

    fn limb(&mut self, from: [f64; 3], to: [f64; 3], radii: [f64; 2], of: Material) {
        let ends = (self.place(from), self.place(to));
        let forward = self.turn * Vector3::x();
        self.shapes.push(Shape::limb(ends, (radii[0], radii[1]), forward, of));
    }

    fn coat_stand(&mut self) {
        let (wood, cloth) = (Material::plain(WOOD), Material::plain([0.09, 0.10, 0.16]));
        self.limb([0.0, 0.0, 0.0], [0.0, 0.0, 1.72], [0.025, 0.02], wood);
        self.ellipsoid([0.0, 0.0, 0.02], [0.22, 0.22, 0.03], wood);
        self.limb([0.02, -0.17, 1.42], [0.02, 0.17, 1.42], [0.07, 0.07], cloth);
        self.ellipsoid([0.03, 0.0, 1.08], [0.12, 0.22, 0.42], cloth);
        for side in [-1.0, 1.0] {
            self.limb([0.03, side * 0.21, 1.38], [0.04, side * 0.25, 0.85], [0.06, 0.05], cloth);
        }
        let felt = Material::plain([0.07, 0.05, 0.04]);
        self.ellipsoid([0.0, 0.0, 1.70], [0.10, 0.09, 0.10], felt);
        self.ellipsoid([0.0, 0.0, 1.65], [0.16, 0.15, 0.012], felt);
    }

    fn draped_chair(&mut self) {
        let wood = Material::plain(WOOD);
        let jacket =
            Material::patterned([0.28, 0.09, 0.07], [0.2, 0.06, 0.05], Pattern::Mottled(0.05));
        self.block([0.0, 0.0, 0.46], [0.22, 0.22, 0.025], wood);
        for (x, y) in [(-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2)] {
            self.limb([x, y, 0.0], [x, y, 0.46], [0.02, 0.02], wood);
        }
        self.block([-0.21, 0.0, 0.75], [0.02, 0.2, 0.28], wood);
        self.limb([-0.21, -0.2, 1.02], [-0.21, 0.2, 1.02], [0.06, 0.06], jacket);
        self.ellipsoid([-0.23, 0.0, 0.78], [0.08, 0.25, 0.32], jacket);
    }

    fn floor_lamp(&mut self) {
        self.limb([0.0, 0.0, 0.0], [0.0, 0.0, 1.5], [0.014, 0.014], Material::plain(METAL));
        self.ellipsoid([0.0, 0.0, 0.015], [0.15, 0.15, 0.02], Material::plain(METAL));
        self.limb(
            [0.0, 0.0, 1.48],
            [0.0, 0.0, 1.66],
            [0.15, 0.09],
            Material::plain([0.75, 0.66, 0.45]),
        );
    }

    fn plant(&mut self) {
        let pot = Material::plain([0.40, 0.18, 0.10]);
        let leaf =
            Material::patterned([0.08, 0.22, 0.06], [0.04, 0.12, 0.04], Pattern::Mottled(0.06));
        self.limb([0.0, 0.0, 0.16], [0.0, 0.0, 0.30], [0.15, 0.19], pot);
        self.limb([0.0, 0.0, 0.3], [0.0, 0.0, 1.2], [0.03, 0.02], Material::plain(WOOD));
        for i in 0..14 {
            let angle = 2.4 * f64::from(i);
            let (rise, out) = (0.75 + 0.065 * f64::from(i), 0.24 - 0.012 * f64::from(i));
            let tip = [out * 1.5 * angle.cos(), out * 1.5 * angle.sin(), rise + 0.1];
            self.limb([0.0, 0.0, rise - 0.1], tip, [0.035, 0.075], leaf);
        }
    }

    fn poster(&mut self) {
        let print =
            Material::patterned([0.65, 0.62, 0.5], [0.12, 0.16, 0.35], Pattern::Print(0.4, 0.6));
        self.block([0.0, 0.0, 1.2], [0.015, 0.4, 0.6], print);
        self.limb([-0.03, 0.0, 0.0], [-0.03, 0.0, 1.2], [0.02, 0.02], Material::plain(METAL));
    }

    fn cardboard_figure(&mut self) {
        let (shirt, legs) =
            (Material::plain([0.12, 0.25, 0.4]), Material::plain([0.05, 0.05, 0.07]));
        let skin = Material::plain([0.52, 0.33, 0.25]);
        let half = Vector3::new(0.012, 0.085, 0.115);
        let pattern = Pattern::Head { half, hairline: 0.62 };
        let face = Material { second: [0.04, 0.03, 0.02], pattern, ..skin };
        self.ellipsoid([0.0, 0.0, 1.58], half.into(), face);
        self.block([0.0, 0.0, 1.45], [0.006, 0.05, 0.06], skin);
        self.ellipsoid([0.0, 0.0, 1.15], [0.010, 0.235, 0.29], shirt);
        self.block([0.0, 0.0, 0.45], [0.006, 0.17, 0.45], legs);
    }

    fn desk(&mut self) {
        let (top, screen) = (Material::plain(scaled(WOOD, 1.5)), Material::plain([0.02; 3]));
        self.block([0.0, 0.0, 0.72], [0.4, 0.75, 0.02], top);
        for (x, y) in [(-0.37, -0.7), (-0.37, 0.7), (0.37, -0.7), (0.37, 0.7)] {
            self.limb([x, y, 0.0], [x, y, 0.72], [0.025, 0.025], Material::plain(METAL));
        }
        // Glass returns hardly any projected dots.
        self.block([-0.1, 0.0, 1.06], [0.02, 0.29, 0.18], screen.with_infrared(0.03));
        self.limb([-0.1, 0.0, 0.74], [-0.1, 0.0, 1.0], [0.03, 0.03], Material::plain(METAL));
    }

    fn shelf(&mut self) {
        let books = Material::patterned([0.35, 0.10, 0.08], [0.1, 0.2, 0.3], Pattern::Checks(0.16));
        self.block([0.0, 0.0, 0.95], [0.15, 0.45, 0.95], Material::plain(WOOD));
        for level in 0..5 {
            let z = 0.2 + 0.36 * f64::from(level);
            self.block([0.03, 0.0, z], [0.13, 0.41, 0.13], books);
        }
    }
}
