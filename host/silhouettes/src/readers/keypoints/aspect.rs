//! The shape of the picture whose sides coordinates are parts of.

use std::fmt;
use std::str::FromStr;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aspect {
    width: f64,
    height: f64,
}

impl Aspect {
    /// Width over height.
    pub fn ratio(self) -> f64 {
        self.width / self.height
    }

    /// The remark about a choice that has no effect.
    pub fn ignored(self) -> String {
        format!("--aspect {self} is ignored, for coordinates are not parts of a picture")
    }
}

impl fmt::Display for Aspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.width, self.height)
    }
}

impl FromStr for Aspect {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.trim().parse().ok().filter(|side: &f64| side.is_finite() && *side > 0.0);
        text.split_once([':', 'x'])
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .filter(|aspect| (0.1..=10.0).contains(&aspect.ratio()))
            .ok_or_else(|| {
                format!(
                    "`{text}` is not the shape of a picture: expected its width and height, such as 9:16 or 1080x1920, from 1:10 to 10:1"
                )
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_of_pictures_are_read_and_others_refused() {
        for text in ["9:16", "1080x1920", " 9 : 16 "] {
            assert_eq!(text.parse::<Aspect>().map(Aspect::ratio), Ok(0.5625), "{text}");
        }
        assert_eq!("1080x1920".parse::<Aspect>().map(|aspect| aspect.to_string()), Ok("1080:1920".into()));
        for bad in ["", "9", "9:", "0:16", "9:-16", "inf:1", "9/16", "16:1", "1:1080"] {
            let error = bad.parse::<Aspect>().expect_err("no shape");
            assert!(error.contains(&format!("`{bad}`")) && error.contains("9:16"), "{error}");
        }
    }
}
