//! Rooms and their furniture.

use nalgebra::{Point2, Point3, Rotation2, Rotation3, Vector2, Vector3};

use crate::furniture::{Furniture, FurnitureKind};
use crate::material::{Colour, Material, Pattern, scaled};
use crate::obstacle::Obstacle;
use crate::ramp::Ramp;
use crate::random::Random;
use crate::room_settings::Floor;
use crate::room_settings::RoomSettings;
use crate::scene::{LightSettings, Scene};
use crate::shape::{Form, Shape};
use crate::world::{Lamp, Object};

mod glass;

const WOOD: Colour = [0.30, 0.17, 0.08];
const METAL: Colour = [0.10, 0.10, 0.11];
/// Thickness of walls and panels, m.
const WALL_M: f64 = 0.1;
/// Half the width and the height of a door, m.
const DOOR_M: [f64; 2] = [0.45, 2.02];
/// Depth of the room behind an open door, m.
const BEHIND_M: f64 = 1.8;
/// Minimum distance of furniture from all paths, m.
const OFF_THE_WAY_M: f64 = 0.75;
/// Number of attempts to find a free position.
const TRIES: usize = 40;
/// Colours of coats, jackets and shades.
const CLOTHS: &[Colour] = &[
    [0.09, 0.10, 0.16],
    [0.28, 0.09, 0.07],
    [0.05; 3],
    [0.30, 0.25, 0.18],
    [0.10, 0.18, 0.12],
    [0.42, 0.40, 0.36],
];

/// Returns floor, ceiling, walls and a door.
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
    let (cx, cy, cz) = (0.5 * x, 0.5 * y, 0.5 * z);
    let door_y = 0.3 * y;
    let mut shapes = match &settings.ramp {
        None => vec![wall_slab([cx, cy, -half], [x, y, 0.0], floor(settings.floor))],
        Some(ramp) => sloped_floor(ramp, [x, y], floor(settings.floor)).into(),
    };
    shapes.extend([
        wall_slab([cx, cy, z + half], [x, y, 0.0], Material::plain([0.75; 3])),
        wall_slab([-half, cy, cz], [0.0, y, z], wall),
        wall_slab([cx, -half, cz], [x, 0.0, z], wall),
        wall_slab([cx, y + half, cz], [x, 0.0, z], wall),
    ]);
    if settings.open_door {
        let [side, top] = DOOR_M;
        let (low, high) = (door_y - side, door_y + side);
        for (from, to) in [
            ([-WALL_M, -WALL_M], [low, z + WALL_M]),
            ([high, -WALL_M], [y + WALL_M, z + WALL_M]),
            ([low, top], [high, z + WALL_M]),
        ] {
            let at = Point3::new(x + half, 0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1]));
            let sides = Vector3::new(WALL_M, to[0] - from[0], to[1] - from[1]) * 0.5;
            shapes.push(Shape::new(Form::Block(sides), at, Rotation3::identity(), wall));
        }
        let behind = Material::plain([0.2, 0.19, 0.18]);
        let end = x + WALL_M + BEHIND_M;
        let middle = 0.5 * (x + end);
        shapes.extend([
            wall_slab([end + half, door_y, cz], [0.0, 3.0, z], behind),
            wall_slab([middle, door_y, -half], [end - x, 3.0, 0.0], behind),
            wall_slab([middle, door_y - 1.5, cz], [end - x, 0.0, z], behind),
            wall_slab([middle, door_y + 1.5, cz], [end - x, 0.0, z], behind),
        ]);
        shapes.extend(door_frame([x, door_y], &Rotation3::identity()));
    } else {
        shapes.push(wall_slab([x + half, cy, cz], [0.0, y, z], wall));
        shapes.extend(door(x, door_y));
    }
    Object::new(shapes, None, false)
}

/// Returns a level block that extends beyond its sides by the thickness of a wall, m.
fn wall_slab(centre: [f64; 3], sides: [f64; 3], of: Material) -> Shape {
    let sides = Vector3::from(sides) * 0.5 + Vector3::repeat(0.5 * WALL_M);
    Shape::new(Form::Block(sides), Point3::from(centre), Rotation3::identity(), of)
}

/// Returns the level floor before a ramp, the ramp, and the level floor after it, in a room of this
/// length and width, m.
fn sloped_floor(ramp: &Ramp, [x, y]: [f64; 2], of: Material) -> [Shape; 3] {
    let Ramp { from_m, length_m, rise_m } = ramp;
    let (half, end_m) = (0.5 * WALL_M, from_m + length_m);
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), -rise_m.atan2(*length_m));
    [
        ([0.5 * from_m, 0.0], *from_m, Rotation3::identity()),
        ([from_m + 0.5 * length_m, 0.5 * rise_m], length_m.hypot(*rise_m), turn),
        ([0.5 * (end_m + x), *rise_m], (x - end_m).max(0.0), Rotation3::identity()),
    ]
    .map(|(middle, long, turn)| {
        let surface = Point3::new(middle[0], 0.5 * y, middle[1]);
        let sides = Vector3::new(0.5 * long, 0.5 * y + half, half);
        Shape::new(Form::Block(sides), surface - turn * Vector3::new(0.0, 0.0, half), turn, of)
    })
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

/// Returns a closed door with its frame on the wall at the far end.
fn door(x: f64, y: f64) -> Vec<Shape> {
    let still = Rotation3::identity();
    let mut shapes = door_frame([x, y], &still);
    for (dy, z, half, colour) in [
        (0.0, 1.0, [0.03, 0.45, 1.0], [0.36, 0.30, 0.22]),
        (0.35, 1.05, [0.07, 0.05, 0.012], [0.5; 3]),
    ] {
        let form = Form::Block(Vector3::from(half));
        let at = Point3::new(x, y + dy, z);
        shapes.push(Shape::new(form, at, still, Material::plain(colour)));
    }
    shapes
}

/// Returns jambs and lintel of a doorway across X.
fn door_frame(at: [f64; 2], turn: &Rotation3<f64>) -> Vec<Shape> {
    let [side, top] = DOOR_M;
    [
        (side + 0.04, 0.5 * top, [0.06, 0.04, 0.5 * top]),
        (-side - 0.04, 0.5 * top, [0.06, 0.04, 0.5 * top]),
        (0.0, top + 0.04, [0.06, side + 0.08, 0.04]),
    ]
    .map(|(y, z, half)| {
        let at = Point3::new(at[0], at[1], 0.0) + turn * Vector3::new(0.0, y, z);
        Shape::new(Form::Block(half.into()), at, *turn, Material::plain(WOOD))
    })
    .into()
}

/// Returns lamps in a row below the ceiling that together give the wanted brightness.
pub fn lamps(room: &RoomSettings, light: &LightSettings) -> Vec<Lamp> {
    let [x, y] = room.size_m;
    let z = room.height_m - 0.15;
    let direct = light.lux * (1.0 - light.ambient);
    let mut lamps = Vec::with_capacity(light.lamps);
    for i in 0..light.lamps {
        let along = x * ((i as f64 + 0.5) / light.lamps as f64);
        let at = Point3::new(along, y * (0.35 + 0.3 * (i % 2) as f64), z);
        lamps.push(Lamp::hanging(at, direct * z * z));
    }
    lamps
}

/// Returns random pieces along the walls, away from the paths of robot and people and from each
/// other; a piece without a free position is left out.
pub fn clutter(scene: &Scene, random: &mut Random) -> Vec<Furniture> {
    let mut ways: Vec<Vec<Point2<f64>>> = vec![
        [scene.robot.start].iter().chain(&scene.robot.path).map(|p| Point2::from(*p)).collect(),
    ];
    for person in &scene.people {
        let offset = Vector2::from(person.offset);
        ways.push(person.path.iter().map(|p| Point2::from(*p) + offset).collect());
    }
    ways.extend(scene.furniture.iter().map(|piece| vec![Point2::from(piece.at)]));
    let mut pieces = Vec::new();
    for _ in 0..scene.room.clutter {
        let mut tries = (0..TRIES).map(|_| random_piece(&scene.room, random));
        let free = tries.find(|piece| {
            ways.iter().all(|way| distance(way, &Point2::from(piece.at)) > OFF_THE_WAY_M)
        });
        if let Some(piece) = free {
            ways.push(vec![Point2::from(piece.at)]);
            pieces.push(piece);
        }
    }
    pieces
}

fn random_piece(room: &RoomSettings, random: &mut Random) -> Furniture {
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
        K::BinOnTable,
    ];
    let [x, y] = room.size_m;
    let (along, side) = (random.between(0.2, 0.97), random.chance(0.5));
    let off = random.between(0.45, 0.8);
    let at = if random.chance(0.25) {
        [x - off, y * random.between(0.1, 0.9)]
    } else {
        [x * along, if side { off } else { y - off }]
    };
    Furniture { kind: random.pick(&kinds), at, heading_deg: random.between(150.0, 210.0) }
}

/// Returns the distance of a position from a polyline with at least one point.
pub fn distance(way: &[Point2<f64>], place: &Point2<f64>) -> f64 {
    let to_segments = way.windows(2).map(|pair| {
        let along = pair[1] - pair[0];
        let part = (place - pair[0]).dot(&along) / along.norm_squared().max(1e-12);
        (place - (pair[0] + along * part.clamp(0.0, 1.0))).norm()
    });
    let to_points = way.iter().map(|point| (place - point).norm());
    to_segments.chain(to_points).fold(f64::INFINITY, f64::min)
}

/// Returns the obstacles around which people walk.
pub fn obstacles(piece: &Furniture) -> Vec<Obstacle> {
    let turn = Rotation2::new(piece.heading_deg.to_radians());
    // Lateral offset and radius of each disc, m.
    let discs: &[(f64, f64)] = match piece.kind {
        FurnitureKind::Desk => &[(0.0, 0.75)],
        FurnitureKind::Shelf => &[(0.0, 0.45)],
        // The jambs are thin, and people keep to the middle anyway.
        FurnitureKind::Doorway => {
            &[(0.6, 0.05), (-0.6, 0.05), (0.85, 0.2), (-0.85, 0.2), (1.1, 0.2), (-1.1, 0.2)]
        }
        FurnitureKind::Partition => &[(-0.65, 0.35), (0.0, 0.35), (0.65, 0.35)],
        FurnitureKind::GlassDoor | FurnitureKind::Mirror => &[(-0.3, 0.25), (0.3, 0.25)],
        FurnitureKind::GlassWall => &[(-0.9, 0.3), (-0.3, 0.3), (0.3, 0.3), (0.9, 0.3)],
        _ => &[(0.0, 0.3)],
    };
    discs
        .iter()
        .map(|(aside, radius_m)| {
            let at = Point2::from(piece.at) + turn * Vector2::new(0.0, *aside);
            Obstacle::standing(at, *radius_m)
        })
        .collect()
}

/// Returns the solids of a piece of furniture. Its cloth, tone, size, proportions and parts are
/// random, so that no two pieces of a kind are the same.
pub fn furniture(piece: &Furniture, ceiling_m: f64, random: &mut Random) -> Object {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), piece.heading_deg.to_radians());
    let cloth = random.pick(CLOTHS);
    let wood = scaled(WOOD, random.between(0.5, 1.6));
    let size = random.between(0.93, 1.07);
    let form = Random::new(random.below(u64::MAX), 0);
    let mut maker = Maker { at: piece.at, turn, cloth, wood, size, form, shapes: Vec::new() };
    match piece.kind {
        FurnitureKind::CoatStand => maker.coat_stand(),
        FurnitureKind::DrapedChair => maker.draped_chair(),
        FurnitureKind::FloorLamp => maker.floor_lamp(),
        FurnitureKind::Plant => maker.plant(),
        FurnitureKind::Pillar => maker.pillar(ceiling_m),
        FurnitureKind::Poster => maker.poster(),
        FurnitureKind::CardboardFigure => maker.cardboard_figure(),
        FurnitureKind::Desk => maker.desk(),
        FurnitureKind::Shelf => maker.shelf(),
        FurnitureKind::Chair => maker.chair(),
        FurnitureKind::BinOnTable => maker.bin_on_table(),
        FurnitureKind::Doorway => maker.doorway(ceiling_m),
        FurnitureKind::Partition => maker.partition(),
        FurnitureKind::Blanket => maker.blanket(),
        FurnitureKind::Flag => maker.flag(),
        FurnitureKind::GlassDoor => maker.glass_door(),
        FurnitureKind::Mirror => maker.mirror(),
        FurnitureKind::GlassWall => maker.glass_wall(),
    }
    Object::new(maker.shapes, None, true)
}

/// Builder of the solids of a piece of furniture, in its axes: X points to its front.
struct Maker {
    at: [f64; 2],
    turn: Rotation3<f64>,
    cloth: Colour,
    wood: Colour,
    /// Height as a multiple of the usual one.
    size: f64,
    /// Random numbers for proportions and parts.
    form: Random,
    shapes: Vec<Shape>,
}

impl Maker {
    /// Returns a random proportion between two others.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.form.between(low, high)
    }

    /// Returns true with this probability, for a part that may be missing.
    fn has(&mut self, probability: f64) -> bool {
        self.form.chance(probability)
    }

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

    /// Adds a pole with a coat in a random position, perhaps a second one, and perhaps a hat.
    fn coat_stand(&mut self) {
        let wood = Material::plain(self.wood);
        let top = 1.72 * self.size * self.between(0.94, 1.12);
        self.limb([0.0, 0.0, 0.0], [0.0, 0.0, top], [0.025, 0.02], wood);
        self.ellipsoid([0.0, 0.0, 0.02], [0.22, 0.22, 0.03], wood);
        self.coat(0.0, top - 0.30);
        if self.has(0.35) {
            let (aside, below) = (self.between(-0.16, 0.16), self.between(0.05, 0.25));
            self.coat(aside, top - 0.30 - below);
        }
        if self.has(0.7) {
            let (felt, brim) = (Material::plain([0.07, 0.05, 0.04]), self.between(0.11, 0.19));
            let (crown, aside) = (self.between(0.08, 0.12), self.between(-0.05, 0.05));
            self.ellipsoid([0.0, aside, top - 0.02], [crown, 0.9 * crown, crown], felt);
            self.ellipsoid([0.0, aside, top - 0.07], [brim, 0.94 * brim, 0.012], felt);
        }
    }

    /// Adds a coat that hangs at this height: slanted shoulders, separate sleeves.
    fn coat(&mut self, aside: f64, shoulder: f64) {
        let cloth = Material::plain(self.cloth);
        let (broad, slant) = (self.between(0.75, 1.2), self.between(-0.05, 0.05));
        let (long, deep) = (self.between(0.28, 0.50), self.between(0.09, 0.16));
        let half = 0.17 * broad;
        let [left, right] = [-1.0, 1.0].map(|y| [0.02, aside + y * half, shoulder + y * slant]);
        self.limb(left, right, [0.07, 0.07], cloth);
        let middle = [0.03, aside, shoulder - 0.8 * long];
        self.ellipsoid(middle, [deep, 0.22 * broad, long], cloth);
        for y in [-1.0, 1.0] {
            let (sleeve, out) = (self.between(0.25, 0.60), self.between(0.20, 0.30));
            let from = [0.03, aside + y * 0.21 * broad, shoulder + y * slant - 0.04];
            let hem = [0.04, aside + y * out * broad, shoulder - 0.04 - sleeve];
            self.limb(from, hem, [0.06, 0.05], cloth);
        }
    }

    /// Adds a pillar, round or square.
    fn pillar(&mut self, ceiling_m: f64) {
        let (stone, half) = (Material::plain([0.55; 3]), 0.21 * self.size * self.between(0.7, 1.3));
        if self.has(0.7) {
            self.limb([0.0, 0.0, -0.1], [0.0, 0.0, ceiling_m], [half; 2], stone);
        } else {
            self.block([0.0, 0.0, 0.5 * ceiling_m], [0.85 * half, half, 0.5 * ceiling_m], stone);
        }
    }

    fn chair(&mut self) {
        let wood = Material::plain(self.wood);
        self.block([0.0, 0.0, 0.43], [0.21, 0.21, 0.02], wood);
        for (x, y) in [(-0.19, -0.19), (-0.19, 0.19), (0.19, -0.19), (0.19, 0.19)] {
            self.limb([x, y, 0.0], [x, y, 0.43], [0.02, 0.02], wood);
        }
        self.block([-0.2, 0.0, 0.68], [0.02, 0.2, 0.24], wood);
    }

    /// Adds a chair with a jacket that covers the whole back, or has slipped to one side.
    fn draped_chair(&mut self) {
        let jacket =
            Material::patterned(self.cloth, scaled(self.cloth, 0.7), Pattern::Mottled(0.05));
        self.chair();
        let (back, broad) = (self.between(0.92, 1.12), self.between(0.85, 1.2));
        let (slip, long) = (self.between(-0.08, 0.08), self.between(0.22, 0.36));
        let half = 0.5 * (back - 0.47);
        self.block([-0.21, 0.0, back - half], [0.02, 0.2, half], Material::plain(self.wood));
        let side = 0.2 * broad;
        let (left, right) = ([-0.21, slip - side, back], [-0.21, slip + side, back]);
        self.limb(left, right, [0.06, 0.06], jacket);
        self.ellipsoid([-0.23, slip, back - 0.75 * long], [0.08, 0.25 * broad, long], jacket);
    }

    /// Adds a bin with a round lid, or an open one.
    fn bin_on_table(&mut self) {
        let (wood, tin) = (Material::plain(self.wood), Material::plain(self.cloth));
        let (half, table) = (self.between(0.24, 0.38), self.between(0.62, 0.80));
        self.block([0.0, 0.0, table], [half, half, 0.015], wood);
        let leg = half - 0.03;
        for (x, y) in [(-leg, -leg), (-leg, leg), (leg, -leg), (leg, leg)] {
            self.limb([x, y, 0.0], [x, y, table], [0.02, 0.02], wood);
        }
        let (below, above) = (self.between(0.12, 0.18), self.between(0.14, 0.21));
        let (tall, aside) = (self.between(0.24, 0.40) * self.size, self.between(-0.06, 0.06));
        let top = table + below + tall;
        self.limb([0.0, aside, table + below], [0.0, aside, top], [below, above], tin);
        if self.has(0.7) {
            let lid = self.between(0.08, 0.13);
            let at = [0.0, aside, top + above + 0.6 * lid];
            self.ellipsoid(at, [lid, lid, 1.3 * lid], Material::plain([0.35; 3]));
        }
    }

    fn doorway(&mut self, ceiling_m: f64) {
        let (paint, [side, top]) = (Material::plain([0.60, 0.58, 0.54]), DOOR_M);
        let above = 0.5 * (ceiling_m - top);
        for y in [-1.0, 1.0] {
            let half = 0.5 * (1.2 - side);
            let at = [0.0, y * (side + half), 0.5 * ceiling_m];
            self.block(at, [0.05, half, 0.5 * ceiling_m], paint);
        }
        self.block([0.0, 0.0, top + above], [0.05, side, above], paint);
        self.shapes.extend(door_frame(self.at, &self.turn));
    }

    fn partition(&mut self) {
        let felt = Material::patterned(self.cloth, scaled(self.cloth, 0.8), Pattern::Mottled(0.02));
        self.block([0.0, 0.0, 0.9], [0.02, 0.8, 0.8], felt);
        for y in [-0.8, 0.8] {
            self.limb([0.0, y, 0.0], [0.0, y, 1.7], [0.025, 0.025], Material::plain(METAL));
            self.block([0.0, y, 0.015], [0.22, 0.03, 0.015], Material::plain(METAL));
        }
    }

    /// Adds a hump as wide as shoulders.
    fn blanket(&mut self) {
        let wool = Material::patterned(self.cloth, scaled(self.cloth, 1.4), Pattern::Checks(0.11));
        self.chair();
        let (top, broad) = (self.between(0.9, 1.25), self.between(0.16, 0.26));
        let (slip, fold) = (self.between(-0.08, 0.08), self.between(0.05, 0.1));
        self.limb([-0.2, slip - broad, top], [-0.2, slip + broad, top], [fold, fold], wool);
        self.limb([-0.15, slip, top - broad], [0.0, slip, 0.1], [broad, 1.3 * broad], wool);
    }

    /// Adds cloth beside a pole, as high as a tall person or higher.
    fn flag(&mut self) {
        let (top, long) = (self.between(1.8, 2.3), self.between(0.7, 1.1));
        let (wide, metal) = (self.between(0.12, 0.25), Material::plain(METAL));
        let stripes =
            Material::patterned(self.cloth, [0.6, 0.58, 0.5], Pattern::Stripes(0.35 * long));
        self.limb([0.0, 0.0, 0.0], [0.0, 0.0, top], [0.015, 0.015], metal);
        self.ellipsoid([0.0, 0.0, 0.02], [0.16, 0.16, 0.03], metal);
        self.ellipsoid([0.02, 0.8 * wide, top - 0.5 * long], [0.06, wide, 0.55 * long], stripes);
    }

    /// Adds a shade or a globe, above the foot or on an arm beside it.
    fn floor_lamp(&mut self) {
        let (metal, cloth) = (Material::plain(METAL), Material::plain([0.75, 0.66, 0.45]));
        let top = 1.66 * self.size * self.between(0.9, 1.1);
        let arm = if self.has(0.3) { self.between(0.12, 0.35) } else { 0.0 };
        self.limb([0.0, -arm, 0.0], [0.0, -arm, top - 0.1], [0.014, 0.014], metal);
        self.ellipsoid([0.0, -arm, 0.015], [0.15, 0.15, 0.02], metal);
        if arm > 0.0 {
            self.limb([0.0, -arm, top - 0.1], [0.0, 0.0, top - 0.05], [0.014, 0.014], metal);
        }
        let (wide, tall) = (self.between(0.11, 0.20), self.between(0.12, 0.26));
        if self.has(0.7) {
            let narrow = wide * self.between(0.45, 0.95);
            self.limb([0.0, 0.0, top - tall], [0.0, 0.0, top], [wide, narrow], cloth);
        } else {
            self.ellipsoid([0.0, 0.0, top - wide], [wide, wide, 0.5 * (wide + tall)], cloth);
        }
    }

    /// Adds leaves around a stem, in random number and direction.
    fn plant(&mut self) {
        let pot = Material::plain([0.40, 0.18, 0.10]);
        let leaf =
            Material::patterned([0.08, 0.22, 0.06], [0.04, 0.12, 0.04], Pattern::Mottled(0.06));
        let (wide, tall) = (self.between(0.8, 1.25), self.between(0.85, 1.2));
        let (count, thick) = (self.between(9.0, 19.0) as usize, self.between(0.055, 0.09));
        self.limb([0.0, 0.0, 0.16], [0.0, 0.0, 0.30], [0.15 * wide, 0.19 * wide], pot);
        self.limb([0.0, 0.0, 0.3], [0.0, 0.0, 1.2 * tall], [0.03, 0.02], Material::plain(WOOD));
        for i in 0..count {
            let part = i as f64 / count as f64;
            let angle = 2.4 * i as f64 + self.between(-0.4, 0.4);
            let rise = tall * (0.75 + 0.91 * part);
            let out = 1.5 * wide * (0.24 - 0.17 * part) * self.between(0.8, 1.2);
            let tip = [out * angle.cos(), out * angle.sin(), rise + 0.1];
            self.limb([0.0, 0.0, rise - 0.1], tip, [0.035, thick], leaf);
        }
    }

    fn poster(&mut self) {
        let (wide, tall) = (0.4 * self.between(0.75, 1.2), 0.6 * self.between(0.75, 1.15));
        let middle = self.between(1.05, 1.3);
        let print =
            Material::patterned([0.65, 0.62, 0.5], [0.12, 0.16, 0.35], Pattern::Print(wide, tall));
        self.block([0.0, 0.0, middle], [0.015, wide, tall], print);
        let foot = Material::plain(METAL);
        self.limb([-0.03, 0.0, 0.0], [-0.03, 0.0, middle], [0.02, 0.02], foot);
    }

    /// Adds the outline of a person, a centimetre thick and life-size; an arm may be held out.
    fn cardboard_figure(&mut self) {
        let (shirt, legs) = (Material::plain(self.cloth), Material::plain([0.05, 0.05, 0.07]));
        let skin = Material::plain([0.52, 0.33, 0.25]);
        let z = self.size * self.between(0.94, 1.06);
        let (broad, head) = (self.between(0.85, 1.15), self.between(0.9, 1.15));
        let half = Vector3::new(0.012, 0.080 * head, 0.112 * head);
        let pattern = Pattern::Head { half, hairline: 0.62 };
        let face = Material { second: [0.04, 0.03, 0.02], pattern, ..skin };
        let tilt = self.between(-0.03, 0.03);
        self.ellipsoid([0.0, tilt, 1.60 * z], half.into(), face);
        self.block([0.0, 0.0, 1.46 * z], [0.006, 0.052, 0.05], skin);
        self.ellipsoid([0.0, 0.0, 1.36 * z], [0.007, 0.235 * broad, 0.075], shirt);
        self.block([0.0, 0.0, 1.16 * z], [0.006, 0.165 * broad, 0.22], shirt);
        self.ellipsoid([0.0, 0.0, 0.97 * z], [0.006, 0.170 * broad, 0.13], legs);
        for y in [-1.0, 1.0] {
            let out = if self.has(0.25) { self.between(0.05, 0.3) } else { 0.0 };
            let shoulder = [0.001, y * 0.2 * broad, 1.34 * z];
            let hand = [0.002, y * (0.225 * broad + out), (0.86 + 0.6 * out) * z];
            self.slat(shoulder, hand, 0.048, shirt);
            self.ellipsoid(hand, [0.006, 0.035, 0.07], skin);
            self.block([0.0, y * 0.088 * broad, 0.48 * z], [0.006, 0.075, 0.46 * z], legs);
        }
        // It leans on a strut.
        self.limb([-0.3, 0.0, 0.0], [-0.01, 0.0, 0.8], [0.01, 0.01], Material::plain(METAL));
    }

    /// Adds a flat ellipse across the front, between two points.
    fn slat(&mut self, from: [f64; 3], to: [f64; 3], half_m: f64, of: Material) {
        let (from, to) = (Vector3::from(from), Vector3::from(to));
        let way = to - from;
        let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), -way.y.atan2(way.z));
        let form = Form::Ellipsoid(Vector3::new(0.006, half_m, 0.5 * way.norm() + 0.02));
        let at = self.place(((from + to) * 0.5).into());
        self.shapes.push(Shape::new(form, at, self.turn * turn, of));
    }

    fn desk(&mut self) {
        let (top, screen) = (Material::plain(scaled(self.wood, 1.5)), Material::plain([0.02; 3]));
        self.block([0.0, 0.0, 0.72], [0.4, 0.75, 0.02], top);
        for (x, y) in [(-0.37, -0.7), (-0.37, 0.7), (0.37, -0.7), (0.37, 0.7)] {
            self.limb([x, y, 0.0], [x, y, 0.72], [0.025, 0.025], Material::plain(METAL));
        }
        // Glass returns almost no projected dots.
        self.block([-0.1, 0.0, 1.06], [0.02, 0.29, 0.18], screen.with_infrared(0.03));
        self.limb([-0.1, 0.0, 0.74], [-0.1, 0.0, 1.0], [0.03, 0.03], Material::plain(METAL));
    }

    fn shelf(&mut self) {
        let books = Material::patterned([0.35, 0.10, 0.08], [0.1, 0.2, 0.3], Pattern::Checks(0.16));
        self.block([0.0, 0.0, 0.95], [0.15, 0.45, 0.95], Material::plain(self.wood));
        for level in 0..5 {
            let z = 0.2 + 0.36 * f64::from(level);
            self.block([0.03, 0.0, z], [0.13, 0.41, 0.13], books);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PersonSettings;
    use crate::split::Split;

    fn scene(seed: u64) -> Scene {
        let mut scene = Scene { seed, ..Scene::default() };
        scene.room.clutter = 8;
        scene.robot.path = vec![[6.0, 2.0]];
        let path = vec![[5.0, 0.5], [5.0, 5.5]];
        scene.people.push(PersonSettings { path, ..PersonSettings::default() });
        scene
    }

    #[test]
    fn clutter_stands_in_nobodys_way_and_differs_between_splits() {
        let mut layouts = Vec::new();
        for split in Split::ALL {
            for number in 0..30 {
                let scene = scene(split.seed(number).unwrap());
                let pieces = clutter(&scene, &mut Random::new(scene.seed, 1));
                assert!(pieces.len() >= 5, "{}", pieces.len());
                let ways = [[[1.0, 3.0], [6.0, 2.0]], [[5.0, 0.5], [5.0, 5.5]]];
                for piece in &pieces {
                    for way in ways {
                        let off = distance(&way.map(Point2::from), &Point2::from(piece.at));
                        assert!(off > 0.7, "{piece:?}: {off}");
                    }
                }
                assert!(!layouts.contains(&pieces));
                layouts.push(pieces);
            }
        }
    }

    /// Half sides, half axes and radii of all solids of a piece, and their heights.
    fn forms(kind: FurnitureKind, seed: u64) -> Vec<(Form, f64)> {
        let piece = Furniture { kind, at: [3.0, 2.0], heading_deg: 20.0 };
        let made = furniture(&piece, 2.8, &mut Random::new(seed, 8));
        made.shapes.iter().map(|shape| (shape.form, shape.origin.z)).collect()
    }

    #[test]
    fn what_looks_like_people_looks_different_each_time() {
        fn is_sane((form, z): &(Form, f64)) -> bool {
            let sizes = match *form {
                Form::Ellipsoid(half) | Form::Block(half) => half,
                Form::Capsule { length, first, second } => Vector3::new(length, first, second),
            };
            sizes.min() > 0.0 && sizes.max() < 3.0 && (-0.2..2.1).contains(z)
        }

        use FurnitureKind as K;
        let kinds = [
            K::CoatStand,
            K::DrapedChair,
            K::FloorLamp,
            K::Plant,
            K::Pillar,
            K::Poster,
            K::CardboardFigure,
            K::BinOnTable,
            K::Blanket,
            K::Flag,
        ];
        for kind in kinds {
            assert_eq!(forms(kind, 1), forms(kind, 1), "the seed decides");
            let all: Vec<_> = (0..20).map(|seed| forms(kind, seed)).collect();
            for (i, one) in all.iter().enumerate() {
                assert!(!all[..i].contains(one), "{kind:?}");
            }
            assert!(all.iter().flatten().all(is_sane), "{kind:?}");
        }
        for kind in [K::CoatStand, K::FloorLamp, K::Plant, K::BinOnTable] {
            let parts: Vec<usize> = (0..20).map(|seed| forms(kind, seed).len()).collect();
            assert!(parts.iter().max() > parts.iter().min(), "{kind:?}: {parts:?}");
        }
    }

    #[test]
    fn an_arm_of_cardboard_reaches_from_the_shoulder_to_the_hand() {
        let (at, turn) = ([0.0, 0.0], Rotation3::identity());
        let form = Random::new(1, 0);
        let mut maker =
            Maker { at, turn, cloth: [0.1; 3], wood: WOOD, size: 1.0, form, shapes: vec![] };
        let (from, to) = ([0.0, 0.2, 1.3], [0.0, 0.5, 0.9]);
        maker.slat(from, to, 0.05, Material::plain([0.5; 3]));
        let arm = maker.shapes[0];
        let (from, to) = (Point3::from(from), Point3::from(to));
        let along = (to - from).normalize();
        let reach = arm.extent(&along);
        assert!((reach - 0.27).abs() < 1e-9, "{reach}");
        assert!((arm.origin - nalgebra::center(&from, &to)).norm() < 1e-12);
    }

    #[test]
    fn an_open_door_can_be_looked_through() {
        fn ray(open_door: bool) -> f64 {
            let settings = RoomSettings { open_door, ..RoomSettings::default() };
            let eye = Point3::new(4.0, 0.3 * settings.size_m[1], 1.0);
            let hits = room(&settings);
            let hits = hits.shapes.iter().filter_map(|s| s.meet(&eye, &Vector3::x()));
            hits.fold(f64::INFINITY, f64::min)
        }

        assert!(
            (ray(false) - 4.97).abs() < 0.01 && (ray(true) - 6.9).abs() < 0.02,
            "{}",
            ray(true)
        );
    }
}
