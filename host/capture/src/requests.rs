//! What is asked and answered at once: stopping, alarms, settings, counters, the sun.

use std::time::Duration;

use farnear_protocol::{
    Request, RequestError, Response,
    message::{AlarmRecord, Axis, Counters, LightLevels, Setting, SettingKey, SunAnswer, SunQuery},
    units::Micros,
};

use crate::{client::Client, error::ClientError, owner::nonsense};

/// Longest wait for a reset board to answer again.
const RESTART: Duration = Duration::from_secs(5);
/// Longest a healthy stepper brakes, also from the fastest that settings allow.
const BRAKING: Duration = Duration::from_secs(3);
/// From one look whether the rig stands to the next.
const LOOK: Duration = Duration::from_millis(10);

impl Client {
    /// Stops all motion along the ramps and ends a running program; positions stay known.
    pub fn stop(&self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::Stop, "stopping")
    }

    /// Waits until no axis moves any more: after a stop steppers brake along their ramps.
    ///
    /// # Errors
    /// [`ClientError`]; [`ClientError::Overdue`] where something still moves after longer than any ramp takes.
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

    /// Switches both light outputs for `time`, at most 60 s. They go off earlier after [`Client::keep_alive`] without a request.
    pub fn set_lights(&self, levels: LightLevels, time: Micros) -> Result<(), ClientError> {
        let request = Request::SetLights { levels, time, silence: self.keep_alive() };
        self.expect_accepted(&request, "switching the light")
    }

    /// Emergency stop: the last step comes within a millisecond, what moved has lost its position, and the alarm has to
    /// be cleared.
    pub fn halt(&self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::Halt, "halting")
    }

    /// Resets the board and says hello to it again.
    ///
    /// # Errors
    /// [`ClientError`]; [`ClientError::Overdue`] where it does not come back.
    pub fn reboot(&mut self) -> Result<(), ClientError> {
        let before = self.hello().boot;
        match self.expect_accepted(&Request::Reboot, "rebooting") {
            // The answer was lost and a retry met the next boot: it has rebooted.
            Ok(()) | Err(ClientError::Reset { .. }) => {}
            Err(error) => return Err(error),
        }
        let allowed = self.timing().allowance(RESTART);
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

    /// The alarm of this number; 0 = the last.
    ///
    /// # Errors
    /// [`ClientError`]; refused with `NoSuchAlarm` where it is not kept.
    pub fn alarm(&self, number: u32) -> Result<AlarmRecord, ClientError> {
        let during = "reading an alarm";
        match self.request(&Request::ReadAlarm { number }, during)? {
            (_, Response::Alarm(record)) => Ok(record),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// The alarms that the board keeps, the last one first.
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

    /// Clears the latched alarm of this number.
    ///
    /// # Errors
    /// [`ClientError`]; refused while its cause is there.
    pub fn clear_alarm(&self, number: u32) -> Result<(), ClientError> {
        self.expect_accepted(&Request::ClearAlarm { number }, &format!("clearing alarm {number}"))
    }

    /// A setting and what it may be.
    pub fn setting(&self, key: SettingKey) -> Result<Setting, ClientError> {
        self.setting_by(&Request::ReadSetting { key }, &format!("reading {}", key.name()))
    }

    /// Changes a setting, now and for later boots. Limits that this client has read in the hello message change with it:
    /// [`Client::reopen`] reads them again.
    ///
    /// # Errors
    /// [`ClientError`]; refused outside the allowed range and while anything moves.
    pub fn set_setting(&self, key: SettingKey, value: i32) -> Result<Setting, ClientError> {
        self.paces().clear();
        let during = format!("setting {} to {value}", key.name());
        self.setting_by(&Request::WriteSetting { key, value }, &during)
    }

    fn setting_by(&self, request: &Request, during: &str) -> Result<Setting, ClientError> {
        match self.request(request, during)? {
            (_, Response::Setting(setting)) => Ok(setting),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// What the board has counted in its life.
    pub fn counters(&self) -> Result<Counters, ClientError> {
        let during = "reading the counters";
        match self.request(&Request::ReadCounters, during)? {
            (_, Response::Counters(counters)) => Ok(counters),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// Where the sun is, and how a subject's shadow lies, as the board calculates it.
    ///
    /// # Errors
    /// [`ClientError`]; refused while a stepper moves.
    pub fn sun(&self, query: &SunQuery) -> Result<SunAnswer, ClientError> {
        let during = "asking for the sun";
        match self.request(&Request::Sun(*query), during)? {
            (_, Response::Sun(answer)) => Ok(answer),
            (_, other) => Err(nonsense(during, &other)),
        }
    }
}
