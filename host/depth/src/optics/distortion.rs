//! Lens distortion by OpenCV's model: from pinhole to sensor positions. With `x = (u - cx) / fx`, `y = (v - cy) / fy`
//! and `r^2 = x^2 + y^2` of the pinhole's pixel (u, v), the lens shows it at `x' = x g + 2 p1 x y + p2 (r^2 + 2 x^2)`,
//! `y' = y g + p1 (r^2 + 2 y^2) + 2 p2 x y`, `g = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)`
//! (Brown 1966; OpenCV, calib3d). Coefficients are in the order of `cv2.calibrateCamera`: k1, k2, p1, p2, k3, k4, k5,
//! k6. Pixel centres are integers.

use serde::{Deserialize, Serialize};

use super::{OpticsError, binned_place};

/// OpenCV's supported coefficient counts; its models of 12 and 14 (thin prism, tilted sensor) are not.
const COUNTS: [usize; 3] = [4, 5, 8];

/// `[distortion]` of an optics file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistortionSection {
    /// `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, px.
    pub camera_matrix: [[f64; 3]; 3],
    /// k1, k2, p1, p2, k3, k4, k5, k6, or the first four or five of them.
    pub coefficients: Vec<f64>,
}

/// A checked distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distortion {
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    coefficients: [f64; 8],
    count: usize,
}

impl DistortionSection {
    /// Checks the values; see the distortion variants of [`OpticsError`].
    pub fn check(&self) -> Result<Distortion, OpticsError> {
        let [[fx, skew, cx], [zero, fy, cy], last] = self.camera_matrix;
        let usable = [fx, fy].iter().all(|f| f.is_finite() && *f > 0.0) && cx.is_finite() && cy.is_finite();
        if !usable || skew != 0.0 || zero != 0.0 || last != [0.0, 0.0, 1.0] {
            return Err(OpticsError::CameraMatrix { rows: self.camera_matrix });
        }
        let count = self.coefficients.len();
        if !COUNTS.contains(&count) {
            return Err(OpticsError::DistortionCount { count });
        }
        if let Some((index, value)) = self.coefficients.iter().enumerate().find(|(_, c)| !c.is_finite()) {
            return Err(OpticsError::DistortionCoefficient { index, value: *value });
        }
        let mut coefficients = [0.0; 8];
        coefficients[..count].copy_from_slice(&self.coefficients);
        Ok(Distortion { focal_px: [fx, fy], centre_px: [cx, cy], coefficients, count })
    }
}

impl Distortion {
    /// The same lens for images with `bin` x `bin` pixels averaged into one.
    pub(super) fn binned(self, bin: f64) -> Self {
        let focal_px = self.focal_px.map(|focal| focal / bin);
        let centre_px = self.centre_px.map(|centre| binned_place(centre, bin));
        Self { focal_px, centre_px, ..self }
    }

    /// Position `[cx, cy]` of the optical axis, px.
    pub fn centre_px(&self) -> [f64; 2] {
        self.centre_px
    }

    /// Sensor position of the pinhole's pixel `[u, v]`.
    pub fn distorted(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [[fx, fy], [cx, cy]] = [self.focal_px, self.centre_px];
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.coefficients;
        let [x, y] = [(u - cx) / fx, (v - cy) / fy];
        let [xx, yy, xy] = [x * x, y * y, x * y];
        let r2 = xx + yy;
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let across = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx);
        let down = y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy;
        [fx * across + cx, fy * down + cy]
    }
}

impl From<Distortion> for DistortionSection {
    fn from(distortion: Distortion) -> Self {
        let Distortion { focal_px: [fx, fy], centre_px: [cx, cy], coefficients, count } = distortion;
        Self {
            camera_matrix: [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            coefficients: coefficients[..count].to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section(coefficients: &[f64]) -> DistortionSection {
        DistortionSection {
            camera_matrix: [[1210.5, 0.0, 318.25], [0.0, 1208.75, 243.5], [0.0, 0.0, 1.0]],
            coefficients: coefficients.to_vec(),
        }
    }

    /// Output of `cv2.projectPoints` (OpenCV 5.0.0) for the corners' rays.
    #[test]
    fn points_lie_where_opencv_projects_them() {
        const FROM: [[f64; 2]; 5] =
            [[0.0, 0.0], [318.25, 243.5], [639.0, 479.0], [100.5, 400.25], [600.0, 20.0]];
        let cases: [(&[f64], [[f64; 2]; 5]); 3] = [
            (
                &[-0.31, 0.12, 0.0011, -0.0007],
                [
                    [10.294254451637642, 8.093342787314043],
                    [318.25, 243.5],
                    [628.6216541834995, 471.5911661967473],
                    [103.59762759633816, 398.05552376859947],
                    [592.2648003228031, 26.194092348450653],
                ],
            ),
            (
                &[-0.31, 0.12, 0.0011, -0.0007, 0.05],
                [
                    [10.273246715141795, 8.077269311000634],
                    [318.25, 243.5],
                    [628.6419519463915, 471.60606915282233],
                    [103.59633290955296, 398.0564557647124],
                    [592.2745200440103, 26.18638211707605],
                ],
            ),
            (
                &[0.4, -0.2, 0.0011, -0.0007, 0.02, 0.3, -0.1, 0.01],
                [
                    [-3.085820913043733, -2.1440440195985104],
                    [318.25, 243.5],
                    [641.9311159713218, 481.3631950386247],
                    [99.3375469548426, 401.1221949077702],
                    [601.9333043460895, 18.52448933441525],
                ],
            ),
        ];
        for (coefficients, expected) in cases {
            let distortion = section(coefficients).check().unwrap();
            for (from, to) in FROM.into_iter().zip(expected) {
                let [x, y] = distortion.distorted(from);
                assert!((x - to[0]).abs() < 1e-9 && (y - to[1]).abs() < 1e-9, "{from:?}: ({x}, {y}) {to:?}");
            }
            assert_eq!(DistortionSection::from(distortion), section(coefficients));
        }
    }

    #[test]
    fn invalid_opencv_models_are_rejected() {
        let message = |section: DistortionSection| section.check().unwrap_err().to_string();
        assert!(message(section(&[0.1; 12])).contains("12 coefficients"));
        assert!(message(section(&[0.1, f64::NAN, 0.0, 0.0])).contains("k2 = NaN"));
        let mut skewed = section(&[0.1; 4]);
        skewed.camera_matrix[0][1] = 0.5;
        assert!(message(skewed).contains("0.5"));
        let mut flat = section(&[0.1; 4]);
        flat.camera_matrix[1][1] = 0.0;
        assert!(message(flat).contains("[0.0, 0.0, 243.5]"));
    }
}
