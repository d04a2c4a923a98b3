//! Text forms of scenes: `plane:900`, `staircase`, `cone,texture=fractal,contrast=0.3`.

use std::fmt;
use std::str::FromStr;

use crate::scene::{Scene, Shape};
use crate::scene_error::SceneError;
use crate::texture::Texture;

const DEFAULT_STEPS: usize = 8;

impl FromStr for Scene {
    type Err = SceneError;

    /// `plane:MM`, `staircase`, `slant`, `cone` or `sphere`, then any of `,texture=sand|fractal`,
    /// `,contrast=NUMBER` and, for the staircase, `,steps=NUMBER`.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let mut parts = text.split(',');
        let name = parts.next().unwrap_or_default();
        let shape = match name.split_once(':') {
            Some(("plane", depth)) => {
                let depth_mm = number("plane", depth, "a depth in mm above 0", |depth| depth > 0.0)?;
                Shape::Plane { depth_mm }
            }
            None => match name {
                "staircase" => Shape::Staircase { steps: DEFAULT_STEPS },
                "slant" => Shape::Slant,
                "cone" => Shape::Cone,
                "sphere" => Shape::Sphere,
                _ => return Err(SceneError::Unknown(name.into())),
            },
            Some(_) => return Err(SceneError::Unknown(name.into())),
        };
        let mut scene = Self::new(shape);
        for part in parts {
            match (part.split_once('='), &mut scene.shape) {
                (Some(("texture", value)), _) => scene.texture = value.parse()?,
                (Some(("contrast", value)), _) => {
                    scene.contrast = number("contrast", value, "0 to 1", |c| (0.0..=1.0).contains(&c))?;
                }
                (Some(("steps", value)), Shape::Staircase { steps }) => {
                    let expected = "a whole number from 2 to 1000";
                    let count = number("steps", value, expected, |n| {
                        n.fract() == 0.0 && (2.0..=1000.0).contains(&n)
                    })?;
                    *steps = count as usize;
                }
                (_, shape) => {
                    let more = if matches!(shape, Shape::Staircase { .. }) { ", steps=NUMBER" } else { "" };
                    return Err(SceneError::Option { scene: name.into(), option: part.into(), more });
                }
            }
        }
        Ok(scene)
    }
}

fn number(
    name: &'static str,
    text: &str,
    expected: &'static str,
    good: impl Fn(f64) -> bool,
) -> Result<f64, SceneError> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && good(value) => Ok(value),
        _ => Err(SceneError::Value { name, value: text.into(), expected }),
    }
}

impl FromStr for Texture {
    type Err = SceneError;

    fn from_str(text: &str) -> Result<Self, SceneError> {
        match text {
            "sand" => Ok(Self::Sand),
            "fractal" => Ok(Self::Fractal),
            _ => Err(SceneError::Value { name: "texture", value: text.into(), expected: "sand or fractal" }),
        }
    }
}

impl fmt::Display for Scene {
    /// The result parses to this scene; height maps and pictures print their kind only.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.shape {
            Shape::Plane { depth_mm } => write!(f, "plane:{depth_mm}")?,
            Shape::Staircase { steps } if *steps == DEFAULT_STEPS => write!(f, "staircase")?,
            Shape::Staircase { steps } => write!(f, "staircase,steps={steps}")?,
            Shape::Slant => write!(f, "slant")?,
            Shape::Cone => write!(f, "cone")?,
            Shape::Sphere => write!(f, "sphere")?,
            Shape::HeightMap(_) => write!(f, "height map")?,
        }
        if self.texture != Texture::Sand {
            write!(f, ",texture={}", self.texture)?;
        }
        if self.contrast != 0.2 {
            write!(f, ",contrast={}", self.contrast)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn text_round_trips() {
        for text in [
            "plane:900",
            "staircase",
            "slant",
            "cone",
            "sphere,texture=fractal",
            "staircase,steps=5,contrast=0.3",
        ] {
            assert_eq!(text.parse::<Scene>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("plain:900", "unknown scene \"plain:900\""),
            ("plane", "unknown scene \"plane\", expected plane:MM"),
            ("plane:-3", "plane = -3"),
            ("plane:NaN", "plane = NaN"),
            ("cone,steps=4", "unknown option \"steps=4\""),
            ("staircase,steps=1", "steps = 1"),
            ("staircase,steps=2.5", "steps = 2.5"),
            ("slant,texture=wool", "texture = wool"),
            ("slant,contrast=7", "contrast = 7"),
        ] {
            let error = text.parse::<Scene>().unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_answered(text in "(plane:|staircase|slant|cone|sphere|\\PC*)[,=.:0-9a-zN]*") {
            if let Ok(scene) = text.parse::<Scene>() {
                prop_assert_eq!(scene.to_string().parse::<Scene>(), Ok(scene));
            }
        }
    }
}
