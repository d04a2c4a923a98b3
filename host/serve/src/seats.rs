//! Who drives: one browser moves the rig, others watch, and a hand-over is asked for.
//!
//! A seat is a socket's: it ends with it. Who comes while nobody drives, drives; so a page that is loaded again goes on. Its
//! secret goes with every request that changes something.

use std::fmt::Write as _;

use subtle::ConstantTimeEq;

/// All seats.
#[derive(Debug, Default)]
pub struct Seats {
    seats: Vec<Seat>,
    last: u32,
    driver: Option<u32>,
    asking: Option<u32>,
}

/// A seat as its owner knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seat {
    /// Its number, which everybody may know.
    pub number: u32,
    /// Its secret.
    pub secret: String,
}

impl Seats {
    /// A new seat; it drives where nobody does.
    ///
    /// # Errors
    /// [`getrandom::Error`] where the system has no random numbers.
    pub fn join(&mut self) -> Result<Seat, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        let secret = bytes.iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        });
        self.last += 1;
        let seat = Seat { number: self.last, secret };
        self.seats.push(seat.clone());
        self.driver.get_or_insert(seat.number);
        Ok(seat)
    }

    /// A seat is left; gives whether it drove. Who asked for it has it now, or who is left alone.
    pub fn leave(&mut self, number: u32) -> bool {
        self.seats.retain(|seat| seat.number != number);
        if self.asking == Some(number) {
            self.asking = None;
        }
        let drove = self.driver == Some(number);
        if drove {
            // A page that is loaded again may come before its old socket has gone: who is left alone drives.
            let alone = <[Seat; 1]>::try_from(self.seats.clone()).ok().map(|[seat]| seat.number);
            self.driver = self.asking.take().or(alone);
        }
        drove
    }

    /// The number of the seat with this secret.
    pub fn number_of(&self, secret: &str) -> Option<u32> {
        let same = |seat: &&Seat| bool::from(seat.secret.as_bytes().ct_eq(secret.as_bytes()));
        self.seats.iter().find(same).map(|seat| seat.number)
    }

    /// Whether this secret is the driver's.
    pub fn drives(&self, secret: &str) -> bool {
        self.driver.is_some() && self.number_of(secret) == self.driver
    }

    /// Asks to drive; done at once where nobody does. `false` for a secret that is nobody's.
    pub fn ask(&mut self, secret: &str) -> bool {
        let Some(number) = self.number_of(secret) else { return false };
        match self.driver {
            None => self.driver = Some(number),
            Some(driver) if driver == number => {}
            Some(_) => self.asking = Some(number),
        }
        true
    }

    /// The driver answers whoever asked. `false` where it is not the driver's secret.
    pub fn answer(&mut self, secret: &str, give: bool) -> bool {
        if !self.drives(secret) {
            return false;
        }
        if let Some(asking) = self.asking.take().filter(|_| give) {
            self.driver = Some(asking);
        }
        true
    }

    /// Who drives.
    pub fn driver(&self) -> Option<u32> {
        self.driver
    }

    /// Who asks to.
    pub fn asking(&self) -> Option<u32> {
        self.asking
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.seats.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_drives_and_a_hand_over_is_asked_for() {
        let mut seats = Seats::default();
        let (first, second) = (seats.join().unwrap(), seats.join().unwrap());
        assert_ne!(first.secret, second.secret);
        assert!(seats.drives(&first.secret) && !seats.drives(&second.secret) && !seats.drives(""));
        assert!(seats.ask(&second.secret) && !seats.drives(&second.secret));
        assert!(!seats.answer(&second.secret, true), "nobody gives themselves what is another's");
        assert!(seats.answer(&first.secret, false));
        assert_eq!(seats.asking(), None);
        assert!(seats.ask(&second.secret) && seats.answer(&first.secret, true));
        assert!(seats.drives(&second.secret) && !seats.drives(&first.secret));
    }

    #[test]
    fn a_seat_that_is_left_goes_to_who_asked_or_comes_next() {
        let mut seats = Seats::default();
        let (first, second) = (seats.join().unwrap(), seats.join().unwrap());
        assert!(!seats.leave(99));
        assert!(seats.ask(&second.secret) && seats.leave(first.number));
        assert!(seats.drives(&second.secret) && !seats.drives(&first.secret));
        assert!(seats.leave(second.number));
        assert_eq!((seats.driver(), seats.count()), (None, 0));
        let third = seats.join().unwrap();
        assert!(seats.drives(&third.secret));
        assert!(!seats.ask("made up"));
    }

    #[test]
    fn who_is_left_alone_drives_and_of_several_nobody_does() {
        let mut seats = Seats::default();
        let [first, second, third] = [0; 3].map(|_| seats.join().unwrap());
        assert!(seats.leave(first.number));
        assert_eq!(seats.driver(), None);
        assert!(seats.ask(&second.secret) && seats.leave(second.number));
        assert!(seats.drives(&third.secret));
    }

    #[test]
    fn who_asked_and_left_gets_nothing() {
        let mut seats = Seats::default();
        let (first, second) = (seats.join().unwrap(), seats.join().unwrap());
        assert!(seats.ask(&second.secret) && !seats.leave(second.number));
        assert!(seats.answer(&first.secret, true) && seats.drives(&first.secret));
    }
}
