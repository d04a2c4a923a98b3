//! Calibrated piezo: stroke per code, hysteresis, creep. Hysteresis by Prandtl and Ishlinskii (K. Kuhnen, European J.
//! Control 9, 2003, sec. 2): play operators of equal weight, half widths evenly up to a quarter of the stroke, and a
//! linear share that closes the loop. Creep by first-order lags a decade apart. Each is an approximation with one
//! measured figure; the observer learns the rest. Cost: 12 comparisons and 6 multiplications a tick.

use farnear_protocol::Nanometres;

use super::BITS;
use crate::io::{DAC_CODE_MAX, DAC_FULL_SCALE_NM};

/// Stroke that the model's figures refer to.
const STROKE: i32 = DAC_FULL_SCALE_NM << BITS;
const PLAYS: usize = 6;
const fn half_width(i: usize) -> i32 {
    STROKE / 4 / PLAYS as i32 * (i as i32 + 1)
}
/// Sum of all half widths, in strokes times 2^16.
const HALF_WIDTHS: i64 = ((PLAYS as i64 + 1) << 16) / 8;
/// Time constants of creep, powers of two of ticks: 0.1, 0.8 and 13 s.
const LAGS: [u32; 3] = [9, 12, 16];
/// Additional fraction bits of a lag.
const LAG_BITS: u32 = 16;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct GaugeScale {
    offset: i32,
    gain: i64,
}

impl GaugeScale {
    pub(crate) const fn new(gain_ppm: u32, offset: Nanometres) -> Self {
        Self { offset: offset.0, gain: ((gain_ppm as i64) << 24) / 1_000_000 }
    }

    /// Position for a reading, in nanometres from its nominal zero.
    pub(crate) const fn position(&self, says: i32) -> Nanometres {
        let nm = (says - self.offset) as i64 * self.gain; // 18 bits times 25
        Nanometres(((nm + (1 << 23)) >> 24) as i32)
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Scale {
    /// Codes per unit of command, times 2^32.
    codes: i64,
    /// Units of command per code, times 2^16.
    units: i64,
}

impl Scale {
    pub(crate) const fn new(gain_pm_per_code: u32) -> Self {
        let gain = if gain_pm_per_code == 0 { 1 } else { gain_pm_per_code as i64 };
        let units = ((gain << (BITS + 16)) + 500) / 1_000;
        Self { codes: (1i64 << 48) / units, units }
    }

    /// Nearest code to a command, and its exact command.
    pub(crate) const fn playable(&self, command: i32) -> (u16, i32) {
        let code = (command as i64 * self.codes + (1 << 31)) >> 32;
        let code = if code < 0 {
            0
        } else if code > DAC_CODE_MAX as i64 {
            DAC_CODE_MAX
        } else {
            code as u16
        };
        (code, self.played(code))
    }

    pub(crate) const fn played(&self, code: u16) -> i32 {
        ((code as i64 * self.units + (1 << 15)) >> 16) as i32
    }
}

/// Predicted lag of the position behind the command.
#[derive(Clone, Debug)]
pub(crate) struct Lag {
    /// Weight of each play and each creep lag, times 2^24.
    play_weight: i64,
    creep_weight: i64,
    plays: [i32; PLAYS],
    /// With [`LAG_BITS`] more.
    crept: [i64; LAGS.len()],
    /// By creep, and by both.
    creep: i32,
    offset: i32,
}

impl Lag {
    /// After a descent from full drive.
    pub(crate) const fn new(hysteresis_ppm: u32, creep_ppm_per_decade: u32) -> Self {
        let mut plays = [0; PLAYS];
        let mut i = 0;
        while i < PLAYS {
            plays[i] = half_width(i);
            i += 1;
        }
        let [play_weight, creep_weight] = weights(hysteresis_ppm, creep_ppm_per_decade);
        Self { play_weight, creep_weight, plays, crept: [0; LAGS.len()], creep: 0, offset: 0 }
    }

    pub(crate) const fn with(&self, hysteresis_ppm: u32, creep_ppm_per_decade: u32) -> Self {
        let [play_weight, creep_weight] = weights(hysteresis_ppm, creep_ppm_per_decade);
        Self { play_weight, creep_weight, ..*self }
    }

    pub(crate) const fn offset(&self) -> i32 {
        self.offset
    }

    pub(crate) fn ahead(&self, command: i32) -> i32 {
        let command = command.clamp(0, STROKE); // no other can be played
        self.hysteresis(command, &self.moved(command)).saturating_add(self.creep)
    }

    pub(crate) fn push(&mut self, command: i32) {
        self.plays = self.moved(command);
        for (crept, shift) in self.crept.iter_mut().zip(LAGS) {
            *crept += ((i64::from(command) << LAG_BITS) - *crept) >> shift;
        }
        let sum: i64 = self.crept.iter().sum();
        self.creep = (((sum >> LAG_BITS) * self.creep_weight) >> 24) as i32; // a few percent of the stroke
        self.offset = self.hysteresis(command, &self.plays).saturating_add(self.creep);
    }

    fn moved(&self, command: i32) -> [i32; PLAYS] {
        core::array::from_fn(|i| {
            let half = half_width(i);
            self.plays[i].clamp(command.saturating_sub(half), command.saturating_add(half))
        })
    }

    fn hysteresis(&self, command: i32, plays: &[i32; PLAYS]) -> i32 {
        let held = plays.iter().enumerate().map(|(i, play)| i64::from(*play) - i64::from(half_width(i)));
        // Plays give stroke - 2 half widths at the top; the linear share completes it.
        let linear = (i64::from(command) * (((PLAYS as i64) << 16) - 2 * HALF_WIDTHS)) >> 16;
        (((held.sum::<i64>() - linear) * self.play_weight) >> 24) as i32 // a fraction of the stroke
    }
}

/// In mid-stroke all plays are used up, half a width below the line through the ends upwards and above it downwards:
/// the loop's width is the sum of all plays times their weight.
const fn weights(hysteresis_ppm: u32, creep_ppm_per_decade: u32) -> [i64; 2] {
    let play = ((hysteresis_ppm as i64) << 40) / 1_000_000 / (2 * HALF_WIDTHS);
    let creep = ((creep_ppm_per_decade as i64) << 24) / 1_000_000;
    [play, creep]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gauge_is_taken_as_it_was_calibrated() {
        let plain = GaugeScale::new(1_000_000, Nanometres(0));
        assert!((-10_000..252_143).all(|says| plain.position(says) == Nanometres(says)));
        // Reads 2 % too high, and 1 um at the relaxed piezo.
        let scale = GaugeScale::new(980_392, Nanometres(1_000));
        assert_eq!(scale.position(1_000), Nanometres(0));
        assert!((scale.position(205_000).0 - 200_000).abs() <= 1);
    }

    #[test]
    fn every_code_is_its_own_nearest() {
        for gain in [2_000, 3_052, 4_000] {
            let scale = Scale::new(gain);
            for code in 0..=u16::MAX {
                assert_eq!(scale.playable(scale.played(code)).0, code);
            }
            assert_eq!(scale.playable(i32::MIN).0, 0);
            assert_eq!(scale.playable(i32::MAX).0, u16::MAX);
        }
        let full = Scale::new(3_052).played(u16::MAX) >> BITS;
        assert!((full - DAC_FULL_SCALE_NM).abs() < 20, "{full}");
    }

    #[test]
    fn hysteresis_has_the_given_width_and_closes_at_both_ends() {
        let mut lag = Lag::new(120_000, 0);
        let mut go = |percent: i32| {
            lag.push(STROKE / 100 * percent);
            f64::from(lag.offset()) / f64::from(STROKE)
        };
        let up: std::vec::Vec<f64> = (0..=100).map(&mut go).collect();
        let down: std::vec::Vec<f64> = (0..=100).rev().map(&mut go).collect();
        let width = up.iter().zip(down.iter().rev()).map(|(up, down)| down - up).fold(0.0, f64::max);
        assert!((width - 0.12).abs() < 0.001, "{width}");
        assert!(up[0].abs() < 1e-4 && up[100].abs() < 1e-4 && down[100].abs() < 1e-4);
        assert!(up[50] < -0.05 && down[50] > 0.05, "below on the way up, above on the way down");
    }

    #[test]
    fn creep_grows_by_as_much_in_each_decade() {
        let mut lag = Lag::new(0, 15_000);
        let mut at = [0.0; 3];
        for tick in 0..=50_000 {
            lag.push(STROKE / 2);
            if let Some(place) = [500, 5_000, 50_000].iter().position(|moment| *moment == tick) {
                at[place] = f64::from(lag.offset()) / f64::from(STROKE / 2);
            }
        }
        for decade in [at[1] - at[0], at[2] - at[1]] {
            assert!((decade - 0.015).abs() < 0.006, "{at:?}");
        }
    }
}
