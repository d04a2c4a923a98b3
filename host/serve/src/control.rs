//! Control of the rig: one browser has it, others watch and can request it. A client is one socket.

use std::{fmt::Write as _, time::Duration};

use subtle::ConstantTimeEq;

/// How long control is reserved for a disconnected holder: a reload takes about a second.
pub const RESERVED: Duration = Duration::from_secs(3);

#[derive(Debug, Default)]
pub struct ControlLock {
    clients: Vec<Client>,
    last: u32,
    holder: Option<u32>,
    /// The disconnected holder while control is reserved for it.
    disconnected: Option<Client>,
    /// Clients that request control, oldest first.
    requests: Vec<u32>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client {
    pub id: u32,
    pub secret: String,
}

impl Client {
    fn has(&self, secret: &str) -> bool {
        self.secret.as_bytes().ct_eq(secret.as_bytes()).into()
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum HandOverError {
    #[error("another browser has control of the rig")]
    NotHolder,
    /// The client has withdrawn its request or has disconnected.
    #[error("browser {0} does not request control")]
    NotRequested(u32),
}

impl ControlLock {
    /// Adds a client. It gets control if free, or if its page had it before a reload (`resumed`: that page's secret).
    pub fn join(&mut self, resumed: Option<&str>) -> Result<Client, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        let secret = bytes.iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        });
        self.last += 1;
        let client = Client { id: self.last, secret };
        let before = resumed.and_then(|secret| {
            self.clients
                .iter()
                .chain(&self.disconnected)
                .find(|other| other.has(secret))
                .map(|other| other.id)
        });
        self.clients.push(client.clone());
        if self.holder.is_none() || (before.is_some() && before == self.holder) {
            self.set_holder(Some(client.id));
        }
        Ok(client)
    }

    /// Removes a client; `true` if it has control. Control stays reserved until [`Self::expire`].
    pub fn leave(&mut self, id: u32) -> bool {
        let Some(at) = self.clients.iter().position(|client| client.id == id) else { return false };
        let client = self.clients.swap_remove(at);
        self.requests.retain(|other| *other != id);
        let held = self.holder == Some(id);
        if held {
            self.disconnected = Some(client);
        }
        held
    }

    /// Ends a reservation, if any (`true`): control passes to the oldest request, or to the only client.
    pub fn expire(&mut self, id: u32) -> bool {
        if self.disconnected.as_ref().is_none_or(|client| client.id != id) {
            return false;
        }
        let only = <&[Client; 1]>::try_from(self.clients.as_slice()).ok().map(|[client]| client.id);
        self.set_holder(self.requests.first().copied().or(only));
        true
    }

    fn set_holder(&mut self, id: Option<u32>) {
        self.holder = id;
        self.disconnected = None;
        self.requests.retain(|other| Some(*other) != id);
    }

    pub fn id_of(&self, secret: &str) -> Option<u32> {
        self.clients.iter().find(|client| client.has(secret)).map(|client| client.id)
    }

    pub fn has_control(&self, secret: &str) -> bool {
        self.holder.is_some() && self.id_of(secret) == self.holder
    }

    /// Requests control; granted immediately if no client has it. `false` for an unknown secret.
    pub fn request(&mut self, secret: &str) -> bool {
        let Some(id) = self.id_of(secret) else { return false };
        if self.holder.is_none() {
            self.set_holder(Some(id));
        } else if self.holder != Some(id) && !self.requests.contains(&id) {
            self.requests.push(id);
        }
        true
    }

    pub fn answer(&mut self, secret: &str, to: u32, give: bool) -> Result<(), HandOverError> {
        if !self.has_control(secret) {
            return Err(HandOverError::NotHolder);
        }
        if !self.requests.contains(&to) {
            return Err(HandOverError::NotRequested(to));
        }
        self.requests.retain(|other| *other != to);
        if give {
            self.set_holder(Some(to));
        }
        Ok(())
    }

    pub fn holder(&self) -> Option<u32> {
        self.holder
    }

    pub fn requested_by(&self) -> Option<u32> {
        self.requests.first().copied()
    }

    pub fn clients(&self) -> usize {
        self.clients.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined<const N: usize>(lock: &mut ControlLock) -> [Client; N] {
        [0; N].map(|_| lock.join(None).unwrap())
    }

    #[test]
    fn one_client_has_control_and_hands_it_over_on_request() {
        let mut lock = ControlLock::default();
        let [first, second] = joined(&mut lock);
        assert_ne!(first.secret, second.secret);
        assert!(
            lock.has_control(&first.secret) && !lock.has_control(&second.secret) && !lock.has_control("")
        );
        assert!(lock.request(&second.secret) && !lock.has_control(&second.secret));
        assert_eq!(lock.answer(&second.secret, second.id, true), Err(HandOverError::NotHolder));
        assert_eq!(lock.answer(&first.secret, second.id, false), Ok(()));
        assert_eq!(lock.requested_by(), None);
        assert!(lock.request(&second.secret));
        assert_eq!(lock.answer(&first.secret, second.id, true), Ok(()));
        assert!(lock.has_control(&second.secret) && !lock.has_control(&first.secret));
        assert!(!lock.request("made up"));
    }

    /// S7: B requests, C requests, the holder grants B's request.
    #[test]
    fn control_goes_to_the_client_named_in_the_answer() {
        let mut lock = ControlLock::default();
        let [holder, b, c] = joined(&mut lock);
        assert!(lock.request(&b.secret) && lock.request(&c.secret));
        assert_eq!(lock.requested_by(), Some(b.id));
        assert_eq!(lock.answer(&holder.secret, b.id, true), Ok(()));
        assert!(lock.has_control(&b.secret));
        assert_eq!(lock.requested_by(), Some(c.id), "the other request waits for the new holder");
        assert!(!lock.leave(c.id));
        assert_eq!(lock.answer(&b.secret, c.id, true), Err(HandOverError::NotRequested(c.id)));
        assert!(lock.has_control(&b.secret));
    }

    #[test]
    fn a_reloaded_page_keeps_control_while_another_watches() {
        let mut lock = ControlLock::default();
        let [holder, watcher] = joined(&mut lock);
        assert!(lock.leave(holder.id));
        assert!(!lock.has_control(&holder.secret), "a disconnected client can request nothing");
        assert!(lock.request(&watcher.secret) && !lock.has_control(&watcher.secret), "reserved");
        let again = lock.join(Some(&holder.secret)).unwrap();
        assert!(lock.has_control(&again.secret));
        assert!(!lock.expire(holder.id), "the reservation was used");
        assert!(lock.has_control(&again.secret));
        // Another client's secret or a used one resumes nothing.
        for secret in [&watcher.secret, &holder.secret, &String::new()] {
            let other = lock.join(Some(secret)).unwrap();
            assert!(!lock.has_control(&other.secret));
        }
    }

    #[test]
    fn a_new_socket_that_arrives_before_the_old_one_closes_takes_over() {
        let mut lock = ControlLock::default();
        let [holder] = joined(&mut lock);
        let again = lock.join(Some(&holder.secret)).unwrap();
        assert!(lock.has_control(&again.secret) && !lock.leave(holder.id));
        assert!(lock.has_control(&again.secret));
    }

    #[test]
    fn an_expired_reservation_passes_to_a_request_or_to_the_only_client_left() {
        let mut lock = ControlLock::default();
        let [first, second, third] = joined(&mut lock);
        assert!(!lock.leave(99) && !lock.expire(99));
        assert!(lock.leave(first.id) && lock.expire(first.id));
        assert_eq!(lock.holder(), None, "of several clients none is chosen");
        assert!(lock.request(&second.secret) && lock.has_control(&second.secret));
        assert!(lock.request(&third.secret) && lock.leave(second.id) && lock.expire(second.id));
        assert!(lock.has_control(&third.secret));
        assert!(lock.leave(third.id) && lock.expire(third.id));
        assert_eq!((lock.holder(), lock.clients()), (None, 0));
        let [next] = joined(&mut lock);
        assert!(lock.has_control(&next.secret));
        let [only] = joined(&mut lock);
        assert!(lock.leave(next.id) && lock.expire(next.id) && lock.has_control(&only.secret));
    }
}
