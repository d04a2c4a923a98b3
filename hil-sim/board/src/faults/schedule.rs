use super::{Happening, Moment, When};
use crate::plant::Noise;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Due {
    pub happening: Happening,
    pub reverts: bool,
}

#[derive(Debug)]
struct Entry {
    happening: Happening,
    noise: Noise,
    seen: u32,
    begins_ns: Option<u64>,
    ends_ns: Option<u64>,
}

impl Entry {
    fn draw(&mut self, now_ns: u64) {
        if let When::Chance { per_s } = self.happening.when {
            let wait_s = -libm::log(1.0 - self.noise.uniform()) / per_s;
            self.begins_ns = Some(now_ns.saturating_add((wait_s * 1e9) as u64)); // saturates
        }
    }
}

#[derive(Debug)]
pub struct Schedule {
    entries: Vec<Entry>,
}

fn nanos(ms: f64) -> u64 {
    libm::round(ms * 1e6) as u64 // saturates
}

impl Schedule {
    /// `seed` draws the random times, independently per entry.
    pub fn new(happenings: &[Happening], seed: u64) -> Self {
        let entry = |(number, happening): (usize, &Happening)| {
            let noise = Noise::new(seed, &format!("happening {number}"));
            let begins_ns = match happening.when {
                When::After { ms } => Some(nanos(ms)),
                When::On { .. } | When::Chance { .. } => None,
            };
            let mut entry = Entry { happening: *happening, noise, seen: 0, begins_ns, ends_ns: None };
            entry.draw(0);
            entry
        };
        Self { entries: happenings.iter().enumerate().map(entry).collect() }
    }

    pub fn notice(&mut self, what: Moment, now_ns: u64) {
        for entry in &mut self.entries {
            let When::On { moment, nth, delay_ms } = entry.happening.when else { continue };
            if moment == what {
                entry.seen = entry.seen.saturating_add(1);
                if entry.seen == nth {
                    entry.begins_ns = Some(now_ns.saturating_add(nanos(delay_ms)));
                }
            }
        }
    }

    pub fn next_ns(&self) -> Option<u64> {
        self.entries.iter().flat_map(|entry| [entry.begins_ns, entry.ends_ns]).flatten().min()
    }

    pub fn is_over(&self) -> bool {
        self.next_ns().is_none()
    }

    /// Due faults, ordered by time, then by their order in the file.
    pub fn take_due(&mut self, now_ns: u64) -> Vec<Due> {
        let mut due = Vec::new();
        while let Some(at_ns) = self.next_ns().filter(|at_ns| *at_ns <= now_ns) {
            for entry in &mut self.entries {
                if entry.ends_ns == Some(at_ns) {
                    entry.ends_ns = None;
                    due.push(Due { happening: entry.happening, reverts: true });
                    entry.draw(at_ns);
                }
                if entry.begins_ns == Some(at_ns) {
                    entry.begins_ns = None;
                    due.push(Due { happening: entry.happening, reverts: false });
                    match entry.happening.for_ms {
                        Some(ms) => entry.ends_ns = Some(at_ns.saturating_add(nanos(ms))),
                        None => entry.draw(at_ns.saturating_add(1)),
                    }
                }
            }
        }
        due
    }

    /// Ends the schedule; returns everything that can be reverted.
    pub fn end(&mut self) -> Vec<Due> {
        let entries = std::mem::take(&mut self.entries);
        entries.iter().map(|entry| Due { happening: entry.happening, reverts: true }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    fn schedule(text: &str) -> Schedule {
        Schedule::new(&Scenario::parse(text).expect("a good file").happens, 1)
    }

    fn reported(due: &[Due]) -> Vec<(&'static str, bool)> {
        due.iter().map(|due| (due.happening.what.name, due.reverts)).collect()
    }

    #[test]
    fn reverts_faults_after_their_duration_in_order_of_time() {
        let mut schedule = schedule(
            "[[happens]]\nafter_ms = 2.5\nwhat = \"motor-stalls\"\nfor_ms = 1\n\
             [[happens]]\nafter_ms = 1\nwhat = \"power-loss\"",
        );
        assert_eq!(schedule.next_ns(), Some(1_000_000));
        assert_eq!(reported(&schedule.take_due(999_999)), []);
        let expected = [("power-loss", false), ("motor-stalls", false), ("motor-stalls", true)];
        assert_eq!(reported(&schedule.take_due(3_500_000)), expected);
        assert!(schedule.is_over());
    }

    #[test]
    fn counts_moments_and_repeats_random_faults() {
        let mut counted = schedule(
            "[[happens]]\non = \"exposure-begins\"\nnth = 2\ndelay_ms = 1\nwhat = \"emergency-stop\"",
        );
        counted.notice(Moment::ExposureBegins, 5);
        counted.notice(Moment::Alarm, 6);
        assert!(counted.is_over());
        counted.notice(Moment::ExposureBegins, 7);
        assert_eq!(counted.next_ns(), Some(1_000_007));
        // Ten a second for a hundred seconds: within five standard deviations of 1000.
        let mut by_chance = schedule("[[happens]]\nchance_per_s = 10\nwhat = \"reset-button\"");
        let count = by_chance.take_due(100_000_000_000).len();
        assert!((842..1158).contains(&count), "{count}");
        let again = schedule("[[happens]]\nchance_per_s = 10\nwhat = \"reset-button\"").next_ns();
        assert_eq!(again, schedule("[[happens]]\nchance_per_s = 10\nwhat = \"reset-button\"").next_ns());
    }
}
