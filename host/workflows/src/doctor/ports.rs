use farnear_capture::transport::ports;

use super::{Finding, Health};

pub(super) fn findings() -> Vec<Finding> {
    let found = ports();
    if found.is_empty() {
        let remedy = "connect the board by its USB socket CN1; the emulated rig needs none (--port sim)";
        return vec![Finding::bad(Health::Optional, "port", "no serial port of a board was found", remedy)];
    }
    found.iter().map(|port| of_port(port)).collect()
}

#[cfg(unix)]
fn of_port(port: &str) -> Finding {
    use std::os::unix::fs::MetadataExt;
    match std::fs::metadata(port) {
        Ok(found) => {
            let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
            let rights = Rights { mode: found.mode(), owner: found.uid(), group: found.gid() };
            match may_open(&rights, &text) {
                Some(false) => {
                    let group = group_name(found.gid());
                    let remedy = format!(
                        "`sudo usermod -aG {group} \"$USER\"`, then log out and in; or a udev rule (docs/bring-up.md)"
                    );
                    Finding::bad(
                        Health::Missing,
                        "port",
                        format!("{port} may be opened by the group {group} only"),
                        remedy,
                    )
                }
                _ => Finding::ok("port", port),
            }
        }
        Err(error) => Finding::bad(
            Health::Missing,
            "port",
            format!("{port}: {error}"),
            "unplug the board and plug it in again",
        ),
    }
}

#[cfg(not(unix))]
fn of_port(port: &str) -> Finding {
    Finding::ok("port", port)
}

#[cfg(unix)]
struct Rights {
    mode: u32,
    owner: u32,
    group: u32,
}

/// Whether this user (`/proc/self/status`) may read and write; `None` if unknown. Opening would reset some boards.
#[cfg(unix)]
fn may_open(rights: &Rights, status: &str) -> Option<bool> {
    let numbers = |name: &str| -> Option<Vec<u32>> {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().map(|number| number.parse().ok()).collect()
    };
    // Real, effective, saved, file system.
    let (user, group) = (*numbers("Uid:")?.get(1)?, *numbers("Gid:")?.get(1)?);
    if user == 0 {
        return Some(true);
    }
    let in_group = group == rights.group || numbers("Groups:")?.contains(&rights.group);
    let shift = if user == rights.owner {
        6
    } else if in_group {
        3
    } else {
        0
    };
    Some(rights.mode >> shift & 0o6 == 0o6)
}

/// A group's name, or its number.
#[cfg(unix)]
fn group_name(number: u32) -> String {
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let text = number.to_string();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == text).then(|| name.to_owned())
    });
    name.unwrap_or(text)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn rights_are_those_of_user_or_group() {
        let status = |user: u32, groups: &str| {
            format!(
                "Name:\tfarnear\nUid:\t{user}\t{user}\t{user}\t{user}\nGid:\t100\t100\t100\t100\nGroups:\t{groups}\n"
            )
        };
        // Debian's rights: root and dialout (20).
        let port = Rights { mode: 0o20660, owner: 0, group: 20 };
        assert_eq!(may_open(&port, &status(1000, "20 44")), Some(true));
        assert_eq!(may_open(&port, &status(1000, "44")), Some(false));
        assert_eq!(may_open(&port, &status(0, "")), Some(true));
        assert_eq!(may_open(&Rights { mode: 0o20666, ..port }, &status(1000, "")), Some(true));
        assert_eq!(
            may_open(&Rights { mode: 0o20640, owner: 0, group: 20 }, &status(1000, "20")),
            Some(false)
        );
        assert_eq!(may_open(&Rights { mode: 0o20660, owner: 0, group: 20 }, ""), None);
        assert_eq!(group_name(0), "root");
    }
}
