//! Depth of pair after pair of one rig.

use ndarray::Array2;

use crate::adaptive_window::Bank;
use crate::measure::{DepthMethod, MeasureError, MeasureSettings, Measurement, measure_after};
use crate::optics::Optics;
use crate::prepare::Registration;
use crate::prepare::noise::PairNoise;

/// Pairs for which noise is measured once.
const SAME_NOISE: usize = 16;

/// Measures pair after pair of one rig as [`measure_pair`](crate::measure::measure_pair) does by
/// [`DepthMethod::Whitened`], faster: filters are designed once, noise is measured in some pairs only, and a pair is
/// aligned as the one before unless its images show that this no longer holds.
#[derive(Debug, Clone)]
pub struct Stream {
    optics: Optics,
    settings: MeasureSettings,
    bank: Bank,
    registration: Option<Registration>,
    /// With the number of pairs for which it still counts.
    noise: Option<(PairNoise, usize)>,
}

impl Stream {
    /// The default method for `optics`. Returns [`MeasureError::Design`] for a PSF that allows none.
    pub fn new(optics: &Optics, settings: &MeasureSettings) -> Result<Self, MeasureError> {
        let bank = Bank::whitened(optics)?;
        Ok(Self { optics: *optics, settings: *settings, bank, registration: None, noise: None })
    }

    /// Variance of a pixel of the next pairs by lossy compression, in their units; 0 without.
    pub fn set_coding(&mut self, variance: f64) {
        self.settings.prepare.coding = variance;
    }

    /// Depth of the next pair `[far, near]`. Pairs of other sizes may follow each other; errors as
    /// [`measure_pair`](crate::measure::measure_pair), after which the stream remains usable.
    pub fn measure(&mut self, images: [Array2<f32>; 2]) -> Result<Measurement, MeasureError> {
        let Self { optics, bank, registration, .. } = self;
        let mut settings = self.settings;
        let known = self.noise.filter(|(_, pairs)| *pairs > 0);
        settings.prepare.noise = settings.prepare.noise.or(known.map(|(noise, _)| noise));
        // From within the pool: otherwise each parallel stage would wake it again.
        let measure = |_: &rayon::Scope<'_>| {
            measure_after(registration, bank, images, optics, DepthMethod::Whitened, None, &settings)
        };
        let found = rayon::scope(measure)?;
        let pairs = known.map_or(SAME_NOISE, |(_, pairs)| pairs) - 1;
        self.noise = Some((found.prepared.noise, pairs));
        Ok(found)
    }
}
