//! Contact of an end switch: bounces on changes and picks up chopper noise.

use std::collections::VecDeque;

use super::Noise;
use crate::parts::SwitchParts;

/// High (`true`) is open, which means actuated.
#[derive(Debug)]
pub struct Contact {
    parts: SwitchParts,
    noise: Noise,
    /// Actuated, and contact level.
    actuated: bool,
    level: bool,
    /// Times of changes while it bounces.
    changes: VecDeque<u64>,
    /// Begin and end of the next false opening.
    glitch_ns: (u64, u64),
}

impl Contact {
    pub fn new(parts: SwitchParts, noise: Noise, actuated: bool) -> Self {
        let mut contact =
            Self { parts, noise, actuated, level: actuated, changes: VecDeque::new(), glitch_ns: (0, 0) };
        contact.plan_glitch();
        contact
    }

    fn wait_ns(&mut self, per_s: f64) -> u64 {
        // 1 - u is never 0. At rate 0 the event never occurs.
        let wait_s = -libm::log(1.0 - self.noise.between(0.0, 1.0)) / per_s;
        (wait_s * 1e9) as u64 // saturates
    }

    fn plan_glitch(&mut self) {
        let begin_ns = self.glitch_ns.1.saturating_add(self.wait_ns(self.parts.glitches_per_s));
        self.glitch_ns = (begin_ns, begin_ns.saturating_add(self.parts.glitch_us * 1000));
    }

    /// Level of the wire; `driven`: the motor's driver is on.
    pub fn level(&mut self, now_ns: u64, actuated: bool, driven: bool) -> bool {
        if actuated != self.actuated {
            self.actuated = actuated;
            self.bounce(now_ns);
        }
        while self.changes.pop_front_if(|at| *at <= now_ns).is_some() {
            self.level = !self.level;
        }
        while self.glitch_ns.1 <= now_ns {
            self.plan_glitch();
        }
        self.level || (driven && self.glitch_ns.0 <= now_ns)
    }

    fn bounce(&mut self, now_ns: u64) {
        self.changes.clear();
        self.level = self.actuated;
        let end_ns = now_ns + self.parts.bounce_us * 1000;
        let mut at_ns = now_ns;
        loop {
            at_ns = at_ns.saturating_add(self.wait_ns(self.parts.bounces_per_ms * 1e3).max(1));
            if at_ns >= end_ns {
                break;
            }
            self.changes.push_back(at_ns);
        }
        // The last level must be the final one.
        if self.changes.len() % 2 == 1 {
            self.changes.pop_back();
        }
    }

    pub fn set_glitches_per_s(&mut self, now_ns: u64, per_s: f64) {
        self.parts.glitches_per_s = per_s;
        self.glitch_ns = (now_ns, now_ns);
        self.plan_glitch();
    }

    /// Next time at which the wire may change without a cause.
    pub fn next_ns(&self, now_ns: u64, driven: bool) -> u64 {
        let (begin_ns, end_ns) = self.glitch_ns;
        let glitch_ns = match (driven, begin_ns > now_ns) {
            (false, _) => u64::MAX,
            (true, true) => begin_ns,
            (true, false) => end_ns,
        };
        self.changes.front().map_or(glitch_ns, |at| glitch_ns.min(*at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARTS: SwitchParts =
        SwitchParts { bounce_us: 800, bounces_per_ms: 10.0, glitch_us: 30, glitches_per_s: 2.0 };

    #[test]
    fn a_contact_bounces_and_settles_at_its_final_level() {
        let mut bounces = 0;
        for seed in 0..50 {
            let parts = SwitchParts { glitches_per_s: 0.0, ..PARTS };
            let mut contact = Contact::new(parts, Noise::new(seed, "contact"), false);
            let mut before = false;
            for us in 0..2_000 {
                let level = contact.level(us * 1000, us >= 100, true);
                bounces += u32::from(level != before);
                assert!(us < 900 || level, "it has ended after 0.8 ms");
                assert!(us >= 100 || !level);
                before = level;
            }
        }
        // Eight changes on average in 0.8 ms, a last odd one dropped, and the change itself.
        assert!((300..500).contains(&bounces), "{bounces}");
    }

    #[test]
    fn false_openings_are_short_rare_and_only_while_the_driver_is_on() {
        let mut contact = Contact::new(PARTS, Noise::new(1, "contact"), false);
        let open = |contact: &mut Contact, driven: bool| {
            (0..50_000_000u64).step_by(10).filter(|us| contact.level(us * 1000, false, driven)).count()
        };
        let seen = open(&mut contact, true) * 10;
        assert!((2_000..4_000).contains(&seen), "100 of 30 us in 50 s, not {seen} us");
        let mut contact = Contact::new(PARTS, Noise::new(1, "contact"), false);
        assert_eq!(open(&mut contact, false), 0);
    }
}
