//! Alarms, settings and counters of the scripted board.

use farnear_protocol::{
    Request, RequestError, Response,
    message::{Alarm, CorrectionFault, EventKind, Failure, ResetCause, Setting, SettingKey},
};

use crate::Board;

impl Board {
    pub(super) fn keep(&mut self, id: u32, request: Request) {
        let answer = match request {
            Request::Halt => {
                self.halts += 1;
                let number = self.raise(Alarm::Halt);
                if let Some((request, _)) = self.active.take() {
                    let reason = Failure::Alarm { number };
                    self.event(EventKind::Failed { request, axis: None, reason });
                }
                Ok(Response::Accepted)
            }
            Request::ReadAlarm { number } => {
                let found = match number {
                    0 => self.alarms.last(),
                    number => self.alarms.iter().find(|record| record.number == number),
                };
                found.map(|record| Response::Alarm(*record)).ok_or_else(|| self.no_such_alarm())
            }
            Request::ClearAlarm { number } => match self.alarms.last() {
                Some(last) if self.latched && last.number == number && self.emergency_stop => {
                    Err(RequestError::AlarmRemains { alarm: last.alarm })
                }
                Some(last) if self.latched && last.number == number => {
                    self.latched = false;
                    self.event(EventKind::AlarmCleared { number });
                    Ok(Response::Accepted)
                }
                _ => Err(self.no_such_alarm()),
            },
            Request::ReadSetting { key } => Ok(Response::Setting(self.setting(key))),
            Request::WriteSetting { key, value } => {
                let setting = self.setting(key);
                if (setting.min..=setting.max).contains(&value) {
                    self.settings.insert(key.name(), value);
                    Ok(Response::Setting(self.setting(key)))
                } else {
                    Err(RequestError::SettingRange(setting))
                }
            }
            Request::ReadCounters
                if self.faults.no_counters_after_reset && self.hello.reset_cause == ResetCause::Software =>
            {
                Err(RequestError::Malformed)
            }
            Request::ReadCounters => Ok(Response::Counters(self.counters)),
            _ => Err(RequestError::Correction(CorrectionFault::None)),
        };
        self.answer(id, answer);
    }

    fn no_such_alarm(&self) -> RequestError {
        let last = self.alarms.len() as u32;
        RequestError::NoSuchAlarm { latched: if self.latched { last } else { 0 }, last }
    }

    fn setting(&self, key: SettingKey) -> Setting {
        let default = 1_000;
        let value = self.settings.get(key.name()).copied().unwrap_or(default);
        Setting { key, value, default, min: 0, max: 20_000_000 }
    }
}
