use nalgebra::{Matrix3, Rotation3, Vector3};

/// An ellipsoid of the body, relative to the centre of the head: x forward,
/// y left, z up, metres.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Half axes along x, y, z, m.
    pub radii: [f64; 3],
}

const fn part(centre: [f64; 3], radii: [f64; 3]) -> Part {
    Part { centre, radii }
}

/// Head, neck, shoulders, chest, trunk and upper arms of an adult in everyday
/// clothes. Head: breadth 15 cm, length 19 cm, height 23 cm (adult means) plus
/// hair; shoulders 46 cm wide over the sleeves.
pub fn body_parts() -> [Part; 9] {
    [
        part([0.0, 0.0, -0.01], [0.10, 0.088, 0.125]),
        part([-0.02, 0.0, -0.15], [0.068, 0.068, 0.10]),
        part([-0.05, 0.0, -0.235], [0.08, 0.14, 0.075]),
        part([-0.04, 0.0, -0.35], [0.11, 0.18, 0.13]),
        part([-0.04, 0.0, -0.54], [0.12, 0.17, 0.32]),
        part([-0.05, 0.165, -0.29], [0.075, 0.08, 0.08]),
        part([-0.05, -0.165, -0.29], [0.075, 0.08, 0.08]),
        part([-0.05, 0.20, -0.44], [0.06, 0.055, 0.21]),
        part([-0.05, -0.20, -0.44], [0.06, 0.055, 0.21]),
    ]
}

/// Depth of each point of the body's image behind the plane through the centre of the head, m; NaN
/// beside the body. A square of [`Relief::SIZE`] cells, [`Relief::SIDE_M`] wide, the head centre in
/// the middle.
#[derive(Clone, Debug)]
pub struct Relief {
    cells: Vec<f64>,
}

impl Relief {
    /// Cells along each side.
    pub const SIZE: usize = 200;
    /// Width and height, m.
    pub const SIDE_M: f64 = 1.0;

    /// The relief at `right`, `down` of the head centre, m; NaN beside the body.
    pub fn at(&self, right_m: f64, down_m: f64) -> f64 {
        let cell = |m: f64| ((m / Self::SIDE_M + 0.5) * Self::SIZE as f64).floor();
        let (x, y) = (cell(right_m), cell(down_m));
        let inside = |v: f64| 0.0 <= v && v < Self::SIZE as f64;
        if inside(x) && inside(y) {
            self.cells[y as usize * Self::SIZE + x as usize]
        } else {
            f64::NAN
        }
    }
}

/// Looks at the body from far away: turned by `yaw_rad` (0 = its back to the
/// viewer, counter-clockwise from above), the viewer looking down by
/// `pitch_rad`.
pub fn render(yaw_rad: f64, pitch_rad: f64) -> Relief {
    let (sin, cos) = pitch_rad.sin_cos();
    let forward = Vector3::new(cos, 0.0, -sin);
    let right = Vector3::new(0.0, -1.0, 0.0);
    let down = Vector3::new(-sin, 0.0, -cos);
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let ellipsoids = body_parts().map(|p| {
        let inverse = Vector3::from(p.radii).map(|r| 1.0 / (r * r));
        let shape =
            turned.matrix() * Matrix3::from_diagonal(&inverse) * turned.matrix().transpose();
        (turned * Vector3::from(p.centre), shape)
    });
    let step = Relief::SIDE_M / Relief::SIZE as f64;
    let metre = |cell: usize| (cell as f64 + 0.5) * step - 0.5 * Relief::SIDE_M;
    let mut cells = Vec::with_capacity(Relief::SIZE * Relief::SIZE);
    for y in 0..Relief::SIZE {
        for x in 0..Relief::SIZE {
            let origin = right * metre(x) + down * metre(y);
            let hits = ellipsoids
                .iter()
                .filter_map(|(centre, shape)| first_hit(&(origin - centre), &forward, shape));
            cells.push(hits.fold(f64::NAN, f64::min));
        }
    }
    Relief { cells }
}

/// Where a ray first meets the ellipsoid `xᵀ S x = 1`, in steps of `direction`.
fn first_hit(origin: &Vector3<f64>, direction: &Vector3<f64>, shape: &Matrix3<f64>) -> Option<f64> {
    let a = direction.dot(&(shape * direction));
    let b = origin.dot(&(shape * direction));
    let c = origin.dot(&(shape * origin)) - 1.0;
    let discriminant = b * b - a * c;
    (discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / a)
}
