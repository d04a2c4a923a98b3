//! Errors of a set of optics.

use crate::psf::PsfError;

const DISTORTION_NAMES: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// An error of a set of optics.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum OpticsError {
    #[error("[stage]: {0}; calibrate the stack again")]
    Stage(&'static str),
    #[error("[{section}] {name} = {value}: must be a positive, finite number{unit}")]
    NotPositive {
        section: &'static str,
        name: &'static str,
        value: f64,
        /// Its unit as the message ends, such as ` of mm`.
        unit: &'static str,
    },
    #[error("[lens] needs aperture_mm or f_number")]
    NoAperture,
    #[error(
        "[lens] aperture_mm = {aperture_mm} and f_number = {f_number} disagree: with focal_length_mm = \
         {focal_length_mm} that aperture is f_number = {would_be:.5}; give one of them"
    )]
    ApertureDisagrees { focal_length_mm: f64, aperture_mm: f64, f_number: f64, would_be: f64 },
    #[error("[focus] needs max_blur_px or near_mm")]
    NoRange,
    #[error(
        "[focus] near_mm = {near_mm} is not nearer than far_mm = {far_mm}: the near focus must be the smaller distance"
    )]
    NearBeyondFar { far_mm: f64, near_mm: f64 },
    #[error(
        "[focus] {name} = {value_mm} is not beyond the focal length of {focal_length_mm} mm: no real image forms"
    )]
    InsideFocalLength { name: &'static str, value_mm: f64, focal_length_mm: f64 },
    #[error(
        "[focus] max_blur_px = {max_blur_px} and near_mm = {near_mm} disagree by {percent:.1} % (2 % allowed): \
         near_mm = {near_would_be_mm:.2} would agree with that blur, max_blur_px = {blur_would_be_px:.4} with that distance"
    )]
    RangeDisagrees {
        max_blur_px: f64,
        near_mm: f64,
        near_would_be_mm: f64,
        blur_would_be_px: f64,
        percent: f64,
    },
    #[error(
        "[distortion] camera_matrix = {rows:?}: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, as cv2.calibrateCamera \
         returns it"
    )]
    CameraMatrix { rows: [[f64; 3]; 3] },
    #[error(
        "[distortion] leaves no pixel of the images of {width}x{height} px: camera_matrix has its centre at cx = {cx}, cy = {cy}; give \
         matrix and coefficients for images of this size"
    )]
    NothingStraight { cx: f64, cy: f64, width: usize, height: usize },
    #[error(
        "[distortion] has {count} coefficients: expected 4, 5 or 8, in OpenCV's order k1, k2, p1, p2, k3, k4, k5, k6"
    )]
    DistortionCount { count: usize },
    #[error("[distortion] {} = {value}: must be a finite number", DISTORTION_NAMES.get(*index).unwrap_or(&"?"))]
    DistortionCoefficient {
        /// Its place in OpenCV's order.
        index: usize,
        value: f64,
    },
    #[error("[psf] {0}")]
    Psf(#[from] PsfError),
}
