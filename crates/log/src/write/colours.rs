use tagalong_core::TrackId;

/// Colours of tracks: neighbours in number are far apart in hue. All are of medium lightness, so
/// that each stands out from white and from dark paper.
const COLOURS: [[u8; 3]; 10] = [
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

    /// Returns the relative luminance of WCAG 2.
    fn luminance(rgb: [u8; 3]) -> f64 {
        let linear = rgb.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
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

    #[test]
    fn colours_repeat_after_ten_tracks() {
        assert_eq!(track_colour(TrackId(2)), track_colour(TrackId(12)));
        assert_ne!(track_colour(TrackId(2)), track_colour(TrackId(3)));
    }
}
