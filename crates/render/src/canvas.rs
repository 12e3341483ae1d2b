//! Canvas with lines, boxes and text.

use nalgebra::Point2;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tagalong_core::RgbImage;
use tagalong_geometry::Rect;

/// Colour with opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// Opacity, 0 to 1.
    pub opacity: f32,
}

impl Ink {
    /// Returns an opaque colour.
    pub const fn solid(rgb: [u8; 3]) -> Self {
        Self { rgb, opacity: 1.0 }
    }

    /// Returns the same colour with less opacity.
    pub const fn faint(self, opacity: f32) -> Self {
        Self { rgb: self.rgb, opacity }
    }
}

/// Space around a text on its bar, pixels.
const BAR_PX: f64 = 1.0;

/// Height of a line of [`Lettering::Small`] text, pixels.
pub const LINE_PX: f64 = 16.0 + 2.0 * BAR_PX;

/// Length of a dash and the gap after it, pixels.
const DASH_PX: i64 = 8;

/// Size and weight of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lettering {
    /// 16 pixels, for notes.
    #[default]
    Small,
    /// 16 pixels, bold, for names in images of up to 1000 columns.
    Bold,
    /// 20 pixels, bold, for names in larger images.
    Large,
}

impl Lettering {
    /// Returns the lettering of names in an image.
    pub const fn of_width(columns: usize) -> Self {
        if columns > 1000 { Self::Large } else { Self::Bold }
    }

    /// Returns the width and the height of a line of text with its bar, pixels.
    pub fn size_px(self, text: &str) -> [f64; 2] {
        let (weight, height) = self.raster();
        let columns = get_raster_width(weight, height) * text.chars().count();
        [columns as f64 + 2.0 * BAR_PX, height.val() as f64 + 2.0 * BAR_PX]
    }

    const fn raster(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Small => (FontWeight::Regular, RasterHeight::Size16),
            Self::Bold => (FontWeight::Bold, RasterHeight::Size16),
            Self::Large => (FontWeight::Bold, RasterHeight::Size20),
        }
    }
}

/// Picture to paint on. Everything outside of it is clipped.
pub struct Canvas {
    image: RgbImage,
}

impl Canvas {
    /// Returns a canvas of one colour.
    pub fn new(width: usize, height: usize, rgb: [u8; 3]) -> Self {
        Self { image: RgbImage::filled(width, height, rgb) }
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.image.width()
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.image.height()
    }

    /// Returns the picture.
    pub fn into_image(self) -> RgbImage {
        self.image
    }

    /// Copies `source` with its upper left corner at column `left` and row `top`.
    pub fn paste(&mut self, source: &RgbImage, left: usize, top: usize) {
        let width = self.image.width();
        let columns = source.width().min(width.saturating_sub(left));
        for y in 0..source.height().min(self.image.height().saturating_sub(top)) {
            let start = (y + top) * width + left;
            self.image.pixels_mut()[start..start + columns]
                .copy_from_slice(&source.row(y)[..columns]);
        }
    }

    /// Paints one pixel.
    pub fn dot(&mut self, x: i64, y: i64, ink: Ink) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        let width = self.image.width();
        if x >= width || y >= self.image.height() {
            return;
        }
        let pixel = &mut self.image.pixels_mut()[y * width + x];
        for (old, new) in pixel.iter_mut().zip(ink.rgb) {
            let mixed = f32::from(*old) + (f32::from(new) - f32::from(*old)) * ink.opacity;
            *old = mixed.round() as u8;
        }
    }

    /// Paints a line of one pixel's width.
    pub fn line(&mut self, from: Point2<f64>, to: Point2<f64>, ink: Ink) {
        // Clipped first: a far point would otherwise cost millions of steps outside the canvas.
        let whole = Rect::new(
            -1.0,
            -1.0,
            self.image.width() as f64 + 2.0,
            self.image.height() as f64 + 2.0,
        );
        let Some((from, to)) = clip(from, to, &whole) else { return };
        let steps = (to - from).amax().ceil().max(1.0);
        for step in 0..=steps as u32 {
            let at = from + (to - from) * (f64::from(step) / steps);
            self.dot(at.x.floor() as i64, at.y.floor() as i64, ink);
        }
    }

    /// Paints lines through all points.
    pub fn path(&mut self, points: &[Point2<f64>], ink: Ink) {
        for pair in points.windows(2) {
            self.line(pair[0], pair[1], ink);
        }
    }

    /// Paints lines through all points, two pixels thick.
    pub fn thick_path(&mut self, points: &[Point2<f64>], ink: Ink) {
        self.path(points, ink);
        let below: Vec<_> = points.iter().map(|p| Point2::new(p.x, p.y + 1.0)).collect();
        self.path(&below, ink);
    }

    /// Paints the outline of a rectangle, `thick` pixels wide, growing inwards.
    pub fn outline(&mut self, rect: &Rect, thick: u32, ink: Ink) {
        for inset in 0..thick {
            let by = 2.0 * f64::from(inset);
            let x = rect.x + 0.5 * by;
            let y = rect.y + 0.5 * by;
            let right = x + rect.width - by - 1.0;
            let bottom = y + rect.height - by - 1.0;
            let corners = [(x, y), (right, y), (right, bottom), (x, bottom), (x, y)];
            self.path(&corners.map(|(x, y)| Point2::new(x, y)), ink);
        }
    }

    /// Paints the dashed outline of a rectangle, one pixel wide.
    pub fn dashed(&mut self, rect: &Rect, ink: Ink) {
        let left = rect.x.floor() as i64;
        let top = rect.y.floor() as i64;
        let right = (rect.right() - 1.0).floor() as i64;
        let bottom = (rect.bottom() - 1.0).floor() as i64;
        let width = self.image.width() as i64;
        let height = self.image.height() as i64;
        // Only columns and rows of the canvas, however far the rectangle reaches.
        for x in left.max(0)..=right.min(width - 1) {
            for y in [top, bottom] {
                self.dash(x, y, x - left, ink);
            }
        }
        for y in top.max(0)..=bottom.min(height - 1) {
            for x in [left, right] {
                self.dash(x, y, y - top, ink);
            }
        }
    }

    fn dash(&mut self, x: i64, y: i64, along: i64, ink: Ink) {
        if along % DASH_PX < DASH_PX / 2 {
            self.dot(x, y, ink);
        }
    }

    /// Paints a filled rectangle.
    pub fn fill(&mut self, rect: &Rect, ink: Ink) {
        let inside = rect.clipped(self.image.width(), self.image.height());
        for y in inside.y as i64..inside.bottom() as i64 {
            for x in inside.x as i64..inside.right() as i64 {
                self.dot(x, y, ink);
            }
        }
    }

    /// Paints a filled disc.
    pub fn disc(&mut self, centre: Point2<f64>, radius: f64, ink: Ink) {
        let reach = radius.ceil() as i64;
        let cx = centre.x.round() as i64;
        let cy = centre.y.round() as i64;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if (dx * dx + dy * dy) as f64 <= radius * radius {
                    self.dot(cx + dx, cy + dy, ink);
                }
            }
        }
    }

    /// Paints a line of small text on a dark bar; `at` is its upper left corner. Text that would
    /// leave the canvas is moved inside.
    pub fn text(&mut self, at: Point2<f64>, text: &str, ink: Ink) {
        self.write(at, text, Lettering::Small, ink);
    }

    /// Paints a line of text on a dark bar; `at` is the upper left corner of the bar. Text that
    /// would leave the canvas is moved inside.
    pub fn write(&mut self, at: Point2<f64>, text: &str, lettering: Lettering, ink: Ink) {
        let [width, height] = lettering.size_px(text);
        let room = (self.image.width() as f64 - width, self.image.height() as f64 - height);
        let x = at.x.min(room.0).max(0.0).floor();
        let y = at.y.min(room.1).max(0.0).floor();
        let bar = Rect::new(x, y, width, height);
        self.fill(&bar, Ink::solid([0, 0, 0]).faint(0.7 * ink.opacity));
        let (weight, raster) = lettering.raster();
        let advance = get_raster_width(weight, raster) as i64;
        let mut x = (x + BAR_PX) as i64;
        let y = (y + BAR_PX) as i64;
        for letter in text.chars() {
            self.letter(x, y, letter, lettering, ink);
            x += advance;
        }
    }

    fn letter(&mut self, x: i64, y: i64, letter: char, lettering: Lettering, ink: Ink) {
        let (weight, height) = lettering.raster();
        // The font is built with ASCII only.
        let glyph = get_raster(letter, weight, height).or_else(|| get_raster('?', weight, height));
        let Some(glyph) = glyph else { return };
        for (dy, row) in (0..).zip(glyph.rows()) {
            for (dx, cover) in (0..).zip(row).filter(|(_, cover)| **cover > 0) {
                self.dot(x + dx, y + dy, ink.faint(ink.opacity * f32::from(*cover) / 255.0));
            }
        }
    }
}

/// Returns the part of a line inside `bounds` (Liang and Barsky), if there is one.
fn clip(from: Point2<f64>, to: Point2<f64>, bounds: &Rect) -> Option<(Point2<f64>, Point2<f64>)> {
    let along = to - from;
    let mut enter = 0.0f64;
    let mut leave = 1.0f64;
    for (step, room) in [
        (-along.x, from.x - bounds.x),
        (along.x, bounds.right() - from.x),
        (-along.y, from.y - bounds.y),
        (along.y, bounds.bottom() - from.y),
    ] {
        if step < 0.0 {
            enter = enter.max(room / step);
        } else if step > 0.0 {
            leave = leave.min(room / step);
        } else if room < 0.0 {
            return None;
        }
    }
    (enter <= leave).then(|| (from + along * enter, from + along * leave))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WHITE: Ink = Ink::solid([255; 3]);

    fn lit(canvas: &Canvas) -> Vec<(usize, usize)> {
        let width = canvas.image.width();
        let pixels = canvas.image.pixels().iter().enumerate();
        pixels.filter(|(_, p)| **p != [0; 3]).map(|(i, _)| (i % width, i / width)).collect()
    }

    #[test]
    fn a_rectangle_covers_its_border_pixels() {
        let mut canvas = Canvas::new(8, 8, [0; 3]);
        canvas.outline(&Rect::new(1.0, 2.0, 4.0, 3.0), 1, WHITE);
        let corners = [(1, 2), (4, 2), (1, 4), (4, 4)];
        assert!(corners.iter().all(|c| lit(&canvas).contains(c)));
        assert_eq!(lit(&canvas).len(), 2 * 4 + 2 * 3 - 4);
    }

    #[test]
    fn letters_read_left_to_right() {
        let mut canvas = Canvas::new(20, 20, [0; 3]);
        canvas.text(Point2::new(1.0, 1.0), "L", WHITE);
        let middle = 1 + Lettering::Small.size_px("L")[0] as usize / 2;
        let left = lit(&canvas).iter().filter(|(x, _)| *x < middle).count();
        let right = lit(&canvas).iter().filter(|(x, _)| *x >= middle).count();
        assert!(left > right, "the stem of an L is on its left: {left} {right}");
    }

    #[test]
    fn faint_ink_mixes() {
        let mut canvas = Canvas::new(1, 1, [100; 3]);
        canvas.dot(0, 0, WHITE.faint(0.5));
        assert_eq!(canvas.image.pixels()[0], [178; 3]);
    }

    proptest! {
        #[test]
        fn a_clipped_line_lights_what_a_long_walk_lights(
            ax in -30.0..40.0f64, ay in -30.0..40.0f64, bx in -30.0..40.0f64, by in -30.0..40.0f64,
        ) {
            let mut canvas = Canvas::new(10, 10, [0; 3]);
            let a = Point2::new(ax, ay);
            let b = Point2::new(bx, by);
            canvas.line(a, b, WHITE);
            for (x, y) in lit(&canvas) {
                let centre = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
                let near = (0..=4000)
                    .map(|i| a + (b - a) * (f64::from(i) / 4000.0))
                    .any(|p| (p - centre).amax() <= 1.0);
                prop_assert!(near, "pixel {x} {y} is not on the line");
            }
        }

        #[test]
        fn drawing_anywhere_is_safe(x in -1e9..1e9f64, y in -1e9..1e9f64, r in 0.0..30.0f64) {
            let mut canvas = Canvas::new(7, 5, [0; 3]);
            canvas.disc(Point2::new(x, y), r, WHITE);
            canvas.text(Point2::new(x, y), "far away", WHITE);
            canvas.outline(&Rect::new(x, y, r, r), 2, WHITE);
            canvas.dashed(&Rect::new(x, y, 1e9 * r, r), WHITE);
            canvas.line(Point2::new(x, y), Point2::new(y, x), WHITE);
            canvas.fill(&Rect::new(x, y, 1e9, 1e9), WHITE);
        }
    }
}
