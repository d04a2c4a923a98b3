//! Video4Linux cameras: device list, formats and error messages. The device is in `device` (feature `v4l2`).

#[cfg(all(feature = "v4l2", target_os = "linux"))]
mod device;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

#[cfg(all(feature = "v4l2", target_os = "linux"))]
pub use device::V4lCamera;

use super::{CameraError, pixels::Layout};

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FoundDevice {
    pub path: PathBuf,
    /// Driver's name; empty if unknown.
    pub name: String,
}

/// Video devices by number, including metadata devices without pictures.
pub fn devices() -> Vec<FoundDevice> {
    listed(Path::new("/sys/class/video4linux"))
}

fn listed(class: &Path) -> Vec<FoundDevice> {
    let entries = fs::read_dir(class).into_iter().flatten().flatten();
    let mut numbered: Vec<(u32, FoundDevice)> = entries
        .filter_map(|entry| {
            let file = entry.file_name().into_string().ok()?;
            let number = file.strip_prefix("video")?.parse().ok()?;
            let name = fs::read_to_string(entry.path().join("name")).unwrap_or_default().trim().to_owned();
            Some((number, FoundDevice { path: Path::new("/dev").join(file), name }))
        })
        .collect();
    numbered.sort_by_key(|(number, _)| *number);
    numbered.into_iter().map(|(_, device)| device).collect()
}

/// Supported formats, best first: fourcc and layout.
pub const FORMATS: [([u8; 4], Layout); 6] = [
    (*b"Y16 ", Layout::Grey16 { bits: 16 }),
    (*b"Y12 ", Layout::Grey16 { bits: 12 }),
    (*b"Y10 ", Layout::Grey16 { bits: 10 }),
    (*b"GREY", Layout::Grey8 { colour_twelfths: 0 }),
    (*b"YUYV", Layout::Yuyv),
    (*b"MJPG", Layout::Jpeg),
];

/// The device's best format: most bits, then least processed.
pub fn best_format(device: &Path, offered: &[[u8; 4]]) -> Result<([u8; 4], Layout), CameraError> {
    FORMATS.into_iter().find(|(name, _)| offered.contains(name)).ok_or_else(|| {
        let text = |name: &[u8; 4]| String::from_utf8_lossy(name).trim().to_owned();
        let offered: Vec<String> = offered.iter().map(text).collect();
        let read: Vec<String> = FORMATS.iter().map(|(name, _)| text(name)).collect();
        let reason = format!("its formats are {}; read are {}", offered.join(", "), read.join(", "));
        unusable(device, reason)
    })
}

/// Checks a device file without opening it, for a clear error.
pub fn check_path(device: &Path) -> Result<(), CameraError> {
    let metadata = fs::metadata(device).map_err(|error| refused(device, &error))?;
    #[cfg(unix)]
    if !std::os::unix::fs::FileTypeExt::is_char_device(&metadata.file_type()) {
        return Err(unusable(device, "it is not a device; expected e.g. v4l:/dev/video0".into()));
    }
    let _ = metadata;
    Ok(())
}

/// Explains a system error and its remedy.
pub fn refused(device: &Path, error: &io::Error) -> CameraError {
    // Linux: ENODEV and ENXIO after an unplug, EBUSY while another program streams, ENOTTY for other devices.
    let reason = match (error.kind(), error.raw_os_error()) {
        (io::ErrorKind::NotFound, _) => {
            let found: Vec<String> = devices().iter().map(|found| found.path.display().to_string()).collect();
            match found.is_empty() {
                true => "no such device, and no other video device: is the camera plugged in?".into(),
                false => format!("no such device; found: {}", found.join(", ")),
            }
        }
        (io::ErrorKind::PermissionDenied, _) => {
            let group = group_of(device).unwrap_or_else(|| "video".into());
            format!(
                "no permission; add yourself to the group `{group}` (sudo usermod -aG {group} $USER) and log in again"
            )
        }
        (_, Some(16)) => "another program uses it; end that program first".into(),
        (_, Some(19 | 6)) => "it has been disconnected: was the camera unplugged?".into(),
        (_, Some(25)) => "it is not a video device".into(),
        _ => format!("the system says: {error}"),
    };
    unusable(device, reason)
}

fn unusable(device: &Path, reason: String) -> CameraError {
    CameraError::Unusable { camera: device.display().to_string(), reason }
}

#[cfg(unix)]
fn group_of(path: &Path) -> Option<String> {
    let number = std::os::unix::fs::MetadataExt::gid(&fs::metadata(path).ok()?);
    group_name(&fs::read_to_string("/etc/group").ok()?, number)
}

#[cfg(not(unix))]
fn group_of(_: &Path) -> Option<String> {
    None
}

#[cfg_attr(not(unix), allow(dead_code))]
fn group_name(groups: &str, number: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(number)).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selects_the_best_format_or_lists_the_offered_ones() {
        let device = Path::new("/dev/video7");
        let best = |offered: &[[u8; 4]]| best_format(device, offered);
        assert_eq!(best(&[*b"MJPG", *b"YUYV", *b"Y10 "]).unwrap(), (*b"Y10 ", Layout::Grey16 { bits: 10 }));
        assert_eq!(best(&[*b"MJPG", *b"YUYV"]).unwrap().1, Layout::Yuyv);
        let error = best(&[*b"H264", *b"RGB3"]).unwrap_err().to_string();
        assert!(
            error.contains("/dev/video7") && error.contains("H264, RGB3") && error.contains("Y10"),
            "{error}"
        );
    }

    #[test]
    fn unusable_devices_give_a_remedy() {
        let absent = check_path(Path::new("/dev/video4711")).unwrap_err().to_string();
        assert!(absent.contains("/dev/video4711") && absent.contains("no such device"), "{absent}");
        let file = tempfile::NamedTempFile::new().unwrap();
        let file = check_path(file.path()).unwrap_err().to_string();
        assert!(file.contains("not a device") && file.contains("v4l:/dev/video0"), "{file}");
        for (number, phrase) in
            [(13, "group `"), (16, "another program"), (19, "unplugged"), (25, "not a video device")]
        {
            let error = refused(Path::new("/dev/null"), &io::Error::from_raw_os_error(number)).to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn finds_the_group_name_of_a_device() {
        let groups = "root:x:0:\naudio:x:29:pulse\nvideo:x:44:a,b\n";
        assert_eq!(group_name(groups, 44).as_deref(), Some("video"));
        assert_eq!(group_name(groups, 45), None);
    }

    #[test]
    fn devices_are_listed_by_number_with_their_name() {
        let class = tempfile::tempdir().unwrap();
        for (file, name) in
            [("video10", "HD Webcam: HD Webcam\n"), ("video2", "imx296\n"), ("v4l-subdev0", "x\n")]
        {
            fs::create_dir(class.path().join(file)).unwrap();
            fs::write(class.path().join(file).join("name"), name).unwrap();
        }
        let found = listed(class.path());
        let names: Vec<_> =
            found.iter().map(|found| (found.path.to_str().unwrap(), found.name.as_str())).collect();
        assert_eq!(names, [("/dev/video2", "imx296"), ("/dev/video10", "HD Webcam: HD Webcam")]);
        assert!(listed(Path::new("/nonexistent")).is_empty());
    }
}
