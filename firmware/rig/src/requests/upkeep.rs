//! Requests about alarms, settings and events.

use farnear_protocol::BoardMicros;
use farnear_protocol::message::{Alarm, EventKind, LinkRate, RecordName, RequestError, Response, SettingKey};

use super::Answer;
use crate::motion::axis::Stepper;
use crate::notes::Note;
use crate::rig::Rig;
use crate::settings::Settings;

impl Rig {
    pub(super) fn clear_alarm(&mut self, number: u32, now: BoardMicros) -> Answer {
        let (stage, emergency_stop, supply_low) = (&self.stage, self.emergency_stop, self.supply_low);
        self.alarms.clear(number, |alarm| match alarm {
            Alarm::EmergencyStop => emergency_stop,
            Alarm::SupplyLow => supply_low,
            Alarm::DriverFault { axis } => stage.stepper(*axis).is_some_and(Stepper::driver_fault),
            _ => false,
        })?;
        self.store.mark(RecordName::Alarms);
        self.events.push(now, EventKind::AlarmCleared { number });
        self.notes.add(Note::AlarmCleared { number });
        Ok(Response::Accepted)
    }

    pub(super) fn set_link_rate(&mut self, rate: LinkRate, now: BoardMicros) -> Answer {
        self.all_must_be_free()?;
        self.link_speed.ask(rate, now);
        Ok(Response::Accepted)
    }

    pub(super) fn write_setting(&mut self, key: SettingKey, value: i32) -> Answer {
        self.all_must_be_free()?;
        self.values.set(key, value).map_err(RequestError::SettingRange)?;
        self.apply_settings();
        Ok(Response::Setting(self.values.setting(key)))
    }

    pub(crate) fn apply_settings(&mut self) {
        // Homing finds position 0 with these.
        let used = |Settings { coarse, fine, lens, .. }: &Settings| {
            ((coarse.backlash, fine.gauge_gain_ppm, fine.gauge_offset), lens.backlash)
        };
        let (coarse, lens) = used(&self.settings);
        self.settings = self.parts.with(&self.values);
        self.stage.apply(&self.settings);
        let (coarse_now, lens_now) = used(&self.settings);
        if coarse_now != coarse {
            self.stage.coarse.lose();
        }
        if lens_now != lens {
            self.stage.lens.lose();
        }
        self.camera.apply(self.settings.camera);
        self.shots.arm(0); // it was checked with other numbers
        self.store.mark(RecordName::Settings);
    }

    pub(super) fn read_event(&self, number: u32) -> Answer {
        match self.events.get(number) {
            Some(event) => Ok(Response::Event(event.clone())),
            None => {
                Err(RequestError::EventGone { oldest: self.events.oldest(), next: self.events.next_number() })
            }
        }
    }
}
