//! Alarms: latched, numbered over the board's life, stored, cleared by number. A latched cause raises no second alarm.
//! The host reads the oldest first, usually the cause. The last eight are stored; with eight latched, no more are.

use farnear_protocol::BoardMicros;
use farnear_protocol::message::{Alarm, AlarmRecord, Axis, Failure, RequestError};

pub(crate) const RETAINED: usize = 8;

#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Alarms {
    count: u32,
    latched: u8,
    /// Alarm `n` is at index `n % RETAINED`.
    kept: [Option<AlarmRecord>; RETAINED],
}

impl Alarms {
    pub(crate) const fn new() -> Self {
        Self { count: 0, latched: 0, kept: [None; RETAINED] }
    }

    /// Restores stored alarms; inconsistent ones are dropped.
    pub(crate) fn restored(count: u32, latched: u8, records: impl Iterator<Item = AlarmRecord>) -> Self {
        let mut alarms = Self { count, latched: 0, kept: [None; RETAINED] };
        for record in records {
            let recent = record.number <= count && count - record.number < RETAINED as u32;
            if recent && record.number > 0 {
                alarms.kept[record.number as usize % RETAINED] = Some(record);
            }
        }
        let known = (0..u32::from(latched).min(RETAINED as u32))
            .take_while(|ago| alarms.read(count.wrapping_sub(*ago)).is_ok_and(|record| record.number > 0))
            .count();
        alarms.latched = known as u8; // at most RETAINED
        alarms
    }

    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    pub(crate) const fn latched_count(&self) -> u8 {
        self.latched
    }

    pub(crate) const fn kept(&self) -> &[Option<AlarmRecord>; RETAINED] {
        &self.kept
    }

    pub(crate) fn latched(&self) -> Option<&AlarmRecord> {
        let oldest = self.count.checked_sub(u32::from(self.latched.checked_sub(1)?))?;
        self.kept[oldest as usize % RETAINED].as_ref()
    }

    /// Latches an alarm; `None` if an equal one is latched.
    pub(crate) fn raise(&mut self, alarm: Alarm, boot: u32, time: BoardMicros) -> Option<AlarmRecord> {
        let full = usize::from(self.latched) == RETAINED;
        let number = self.count.checked_add(1)?;
        if full || self.each_latched().any(|record| is_like(&record.alarm, &alarm)) {
            return None;
        }
        let record = AlarmRecord { number, boot, time, alarm };
        self.count = number;
        self.latched += 1;
        self.kept[number as usize % RETAINED] = Some(record);
        Some(record)
    }

    fn each_latched(&self) -> impl Iterator<Item = &AlarmRecord> {
        let latched = u32::from(self.latched);
        (0..latched).filter_map(|ago| self.kept[self.count.wrapping_sub(ago) as usize % RETAINED].as_ref())
    }

    /// Reads a stored alarm; 0 = the last.
    pub(crate) fn read(&self, number: u32) -> Result<AlarmRecord, RequestError> {
        let number = if number == 0 { self.count } else { number };
        let kept = self.kept[number as usize % RETAINED].filter(|record| record.number == number);
        kept.ok_or_else(|| self.unknown())
    }

    /// Clears the latched alarm unless its cause persists.
    pub(crate) fn clear(
        &mut self,
        number: u32,
        remains: impl FnOnce(&Alarm) -> bool,
    ) -> Result<(), RequestError> {
        match self.latched() {
            Some(latched) if latched.number == number => {
                if remains(&latched.alarm) {
                    return Err(RequestError::AlarmRemains { alarm: latched.alarm });
                }
                self.latched -= 1;
                Ok(())
            }
            _ => Err(self.unknown()),
        }
    }

    fn unknown(&self) -> RequestError {
        RequestError::NoSuchAlarm {
            latched: self.latched().map_or(0, |record| record.number),
            last: self.count,
        }
    }
}

/// Same cause, possibly with other values.
fn is_like(one: &Alarm, other: &Alarm) -> bool {
    use Alarm::{Following, HostSilence};
    match (one, other) {
        (Following { axis, .. }, Following { axis: of_other, .. }) => axis == of_other,
        (HostSilence { .. }, HostSilence { .. }) => true,
        _ => one == other,
    }
}

/// Alarm for a stepper's fault; `None` if only the work fails.
pub(crate) const fn of_fault(axis: Axis, fault: Failure) -> Option<Alarm> {
    match fault {
        Failure::Following { error } => Some(Alarm::Following { axis, error }),
        Failure::DriverFault => Some(Alarm::DriverFault { axis }),
        Failure::StepUnderrun => Some(Alarm::StepUnderrun { axis }),
        Failure::FarSwitch => Some(Alarm::UnexpectedSwitch { axis, far: true }),
        Failure::HomeSwitch => Some(Alarm::UnexpectedSwitch { axis, far: false }),
        _ => None,
    }
}

/// Axis of an alarm and the failure of its work; other work fails with the alarm's number.
pub(crate) const fn as_failure(alarm: &Alarm) -> Option<(Axis, Failure)> {
    match *alarm {
        Alarm::Following { axis, error } => Some((axis, Failure::Following { error })),
        Alarm::DriverFault { axis } => Some((axis, Failure::DriverFault)),
        Alarm::StepUnderrun { axis } => Some((axis, Failure::StepUnderrun)),
        Alarm::UnexpectedSwitch { axis, far: true } => Some((axis, Failure::FarSwitch)),
        Alarm::UnexpectedSwitch { axis, far: false } => Some((axis, Failure::HomeSwitch)),
        Alarm::Gauge => Some((Axis::SensorFine, Failure::Gauge)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::Nanometres;
    use proptest::prelude::*;

    const STOP: Alarm = Alarm::EmergencyStop;

    fn raise(alarms: &mut Alarms, alarm: Alarm) -> Option<u32> {
        alarms.raise(alarm, 3, BoardMicros(5)).map(|record| record.number)
    }

    #[test]
    fn the_first_is_seen_first_and_each_is_cleared_by_its_number() {
        let mut alarms = Alarms::new();
        assert_eq!(alarms.latched(), None);
        let unknown = RequestError::NoSuchAlarm { latched: 0, last: 0 };
        assert_eq!(alarms.read(0), Err(unknown.clone()));
        assert_eq!(alarms.clear(0, |_| false), Err(unknown));
        assert_eq!(raise(&mut alarms, STOP), Some(1));
        assert_eq!(raise(&mut alarms, STOP), None, "its like is latched");
        assert_eq!(raise(&mut alarms, Alarm::Halt), Some(2));
        assert_eq!(alarms.latched().map(|record| record.alarm), Some(STOP));
        let wrong = RequestError::NoSuchAlarm { latched: 1, last: 2 };
        assert_eq!(alarms.clear(2, |_| false), Err(wrong), "not the one that is seen");
        assert_eq!(alarms.clear(1, |_| true), Err(RequestError::AlarmRemains { alarm: STOP }));
        assert_eq!(alarms.clear(1, |_| false), Ok(()));
        assert_eq!(alarms.latched().map(|record| record.number), Some(2));
        assert_eq!(alarms.clear(2, |_| false), Ok(()));
        assert_eq!((alarms.latched(), alarms.read(0).map(|record| record.alarm)), (None, Ok(Alarm::Halt)));
        assert_eq!(raise(&mut alarms, STOP), Some(3));
    }

    fn any_alarm() -> impl Strategy<Value = Alarm> {
        let axis = || prop_oneof![Just(Axis::SensorCoarse), Just(Axis::Lens)];
        prop_oneof![
            Just(Alarm::EmergencyStop),
            Just(Alarm::Halt),
            Just(Alarm::Gauge),
            Just(Alarm::SupplyLow),
            Just(Alarm::QueueOverflow),
            any::<u32>().prop_map(|request| Alarm::HostSilence { request }),
            axis().prop_map(|axis| Alarm::DriverFault { axis }),
            axis().prop_map(|axis| Alarm::StepUnderrun { axis }),
            (axis(), any::<bool>()).prop_map(|(axis, far)| Alarm::UnexpectedSwitch { axis, far }),
            (axis(), any::<i32>()).prop_map(|(axis, nm)| Alarm::Following { axis, error: Nanometres(nm) }),
        ]
    }

    proptest! {
        #[test]
        fn no_sequence_loses_a_latched_alarm(
            steps in prop::collection::vec((any_alarm(), prop::option::weighted(0.4, 0u32..20)), 0..60)) {
            let mut alarms = Alarms::new();
            let mut model: std::vec::Vec<AlarmRecord> = std::vec::Vec::new();
            for (alarm, clear) in steps {
                match clear {
                    None => model.extend(alarms.raise(alarm, 1, BoardMicros(0))),
                    Some(number) => {
                        let first = model.first().is_some_and(|record| record.number == number);
                        prop_assert_eq!(alarms.clear(number, |_| false).is_ok(), first);
                        if first {
                            model.remove(0);
                        }
                    }
                }
                prop_assert_eq!(alarms.latched(), model.first());
                prop_assert!(model.len() <= RETAINED);
                for record in &model {
                    prop_assert_eq!(alarms.read(record.number), Ok(*record), "what is latched can be read");
                }
                let records = alarms.kept().iter().flatten().copied();
                let restored = Alarms::restored(alarms.count(), alarms.latched_count(), records);
                prop_assert_eq!(&restored, &alarms, "the memory brings it back");
            }
        }
    }

    #[test]
    fn the_same_cause_with_other_values_is_not_latched_twice() {
        let following = |axis, nm| Alarm::Following { axis, error: Nanometres(nm) };
        let mut alarms = Alarms::new();
        assert_eq!(raise(&mut alarms, following(Axis::Lens, 9_000)), Some(1));
        assert_eq!(raise(&mut alarms, following(Axis::Lens, -7_000)), None);
        assert_eq!(raise(&mut alarms, following(Axis::SensorCoarse, 9_000)), Some(2));
        assert_eq!(raise(&mut alarms, Alarm::HostSilence { request: 4 }), Some(3));
        assert_eq!(raise(&mut alarms, Alarm::HostSilence { request: 5 }), None);
        assert_eq!(raise(&mut alarms, Alarm::DriverFault { axis: Axis::Lens }), Some(4));
        assert_eq!(raise(&mut alarms, Alarm::DriverFault { axis: Axis::SensorCoarse }), Some(5));
    }

    #[test]
    fn stored_alarms_without_a_number_and_those_before_the_last_eight_are_dropped() {
        let record = |number| AlarmRecord { number, boot: 3, time: BoardMicros(5), alarm: STOP };
        let restored = Alarms::restored(9, 1, [record(9), record(2), record(1), record(10)].into_iter());
        let kept: std::vec::Vec<u32> = restored.kept().iter().flatten().map(|record| record.number).collect();
        assert_eq!(kept, [9, 2]);
        assert_eq!(restored.latched(), Some(&record(9)));
        assert_eq!(Alarms::restored(3, 0, [record(0)].into_iter()).kept(), &[None; RETAINED]);
    }
}
