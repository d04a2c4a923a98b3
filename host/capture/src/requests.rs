//! Requests without long work: stop, alarms, settings, counters, sun.

use std::time::Duration;

use farnear_protocol::{
    Request, RequestError, Response,
    message::{AlarmRecord, Axis, Counters, LightLevels, Setting, SettingKey, SunAnswer, SunQuery},
    units::Micros,
};

use crate::{
    client::{Client, Known},
    error::ClientError,
    owner::nonsense,
    timing::BRAKING,
};

const RESTART: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_millis(10);

impl Client {
    /// Stops along the ramps and ends a program; positions remain valid.
    pub fn stop(&self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::Stop, "stopping")
    }

    /// Waits for all axes to brake to rest. Returns [`ClientError::Overdue`] after longer than any ramp.
    pub fn wait_until_it_stands(&self) -> Result<(), ClientError> {
        let allowed = self.timing().allowance(BRAKING);
        let until = std::time::Instant::now() + allowed;
        loop {
            let status = self.status()?;
            if !Axis::ALL.iter().any(|axis| status.axis(*axis).moving) {
                return Ok(());
            }
            if std::time::Instant::now() >= until {
                return Err(ClientError::Overdue { during: "braking".into(), allowed });
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Repeats what the board refuses because of work that no handle has: its program has ended, or its start was not
    /// answered. That work is stopped first.
    pub(crate) fn after_lost_work<T>(
        &self,
        act: impl Fn() -> Result<T, ClientError>,
    ) -> Result<T, ClientError> {
        let error = match act() {
            Err(error) => error,
            done => return done,
        };
        let is_busy = matches!(error, ClientError::Refused { error: RequestError::Busy { .. }, .. });
        // A stop would end the work of all handles.
        if !is_busy || self.has_work() {
            return Err(error);
        }
        self.stop()?;
        self.wait_until_it_stands()?;
        act()
    }

    /// Switches both light outputs for `time`, at most 60 s. `Client::keep_alive` without a request ends it.
    pub fn set_lights(&self, levels: LightLevels, time: Micros) -> Result<(), ClientError> {
        let request = Request::SetLights { levels, time, silence: self.keep_alive() };
        self.expect_accepted(&request, "switching the light")
    }

    /// Emergency stop: steps end within a millisecond, moving axes lose their position. Latches an alarm.
    pub fn halt(&self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::Halt, "halting")
    }

    /// Resets the board and says hello again. Returns [`ClientError::Overdue`] if it does not return.
    pub fn reboot(&mut self) -> Result<(), ClientError> {
        let before = self.hello().boot;
        match self.expect_accepted(&Request::Reboot, "rebooting") {
            // The answer was lost and a repeat met the next boot: it has rebooted.
            Ok(()) | Err(ClientError::Reset { .. }) => {}
            Err(error) => return Err(error),
        }
        let allowed = self.timing().allowance(BRAKING + RESTART);
        let until = std::time::Instant::now() + allowed;
        loop {
            self.reopen_within(until.saturating_duration_since(std::time::Instant::now()))?;
            if self.hello().boot != before {
                return Ok(());
            }
            if std::time::Instant::now() >= until {
                return Err(ClientError::Overdue { during: "rebooting".into(), allowed });
            }
        }
    }

    /// Reads a stored alarm; 0 = the last.
    pub fn alarm(&self, number: u32) -> Result<AlarmRecord, ClientError> {
        let during = "reading an alarm";
        match self.request(&Request::ReadAlarm { number }, during)? {
            (_, Response::Alarm(record)) => Ok(record),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// Stored alarms, newest first.
    pub fn alarms(&self) -> Result<Vec<AlarmRecord>, ClientError> {
        let mut alarms = Vec::new();
        let mut number = 0;
        loop {
            match self.alarm(number) {
                Ok(record) => {
                    number = record.number.saturating_sub(1);
                    alarms.push(record);
                }
                Err(ClientError::Refused { error: RequestError::NoSuchAlarm { .. }, .. }) => {
                    return Ok(alarms);
                }
                Err(error) => return Err(error),
            }
            if number == 0 {
                return Ok(alarms);
            }
        }
    }

    /// Clears the latched alarm with this number; rejected while its cause persists.
    pub fn clear_alarm(&self, number: u32) -> Result<(), ClientError> {
        self.expect_accepted(&Request::ClearAlarm { number }, &format!("clearing alarm {number}"))
    }

    pub fn setting(&self, key: SettingKey) -> Result<Setting, ClientError> {
        self.setting_by(&Request::ReadSetting { key }, &format!("reading {}", key.name()))
    }

    /// Changes a setting permanently. [`Client::reopen`] updates derived limits. Rejected out of range or in motion.
    pub fn set_setting(&self, key: SettingKey, value: i32) -> Result<Setting, ClientError> {
        *self.known() = Known::default();
        let during = format!("setting {} to {value}", key.name());
        self.setting_by(&Request::WriteSetting { key, value }, &during)
    }

    fn setting_by(&self, request: &Request, during: &str) -> Result<Setting, ClientError> {
        match self.request(request, during)? {
            (_, Response::Setting(setting)) => Ok(setting),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    pub fn counters(&self) -> Result<Counters, ClientError> {
        let during = "reading the counters";
        match self.request(&Request::ReadCounters, during)? {
            (_, Response::Counters(counters)) => Ok(counters),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// Sun and shadow calculated by the board; rejected while a stepper moves.
    pub fn sun(&self, query: &SunQuery) -> Result<SunAnswer, ClientError> {
        let during = "asking for the sun";
        match self.request(&Request::Sun(*query), during)? {
            (_, Response::Sun(answer)) => Ok(answer),
            (_, other) => Err(nonsense(during, &other)),
        }
    }
}
