//! Colours of tracks in pictures and in `tracks.mcap`. Pages have the same ones as `--t0` to `--t19`
//! in `crates/report/src/page/base.css`.

use tagalong_core::TrackId;

/// Colours of tracks: consecutive IDs are far apart in hue. All are of medium lightness, so that
/// each stands out from white and from dark backgrounds.
const COLOURS: [[u8; 3]; 20] = [
    [61, 139, 253],
    [232, 113, 10],
    [26, 161, 121],
    [179, 106, 226],
    [239, 75, 115],
    [140, 148, 20],
    [11, 157, 181],
    [176, 125, 66],
    [90, 160, 40],
    [214, 69, 46],
    [15, 120, 120],
    [165, 135, 165],
    [120, 105, 45],
    [195, 0, 255],
    [0, 105, 195],
    [255, 0, 255],
    [120, 90, 135],
    [195, 0, 150],
    [120, 45, 255],
    [0, 120, 0],
];

/// Number of colours before they repeat.
pub const TRACK_COLOURS: u32 = COLOURS.len() as u32;

/// Returns the colour of a track as red, green and blue: the same in pictures, on pages and in
/// `tracks.mcap`.
pub fn track_colour(id: TrackId) -> [u8; 3] {
    COLOURS[id.0 as usize % COLOURS.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(v: u8) -> f64 {
        let v = f64::from(v) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    }

    /// Returns the relative luminance of WCAG 2.
    fn luminance(rgb: [u8; 3]) -> f64 {
        let [r, g, b] = rgb.map(linear);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn each_colour_stands_out_from_white_and_from_dark_paper() {
        let dark = luminance([18, 23, 28]) + 0.05;
        for id in 0..TRACK_COLOURS {
            let own = luminance(track_colour(TrackId(id))) + 0.05;
            assert!(1.05 / own >= 3.0, "{id} on white: {:.2}", 1.05 / own);
            assert!(own / dark >= 3.0, "{id} on dark: {:.2}", own / dark);
        }
    }

    /// Returns lightness and two axes of hue (Oklab), in which equal distances look alike.
    fn oklab(rgb: [u8; 3]) -> [f64; 3] {
        let [r, g, b] = rgb.map(linear);
        let l = (0.412_221 * r + 0.536_333 * g + 0.051_446 * b).cbrt();
        let m = (0.211_903 * r + 0.680_700 * g + 0.107_397 * b).cbrt();
        let s = (0.088_302 * r + 0.281_719 * g + 0.629_979 * b).cbrt();
        [
            0.210_454 * l + 0.793_618 * m - 0.004_072 * s,
            1.977_998 * l - 2.428_592 * m + 0.450_594 * s,
            0.025_904 * l + 0.782_772 * m - 0.808_676 * s,
        ]
    }

    #[test]
    fn twenty_tracks_have_colours_that_differ() {
        assert_eq!(TRACK_COLOURS, 20);
        assert_eq!(track_colour(TrackId(2)), track_colour(TrackId(22)));
        for a in 0..TRACK_COLOURS {
            for b in 0..a {
                let [x, y] = [a, b].map(|id| oklab(track_colour(TrackId(id))));
                let square: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
                assert!(square.sqrt() > 0.05, "{a} and {b}: {:.3}", square.sqrt());
            }
        }
    }
}
