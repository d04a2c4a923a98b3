//! Request ids over a boot. The last [`IDS`] are tracked for delayed ones (RFC 4303, 3.4.3); older ones count as used.

use farnear_protocol::message::ID_STEP_MAX;

pub(super) const IDS: u32 = u64::BITS;

#[derive(Clone, Copy, Debug)]
pub(super) struct Ids {
    last: u32,
    /// Bit n: `last - n` was used.
    used: u64,
}

impl Ids {
    /// A new boot; 0 is not an id.
    pub(super) const fn new() -> Self {
        Self { last: 0, used: u64::MAX }
    }

    /// Largest used id, 0 = none.
    pub(super) const fn last(&self) -> u32 {
        self.last
    }

    pub(super) const fn is_new(&self, id: u32) -> bool {
        if id > self.last {
            id - self.last <= ID_STEP_MAX
        } else {
            let age = self.last - id;
            age < IDS && self.used & (1 << age) == 0
        }
    }

    pub(super) fn take(&mut self, id: u32) {
        if id > self.last {
            self.used = self.used.checked_shl(id - self.last).unwrap_or(0) | 1;
            self.last = id;
        } else if let Some(bit) = 1u64.checked_shl(self.last - id) {
            self.used |= bit;
        }
    }

    /// Lower ids belong to earlier sessions.
    pub(super) fn begin(&mut self, id: u32) {
        *self = Self { last: id.max(self.last), used: u64::MAX };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_id_is_new_once_and_what_is_older_than_the_window_never() {
        let mut ids = Ids::new();
        ids.begin(10);
        assert!(!ids.is_new(10) && !ids.is_new(9) && ids.is_new(11));
        ids.take(13);
        assert!(ids.is_new(11) && ids.is_new(12) && !ids.is_new(13));
        ids.take(11);
        assert!(!ids.is_new(11) && ids.is_new(12));
        ids.take(12 + IDS);
        assert!(!ids.is_new(12), "older than the window");
        assert!(!ids.is_new(13), "was used");
        assert!(ids.is_new(14), "never was");
        ids.begin(200);
        assert!(!ids.is_new(199) && !ids.is_new(14), "of a session before");
        // A session may be opened with a late id.
        ids.take(205);
        ids.begin(203);
        assert_eq!(ids.last(), 205);
        assert!((200..=205).all(|id| !ids.is_new(id)) && ids.is_new(206));
    }

    #[test]
    fn no_frame_can_use_all_ids_up() {
        let mut ids = Ids::new();
        assert!(!ids.is_new(u32::MAX) && !ids.is_new(ID_STEP_MAX + 1));
        assert!(ids.is_new(ID_STEP_MAX));
        ids.take(ID_STEP_MAX);
        assert_eq!(ids.last(), ID_STEP_MAX);
        assert!(ids.is_new(1 + ID_STEP_MAX) && !ids.is_new(1));
    }
}
