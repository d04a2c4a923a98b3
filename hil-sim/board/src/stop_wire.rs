//! A contact of the emergency stop at a break input: it bounces, and a capacitor delays the rise.

use crate::{
    parts::{SwitchParts, WireParts},
    plant::{Contact, Noise},
};

const BOUNCES_PER_MS: f64 = 10.0;

#[derive(Debug)]
pub struct StopWire {
    contact: Contact,
    rise_ns: u64,
    pressed: bool,
    open_ns: Option<u64>,
}

impl StopWire {
    pub fn new(parts: &WireParts, noise: Noise) -> Self {
        let switch = SwitchParts {
            bounce_us: parts.break_bounce_us,
            bounces_per_ms: BOUNCES_PER_MS,
            glitch_us: 0,
            glitches_per_s: 0.0,
        };
        let contact = Contact::new(switch, noise, false);
        Self { contact, rise_ns: parts.break_rise_us * 1_000, pressed: false, open_ns: None }
    }

    pub fn press(&mut self, pressed: bool) {
        self.pressed = pressed;
    }

    /// Whether the input is high. A closing contact discharges the capacitor within 10 us: at once.
    pub fn is_high(&mut self, now_ns: u64) -> bool {
        if !self.contact.level(now_ns, self.pressed, false) {
            self.open_ns = None;
            return false;
        }
        now_ns >= *self.open_ns.get_or_insert(now_ns) + self.rise_ns
    }

    /// Next time at which the input may change.
    pub fn next_ns(&self, now_ns: u64) -> u64 {
        let rise_ns = self.open_ns.map(|open_ns| open_ns + self.rise_ns).filter(|at| *at > now_ns);
        self.contact.next_ns(now_ns, false).min(rise_ns.unwrap_or(u64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_rises_only_after_its_contact_was_open_for_the_rise_time() {
        let parts = WireParts { resistors: true, break_rise_us: 100, break_bounce_us: 500 };
        let mut firsts = Vec::new();
        for seed in 0..50 {
            let mut wire = StopWire::new(&parts, Noise::new(seed, "stop"));
            let high =
                |wire: &mut StopWire| (0..1_000).map(|us| wire.is_high(us * 1_000)).collect::<Vec<_>>();
            assert!(high(&mut wire).iter().all(|high| !high));
            wire.press(true);
            let levels = (1_000..2_000).map(|us| wire.is_high(us * 1_000)).collect::<Vec<_>>();
            let first = levels.iter().position(|high| *high).expect("it rises");
            assert!(first >= 100 && levels[600..].iter().all(|high| *high), "{first}");
            firsts.push(first);
        }
        assert!(firsts.iter().any(|first| *first > 100), "some bounce");
    }
}
