//! Conversion of `sensor_msgs/CameraInfo` to the lens of a camera.

use tagalong_geometry::{ConicalMirror, Distortion, Panorama, Pinhole};

use crate::msgs::{CameraInfo, Header};

/// Lens and the size of its image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Intrinsics {
    /// Lens, in pixels of the image as delivered.
    pub lens: Pinhole,
    /// Columns of the image as delivered; 0 if the message does not give them.
    pub width: usize,
    /// Rows of the image as delivered; 0 if the message does not give them.
    pub height: usize,
    /// Baseline: distance to the left camera of a stereo pair, m, from `P[3]`; `None` if 0.
    pub baseline_m: Option<f64>,
    /// Mirror in front of the lens, if there is one.
    pub mirror: Option<Mirrored>,
}

impl Intrinsics {
    /// Returns the lens for images that are smaller or larger by an integer factor in both
    /// directions; `None` for other sizes, including equal ones.
    pub fn scaled_to(&self, width: usize, height: usize) -> Option<Self> {
        let is_known = self.width > 0 && self.height > 0 && width > 0 && height > 0;
        if !is_known || self.mirror.is_some() || (width, height) == (self.width, self.height) {
            return None;
        }
        let ours = (self.width, self.height);
        let theirs = (width, height);
        if !is_multiple(ours, theirs) && !is_multiple(theirs, ours) {
            return None;
        }
        let scale = width as f64 / self.width as f64;
        let Pinhole { fx, fy, cx, cy, distortion } = self.lens;
        // Pixel centres have integer coordinates, hence the half pixels.
        let [cx, cy] = [cx, cy].map(|c| (c + 0.5) * scale - 0.5);
        let lens = Pinhole { fx: fx * scale, fy: fy * scale, cx, cy, distortion };
        Some(Self { lens, width, height, ..*self })
    }
}

/// Image of a camera with a conical mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Mirrored {
    /// Circular image: `distortion_model` is [`CONICAL_MIRROR`].
    Raw(ConicalMirror),
    /// Unwrapped image: `distortion_model` is [`UNWRAPPED`], and D is that of the mirror, with both
    /// radii divided by the focal length.
    Unwrapped(Panorama),
}

/// `distortion_model` of a circular image of a conical mirror. K holds the focal length and the
/// centre, D the [`mirror_coefficients`].
pub const CONICAL_MIRROR: &str = "conical_mirror";

/// Returns D of a mirror's calibration: half angle (rad), height of the apex (m), inner and outer
/// radius (pixels).
pub fn mirror_coefficients(mirror: &ConicalMirror) -> [f64; 4] {
    [mirror.half_angle_rad, mirror.apex_m, mirror.inner_px, mirror.outer_px]
}

/// `distortion_model` of an image of a conical mirror that was unwrapped before it was recorded,
/// with a column per bearing and a row per elevation as in [`Panorama`]. D holds half angle (rad),
/// height of the apex (m) and the tangents of the smallest and the largest angle from the axis; K
/// is that of any image with evenly spaced angles, and follows from D.
pub const UNWRAPPED: &str = "conical_mirror_unwrapped";

impl CameraInfo {
    /// Returns the calibration of a camera without mirror as its driver would publish it;
    /// [`intrinsics`] reads it back. `size` is the number of columns and rows of the image, and
    /// `aside_m` the distance to the right of the left camera of a stereo pair, m.
    pub fn of_lens(header: &Header, lens: &Pinhole, size: (usize, usize), aside_m: f64) -> Self {
        let Pinhole { fx, fy, cx, cy, distortion } = *lens;
        let (model, d) = match distortion {
            Distortion::None => ("plumb_bob", vec![0.0; 5]),
            Distortion::PlumbBob(d) => ("plumb_bob", d.to_vec()),
            // Drivers write only 8 coefficients if the others are zero.
            Distortion::Rational(d) if d[8..] == [0.0; 6] => {
                ("rational_polynomial", d[..8].to_vec())
            }
            Distortion::Rational(d) => ("rational_polynomial", d.to_vec()),
            Distortion::Equidistant(d) => ("equidistant", d.to_vec()),
        };
        Self {
            header: header.clone(),
            width: size.0 as u32,
            height: size.1 as u32,
            distortion_model: model.into(),
            d,
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, -fx * aside_m, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..Self::default()
        }
    }
}

/// Reason why a calibration cannot be used, with the name of the field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// K has no focal lengths, which by REP 104 means uncalibrated.
    #[error(
        "K[0] and K[4] are 0: the camera is uncalibrated; calibrate it or publish its camera_info"
    )]
    Uncalibrated,
    /// A number is outside of its range.
    #[error("{field} = {value}: {why}")]
    Field {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// Condition on the value.
        why: &'static str,
    },
    /// The distortion model is unknown or has the wrong number of coefficients.
    #[error(
        "distortion model `{model}` with {count} coefficients; \
         known: plumb_bob (4 or 5), rational_polynomial (8, 12 or 14), equidistant or \
         fisheye (4), none (0), \
         conical_mirror and conical_mirror_unwrapped (4, see `ConicalMirror`)"
    )]
    Distortion {
        /// Name of the model.
        model: String,
        /// Number of coefficients given.
        count: usize,
    },
    /// The size of the image is not that of the calibration.
    #[error(
        "calibrated for {calibrated_width}x{calibrated_height}, \
         but the images are {width}x{height}"
    )]
    Size {
        /// Columns in the calibration.
        calibrated_width: usize,
        /// Rows in the calibration.
        calibrated_height: usize,
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
    },
}

/// Reads a calibration. If `rectified`, the image was rectified before it was recorded: then P
/// applies, and there is no distortion.
///
/// ROI and binning: K and P are given in pixels of the full image. A pixel of the delivered image
/// covers `binning` of them, and pixel coordinates refer to pixel centres, hence
/// `c' = (c - offset + 0.5) / binning - 0.5`.
///
/// # Errors
/// [`CalibrationError`]; every number is checked before it is used.
pub fn intrinsics(info: &CameraInfo, rectified: bool) -> Result<Intrinsics, CalibrationError> {
    check_finite(info)?;
    check_rotation(&info.r)?;
    let k = &info.k;
    let p = &info.p;
    // P is for rectified images, but if K is missing, or only has ones on its diagonal, P is all
    // there is.
    let has_no_k = k[0] == 0.0 && k[4] == 0.0;
    let rectified = rectified || has_no_k && p[0] != 0.0;
    let use_p = rectified && p[0] != 0.0;
    if !use_p && has_no_k {
        return Err(CalibrationError::Uncalibrated);
    }
    let full = if use_p {
        check_lens(info, ["P[0]", "P[5]", "P[2]", "P[6]"], [p[0], p[5], p[2], p[6]])?
    } else {
        check_lens(info, ["K[0]", "K[4]", "K[2]", "K[5]"], [k[0], k[4], k[2], k[5]])?
    };
    if [CONICAL_MIRROR, UNWRAPPED].contains(&info.distortion_model.as_str()) {
        let seen = delivered(info, full, Distortion::None);
        let mirror = Some(mirrored(info, &seen)?);
        return Ok(Intrinsics { mirror, ..seen });
    }
    let distortion = if rectified { Distortion::None } else { distortion(info)? };
    Ok(Intrinsics { baseline_m: baseline(p), ..delivered(info, full, distortion) })
}

/// Returns the mirror of a calibration; binning makes its circles smaller.
fn mirrored(info: &CameraInfo, seen: &Intrinsics) -> Result<Mirrored, CalibrationError> {
    let unusable = CalibrationError::Distortion {
        model: info.distortion_model.clone(),
        count: info.d[..].len(),
    };
    let &[half_angle, apex_m, inner, outer] = &info.d[..] else { return Err(unusable) };
    let raw = info.distortion_model == CONICAL_MIRROR;
    // K may be all zero here, because P is used for a rectified image.
    let scale = if raw { seen.lens.fx / info.k[0].max(f64::MIN_POSITIVE) } else { 1.0 };
    let d = [half_angle, apex_m, scale * inner, scale * outer];
    let (focal, centre) =
        if raw { (seen.lens.fx, [seen.lens.cx, seen.lens.cy]) } else { (1.0, [0.0; 2]) };
    let mirror = ConicalMirror::new(focal, centre, d).ok_or(unusable)?;
    Ok(if raw {
        Mirrored::Raw(mirror)
    } else {
        Mirrored::Unwrapped(Panorama { mirror, columns: seen.width, rows: seen.height })
    })
}

/// Checks that the calibration belongs to images of this size.
///
/// # Errors
/// [`CalibrationError::Size`].
pub fn check_size(
    calibrated: &Intrinsics,
    width: usize,
    height: usize,
) -> Result<(), CalibrationError> {
    let unknown = calibrated.width == 0 || calibrated.height == 0;
    if unknown || (calibrated.width, calibrated.height) == (width, height) {
        return Ok(());
    }
    Err(CalibrationError::Size {
        calibrated_width: calibrated.width,
        calibrated_height: calibrated.height,
        width,
        height,
    })
}

/// Returns true for a calibration without focal lengths in K and P, which by REP 104 means that the
/// camera is uncalibrated. Drivers may fill other elements, such as ones on the diagonal.
pub(crate) fn is_blank(info: &CameraInfo) -> bool {
    let has_k = info.k[0] != 0.0 && info.k[4] != 0.0;
    let has_p = info.p[0] != 0.0 && info.p[5] != 0.0;
    !has_k && !has_p
}

fn check_finite(info: &CameraInfo) -> Result<(), CalibrationError> {
    let fields = [("K", &info.k[..]), ("D", &info.d), ("R", &info.r), ("P", &info.p)];
    for (field, values) in fields {
        if let Some(value) = values.iter().find(|v| !v.is_finite()) {
            return Err(CalibrationError::Field { field, value: *value, why: "must be finite" });
        }
    }
    Ok(())
}

/// Checks that R is a rotation, or all zero if the driver leaves it out.
fn check_rotation(r: &[f64; 9]) -> Result<(), CalibrationError> {
    if r.iter().all(|v| *v == 0.0) {
        return Ok(());
    }
    let r = nalgebra::Matrix3::from_row_slice(r);
    let off = (r * r.transpose() - nalgebra::Matrix3::identity()).norm();
    if off > 1e-3 || r.determinant() < 0.0 {
        let why = "R must be a rotation (this is how far R times its transpose is from identity)";
        return Err(CalibrationError::Field { field: "R", value: off, why });
    }
    Ok(())
}

/// Maximum focal length, as a multiple of the image side.
const LONGEST_FOCAL: f64 = 1e3;

fn check_lens(
    info: &CameraInfo,
    names: [&'static str; 4],
    [fx, fy, cx, cy]: [f64; 4],
) -> Result<[f64; 4], CalibrationError> {
    for (field, value) in [(names[0], fx), (names[1], fy)] {
        if value <= 0.0 {
            return Err(CalibrationError::Field { field, value, why: "must be positive" });
        }
    }
    // That of a telescope with a view of a twentieth of a degree; a larger value must be in another
    // unit.
    let longest = LONGEST_FOCAL * f64::from(info.width.max(info.height));
    for (field, value) in [(names[0], fx), (names[1], fy)] {
        if longest > 0.0 && value > longest {
            let why = "must be at most a thousand image sides";
            return Err(CalibrationError::Field { field, value, why });
        }
    }
    // The outer edges of the pixels are half a pixel beyond the first and the last centre.
    for (field, value, size) in [(names[2], cx, info.width), (names[3], cy, info.height)] {
        if size > 0 && !(-0.5..=f64::from(size) - 0.5).contains(&value) {
            return Err(CalibrationError::Field { field, value, why: "must lie in the image" });
        }
    }
    Ok([fx, fy, cx, cy])
}

fn distortion(info: &CameraInfo) -> Result<Distortion, CalibrationError> {
    let d = &info.d;
    // All-zero coefficients mean no distortion in any model, even an unknown one.
    if d.iter().all(|v| *v == 0.0) {
        return Ok(Distortion::None);
    }
    match (info.distortion_model.as_str(), d[..].len()) {
        ("plumb_bob", 4) => Ok(Distortion::PlumbBob([d[0], d[1], d[2], d[3], 0.0])),
        ("plumb_bob", 5) => Ok(Distortion::PlumbBob([d[0], d[1], d[2], d[3], d[4]])),
        ("rational_polynomial", count @ (8 | 12 | 14)) => {
            let mut all = [0.0; 14];
            all[..count].copy_from_slice(d);
            Ok(Distortion::Rational(all))
        }
        // The names in ROS and in OpenCV.
        ("equidistant" | "fisheye", 4) => Ok(Distortion::Equidistant([d[0], d[1], d[2], d[3]])),
        (model, count) => Err(CalibrationError::Distortion { model: model.to_owned(), count }),
    }
}

/// Returns the baseline: `P[3] = -fx * baseline` for the right camera of a pair, 0 for any other.
fn baseline(p: &[f64; 12]) -> Option<f64> {
    (p[0] > 0.0 && p[3] != 0.0).then(|| -p[3] / p[0])
}

/// Returns true if a size is an integer multiple of another, and larger, in both directions.
fn is_multiple(large: (usize, usize), small: (usize, usize)) -> bool {
    let times = large.0 / small.0;
    times > 1 && (times * small.0, times * small.1) == large
}

fn delivered(info: &CameraInfo, full: [f64; 4], distortion: Distortion) -> Intrinsics {
    let [fx, fy, cx, cy] = full;
    let bx = info.binning_x.max(1);
    let by = info.binning_y.max(1);
    let roi = &info.roi;
    // An empty region stands for the full image.
    let whole = roi.width == 0 || roi.height == 0;
    let (width, height) = if whole { (info.width, info.height) } else { (roi.width, roi.height) };
    let (x0, y0) = if whole { (0, 0) } else { (roi.x_offset, roi.y_offset) };
    let [cx, cy] = [(cx, x0, bx), (cy, y0, by)].map(|(centre, offset, binning)| {
        (centre - f64::from(offset) + 0.5) / f64::from(binning) - 0.5
    });
    let lens = Pinhole { fx: fx / f64::from(bx), fy: fy / f64::from(by), cx, cy, distortion };
    Intrinsics {
        lens,
        width: (width / bx) as usize,
        height: (height / by) as usize,
        baseline_m: None,
        mirror: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msgs::RegionOfInterest;

    fn info() -> CameraInfo {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: "plumb_bob".into(),
            d: vec![0.1, -0.2, 0.001, 0.002, 0.05],
            k: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [480.0, 0.0, 321.0, -48.0, 0.0, 480.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        }
    }

    #[test]
    fn what_a_lens_publishes_is_read_back() {
        use Distortion::{Equidistant, None, PlumbBob, Rational};
        let bent = PlumbBob([0.1, -0.2, 0.001, 0.002, 0.05]);
        let wide = rational(&[0.1, -0.2, 0.001, 0.002, 0.05, 0.3, 0.2, 0.1]);
        let tilted = Rational(std::array::from_fn(|at| 0.01 * at as f64));
        for distortion in [None, bent, wide, tilted, Equidistant([0.1, 0.02, -0.01, 0.001])] {
            let lens = Pinhole { fx: 500.0, fy: 510.0, cx: 320.0, cy: 240.0, distortion };
            let info = CameraInfo::of_lens(&Header::default(), &lens, (640, 480), 0.12);
            let read = intrinsics(&info, false).unwrap();
            let size = (read.width, read.height);
            let baseline_m = read.baseline_m.unwrap();
            assert_eq!((read.lens, size, read.mirror), (lens, (640, 480), Option::None));
            assert!((baseline_m - 0.12).abs() < 1e-12, "{baseline_m}");
        }
    }

    fn broken(change: impl FnOnce(&mut CameraInfo)) -> String {
        let mut info = info();
        change(&mut info);
        intrinsics(&info, false).unwrap_err().to_string()
    }

    #[test]
    fn raw_images_have_k_and_d_and_rectified_ones_p() {
        let raw = intrinsics(&info(), false).unwrap();
        assert_eq!(
            (raw.lens.fx, raw.lens.fy, raw.lens.cx, raw.lens.cy),
            (500.0, 510.0, 320.0, 240.0)
        );
        assert_eq!(raw.lens.distortion, Distortion::PlumbBob([0.1, -0.2, 0.001, 0.002, 0.05]));
        let rectified = intrinsics(&info(), true).unwrap();
        assert_eq!((rectified.lens.fx, rectified.lens.cx), (480.0, 321.0));
        assert_eq!(rectified.lens.distortion, Distortion::None);
        assert_eq!(rectified.baseline_m, Some(0.1));
    }

    #[test]
    fn a_region_and_binning_move_the_principal_point() {
        let roi = RegionOfInterest {
            x_offset: 100,
            y_offset: 40,
            width: 400,
            height: 200,
            do_rectify: false,
        };
        let cut = CameraInfo { roi, binning_x: 2, binning_y: 4, ..info() };
        let seen = intrinsics(&cut, false).unwrap();
        assert_eq!((seen.width, seen.height), (200, 50));
        // The centre of the first delivered pixel is the middle of the two full pixels 100 and 101,
        // that is 100.5.
        for (full, column) in [(100.5, 0.0), (498.5, 199.0)] {
            let found = (full - 320.0) / 500.0 * seen.lens.fx + seen.lens.cx;
            assert!((found - column).abs() < 1e-12);
        }
        assert_eq!(seen.lens.fy, 127.5);
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let blank = broken(|i| {
            i.k = [0.0; 9];
            i.p = [0.0; 12];
        });
        assert!(blank.contains("uncalibrated"));
        assert!(broken(|i| i.k[0] = f64::NAN).starts_with("K = NaN"));
        assert!(broken(|i| i.k[4] = -1.0).starts_with("K[4] = -1"));
        assert!(broken(|i| i.k[2] = 900.0).starts_with("K[2] = 900"));
        assert!(broken(|i| i.r[0] = 2.0).starts_with("R ="));
        assert!(broken(|i| i.d.truncate(3)).contains("`plumb_bob` with 3"));
        assert!(
            broken(|i| i.distortion_model = "equidistant".into()).contains("`equidistant` with 5")
        );
        assert!(broken(|i| i.distortion_model = "of my own".into()).contains("`of my own`"));
        assert!(broken(|i| i.p[3] = f64::INFINITY).starts_with("P ="));
        assert!(broken(|i| i.k[0] = 1e30).contains("at most a thousand image sides"));
    }

    #[test]
    fn models_are_read_with_all_their_numbers_of_coefficients() {
        fn lens(model: &str, count: u32) -> Distortion {
            let d = (1..=count).map(f64::from).collect();
            let info = CameraInfo { d, distortion_model: model.into(), ..info() };
            intrinsics(&info, false).unwrap().lens.distortion
        }

        assert_eq!(lens("plumb_bob", 4), Distortion::PlumbBob([1.0, 2.0, 3.0, 4.0, 0.0]));
        for count in [8, 12, 14] {
            let expected: Vec<f64> = (1..=count).map(f64::from).collect();
            assert_eq!(lens("rational_polynomial", count), rational(&expected));
        }
        for model in ["equidistant", "fisheye"] {
            assert_eq!(lens(model, 4), Distortion::Equidistant([1.0, 2.0, 3.0, 4.0]));
        }
    }

    fn rational(first: &[f64]) -> Distortion {
        let mut all = [0.0; 14];
        all[..first.len()].copy_from_slice(first);
        Distortion::Rational(all)
    }

    #[test]
    fn p_stands_in_for_a_k_that_is_left_out() {
        for corner in [0.0, 1.0] {
            let mut k = [0.0; 9];
            k[8] = corner;
            let seen = intrinsics(&CameraInfo { k, ..info() }, false).unwrap();
            assert_eq!((seen.lens.fx, seen.lens.cx), (480.0, 321.0));
            assert_eq!(seen.lens.distortion, Distortion::None);
        }
    }

    #[test]
    fn a_whole_number_of_sizes_scales_the_lens_and_no_other_does() {
        let calibrated = intrinsics(&info(), false).unwrap();
        let half = calibrated.scaled_to(320, 240).unwrap();
        assert_eq!((half.lens.fx, half.lens.cx, half.width), (250.0, 159.75, 320));
        let double = half.scaled_to(640, 480).unwrap();
        assert!((double.lens.cx - calibrated.lens.cx).abs() < 1e-9);
        for (width, height) in [(640, 480), (640, 360), (960, 720), (320, 480), (0, 0)] {
            assert_eq!(calibrated.scaled_to(width, height), None, "{width}x{height}");
        }
    }

    #[test]
    fn another_size_is_named() {
        let calibrated = intrinsics(&info(), false).unwrap();
        assert!(check_size(&calibrated, 640, 480).is_ok());
        let error = check_size(&calibrated, 320, 240).unwrap_err();
        assert_eq!(error.to_string(), "calibrated for 640x480, but the images are 320x240");
    }
}
