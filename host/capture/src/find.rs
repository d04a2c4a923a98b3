use std::path::Path;

use serialport::{SerialPortInfo, SerialPortType};

use crate::error::PortError;

/// USB vendor id of STMicroelectronics.
const ST: u16 = 0x0483;
/// ST-LINKs with a serial port: V2-1 and V3, with and without disk and second port.
const ST_LINKS: [u16; 7] = [0x374b, 0x374e, 0x374f, 0x3752, 0x3753, 0x3754, 0x3757];

/// The port of the only ST-LINK (on every NUCLEO), or an error. Sends nothing, as there may be other instruments.
pub fn board_port() -> Result<String, PortError> {
    only(&present())
}

/// Serial ports of this computer; empty if unknown.
pub(crate) fn present() -> Vec<SerialPortInfo> {
    // On Linux the listing panics without this folder, as in some containers.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    serialport::available_ports().unwrap_or_default()
}

fn only(present: &[SerialPortInfo]) -> Result<String, PortError> {
    let names: Vec<String> = present.iter().map(|port| port.port_name.clone()).collect();
    let boards = present.iter().filter(|port| is_board(port) && !is_call_in(port, present));
    let mut boards: Vec<String> = boards.map(|port| port.port_name.clone()).collect();
    match boards.as_mut_slice() {
        [] => Err(PortError::NoBoard { present: names }),
        [one] => Ok(std::mem::take(one)),
        _ => Err(PortError::SeveralBoards { ports: boards }),
    }
}

/// macOS lists each port twice; the `cu` one does not wait for a modem.
pub(crate) fn is_call_in(port: &SerialPortInfo, present: &[SerialPortInfo]) -> bool {
    let name = port.port_name.strip_prefix("/dev/tty.");
    name.is_some() && present.iter().any(|other| other.port_name.strip_prefix("/dev/cu.") == name)
}

fn is_board(port: &SerialPortInfo) -> bool {
    matches!(&port.port_type, SerialPortType::UsbPort(usb) if usb.vid == ST && ST_LINKS.contains(&usb.pid))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn port(name: &str, vid: u16, pid: u16) -> SerialPortInfo {
        let usb = UsbPortInfo { vid, pid, serial_number: None, manufacturer: None, product: None };
        SerialPortInfo { port_name: name.into(), port_type: SerialPortType::UsbPort(usb) }
    }

    #[test]
    fn finds_the_only_st_link_and_rejects_two() {
        let modem = port("/dev/ttyUSB0", 0x0403, 0x6001);
        let built_in = SerialPortInfo { port_name: "/dev/ttyS0".into(), port_type: SerialPortType::Unknown };
        let board = port("/dev/ttyACM0", ST, 0x374b);
        let others = [modem, built_in];
        let none = only(&others).unwrap_err().to_string();
        assert!(none.contains("/dev/ttyUSB0, /dev/ttyS0"), "{none}");
        let with = |more: &[SerialPortInfo]| only(&[&others, more].concat());
        assert_eq!(with(std::slice::from_ref(&board)).unwrap(), "/dev/ttyACM0");
        let two = with(&[board, port("/dev/ttyACM1", ST, 0x3754)]).unwrap_err().to_string();
        assert!(two.contains("/dev/ttyACM0, /dev/ttyACM1"), "{two}");
    }

    #[test]
    fn counts_a_port_that_macos_lists_twice_once() {
        let twice = [port("/dev/tty.usbmodem3", ST, 0x374e), port("/dev/cu.usbmodem3", ST, 0x374e)];
        assert_eq!(only(&twice).unwrap(), "/dev/cu.usbmodem3");
    }
}
