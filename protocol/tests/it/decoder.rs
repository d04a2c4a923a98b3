//! The decoder with garbage, cuts and flipped bits.

use farnear_protocol::{
    BoardMicros, Event, EventKind, Log, Micros, Nanometres, Request, RequestError, Response,
    frame::{BODY_MAX, Decoder, Encoded, FRAME_MAX, FrameError, Header, Kind, Packet, decode, encode},
    message::{Axis, CODES_MAX, COEFFICIENTS_MAX, Codes, ResetCause, Shot, TriggerMode},
};
use proptest::{collection::vec, prelude::*};

fn header(kind: Kind, id: u32, boot: u32) -> Header {
    Header { version: 3, kind, id, boot }
}

fn request(id: u32, request: &Request) -> Encoded {
    encode(header(Kind::Request, id, 7), request).expect("fits")
}

fn feed(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Result<Packet, FrameError>> {
    bytes.iter().filter_map(|byte| decoder.push(*byte)).collect()
}

fn any_request() -> impl Strategy<Value = Request> {
    let axis = prop_oneof![Just(Axis::SensorCoarse), Just(Axis::SensorFine), Just(Axis::Lens)];
    let mode =
        prop_oneof![Just(TriggerMode::Hardware), Just(TriggerMode::Software), Just(TriggerMode::FreeRunning)];
    let codes = || vec(any::<i16>(), 0..=CODES_MAX).prop_map(|codes| codes.into_iter().collect::<Codes>());
    prop_oneof![
        Just(Request::Hello),
        Just(Request::Status),
        (axis.clone(), any::<u32>()).prop_map(|(axis, us)| Request::Home { axis, silence: Micros(us) }),
        (axis.clone(), any::<i32>(), any::<u32>()).prop_map(|(axis, nm, us)| Request::Move {
            axis,
            target: Nanometres(nm),
            silence: Micros(us)
        }),
        (any::<u8>(), axis, mode, any::<(i32, u32, i32, u32, u16)>()).prop_map(
            |(index, axis, mode, (target, exposure, window, dwell, repeat))| Request::LoadShot {
                index,
                shot: Shot {
                    axis,
                    target: Nanometres(target),
                    exposure: Micros(exposure),
                    settle_window: Nanometres(window),
                    settle_dwell: Micros(dwell),
                    repeat,
                    mode,
                },
            }
        ),
        any::<u32>().prop_map(|number| Request::ReadEvent { number }),
        (any::<[u16; 3]>(), any::<i16>(), codes()).prop_map(|([row, first, step], truth, codes)| {
            Request::FitSamples { row, first, step, truth, codes }
        }),
        (any::<u16>(), codes()).prop_map(|(first, codes)| Request::PutRow { first, codes }),
        (any::<u8>(), vec(any::<i32>(), 0..=COEFFICIENTS_MAX)).prop_map(|(first, bits)| {
            Request::PutCoefficients { first, bits: bits.into_iter().collect() }
        }),
        Just(Request::Stop),
        Just(Request::Reboot),
    ]
}

#[test]
fn a_million_random_byte_strings_neither_panic_nor_pass_the_crc() {
    // xorshift64*: fast and seeded. The CRC accepts a random frame of at least 14 bytes once in 2^32, so a
    // single pass in 10^6 strings would be an error.
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D)
    };
    let mut decoder = Decoder::new();
    let mut passed = 0;
    for _ in 0..1_000_000 {
        let length = next() % 48;
        for _ in 0..length {
            let random = next();
            // Every eighth byte is a delimiter, so that frames of all lengths appear.
            let byte = if random & 7 == 0 { 0 } else { (random >> 8) as u8 };
            passed += u32::from(matches!(decoder.push(byte), Some(Ok(_))));
        }
    }
    assert_eq!(passed, 0);
    feed(&mut decoder, &[0]);
    assert!(matches!(feed(&mut decoder, &request(1, &Request::Status))[..], [Ok(_)]));
}

#[test]
fn a_frame_without_a_delimiter_is_too_long_once_and_the_next_is_read() {
    let mut decoder = Decoder::new();
    assert_eq!(feed(&mut decoder, &[0x55; 10 * FRAME_MAX]), []);
    assert_eq!(feed(&mut decoder, &[0]), [Err(FrameError::TooLong)]);
    assert!(matches!(feed(&mut decoder, &request(1, &Request::Hello))[..], [Ok(_)]));
}

struct Raw<'a>(&'a [u8]);

impl serde::Serialize for Raw<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeTuple;
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

#[test]
fn rejects_bodies_with_surplus_bytes() {
    let mut packet =
        decode(request(1, &Request::Status).split_last().expect("not empty").1).expect("decodes");
    assert_eq!(packet.message::<Request>(), Some(Request::Status));
    packet.body.push(0).expect("room");
    assert_eq!(packet.message::<Request>(), None);
}

#[test]
fn frames_of_up_to_256_bytes_are_read_and_one_more_is_too_long() {
    let header = header(Kind::Request, 5, 7);
    for length in [1, BODY_MAX - 1, BODY_MAX] {
        for byte in [0, 1, 0xff] {
            let body = vec![byte; length];
            let Some(encoded) = encode(header, &Raw(&body)) else {
                panic!("{length} bytes {byte} do not fit");
            };
            let packets = feed(&mut Decoder::new(), &encoded);
            assert!(
                matches!(&packets[..], [Ok(packet)] if packet.body.as_slice() == body),
                "{length} of {byte}"
            );
        }
    }
    assert_eq!(encode(header, &Raw(&[1; BODY_MAX + 1])), None);
    // No zero byte: a run of 254 bytes needs no further COBS code.
    let header = Header { id: 0x0101_0101, boot: 0x0101_0101, ..header };
    let encoded = encode(header, &Raw(&[2; BODY_MAX])).expect("it fits");
    assert_eq!((encoded.len(), encoded.last()), (FRAME_MAX, Some(&0)));
    assert!(matches!(&feed(&mut Decoder::new(), &encoded)[..], [Ok(packet)] if packet.header == header));
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(id: u32, boot: u32, message in any_request()) {
        let wire = encode(header(Kind::Request, id, boot), &message).expect("every request fits");
        prop_assert!(wire.len() <= FRAME_MAX);
        prop_assert_eq!(wire.iter().filter(|byte| **byte == 0).count(), 1);
        let packets = feed(&mut Decoder::new(), &wire);
        let [Ok(packet)] = &packets[..] else { return Err(TestCaseError::fail("one frame")) };
        prop_assert_eq!(packet.header, header(Kind::Request, id, boot));
        prop_assert_eq!(packet.message::<Request>(), Some(message));
    }

    #[test]
    fn after_any_garbage_the_next_frame_is_read(
        garbage in vec(any::<u8>(), 0..600),
        message in any_request(),
    ) {
        let mut decoder = Decoder::new();
        feed(&mut decoder, &garbage);
        feed(&mut decoder, &[0]);
        let packets = feed(&mut decoder, &request(3, &message));
        let [Ok(packet)] = &packets[..] else { return Err(TestCaseError::fail("one frame")) };
        prop_assert_eq!(packet.message::<Request>(), Some(message));
    }

    #[test]
    fn any_one_or_two_flipped_bits_are_found(message in any_request(), first: u16, second: u16) {
        let wire = request(3, &message);
        let mut flipped = wire.clone();
        let bits = wire.len() * 8;
        for bit in [usize::from(first) % bits, usize::from(second) % bits] {
            flipped[bit / 8] ^= 1 << (bit % 8);
        }
        prop_assume!(flipped != wire);
        for packet in feed(&mut Decoder::new(), &flipped) {
            prop_assert!(packet.is_err());
        }
    }

    #[test]
    fn random_bodies_never_panic(body in vec(any::<u8>(), 0..BODY_MAX)) {
        let wire = encode(header(Kind::Request, 1, 1), &Raw(&body)).expect("fits");
        let packet = decode(&wire[..wire.len() - 1]).expect("decodes");
        let _ = packet.message::<Request>();
        let _ = packet.message::<Response>();
        let _ = packet.message::<RequestError>();
        let _ = packet.message::<Event>();
        let _ = packet.message::<Log>();
    }
}

#[test]
fn an_event_travels() {
    let event = Event { time: BoardMicros(5), kind: EventKind::Started { cause: ResetCause::PowerOn } };
    let wire = encode(header(Kind::Event, 0, 9), &event).expect("fits");
    let packets = feed(&mut Decoder::new(), &wire);
    assert_eq!(packets[0].as_ref().ok().and_then(Packet::message), Some(event));
}
