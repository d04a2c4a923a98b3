//! Settings of the background model. Grey levels from 0 to 255.

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// History T; the learning rate is 1 / T after T frames.
    pub history_frames: u32,
    /// 1 to [`Settings::MAX_COMPONENTS`].
    pub max_components: usize,
    /// Squared Mahalanobis distance of background.
    pub background_threshold: f32,
    /// Squared Mahalanobis distance of a component; beyond it a new one is created.
    pub component_threshold: f32,
    /// Share of the data explained by background components, 1 - c_f (2006, equation 9).
    pub background_share: f32,
    /// Weight removed from every component by the Dirichlet prior, c_T (2004, equation 14).
    pub complexity_prior: f32,
    /// Squared grey levels.
    pub initial_variance: f32,
    /// Squared grey levels.
    pub min_variance: f32,
    /// Squared grey levels.
    pub max_variance: f32,
    /// Shadow test; `None` labels shadow as foreground.
    pub shadow: Option<ShadowSettings>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowSettings {
    /// Darkest shadow relative to the lit background, 0 to 1.
    pub darkest: f32,
}

impl Settings {
    pub const MAX_COMPONENTS: usize = 8;

    pub fn check(&self) -> Result<(), SettingsError> {
        let require = |holds: bool, name: &'static str, value: f32, must: &'static str| {
            if holds { Ok(()) } else { Err(SettingsError { name, value, must }) }
        };
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let share = |value: f32| value > 0.0 && value < 1.0;
        require(self.history_frames >= 1, "history_frames", self.history_frames as f32, "at least 1")?;
        require(
            (1..=Self::MAX_COMPONENTS).contains(&self.max_components),
            "max_components",
            self.max_components as f32,
            "1 to 8",
        )?;
        for (name, value) in [
            ("background_threshold", self.background_threshold),
            ("component_threshold", self.component_threshold),
            ("min_variance", self.min_variance),
        ] {
            require(positive(value), name, value, "finite and above 0")?;
        }
        require(share(self.background_share), "background_share", self.background_share, "between 0 and 1")?;
        require(
            (0.0..1.0).contains(&self.complexity_prior),
            "complexity_prior",
            self.complexity_prior,
            "at least 0 and below 1",
        )?;
        let max_holds = self.max_variance.is_finite() && self.max_variance >= self.min_variance;
        require(max_holds, "max_variance", self.max_variance, "finite and at least min_variance")?;
        require(
            (self.min_variance..=self.max_variance).contains(&self.initial_variance),
            "initial_variance",
            self.initial_variance,
            "between min_variance and max_variance",
        )?;
        if let Some(shadow) = self.shadow {
            require(share(shadow.darkest), "shadow.darkest", shadow.darkest, "between 0 and 1")?;
        }
        Ok(())
    }
}

impl Default for Settings {
    /// The papers' values (c_T 0.05, c_f 0.1, three and four standard deviations) and common variances.
    fn default() -> Self {
        Self {
            history_frames: 500,
            max_components: 5,
            background_threshold: 16.0,
            component_threshold: 9.0,
            background_share: 0.9,
            complexity_prior: 0.05,
            initial_variance: 15.0,
            min_variance: 4.0,
            max_variance: 75.0,
            shadow: Some(ShadowSettings { darkest: 0.5 }),
        }
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("background model: {name} is {value}, but must be {must}")]
pub struct SettingsError {
    pub name: &'static str,
    pub value: f32,
    pub must: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_hold() {
        assert_eq!(Settings::default().check(), Ok(()));
    }

    #[test]
    fn a_bad_setting_is_named_with_its_value() {
        let nought = Settings { history_frames: 0, ..Settings::default() };
        assert_eq!(nought.check().unwrap_err().name, "history_frames");
        let swapped = Settings { min_variance: 80.0, ..Settings::default() };
        assert_eq!(swapped.check().unwrap_err().name, "max_variance");
        let nan = Settings { background_threshold: f32::NAN, ..Settings::default() };
        assert_eq!(nan.check().unwrap_err().name, "background_threshold");
        let dark = Settings { shadow: Some(ShadowSettings { darkest: 1.5 }), ..Settings::default() };
        assert!(dark.check().unwrap_err().to_string().contains("1.5"));
    }
}
