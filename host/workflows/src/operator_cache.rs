//! Designed operators in the user's cache folder. An entry belongs to a request and a build of this program,
//! so it equals a new design bit for bit. Damaged entries are replaced. Reading takes well below 1 ms, a
//! design a few ms, at most 1 s.

use std::{
    env, fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use farnear_depth::operators::{self, DesignError, Operators, Request};
use farnear_files::staging;

/// Version of the layout: a line with a hash of key and operators, then the operators as TOML.
const LAYOUT: u32 = 1;
/// Most entries; the oldest are removed. Each is 12 kB.
const ENTRIES_MAX: usize = 64;

pub fn operators(request: &Request) -> Result<Operators, DesignError> {
    let (Some(folder), Some(build)) = (folder(), build()) else { return operators::design(request) };
    cached(&folder.join("farnear").join("operators"), &build, request)
}

fn cached(folder: &Path, build: &str, request: &Request) -> Result<Operators, DesignError> {
    let format = operators::FORMAT;
    // Numbers of a request are printed without loss.
    let key = format!("layout {LAYOUT}, operators {format}, build {build}, {request:?}");
    let entry = folder.join(format!("{:016x}.toml", sum(&[&key])));
    if let Some(found) = read(&entry, &key).filter(|found| found.request() == request) {
        return Ok(found);
    }
    let designed = operators::design(request)?;
    if let Ok(body) = toml::to_string(&designed)
        && fs::create_dir_all(folder).is_ok()
    {
        let text = format!("{:016x}\n{body}", sum(&[&key, &body]));
        // Without an entry, the next call designs again.
        let _ = staging::write_file(&entry, text.as_bytes());
        drop_oldest(folder);
    }
    Ok(designed)
}

fn read(entry: &Path, key: &str) -> Option<Operators> {
    let text = fs::read_to_string(entry).ok()?;
    let (written, body) = text.split_once('\n')?;
    if u64::from_str_radix(written, 16).ok()? != sum(&[key, body]) {
        return None;
    }
    toml::from_str(body).ok()
}

fn drop_oldest(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut entries: Vec<(SystemTime, PathBuf)> = entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            Some((entry.metadata().ok()?.modified().ok()?, entry.path()))
        })
        .collect();
    entries.sort();
    let surplus = entries.len().saturating_sub(ENTRIES_MAX);
    for (_, path) in &entries[..surplus] {
        let _ = fs::remove_file(path); // another program may have done so
    }
}

/// The hasher is stable within a build, which is sufficient.
fn sum(parts: &[&str]) -> u64 {
    let mut hasher = DefaultHasher::new();
    parts.hash(&mut hasher);
    hasher.finish()
}

/// Identifies the build: a design may change without a new version.
fn build() -> Option<String> {
    let program = fs::metadata(env::current_exe().ok()?).ok()?;
    let written = program.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(format!("{} of {} bytes at {}", env!("CARGO_PKG_VERSION"), program.len(), written.as_nanos()))
}

pub(crate) fn folder() -> Option<PathBuf> {
    user_folder("XDG_CACHE_HOME", "Library/Caches", ".cache")
}

/// The user's data folder: default place of files.
pub fn data_folder() -> Option<PathBuf> {
    user_folder("XDG_DATA_HOME", "Library/Application Support", ".local/share")
}

fn user_folder(variable: &str, mac: &str, other: &str) -> Option<PathBuf> {
    let absolute = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    absolute(variable).or_else(|| {
        if cfg!(windows) {
            absolute("LOCALAPPDATA")
        } else {
            Some(absolute("HOME")?.join(if cfg!(target_os = "macos") { mac } else { other }))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_depth::{
        operators::{Design, Family},
        psf::Psf,
    };

    fn request(max_blur_px: f64) -> Request {
        let psf = Psf::PillBox;
        Request { family: Family::of(psf), design: Design::default(), psf, max_blur_px, kernel_size: 7 }
    }

    fn entries(folder: &Path) -> Vec<PathBuf> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn cached_operators_equal_designed_ones() {
        let folder = tempfile::tempdir().unwrap();
        // The last bit of the number matters.
        let request = request(2.0 + f64::EPSILON * 2.0);
        let designed = operators::design(&request).unwrap();
        assert_eq!(cached(folder.path(), "a", &request).unwrap(), designed);
        let [entry] = entries(folder.path()).try_into().unwrap();
        let written = fs::metadata(&entry).unwrap().modified().unwrap();
        assert_eq!(cached(folder.path(), "a", &request).unwrap(), designed);
        assert_eq!(fs::metadata(&entry).unwrap().modified().unwrap(), written, "it was designed again");
    }

    #[test]
    fn other_builds_and_requests_have_entries_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        for (build, blur) in [("a", 2.0), ("b", 2.0), ("a", 2.5)] {
            assert_eq!(cached(folder.path(), build, &request(blur)).unwrap().max_blur_px(), blur);
        }
        assert_eq!(entries(folder.path()).len(), 3);
    }

    #[test]
    fn broken_entries_are_rewritten() {
        let folder = tempfile::tempdir().unwrap();
        let request = request(2.0);
        let designed = cached(folder.path(), "a", &request).unwrap();
        let [entry] = entries(folder.path()).try_into().unwrap();
        let whole = fs::read_to_string(&entry).unwrap();
        // A changed digit still gives valid but different operators.
        let digit = whole.rfind(|letter: char| ('1'..'9').contains(&letter)).unwrap();
        let mut other_digit = whole.clone();
        other_digit.replace_range(digit..=digit, "9");
        for broken in ["", "nonsense", &whole[..whole.len() / 2], &other_digit] {
            fs::write(&entry, broken).unwrap();
            assert_eq!(cached(folder.path(), "a", &request).unwrap(), designed);
            assert_eq!(fs::read_to_string(&entry).unwrap(), whole);
        }
    }

    #[test]
    fn the_cache_stays_small_and_may_be_absent() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..ENTRIES_MAX + 9 {
            fs::write(folder.path().join(format!("{number}.toml")), "old").unwrap();
        }
        cached(folder.path(), "a", &request(2.0)).unwrap();
        assert_eq!(entries(folder.path()).len(), ENTRIES_MAX);
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(cached(&file.join("below"), "a", &request(2.0)).is_ok());
    }
}
