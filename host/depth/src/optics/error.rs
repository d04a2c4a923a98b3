//! Errors of a set of optics.

use crate::psf::PsfError;

const DISTORTION_NAMES: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// An error of a set of optics.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OpticsError {
    /// The section that a z-stack taught.
    #[error("[stage]: {0}; calibrate the stack again")]
    Stage(&'static str),
    /// A number that must be positive and finite is not.
    #[error("[{section}] {name} = {value}: must be a positive, finite number{unit}")]
    NotPositive {
        /// Section of the file.
        section: &'static str,
        /// Name of the value.
        name: &'static str,
        /// The value that was given.
        value: f64,
        /// Its unit as the message ends, such as ` of mm`.
        unit: &'static str,
    },
    /// Neither `aperture_mm` nor `f_number` was given.
    #[error("[lens] needs aperture_mm or f_number")]
    NoAperture,
    /// `aperture_mm` and `f_number` are both given and contradict each other.
    #[error(
        "[lens] aperture_mm = {aperture_mm} and f_number = {f_number} disagree: with focal_length_mm = \
         {focal_length_mm} that aperture is f_number = {would_be:.5}; give one of them"
    )]
    ApertureDisagrees {
        /// Given focal length.
        focal_length_mm: f64,
        /// Given aperture diameter.
        aperture_mm: f64,
        /// Given f-number.
        f_number: f64,
        /// The f-number that the aperture leads to.
        would_be: f64,
    },
    /// Neither `max_blur_px` nor `near_mm` was given.
    #[error("[focus] needs max_blur_px or near_mm")]
    NoRange,
    /// `near_mm` is not nearer than `far_mm`.
    #[error(
        "[focus] near_mm = {near_mm} is not nearer than far_mm = {far_mm}: the near focus must be the smaller distance"
    )]
    NearBeyondFar {
        /// Given far focus.
        far_mm: f64,
        /// Given near focus.
        near_mm: f64,
    },
    /// A focus distance at which a thin lens forms no real image.
    #[error(
        "[focus] {name} = {value_mm} is not beyond the focal length of {focal_length_mm} mm: no real image forms"
    )]
    InsideFocalLength {
        /// Name of the distance.
        name: &'static str,
        /// Its value.
        value_mm: f64,
        /// The focal length.
        focal_length_mm: f64,
    },
    /// `max_blur_px` and `near_mm` contradict each other.
    #[error(
        "[focus] max_blur_px = {max_blur_px} and near_mm = {near_mm} disagree by {percent:.1} % (2 % allowed): \
         near_mm = {near_would_be_mm:.2} would agree with that blur, max_blur_px = {blur_would_be_px:.4} with that distance"
    )]
    RangeDisagrees {
        /// Given blur radius.
        max_blur_px: f64,
        /// Given near focus.
        near_mm: f64,
        /// Near focus that the blur leads to.
        near_would_be_mm: f64,
        /// Blur that the near focus leads to.
        blur_would_be_px: f64,
        /// Relative difference of the blur radii in percent.
        percent: f64,
    },
    /// A camera matrix that is not one of OpenCV's.
    #[error(
        "[distortion] camera_matrix = {rows:?}: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, as cv2.calibrateCamera \
         returns it"
    )]
    CameraMatrix {
        /// Row by row.
        rows: [[f64; 3]; 3],
    },
    /// A model of distortion that is not known.
    #[error(
        "[distortion] has {count} coefficients: expected 4, 5 or 8, in OpenCV's order k1, k2, p1, p2, k3, k4, k5, k6"
    )]
    DistortionCount {
        /// How many were given.
        count: usize,
    },
    /// A coefficient that is not a number.
    #[error("[distortion] {} = {value}: must be a finite number", DISTORTION_NAMES.get(*index).unwrap_or(&"?"))]
    DistortionCoefficient {
        /// Its place in OpenCV's order.
        index: usize,
        /// The value that was given.
        value: f64,
    },
    /// The point-spread function's parameters are unusable.
    #[error("[psf] {0}")]
    Psf(#[from] PsfError),
}
