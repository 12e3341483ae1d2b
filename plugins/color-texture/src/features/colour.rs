use super::spread;
use super::window::{Grid, HEAD, Surface, TORSO};

/// Bins of a histogram of hues.
const HUES: usize = 6;
/// Numbers of one zone.
const OF_ZONE: usize = HUES + 9;

/// Numbers of the colours.
pub const COUNT: usize = 2 * OF_ZONE + 3;

/// Shares of red and green in skin, whatever its tone: a box in chromaticity.
/// It is a number among others, no gate; lamps are coloured, and people turn
/// their backs.
const SKIN: [[f32; 2]; 2] = [[0.36, 0.56], [0.27, 0.36]];

/// Darker than this is hair, or black.
const DARK: f32 = 50.0;

/// Colours of head and torso, where they lie on the candidate in depth.
pub fn push(colour: &Grid<[f32; 3]>, surface: Option<&Surface>, out: &mut Vec<f32>) {
    let [head, torso] = [HEAD, TORSO].map(|zone| {
        let cells: Vec<[f32; 3]> = zone
            .cells()
            .filter(|cell| surface.is_none_or(|surface| surface.is_on(*cell)))
            .map(|cell| colour[cell])
            .collect();
        zone_numbers(&cells)
    });
    out.extend(head);
    out.extend(torso);
    let hues = head[..HUES].iter().zip(&torso[..HUES]);
    // People often wear other colours than they have on the head; pillars do not.
    out.push(hues.map(|(a, b)| (a - b).abs()).sum());
    out.push((head[HUES] - torso[HUES]).hypot(head[HUES + 2] - torso[HUES + 2]));
    out.push(head[OF_ZONE - 2] - torso[OF_ZONE - 2]);
}

/// Hues; mean and spread of the shares of red and green, of saturation;
/// spread of the intensity; shares of skin and of dark.
fn zone_numbers(cells: &[[f32; 3]]) -> [f32; OF_ZONE] {
    let chroma: Vec<[f32; 2]> = cells.iter().map(|c| chromaticity(*c)).collect();
    let mut numbers = [0.0; OF_ZONE];
    numbers[..HUES].copy_from_slice(&hues(cells));
    let [red, green] = [0, 1].map(|k| spread(chroma.iter().map(|c| c[k])));
    let saturations = spread(cells.iter().map(|c| saturation(*c)));
    let [_, contrast] = spread(cells.iter().map(|c| intensity(*c)));
    let rest = [red, green, saturations].concat();
    numbers[HUES..HUES + 6].copy_from_slice(&rest);
    numbers[HUES + 6] = contrast / 64.0;
    let skin = chroma.iter().filter(|c| is_skin(**c)).count();
    let dark = cells.iter().filter(|c| intensity(**c) < DARK).count();
    numbers[HUES + 7] = skin as f32 / cells.len() as f32;
    numbers[HUES + 8] = dark as f32 / cells.len() as f32;
    numbers
}

fn intensity(colour: [f32; 3]) -> f32 {
    colour.iter().sum::<f32>() / 3.0
}

/// Shares of red and green.
fn chromaticity(colour: [f32; 3]) -> [f32; 2] {
    // The constant keeps the chromaticity of black pixels at grey.
    let sum = colour.iter().sum::<f32>() + 3.0;
    [(colour[0] + 1.0) / sum, (colour[1] + 1.0) / sum]
}

fn is_skin(chroma: [f32; 2]) -> bool {
    SKIN.iter().zip(chroma).all(|([least, most], v)| (*least..*most).contains(&v))
}

fn saturation(colour: [f32; 3]) -> f32 {
    let (least, most) = ends(colour);
    (most - least) / (most + 1.0)
}

fn ends(colour: [f32; 3]) -> (f32, f32) {
    (colour.into_iter().fold(f32::MAX, f32::min), colour.into_iter().fold(0.0, f32::max))
}

/// Mean saturation by hue: 0 everywhere for greys.
fn hues(cells: &[[f32; 3]]) -> [f32; HUES] {
    let mut histogram = [0.0; HUES];
    for colour in cells {
        // Grey pixels have no hue, so the saturation is the weight.
        histogram[hue(*colour)] += saturation(*colour) / cells.len() as f32;
    }
    if cells.is_empty() { [f32::NAN; HUES] } else { histogram }
}

/// The sixth of the circle of hues, from red on.
fn hue([r, g, b]: [f32; 3]) -> usize {
    let (least, most) = ends([r, g, b]);
    let span = most - least;
    if span <= 0.0 {
        return 0;
    }
    let turn = if most == r {
        ((g - b) / span).rem_euclid(6.0)
    } else if most == g {
        (b - r) / span + 2.0
    } else {
        (r - g) / span + 4.0
    };
    (turn as usize).min(HUES - 1)
}

#[cfg(test)]
mod tests {
    use super::super::window::SIDE;
    use super::*;

    #[test]
    fn hues_go_round_the_circle() {
        let colours = [[9., 1., 0.], [9., 9., 0.], [0., 9., 1.], [0., 8., 9.], [1., 0., 9.]];
        assert_eq!(colours.map(hue), [0, 1, 2, 3, 4]);
        assert_eq!(hue([9.0, 0.0, 1.0]), 5);
        assert_eq!(hue([7.0, 7.0, 7.0]), 0);
    }

    #[test]
    fn faces_of_any_tone_are_skin_and_grey_is_not() {
        for face in [[224.0, 172.0, 140.0], [141.0, 85.0, 55.0], [70.0, 44.0, 32.0]] {
            assert!(is_skin(chromaticity(face)), "{:?}", chromaticity(face));
        }
        assert!(!is_skin(chromaticity([120.0, 120.0, 120.0])));
        assert!(!is_skin(chromaticity([40.0, 90.0, 160.0])));
    }

    #[test]
    fn every_colour_has_its_numbers() {
        let mut out = Vec::new();
        push(&[[200.0, 20.0, 20.0]; SIDE * SIDE], None, &mut out);
        assert_eq!(out.len(), COUNT);
        assert!(out.iter().all(|v| v.is_finite()));
        assert!(out[0] > 0.8 && out[1] == 0.0, "red: {:?}", &out[..HUES]);
        assert!(out[2 * OF_ZONE].abs() < 1e-4, "head and torso have the same hues");
    }

    /// A red cell and a nearly black one.
    #[test]
    fn the_numbers_of_a_zone_are_those_of_their_definitions() {
        let numbers = zone_numbers(&[[200.0, 50.0, 50.0], [10.0, 10.0, 10.0]]);
        let red = [201.0 / 303.0, 11.0 / 33.0];
        let green = [51.0 / 303.0, 11.0 / 33.0];
        let expected = [
            0.5 * (red[0] + red[1]),
            0.5 * (red[0] - red[1]),
            0.5 * (green[0] + green[1]),
            0.5 * (green[1] - green[0]),
            // Saturations of 150 / 201 and 0.
            75.0 / 201.0,
            75.0 / 201.0,
            // Intensities of 100 and 10.
            45.0 / 64.0,
            0.0,
            0.5,
        ];
        for (found, expected) in numbers[HUES..].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-4, "{numbers:?}");
        }
        assert!((numbers[0] - 75.0 / 201.0).abs() < 1e-4 && numbers[1..HUES] == [0.0; 5]);
        assert_eq!(saturation([0.0; 3]), 0.0);
        assert_eq!(chromaticity([0.0; 3]), [1.0 / 3.0; 2], "black is grey");
    }
}
