//! A ring that a DMA stream fills: how its reader tells a lap from a lost one.
//!
//! The stream's flag of a lap may appear some cycles after its place has passed the ring's end. The reader therefore
//! reads the flag, then the place, takes the bytes, and only then clears the flag of a lap that the place has shown.
//! Otherwise the flag would stay for the next reading, where it means a second lap.

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lap {
    Unfinished,
    /// The stream has passed the ring's end; clear its flag.
    Finished,
    /// It has also passed unread bytes; clear its flag.
    Lost,
}

/// `flag` was read before the stream's place `end`; the reader is at `taken`.
pub const fn lap(flag: bool, taken: usize, end: usize) -> Lap {
    if end < taken {
        Lap::Finished
    } else if flag {
        Lap::Lost
    } else {
        Lap::Unfinished
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RING: usize = 16;

    #[derive(Default)]
    struct Stream {
        bytes: usize,
        flag: bool,
        /// The flag follows in the next step.
        follows: bool,
    }

    impl Stream {
        fn receive(&mut self, bytes: usize, late: bool) {
            self.flag |= core::mem::take(&mut self.follows);
            for _ in 0..bytes {
                self.bytes += 1;
                if self.bytes.is_multiple_of(RING) {
                    (self.flag, self.follows) = (self.flag || !late, late);
                }
            }
        }
    }

    #[test]
    fn a_flag_that_appears_at_any_step_of_the_reader_loses_no_byte() {
        for case in 0..2 * 27 * RING {
            let (late, rest) = (case % 2 == 1, case / 2);
            // Bytes before the flag is read, between flag and place, and while bytes are taken.
            let [a, b, c] = [rest % 3, rest / 3 % 3, rest / 9 % 3];
            let begin = rest / 27;
            let mut stream = Stream::default();
            stream.receive(begin, late);
            let mut read = begin;
            for _ in 0..100 {
                stream.receive(a, late);
                let flag = stream.flag;
                stream.receive(b, late);
                let end = stream.bytes % RING;
                let lap = lap(flag, read % RING, end);
                assert_ne!(lap, Lap::Lost, "{begin} {a} {b} {c} {late}");
                while read % RING != end {
                    read += 1;
                }
                stream.receive(c, late);
                if lap == Lap::Finished {
                    stream.flag = false;
                }
                assert!(read <= stream.bytes && stream.bytes - read <= c, "{begin} {a} {b} {c} {late}");
            }
            stream.receive(RING + 1, late);
            stream.receive(0, late);
            // A loss that ends before the reader's place looks like one lap.
            let end = stream.bytes % RING;
            assert_eq!(lap(stream.flag, read % RING, end) == Lap::Lost, end >= read % RING);
        }
    }
}
