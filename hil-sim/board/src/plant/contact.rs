//! The contact of an end switch as its wire has it: it bounces when it changes, and the motor's chopper is coupled into it.

use std::collections::VecDeque;

use super::Noise;
use crate::parts::SwitchParts;

/// See the module. High, `true`, is open, which is actuated.
#[derive(Debug)]
pub struct Contact {
    parts: SwitchParts,
    noise: Noise,
    /// Whether the switch is actuated, and what its contact says.
    actuated: bool,
    level: bool,
    /// When the contact changes while it bounces.
    changes: VecDeque<u64>,
    /// When the next false opening begins and ends.
    glitch_ns: (u64, u64),
}

impl Contact {
    /// A contact at rest.
    pub fn new(parts: SwitchParts, noise: Noise, actuated: bool) -> Self {
        let mut contact =
            Self { parts, noise, actuated, level: actuated, changes: VecDeque::new(), glitch_ns: (0, 0) };
        contact.plan_glitch();
        contact
    }

    /// Nanoseconds until something happens that happens so often a second.
    fn wait_ns(&mut self, per_s: f64) -> u64 {
        // 1 - u is never 0; without any it never comes.
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
        // It ends where it belongs.
        if self.changes.len() % 2 == 1 {
            self.changes.pop_back();
        }
    }

    /// So many false openings a second from now on.
    pub fn set_glitches_per_s(&mut self, now_ns: u64, per_s: f64) {
        self.parts.glitches_per_s = per_s;
        self.glitch_ns = (now_ns, now_ns);
        self.plan_glitch();
    }

    /// When the wire may change by itself next.
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
    fn it_bounces_for_a_while_and_ends_where_it_belongs() {
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
        // Eight changes on average in 0.8 ms, of which a last odd one does not count; and the change itself.
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
