//! Variants of an example: mirrored, and shifted a little.

use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

/// Mirrors the picture horizontally.
pub fn mirrored(grey: &GreyImage) -> GreyImage {
    let width = grey.width();
    GreyImage::from_fn(width, grey.height(), |x, y| grey.row(y)[width - 1 - x])
}

/// Shifts a square right and down by fractions of its width, and scales it by `growth` about its
/// new centre.
pub fn shifted(square: &Rect, (right, down, growth): (f64, f64, f64)) -> Rect {
    let x = square.x + right * square.width;
    let y = square.y + down * square.width;
    Rect { x, y, ..*square }.inflated(growth - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_exchanges_columns_and_twice_is_never() {
        let image = GreyImage::from_fn(3, 2, |x, y| (10 * y + x) as u8);
        assert_eq!(mirrored(&image).pixels(), [2, 1, 0, 12, 11, 10]);
        assert_eq!(mirrored(&mirrored(&image)), image);
    }

    #[test]
    fn a_square_moves_and_grows_about_its_centre() {
        let square = Rect::new(10.0, 20.0, 40.0, 40.0);
        let moved = shifted(&square, (0.25, -0.5, 1.5));
        assert_eq!(moved, Rect::new(10.0, -10.0, 60.0, 60.0));
        assert_eq!(shifted(&square, (0.0, 0.0, 1.0)), square);
    }
}
