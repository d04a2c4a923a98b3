//! A stepper motor with its driver: the field steps exactly, the rotor follows as far as its torque allows.
//!
//! Lengths are microsteps (3200 per turn). `J x'' = T(x') sin(2 pi (field - x) / 64) - D x' - friction`
//! (Acarnley, Stepping Motors, 4th ed. 2002, ch. 4). A rotor that cannot follow loses whole periods (four
//! full steps), 10 um with a 0.5 mm screw.
//!
//! NEMA 17: 0.4 N m holding torque, 54 g cm2 plus the same for coupling and screw, 10 mN m friction. Torque
//! falls with speed: stall at about 11 mm/s. [`Motor::STEP_NS`] is 1/200 of the rotor's period of 4 ms.

pub const MICROSTEPS_PER_TURN: f64 = 3200.0;
/// Microsteps per torque period: four full steps.
const PERIOD: f64 = 64.0;
/// Acceleration at the full holding torque, microsteps/s2: 0.4 N m / 8.4e-6 kg m2.
const HOLDING: f64 = 2.425e7;
/// Acceleration that friction takes, microsteps/s2: 10 mN m.
const FRICTION: f64 = 6.06e5;
/// Viscous damping, 1/s: 0.06 of the critical one.
const DAMPING: f64 = 185.0;
/// Speed at which the torque has fallen to a half, microsteps/s.
const HALF_TORQUE_SPEED: f64 = 60_000.0;

#[derive(Debug)]
pub struct Motor {
    now_ns: u64,
    field: i64,
    rotor: f64,
    speed: f64,
    torque: f64,
    blocked: bool,
    resting: bool,
}

impl Motor {
    pub const STEP_NS: u64 = 20_000;

    pub fn new(microsteps: i64) -> Self {
        Self {
            now_ns: 0,
            field: microsteps,
            rotor: microsteps as f64,
            speed: 0.0,
            torque: 1.0,
            blocked: false,
            resting: true,
        }
    }

    pub fn step(&mut self, away: bool) {
        self.field += if away { 1 } else { -1 };
        self.resting = false;
    }

    pub fn rotor(&self) -> f64 {
        self.rotor
    }

    pub fn field(&self) -> i64 {
        self.field
    }

    /// Available torque (0 to 1): simulates a loose coupling or low current.
    pub fn set_torque(&mut self, share: f64) {
        self.torque = share;
        self.resting = false;
    }

    pub fn reset_sequencer(&mut self) {
        let period = PERIOD as i64;
        self.field = (self.field + period / 2).div_euclid(period) * period;
        self.resting = false;
    }

    pub fn set_blocked(&mut self, blocked: bool) {
        self.blocked = blocked;
        self.resting = false;
    }

    /// Advances the rotor. `moved` receives each position and returns the limit of an end stop that it hits.
    pub fn advance(&mut self, now_ns: u64, mut moved: impl FnMut(f64) -> f64) {
        while self.now_ns < now_ns && !self.resting {
            let step_ns = (now_ns - self.now_ns).min(Self::STEP_NS);
            self.now_ns += step_ns;
            self.solve(step_ns as f64 * 1e-9);
            let held = moved(self.rotor);
            if held != self.rotor {
                self.rotor = held;
                self.speed = 0.0;
            }
        }
        self.now_ns = self.now_ns.max(now_ns);
    }

    fn solve(&mut self, seconds: f64) {
        let angle = core::f64::consts::TAU / PERIOD * (self.field as f64 - self.rotor);
        let torque = self.torque * HOLDING / (1.0 + self.speed.abs() / HALF_TORQUE_SPEED);
        let pull = torque * libm::sin(angle);
        if self.blocked {
            self.speed = 0.0;
            return;
        }
        // Velocity first, then position with the new velocity: keeps an oscillation's energy.
        let pulled = self.speed + seconds * (pull - DAMPING * self.speed);
        let rubbed = seconds * FRICTION;
        self.speed = if pulled.abs() <= rubbed { 0.0 } else { pulled - rubbed.copysign(pulled) };
        self.rotor += seconds * self.speed;
        self.resting = self.speed == 0.0 && pull.abs() <= FRICTION;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(motor: &mut Motor, top: f64, seconds: f64, brakes: bool) {
        let (mut at_s, mut rate) = (motor.now_ns as f64 * 1e-9, 500.0);
        let brake_s = at_s + seconds;
        while at_s < brake_s || (brakes && rate > 500.0) {
            at_s += 1.0 / rate;
            let change = 320_000.0 / rate;
            rate = if at_s < brake_s { (rate + change).min(top) } else { rate - change };
            motor.advance((at_s * 1e9) as u64, |rotor| rotor);
            motor.step(true);
        }
    }

    fn stand(motor: &mut Motor) {
        motor.advance(motor.now_ns + 500_000_000, |rotor| rotor);
    }

    #[test]
    fn follows_at_working_speed_and_stalls_beyond_its_torque() {
        let mut motor = Motor::new(0);
        run(&mut motor, 40_000.0, 0.5, true);
        stand(&mut motor);
        assert!((motor.field() as f64 - motor.rotor()).abs() < 0.3, "nothing is lost, friction holds it");
        run(&mut motor, 40_000.0, 0.5, false);
        let lag = motor.field() as f64 - motor.rotor();
        assert!((1.0..16.0).contains(&lag), "a lag of {lag} microsteps is less than a full step");

        let mut motor = Motor::new(0);
        run(&mut motor, 100_000.0, 1.0, true);
        stand(&mut motor);
        let lost = motor.field() as f64 - motor.rotor();
        assert!(lost > 1000.0, "lost {lost} microsteps");
        let periods = lost / PERIOD;
        assert!((periods - libm::round(periods)).abs() < 0.01, "whole periods are lost, not {periods}");
    }

    #[test]
    fn a_weak_motor_loses_steps_at_working_speed() {
        let mut motor = Motor::new(0);
        motor.set_torque(0.3);
        run(&mut motor, 40_000.0, 0.5, true);
        stand(&mut motor);
        assert!(motor.field() as f64 - motor.rotor() > 1000.0);
    }

    #[test]
    fn a_blocked_rotor_stays_and_snaps_to_the_nearest_pole_when_it_is_freed() {
        let mut motor = Motor::new(0);
        motor.set_blocked(true);
        run(&mut motor, 5_000.0, 0.1, false);
        let field = motor.field();
        assert_eq!(motor.rotor(), 0.0);
        motor.set_blocked(false);
        stand(&mut motor);
        let nearest = libm::round(field as f64 / PERIOD) * PERIOD;
        assert!((motor.rotor() - (field as f64 - nearest)).abs() < PERIOD / 2.0 + 0.3);
        assert!(motor.resting);
    }
}
