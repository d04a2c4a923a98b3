//! Mathematics on the board: answers of the emulated Cortex-M4F and of this machine agree to the bit.

use crate::bench::{Bench, answer_in, request_frame};
use farnear_protocol::{
    BoardMicros, Request, Response,
    frame::Decoder,
    message::{
        CODES_MAX, COEFFICIENTS_MAX, CorrectionForm, CorrectionInfo, QueryDeviations, ResetCause,
        ShadowQuery, SunQuery,
    },
};
use farnear_rig::{
    Identity, Rig,
    io::{GAUGE_CODE_ZERO, Inputs, MotorInputs, StepperState, TICK_US},
};
use farnear_sim::plant::Noise;

const WIDTH: u16 = 640;
const HEIGHT: u16 = 480;

/// The board's code on this machine, without devices.
struct Here {
    rig: Rig,
    now: u64,
    id: u32,
}

impl Here {
    fn new() -> Self {
        let identity = Identity {
            board: "here",
            firmware: "test",
            unique_id: [0; 12],
            boot: 1,
            piezo_code: None,
            reset_cause: ResetCause::PowerOn,
            emulated: true,
            own_clock: false,
            last_words: None,
        };
        let mut here = Self { rig: Rig::new(identity, None, BoardMicros(0)), now: 0, id: 0 };
        assert_eq!(here.ask(&Request::OpenSession), Ok(Response::Accepted));
        here
    }

    fn tick(&mut self) {
        self.now += u64::from(TICK_US);
        let stepper = StepperState { pulses: 0, idle: true, underrun: false, room: 8 };
        let motor = MotorInputs {
            encoder_counts: 0,
            home_switch: false,
            far_switch: false,
            driver_fault: false,
            stepper,
        };
        self.rig.tick(&Inputs {
            now: BoardMicros(self.now),
            coarse: motor,
            lens: motor,
            gauge_code: Some(GAUGE_CODE_ZERO),
            emergency_stop: false,
            supply_low: false,
            memory_failed: false,
            link_overflow: false,
            exposure: None,
            strobe: None,
        });
    }

    fn ask(&mut self, request: &Request) -> crate::bench::Answer {
        self.id += 1;
        let boot = if *request == Request::Hello { 0 } else { self.rig.boot() };
        for byte in request_frame(self.id, boot, request) {
            self.rig.receive(byte);
            while self.rig.serve(BoardMicros(self.now)) {}
        }
        let mut decoder = Decoder::new();
        for _ in 0..100 {
            self.tick();
            while let Some(frame) = self.rig.transmit() {
                let packets = frame.iter().filter_map(|byte| decoder.push(*byte)?.ok()).collect::<Vec<_>>();
                if let Some((_, answer)) = packets.iter().filter_map(answer_in).find(|(id, _)| *id == self.id)
                {
                    return answer;
                }
            }
        }
        panic!("no answer to {request:?} here");
    }
}

fn both(bench: &mut Bench, here: &mut Here, request: &Request) -> Response {
    let (there, here) = (bench.ask(request), here.ask(request));
    assert_eq!(there, here, "{request:?}");
    there.unwrap_or_else(|error| panic!("{request:?}: {error:?}"))
}

fn noise_codes(noise: &mut Noise, count: usize) -> heapless::Vec<i16, CODES_MAX> {
    (0..count).map(|_| (noise.bits() as i16) / 2).collect()
}

#[test]
fn corrected_rows_have_the_same_bits() {
    let (mut bench, mut here) = (Bench::new(1), Here::new());
    let mut noise = Noise::new(1, "test of corrections");
    for form in [CorrectionForm::Regions, CorrectionForm::Blend, CorrectionForm::Full] {
        let info =
            CorrectionInfo { form, width: WIDTH, height: HEIGHT, centre_um: 909_905, half_span_um: 30_024 };
        both(&mut bench, &mut here, &Request::OpenCorrection(info));
        let count = usize::from(form.coefficients());
        for first in (0..count).step_by(COEFFICIENTS_MAX) {
            let some = COEFFICIENTS_MAX.min(count - first);
            let bits = (0..some).map(|_| noise.bits() as i32 >> 6).collect();
            both(&mut bench, &mut here, &Request::PutCoefficients { first: first as u8, bits });
        }
        for row in [0, 1, 159, 160, 479] {
            for first in (0..usize::from(WIDTH)).step_by(CODES_MAX) {
                let codes = noise_codes(&mut noise, CODES_MAX.min(usize::from(WIDTH) - first));
                both(&mut bench, &mut here, &Request::PutRow { first: first as u16, codes });
            }
            both(&mut bench, &mut here, &Request::CorrectRow { row });
            for first in (0..usize::from(WIDTH)).step_by(CODES_MAX) {
                let count = CODES_MAX.min(usize::from(WIDTH) - first) as u8;
                let row = both(&mut bench, &mut here, &Request::GetRow { first: first as u16, count });
                assert!(matches!(row, Response::Row(codes) if codes.len() == usize::from(count)));
            }
        }
    }
}

#[test]
fn a_fit_on_the_board_has_the_same_bits() {
    let (mut bench, mut here) = (Bench::new(1), Here::new());
    let mut noise = Noise::new(2, "test of fits");
    for form in [CorrectionForm::Regions, CorrectionForm::Full] {
        let info =
            CorrectionInfo { form, width: WIDTH, height: HEIGHT, centre_um: 909_905, half_span_um: 30_024 };
        both(&mut bench, &mut here, &Request::OpenCorrection(info));
        for depth in 0..5i16 {
            let truth = (depth - 2) * 10_000;
            for row in (8..HEIGHT).step_by(24) {
                let codes = (0..72).map(|_| truth + (noise.bits() as i16) / 512).collect();
                both(&mut bench, &mut here, &Request::FitSamples { row, first: 0, step: 8, truth, codes });
            }
        }
        both(&mut bench, &mut here, &Request::SolveFit);
        let count = COEFFICIENTS_MAX.min(usize::from(form.coefficients())) as u8;
        let found = both(&mut bench, &mut here, &Request::GetCoefficients { first: 0, count });
        assert!(matches!(found, Response::Coefficients(bits) if bits.iter().any(|bits| *bits != 0)));
    }
}

#[test]
fn sun_positions_and_shadows_have_the_same_bits() {
    let (mut bench, mut here) = (Bench::new(1), Here::new());
    let mut noise = Noise::new(3, "test of shadows");
    let mut angles = 0;
    for _ in 0..60 {
        let deviations = QueryDeviations {
            day_e3: 500,
            time_s: 60,
            latitude_e7: 100_000,
            longitude_e7: 100_000,
            azimuth_e7: 10_000_000,
            camera_height_mm: 20,
            height_mm: 50,
            distance_mm: 100,
        };
        let shadow = ShadowQuery {
            azimuth_e7: noise.between(-1.8e9, 1.8e9) as i32,
            camera_height_mm: noise.between(500.0, 4_000.0) as u32,
            distance_mm: noise.between(2_000.0, 30_000.0) as u32,
            lateral_mm: noise.between(-2_000.0, 2_000.0) as i32,
            height_mm: noise.between(1_000.0, 2_000.0) as u32,
            deviations,
        };
        let query = SunQuery {
            unix_seconds: noise.between(1.4e9, 1.8e9) as i64,
            latitude_e7: noise.between(-6e8, 6e8) as i32,
            longitude_e7: noise.between(-1.8e9, 1.8e9) as i32,
            shadow: Some(shadow),
        };
        let answer = both(&mut bench, &mut here, &Request::Sun(query));
        angles += u32::from(format!("{answer:?}").contains("Angle"));
    }
    assert!(angles > 15, "the sun was up in {angles} of 60");
}
