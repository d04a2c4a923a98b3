//! Cycles per instruction kind without wait states: Cortex-M4 manual (DDI 0439), table 3-1 and section 3.3.3;
//! floating point: table 7-1. Upper values of ranges. Encodings: ARMv7-M (DDI 0403), chapter A5.

/// Pipeline refill (manual: 1 to 3).
const REFILL: u64 = 2;
pub(super) const EXCEPTION_ENTRY: u64 = 12;
pub(super) const EXCEPTION_RETURN: u64 = 10;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Instruction {
    first: u16,
    second: Option<u16>,
}

/// Wait cycles: a bridge takes two bus cycles, APB1 runs at 1/4 and APB2 at 1/2 of the clock; AHB has one
/// (RM0090, section 2.1; sums not checked).
pub(super) const fn bus_cycles(address: u64) -> u64 {
    match address {
        0x4000_0000..0x4001_0000 => 8,
        0x4001_0000..0x4002_0000 => 4,
        0x4002_0000..0x6000_0000 => 1,
        _ => 0,
    }
}

impl Instruction {
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let half = |at: usize| Some(u16::from_le_bytes(*bytes.get(at..at + 2)?.first_chunk()?));
        let first = half(0)?;
        let long = first >> 11 >= 0b11101;
        Some(Self { first, second: if long { Some(half(2)?) } else { None } })
    }

    pub(super) const fn bytes(self) -> u64 {
        if self.second.is_some() { 4 } else { 2 }
    }

    pub(super) const fn may_branch(self) -> bool {
        let first = self.first;
        match self.second {
            None => {
                // BX and BLX; ADD and MOV to the program counter.
                let computed = first & 0xff00 == 0x4700 || first & 0xfd87 == 0x4487;
                let pops = first & 0xff00 == 0xbd00;
                let compares = first & 0xf500 == 0xb100;
                let conditional = first & 0xf000 == 0xd000 || first & 0xf800 == 0xe000;
                computed || pops || compares || conditional
            }
            Some(second) => {
                let branches = first & 0xf800 == 0xf000 && second & 0x8000 != 0 && second & 0x5000 != 0;
                let conditional =
                    first & 0xf800 == 0xf000 && second & 0xd000 == 0x8000 && first & 0x0380 != 0x0380;
                let table = first & 0xfff0 == 0xe8d0 && second & 0xffe0 == 0xf000;
                let pops = first & 0xfe50 == 0xe810 && second & 0x8000 != 0;
                let loads = first & 0xff70 == 0xf850 && second & 0xf000 == 0xf000;
                branches || conditional || table || pops || loads
            }
        }
    }

    pub(super) const fn may_return(self) -> bool {
        self.may_branch()
    }

    pub(super) const fn literal(self, pc: u64) -> Option<u64> {
        let base = (pc + 4) & !3;
        match self.second {
            None if self.first & 0xf800 == 0x4800 => Some(base + 4 * (self.first & 0xff) as u64),
            Some(second) if self.first & 0xff7f == 0xf85f => {
                let offset = (second & 0xfff) as u64;
                Some(if self.first & 0x80 != 0 { base + offset } else { base - offset })
            }
            _ => None,
        }
    }

    pub(super) const fn cycles(self, branches: bool) -> u64 {
        let base = match self.second {
            None => short(self.first),
            Some(second) => long(self.first, second),
        };
        if branches && self.may_branch() { base + REFILL } else { base }
    }
}

const fn short(first: u16) -> u64 {
    match first >> 11 {
        // Loads: literal, register, offset, stack.
        0b01001 | 0b01101 | 0b01111 | 0b10001 | 0b10011 => 2,
        0b01010 | 0b01011 if (first & 0x0800 != 0 || first & 0x0e00 == 0x0600) => 2,
        // PUSH and POP, STM and LDM.
        0b10110 if first & 0xfe00 == 0xb400 => 1 + (first & 0x1ff).count_ones() as u64,
        0b10111 if first & 0xfe00 == 0xbc00 => 1 + (first & 0x1ff).count_ones() as u64,
        0b11000 | 0b11001 => 1 + (first & 0xff).count_ones() as u64,
        // Everything else, and buffered stores.
        _ => 1,
    }
}

const fn long(first: u16, second: u16) -> u64 {
    match (first >> 9) & 0b1111 {
        // LDM and STM; two words; exclusive and table branches.
        0b0100 => {
            if first & 0x0040 == 0 {
                1 + second.count_ones() as u64
            } else {
                3
            }
        }
        // Coprocessor: the floating-point unit.
        0b0110 | 0b0111 | 0b1110 | 0b1111 => floating(first, second),
        // Loads and stores of one word: 1111 100x.
        0b1100 if first & 0x0010 != 0 => 2,
        // 1111 1011: multiplications and divisions.
        0b1101 if first & 0xff80 == 0xfb80 && second & 0x00f0 == 0x00f0 => 12,
        0b1101 if first & 0xff80 == 0xfb00 => {
            // With accumulation: one more.
            if second & 0xf000 == 0xf000 { 1 } else { 2 }
        }
        // MRS and MSR.
        _ if first & 0xff80 == 0xf380 && second & 0xd000 == 0x8000 => 2,
        _ => 1,
    }
}

/// VLDR and VSTR 2 (double 3), several 1 + N, division and root 14, fused and chained 3, other 1.
const fn floating(first: u16, second: u16) -> u64 {
    if first & 0xfe00 == 0xec00 {
        let words = (second & 0xff) as u64;
        // P set and W clear: one register.
        return if first & 0x0120 == 0x0100 { if second & 0x0100 != 0 { 3 } else { 2 } } else { 1 + words };
    }
    match first & 0xffb0 {
        0xee80 => 14,
        0xeeb0 if second & 0x00c0 == 0x00c0 && first & 0x000f == 1 => 14,
        0xee00 | 0xee10 | 0xeea0 | 0xee90 if second & 0x0010 == 0 => 3,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycles(halves: &[u16]) -> (u64, bool) {
        let bytes: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let instruction = Instruction::decode(&bytes).expect("an instruction");
        assert_eq!(instruction.bytes(), bytes.len() as u64);
        (instruction.cycles(true), instruction.may_branch())
    }

    #[test]
    fn cycles_per_kind_match_the_manual() {
        for (halves, expected, what) in [
            (&[0x1840][..], (1, false), "adds r0, r0, r1"),
            (&[0x4348], (1, false), "muls r0, r1"),
            (&[0x6808], (2, false), "ldr r0, [r1]"),
            (&[0x6008], (1, false), "str r0, [r1]"),
            (&[0x4801], (2, false), "ldr r0, =constant"),
            (&[0x5c08], (2, false), "ldrb r0, [r1, r0]"),
            (&[0xb5f0], (6, false), "push {r4-r7, lr}"),
            (&[0xbdf0], (6 + REFILL, true), "pop {r4-r7, pc}"),
            (&[0x4770], (1 + REFILL, true), "bx lr"),
            (&[0xd1fe], (1 + REFILL, true), "bne"),
            (&[0xe7fe], (1 + REFILL, true), "b"),
            (&[0xb108], (1 + REFILL, true), "cbz r0"),
            (&[0xbf08], (1, false), "it eq"),
            (&[0xf000, 0xf800], (1 + REFILL, true), "bl"),
            (&[0xf7ff, 0xbffe], (1 + REFILL, true), "b.w"),
            (&[0xe92d, 0x4ff0], (10, false), "push {r4-r11, lr}"),
            (&[0xe8bd, 0x8ff0], (10 + REFILL, true), "pop {r4-r11, pc}"),
            (&[0xe9d1, 0x0100], (3, false), "ldrd r0, r1, [r1]"),
            (&[0xf8d1, 0x0004], (2, false), "ldr.w r0, [r1, #4]"),
            (&[0xf8c1, 0x0004], (1, false), "str.w r0, [r1, #4]"),
            (&[0xfb90, 0xf0f1], (12, false), "sdiv r0, r0, r1"),
            (&[0xfbb0, 0xf0f1], (12, false), "udiv r0, r0, r1"),
            (&[0xfba0, 0x0101], (1, false), "umull r0, r1, r0, r1"),
            (&[0xfb00, 0x2001], (2, false), "mla r0, r0, r1, r2"),
            (&[0xfb00, 0xf001], (1, false), "mul.w r0, r0, r1"),
            (&[0xf04f, 0x0001], (1, false), "mov.w r0, #1"),
            (&[0xed90, 0x0a00], (2, false), "vldr s0, [r0]"),
            (&[0xee80, 0x0a20], (14, false), "vdiv.f32 s0, s0, s1"),
            (&[0xeeb1, 0x0ac0], (14, false), "vsqrt.f32 s0, s0"),
            (&[0xee30, 0x0a20], (1, false), "vadd.f32 s0, s0, s1"),
        ] {
            assert_eq!(cycles(halves), expected, "{what}");
        }
    }

    #[test]
    fn finds_the_address_of_a_literal() {
        let literal = |halves: &[u16], pc| {
            let bytes: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
            Instruction::decode(&bytes).and_then(|instruction| instruction.literal(pc))
        };
        assert_eq!(literal(&[0x4801], 0x0800_0002), Some(0x0800_0008));
        assert_eq!(literal(&[0xf8df, 0x0010], 0x0800_0000), Some(0x0800_0014));
        assert_eq!(literal(&[0x6808], 0x0800_0000), None);
    }
}
