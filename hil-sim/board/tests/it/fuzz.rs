//! Random input on the link: the board answers valid requests, stays alive and respects its limits.

use crate::bench::{Bench, amount, fine_shot, request_frame};
use farnear_protocol::{
    Micros, Nanometres, Request, Response,
    message::{
        Axis, CorrectionForm, CorrectionInfo, QueryDeviations, ResetCause, Routine, SettingKey, ShadowQuery,
        SunQuery, TriggerMode,
    },
};
use farnear_sim::plant::Noise;

/// About 600 frames per second of board time; the campaign sends more.
const FRAMES: u64 = 1_000;
/// Valid frames kept for repetition.
const KEPT: usize = 256;
/// Positions and durations: mostly extreme, some near the limits, some sensible.
const EDGES: [i32; 12] =
    [0, 1, -1, i32::MIN, i32::MAX, 13_000_000, 13_000_001, 5_000, 195_000, 100_000, 500_000, 6_000_000];

struct Fuzz {
    noise: Noise,
    boot: u32,
    id: u32,
    sent: Vec<Vec<u8>>,
}

impl Fuzz {
    fn below(&mut self, end: u64) -> u64 {
        self.noise.bits() % end
    }

    fn number(&mut self) -> i32 {
        match self.below(3) {
            0 => EDGES[self.below(EDGES.len() as u64) as usize],
            1 => self.below(13_000_000) as i32,
            _ => self.noise.bits() as i32,
        }
    }

    fn axis(&mut self) -> Axis {
        [Axis::SensorCoarse, Axis::SensorFine, Axis::Lens][self.below(3) as usize]
    }

    fn silence(&mut self) -> Micros {
        [Micros(200_000), Micros(60_000_000), Micros(self.number() as u32)][self.below(3) as usize]
    }

    fn codes(&mut self) -> heapless::Vec<i16, 72> {
        let count = self.below(73);
        (0..count).map(|_| self.noise.bits() as i16).collect()
    }

    fn request(&mut self) -> Request {
        let (axis, silence) = (self.axis(), self.silence());
        let small = self.below(256) as u8;
        match self.below(27) {
            0 => Request::Hello,
            25 => Request::OpenSession,
            1 => Request::Status,
            2 => Request::Home { axis, silence },
            3..=5 => Request::Move { axis, target: Nanometres(self.number()), silence },
            6 => Request::Stop,
            7 => {
                let mode = [TriggerMode::Hardware, TriggerMode::Software, TriggerMode::FreeRunning];
                let mut shot =
                    fine_shot(self.number(), self.number() as u32, self.number(), self.number() as u32);
                (shot.axis, shot.repeat) = (axis, self.below(4) as u16);
                shot.mode = mode[self.below(3) as usize];
                Request::LoadShot { index: small % 70, shot }
            }
            8 if small.is_multiple_of(2) => {
                let period = Micros(self.number() as u32);
                Request::RunContinuously { period, exposures: u32::from(small % 3), silence }
            }
            8 => Request::RunProgram { silence },
            9 => Request::ReadEvent { number: self.number() as u32 },
            10 => Request::Halt,
            11 => Request::ArmProgram { shots: small % 70 },
            12 => Request::PauseProgram,
            13 => Request::ResumeProgram,
            14 => {
                let routine = [Routine::Travel { axis }, Routine::Backlash { axis }, Routine::Piezo];
                Request::Calibrate { routine: routine[self.below(3) as usize], silence }
            }
            15 => Request::ReadAlarm { number: self.number() as u32 },
            16 => Request::ClearAlarm { number: self.below(40) as u32 },
            17 => {
                let key = [
                    SettingKey::CoarseBacklashNm,
                    SettingKey::LensSpeedNmPerS,
                    SettingKey::PiezoHysteresisPpm,
                ];
                Request::WriteSetting { key: key[self.below(3) as usize], value: self.number() }
            }
            18 => Request::ReadCounters,
            19 => {
                let deviations = QueryDeviations {
                    day_e3: 0,
                    time_s: self.number() as u32,
                    latitude_e7: 0,
                    longitude_e7: 0,
                    azimuth_e7: self.number() as u32,
                    camera_height_mm: 10,
                    height_mm: self.number() as u32,
                    distance_mm: 10,
                };
                let shadow = ShadowQuery {
                    azimuth_e7: self.number(),
                    camera_height_mm: self.number() as u32,
                    distance_mm: self.number() as u32,
                    lateral_mm: self.number(),
                    height_mm: self.number() as u32,
                    deviations,
                };
                Request::Sun(SunQuery {
                    unix_seconds: self.noise.bits() as i64,
                    latitude_e7: self.number(),
                    longitude_e7: self.number(),
                    shadow: Some(shadow),
                })
            }
            20 => {
                let form = [CorrectionForm::Regions, CorrectionForm::Blend, CorrectionForm::Full];
                Request::OpenCorrection(CorrectionInfo {
                    form: form[self.below(3) as usize],
                    width: [640, 6, 1024, self.number() as u16][self.below(4) as usize],
                    height: [480, 6, self.number() as u16][self.below(3) as usize],
                    centre_um: self.number(),
                    half_span_um: self.number(),
                })
            }
            21 => Request::FitSamples {
                row: self.below(500) as u16,
                first: self.below(700) as u16,
                step: self.below(9) as u16,
                truth: self.noise.bits() as i16,
                codes: self.codes(),
            },
            22 => Request::SolveFit,
            23 => Request::PutRow { first: self.below(1100) as u16, codes: self.codes() },
            24 => Request::CorrectRow { row: self.below(500) as u16 },
            _ => Request::GetRow { first: self.below(1100) as u16, count: small },
        }
    }

    /// Mostly valid frames, some damaged, some garbage.
    fn bytes(&mut self) -> Vec<u8> {
        self.id += 1;
        let request = self.request();
        let mut frame = request_frame(self.id, self.boot, &request);
        match self.below(10) {
            0 => {
                let place = self.below(frame.len() as u64) as usize;
                frame[place] ^= 1 << self.below(8);
            }
            1 => frame.truncate(self.below(frame.len() as u64) as usize),
            2 => {
                let count = self.below(600);
                frame = (0..count).map(|_| self.noise.bits() as u8).collect();
            }
            3 if !self.sent.is_empty() => {
                let place = self.below(self.sent.len() as u64) as usize;
                frame = self.sent[place].clone();
            }
            4 => {
                let burst = (0..30).map(|_| self.below(self.sent.len().max(1) as u64) as usize);
                let places: Vec<usize> = burst.collect();
                frame.extend(places.iter().filter_map(|place| self.sent.get(*place)).flatten());
            }
            _ if self.sent.len() < KEPT => self.sent.push(frame.clone()),
            _ => {
                let place = self.below(KEPT as u64) as usize;
                self.sent[place] = frame.clone();
            }
        }
        frame
    }
}

#[test]
fn nothing_on_the_link_stops_the_board() {
    let mut bench = Bench::new(amount("FARNEAR_SEED", 1));
    let noise = Noise::new(amount("FARNEAR_SEED", 1), "fuzz");
    let mut fuzz = Fuzz { noise, boot: bench.boot, id: 1_000, sent: Vec::new() };
    let frames = amount("FARNEAR_FUZZ_FRAMES", FRAMES);
    let mut sent = 0u64;
    while sent < frames {
        for _ in 0..20 {
            let bytes = fuzz.bytes();
            bench.rig.send(&bytes).expect("runs");
            sent += 1;
            let pause = fuzz.below(3_000);
            bench.rig.advance_us(pause).expect("the emulated board runs");
        }
        // The ends of the travel are not touched, and the board has not restarted.
        let report = bench.report();
        assert_eq!(report.resets, 0, "the board was reset after {sent} frames");
        for stage in [report.coarse, report.lens] {
            assert!((-500.0..13_600.0).contains(&stage.position_um), "{report:?}");
        }
        bench.rig.take_bytes();
    }
    // Ends a broken frame and collects pending answers; then the board answers normally.
    bench.rig.send(&[0]).expect("runs");
    bench.rig.advance_us(20_000).expect("runs");
    bench.rig.take_bytes();
    let hello = bench.say_hello();
    assert_eq!((hello.boot, hello.reset_cause), (fuzz.boot, ResetCause::PowerOn));
    assert_eq!(bench.ask(&Request::Stop), Ok(Response::Accepted));
    bench.rig.advance_us(3_000_000).expect("runs");
    bench.answers();
    if let Some(latched) = bench.alarm() {
        assert_eq!(bench.ask(&Request::ClearAlarm { number: latched.number }), Ok(Response::Accepted));
    }
    let longest = bench.longest_tick();
    let depth = bench.peek(|rig| rig.stack_depth());
    println!("{sent} frames; the longest tick took {longest} instructions; the stack was {depth} bytes deep");
}
