//! Extension of 32-bit time stamps.

use farnear_protocol::BoardMicros;

/// The time with these lower 32 bits within 35 minutes of `now`, before or after, as an edge may follow it.
pub const fn extend(stamp: u32, now: BoardMicros) -> BoardMicros {
    let ahead = stamp.wrapping_sub(now.0 as u32) as i32;
    BoardMicros(now.0.saturating_add_signed(ahead as i64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_edge_after_the_look_at_the_clock_lies_after_it() {
        let now = BoardMicros(5_000_000_000);
        assert_eq!(extend(now.0 as u32 + 3, now), BoardMicros(5_000_000_003));
        assert_eq!(extend(now.0 as u32 - 3, now), BoardMicros(4_999_999_997));
        assert_eq!(extend(2, BoardMicros(u64::from(u32::MAX) - 1)), BoardMicros(0x1_0000_0002));
    }

    proptest! {
        #[test]
        fn every_moment_near_now_is_found(now in 1u64 << 31..1 << 50, way in -0x7fff_ffffi64..0x7fff_ffff) {
            let moment = now.saturating_add_signed(way);
            prop_assert_eq!(extend(moment as u32, BoardMicros(now)), BoardMicros(moment));
        }
    }
}
