//! How well a continuous capture kept its pace.

use farnear_capture::continuous::{Frame, Loss, Outcome};
use farnear_protocol::{
    Micros,
    message::{DropReason, Shot},
};
use serde::Serialize;

use crate::figures::rounded;

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ContinuousFigures {
    /// Exposures with an image.
    pub exposures: usize,
    pub cycles: usize,
    pub board_s: f64,
    /// Exposures per second of board time.
    pub rate_hz: f64,
    /// Frames without an exposure because the position had not settled.
    pub dropped_not_settled: usize,
    /// Frames without an exposure because the camera was not ready.
    pub dropped_camera_busy: usize,
    /// Frames without an exposure because the camera did not respond to its trigger.
    pub dropped_no_strobe: usize,
    pub lost_events: usize,
    pub lost_images: usize,
    /// Exposures during which the measured position left the settle window.
    pub exposures_outside_window: usize,
    /// Largest error of a trigger time. Without a pace: largest difference of an interval from the mean.
    pub jitter_us: f64,
    /// Longest time from the start of a move until it settled.
    pub longest_settle_ms: f64,
    /// Largest difference between measured and commanded position during an exposure.
    pub largest_deviation_um: f64,
}

pub struct Tally {
    period: Micros,
    windows_nm: Vec<i32>,
    counted: ContinuousFigures,
    first: Option<(u32, u64)>,
    last: Option<(u32, u64)>,
    intervals_us: (u64, u64),
}

impl Tally {
    pub fn new(period: Micros, shots: &[Shot]) -> Self {
        let counted = ContinuousFigures {
            exposures: 0,
            cycles: 0,
            board_s: 0.0,
            rate_hz: 0.0,
            dropped_not_settled: 0,
            dropped_camera_busy: 0,
            dropped_no_strobe: 0,
            lost_events: 0,
            lost_images: 0,
            exposures_outside_window: 0,
            jitter_us: 0.0,
            longest_settle_ms: 0.0,
            largest_deviation_um: 0.0,
        };
        let windows_nm = shots.iter().map(|shot| shot.settle_window.0).collect();
        Self { period, windows_nm, counted, first: None, last: None, intervals_us: (u64::MAX, 0) }
    }

    pub fn exposures(&self) -> usize {
        self.counted.exposures
    }

    /// Board time since the first exposure.
    pub fn seconds_at(&self, frame: &Frame) -> f64 {
        let begin = self.first.map_or(frame.record.trigger.0, |(_, begin)| begin);
        frame.record.trigger.0.saturating_sub(begin) as f64 / 1e6
    }

    pub fn completed(&mut self) {
        self.counted.cycles += 1;
    }

    pub fn count(&mut self, outcome: &Outcome) {
        let counted = &mut self.counted;
        let frame = match outcome {
            Outcome::Taken(frame) => frame,
            Outcome::Dropped { loss, .. } => {
                match loss {
                    Loss::Board(DropReason::NotSettled { .. }) => counted.dropped_not_settled += 1,
                    Loss::Board(DropReason::CameraBusy) => counted.dropped_camera_busy += 1,
                    Loss::Board(DropReason::NoStrobe) => counted.dropped_no_strobe += 1,
                    Loss::EventLost => counted.lost_events += 1,
                    Loss::Image { .. } => counted.lost_images += 1,
                }
                return;
            }
        };
        counted.exposures += 1;
        let window_nm = self.windows_nm.get(usize::from(frame.record.index)).copied().unwrap_or(i32::MAX);
        counted.exposures_outside_window += usize::from(frame.deviation.0 > window_nm);
        counted.longest_settle_ms = counted.longest_settle_ms.max(f64::from(frame.record.settle.0) / 1e3);
        counted.largest_deviation_um = counted.largest_deviation_um.max(f64::from(frame.deviation.0) / 1e3);
        let (number, trigger) = (frame.number, frame.record.trigger.0);
        let (first, begin) = *self.first.get_or_insert((number, trigger));
        if self.period.0 > 0 {
            let due = begin + u64::from(number.wrapping_sub(first)) * u64::from(self.period.0);
            counted.jitter_us = counted.jitter_us.max(trigger.abs_diff(due) as f64);
        } else if let Some((_, at)) = self.last.filter(|(before, _)| before.wrapping_add(1) == number) {
            let interval = trigger.saturating_sub(at);
            let (shortest, longest) = self.intervals_us;
            self.intervals_us = (shortest.min(interval), longest.max(interval));
        }
        self.last = Some((number, trigger));
    }

    pub fn figures(self) -> ContinuousFigures {
        let mut figures = self.counted;
        if let (Some((_, first)), Some((_, last))) = (self.first, self.last) {
            let seconds = last.saturating_sub(first) as f64 / 1e6;
            figures.board_s = rounded(seconds, 6);
            if figures.exposures > 1 && seconds > 0.0 {
                let intervals = (figures.exposures - 1) as f64;
                figures.rate_hz = rounded(intervals / seconds, 3);
                let (shortest, longest) = self.intervals_us;
                if self.period.0 == 0 && longest > 0 {
                    let mean = seconds * 1e6 / intervals;
                    let spread = (longest as f64 - mean).max(mean - shortest as f64);
                    figures.jitter_us = rounded(spread.max(0.0), 1);
                }
            }
        }
        figures
    }
}
