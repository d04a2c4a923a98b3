//! Replays a run from its VCD trace with the same rig, bytes and faults, and compares line by line.

use std::{collections::VecDeque, path::Path};

use rigless::chip::fram::SIZE;

use crate::{
    command::{CameraOrder, Outlets},
    config::{Pace, RigConfig},
    error::SimError,
    rig::launch,
    scenario::Scenario,
    trace::vcd::{END_OF_HEADING, MADE_OF, name_of, unhex},
};

#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Entry {
    Sent(Vec<u8>),
    Ordered(CameraOrder),
    Healed,
    /// The emulator stopped because a requested time ended.
    Looked {
        asked_ns: u64,
    },
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Departure {
    pub at_ns: u64,
    /// Line of the trace, from 1.
    pub line: usize,
    pub signal: &'static str,
    /// Recorded line; `None` after its end.
    pub recorded: Option<String>,
    /// Replayed line; `None` if the run ended early.
    pub now: Option<String>,
}

#[derive(Clone, Debug, Default)]
pub struct Comparer {
    lines: VecDeque<String>,
    line: usize,
    at_ns: u64,
    departure: std::sync::Arc<std::sync::Mutex<Option<Departure>>>,
}

impl Comparer {
    pub fn hold(&mut self, line: &str) {
        let recorded = self.lines.pop_front();
        self.line += 1;
        if recorded.as_deref() != Some(line) {
            self.depart(recorded, Some(line.into()));
        }
        if let Some(at_ns) = line.strip_prefix('#').and_then(|at_ns| at_ns.parse().ok()) {
            self.at_ns = at_ns;
        }
    }

    pub fn end(&mut self) {
        if let Some(recorded) = self.lines.pop_front() {
            self.line += 1;
            self.depart(Some(recorded), None);
        }
    }

    pub fn departs(&self) -> bool {
        self.first().is_some()
    }

    fn first(&self) -> Option<Departure> {
        self.departure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    fn depart(&self, recorded: Option<String>, now: Option<String>) {
        let line = recorded.as_ref().or(now.as_ref());
        let signal = line.and_then(|line| line.chars().next_back()).map_or("?", name_of);
        let departure = Departure { at_ns: self.at_ns, line: self.line, signal, recorded, now };
        self.departure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(departure);
    }
}

#[derive(Debug)]
pub struct Script {
    pub firmware: u64,
    pub memory: Option<Box<[u8; SIZE]>>,
    pub comparer: Comparer,
    entries: VecDeque<(u64, Entry)>,
    end_ns: u64,
}

impl Script {
    pub fn take_due(&mut self, now_ns: u64) -> Option<Entry> {
        let (_, entry) = self.entries.pop_front_if(|(at_ns, _)| *at_ns <= now_ns)?;
        Some(entry)
    }

    /// Time of the next action; `None` at the end of the trace.
    pub fn next_ns(&self, now_ns: u64) -> Option<u64> {
        let next_ns = self.entries.front().map_or(u64::MAX, |(at_ns, _)| *at_ns);
        (now_ns < self.end_ns).then_some(next_ns.min(self.end_ns))
    }
}

fn words<'a>(heading: &'a str, prefix: &str) -> Result<&'a str, String> {
    let rest = heading.split_once(prefix).map(|(_, rest)| rest);
    let text = rest.and_then(|rest| rest.split_once("$end")).map(|(text, _)| text.trim());
    text.ok_or_else(|| format!("it has no line \"{prefix}...\": a VCD that farnear-sim wrote is expected"))
}

fn comment(text: &str) -> Result<Option<Entry>, String> {
    let words: Vec<&str> = text.split(' ').collect();
    let number = |place: usize| words.get(place).and_then(|word| word.parse::<u64>().ok());
    let order = match words.first().copied() {
        Some("look") => return Ok(number(1).map(|asked_ns| Entry::Looked { asked_ns })),
        Some("heal") => return Ok(Some(Entry::Healed)),
        Some("touched") => {
            return Err("a test accessed that rig directly, which a trace cannot replay".into());
        }
        Some("expose") => number(1).zip(number(2)).map(|(exposure_us, id)| CameraOrder::Expose {
            exposure_us,
            id: id as u32, // written from such a number
        }),
        Some("free-run") => number(1)
            .zip(number(2))
            .map(|(period_us, exposure_us)| CameraOrder::FreeRun { period_us, exposure_us }),
        _ => None,
    };
    Ok(order.map(Entry::Ordered))
}

fn parse(text: &str) -> Result<(RigConfig, Script), String> {
    // A killed rig leaves a part of a line: the run is replayed up to the last complete time.
    let complete = if text.ends_with('\n') { None } else { text.rfind("\n#") };
    let text = complete.map_or(text, |end| &text[..=end]);
    let (heading, body) = text
        .split_once(END_OF_HEADING)
        .ok_or_else(|| format!("it has no {END_OF_HEADING}: a VCD that farnear-sim wrote is expected"))?;
    let [firmware, pace, memory, scenario] = MADE_OF;
    let firmware = words(heading, firmware)?;
    let firmware =
        u64::from_str_radix(firmware, 16).map_err(|_| format!("firmware {firmware:?} is not a number"))?;
    let memory = match words(heading, memory)? {
        "" => None,
        hex => {
            let bytes = unhex(hex).and_then(|bytes| bytes.into_boxed_slice().try_into().ok());
            Some(bytes.ok_or("the memory has the wrong size")?)
        }
    };
    let scenario = Scenario::parse(words(heading, scenario)?)?;
    let mut config = RigConfig::of(&scenario)?;
    config.pace = if words(heading, pace)? == "paced" { Pace::Realtime } else { Pace::OnRequest };
    let (mut entries, mut at_ns) = (VecDeque::new(), 0);
    let first = heading.lines().count() + 2; // behind the line that ends the heading
    let lines: VecDeque<String> = body.lines().skip(1).map(Into::into).collect();
    for (line, number) in lines.iter().zip(first..) {
        let wrong = |what: &str| format!("line {number}: {what}: {line:?}");
        if let Some(time) = line.strip_prefix('#') {
            at_ns = time.parse().map_err(|_| wrong("a time is expected"))?;
        } else if let Some(hex) = line.strip_prefix('s').and_then(|line| line.strip_suffix(" i")) {
            let bytes = unhex(hex).ok_or_else(|| wrong("bytes in hexadecimal are expected"))?;
            entries.push_back((at_ns, Entry::Sent(bytes)));
        } else if let Some(text) = line.strip_prefix("$comment ") {
            let entry = comment(text.trim_end_matches(" $end")).map_err(|what| wrong(&what))?;
            entries.extend(entry.map(|entry| match entry {
                Entry::Looked { asked_ns } => (asked_ns, entry),
                _ => (at_ns, entry),
            }));
        }
    }
    let comparer = Comparer { lines, line: first - 1, ..Comparer::default() };
    Ok((config, Script { firmware, memory, comparer, entries, end_ns: at_ns }))
}

/// Returns the length in virtual ns and the first difference.
pub fn replay(path: &Path, firmware: Option<&Path>) -> Result<(u64, Option<Departure>), SimError> {
    let wrong = |reason: String| SimError::Replay { path: path.into(), reason };
    let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    let (config, script) = parse(&text).map_err(wrong)?;
    let config = RigConfig { firmware: firmware.map(Into::into), ..config };
    let (end_ns, comparer) = (script.end_ns, script.comparer.clone());
    let (shots, _) = std::sync::mpsc::channel();
    let outlets = Outlets { bytes: None, another_port: None, shots, pictures: None };
    // The board's bytes are dropped, as with an unplugged port.
    let (_commands, thread) = launch(&config, outlets, Some(script))?;
    thread.join().unwrap_or_else(|_| Err(SimError::Emulator("it panicked".into())))?;
    Ok((end_ns, comparer.first()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_an_invalid_trace_with_its_line() {
        let heading = format!(
            "$comment firmware 00ff $end\n$comment pace lockstep $end\n$comment memory  $end\n\
             $comment scenario \nseed = 3\n$end\n{END_OF_HEADING}\n"
        );
        let refused = |text: &str, expected: &str| {
            let reason = parse(text).expect_err(text);
            assert!(reason.contains(expected), "{reason}");
        };
        refused("time_us,event", "a VCD that farnear-sim wrote");
        refused(&heading.replace("firmware", "software"), "$comment firmware");
        refused(&(heading.clone() + "#x\n"), "line 8: a time is expected: \"#x\"");
        refused(&(heading.clone() + "#7\nsa i\n"), "line 9: bytes");
        refused(&(heading.clone() + "#7\n$comment touched $end\n"), "line 9: a test accessed");
        let text = heading + "#7\ns00ff i\n#9\n$comment expose 20 3 $end\n$comment look 8 $end\n";
        let (config, script) = parse(&text).expect("a good trace");
        assert_eq!((config.seed, script.firmware, script.end_ns), (3, 255, 9));
        let order = Entry::Ordered(CameraOrder::Expose { exposure_us: 20, id: 3 });
        assert_eq!(
            script.entries,
            [(7, Entry::Sent(vec![0, 255])), (9, order), (8, Entry::Looked { asked_ns: 8 })]
        );
        for cut in ["$end\n", "\n"] {
            let (_, script) = parse(text.trim_end_matches(cut)).expect("a trace of a killed rig");
            assert_eq!((script.end_ns, script.entries.len()), (7, 1), "{cut:?} is missing");
        }
    }
}
