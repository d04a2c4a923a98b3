//! Reads a list of jobs of any length, job by job. TOML: a `[[job]]` table per job, after tables by kind
//! (`[depth]`) with fields shared by all jobs of that kind. CSV: a header with field names and a row per job;
//! an empty cell is a missing field.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufRead, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use super::{BatchError, fields::Fields};

/// Most bytes of a job, so that memory does not depend on the file.
pub(super) const JOB_BYTES_MAX: u64 = 1 << 20;
const JOB: &str = "[[job]]";
/// Spreadsheets and editors write it.
const BYTE_ORDER_MARK: &str = "\u{feff}";
pub(super) const KIND: &str = "do";

pub(super) struct Entry {
    pub number: usize,
    pub line: usize,
    /// Task and remaining fields, or why they cannot be read.
    pub job: Result<(String, Fields), BatchError>,
}

pub(super) struct Manifest {
    path: PathBuf,
    base: PathBuf,
    source: Source,
    number: usize,
}

enum Source {
    Toml { reader: BufReader<File>, next_line: usize, defaults: BTreeMap<String, Fields>, ended: bool },
    Csv { reader: Box<csv::Reader<LineFeeds>>, names: csv::StringRecord },
}

/// A text file with line feeds for all ends of lines: after a carriage return the CSV reader counts a line too few.
struct LineFeeds {
    file: File,
    after_return: bool,
}

impl Read for LineFeeds {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let count = self.file.read(buffer)?;
            let mut kept = 0;
            for at in 0..count {
                let byte = buffer[at];
                if byte != b'\n' || !self.after_return {
                    buffer[kept] = if byte == b'\r' { b'\n' } else { byte };
                    kept += 1;
                }
                self.after_return = byte == b'\r';
            }
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}

impl Manifest {
    pub fn open(path: &Path) -> Result<Self, BatchError> {
        let base = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let file = File::open(path).map_err(|source| BatchError::Read { path: path.into(), source })?;
        let source = match ending.as_str() {
            "csv" => csv_source(file, path)?,
            "toml" => toml_source(file, path, &base)?,
            _ => return Err(BatchError::Ending { path: path.into() }),
        };
        Ok(Self { path: path.into(), base, source, number: 0 })
    }

    /// Returns `None` at the end.
    pub fn next(&mut self) -> Result<Option<Entry>, BatchError> {
        let found = match &mut self.source {
            Source::Csv { reader, names } => {
                let mut row = csv::StringRecord::new();
                // Spreadsheets write rows of empty cells.
                let (line, read) = loop {
                    let line = reader.position().line() as usize;
                    let read = reader.read_record(&mut row);
                    if !matches!(read, Ok(true)) || row.iter().any(|cell| !cell.is_empty()) {
                        break (line, read);
                    }
                };
                match read {
                    Ok(false) => None,
                    Ok(true) => {
                        let line = row.position().map_or(line, |position| position.line() as usize);
                        let wrong = |reason| BatchError::Manifest { path: self.path.clone(), line, reason };
                        Some((line, of_row(names, &row, &self.base, wrong)))
                    }
                    Err(error) if matches!(error.kind(), csv::ErrorKind::Io(_)) => {
                        return Err(wrong_csv(&self.path, &error));
                    }
                    Err(error) => {
                        let line = error.position().map_or(line, |position| position.line() as usize);
                        Some((line, Err(wrong_csv(&self.path, &error))))
                    }
                }
            }
            Source::Toml { .. } => {
                let table = self.next_table()?;
                table.map(|(line, text)| (line, self.of_table(line, &text)))
            }
        };
        Ok(found.map(|(line, job)| {
            self.number += 1;
            Entry { number: self.number, line, job }
        }))
    }

    /// The next TOML `[[job]]` without that line, and its line number.
    fn next_table(&mut self) -> Result<Option<(usize, String)>, BatchError> {
        let Source::Toml { reader, next_line, ended, .. } = &mut self.source else { return Ok(None) };
        if *ended {
            return Ok(None);
        }
        let begin = *next_line - 1;
        let (text, more) = until_job(reader, &self.path, next_line)?;
        *ended = !more;
        Ok(Some((begin, text)))
    }

    fn of_table(&self, line: usize, text: &str) -> Result<(String, Fields), BatchError> {
        let Source::Toml { defaults, .. } = &self.source else {
            return Err(BatchError::MissingField { name: KIND });
        };
        // Count lines from the beginning of the file.
        let table =
            text.parse::<toml::Table>().map_err(|error| wrong_toml(&self.path, line, text, &error))?;
        let (kind, fields) = split(Fields::of_table(&table, &self.base)?)?;
        let fields = match defaults.get(&kind) {
            Some(defaults) => fields.with_defaults(defaults),
            None => fields,
        };
        Ok((kind, fields))
    }
}

fn split(mut fields: Fields) -> Result<(String, Fields), BatchError> {
    let kind = fields.text(KIND)?;
    fields.remove(KIND);
    Ok((kind, fields))
}

fn of_row(
    names: &csv::StringRecord,
    row: &csv::StringRecord,
    base: &Path,
    wrong: impl FnOnce(String) -> BatchError,
) -> Result<(String, Fields), BatchError> {
    if row.len() != names.len() {
        let reason = format!("found {} fields, expected {} as in the header", row.len(), names.len());
        return Err(wrong(reason));
    }
    let mut fields = Fields::new(base);
    for (name, cell) in names.iter().zip(row).filter(|(_, cell)| !cell.is_empty()) {
        fields.insert(name, vec![cell.into()])?;
    }
    split(fields)
}

/// Separator of the header: spreadsheets may write semicolons or tabs.
fn separator(file: &mut File, path: &Path) -> Result<u8, BatchError> {
    let unreadable = |source| BatchError::Read { path: path.into(), source };
    let mut header = String::new();
    // A header that is not UTF-8 is reported by the reader.
    let _ = BufReader::new(file.by_ref().take(JOB_BYTES_MAX)).read_line(&mut header);
    file.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    let count = |separator: u8| header.bytes().filter(|byte| *byte == separator).count();
    Ok([b',', b';', b'\t'].into_iter().rev().max_by_key(|separator| count(*separator)).unwrap_or(b','))
}

fn csv_source(mut file: File, path: &Path) -> Result<Source, BatchError> {
    let delimiter = separator(&mut file, path)?;
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(LineFeeds { file, after_return: false });
    let names = reader.headers().map_err(|error| wrong_csv(path, &error))?.clone();
    let names = names.iter().map(|name| name.trim_start_matches(BYTE_ORDER_MARK));
    let names: csv::StringRecord = names.collect();
    let wrong = |reason| BatchError::Manifest { path: path.into(), line: 1, reason };
    if !names.iter().any(|name| name == KIND) {
        let header = names.iter().collect::<Vec<_>>().join(",");
        return Err(wrong(format!(
            "its header is \"{header}\"; expected the names of fields with `{KIND}` among them"
        )));
    }
    let mut fields = Fields::default();
    // Spreadsheets may add empty columns.
    for name in names.iter().filter(|name| !name.is_empty()) {
        fields.insert(name, Vec::new()).map_err(|error| wrong(error.to_string()))?;
    }
    Ok(Source::Csv { reader: Box::new(reader), names })
}

fn toml_source(file: File, path: &Path, base: &Path) -> Result<Source, BatchError> {
    let mut reader = BufReader::new(file);
    let unreadable = |source| BatchError::Read { path: path.into(), source };
    if reader.fill_buf().map_err(unreadable)?.starts_with(BYTE_ORDER_MARK.as_bytes()) {
        reader.consume(BYTE_ORDER_MARK.len());
    }
    let mut next_line = 1;
    let (head, more) = until_job(&mut reader, path, &mut next_line)?;
    let table = head.parse::<toml::Table>().map_err(|error| wrong_toml(path, 0, &head, &error))?;
    let mut defaults = BTreeMap::new();
    for (kind, values) in table {
        let Some(values) = values.as_table().filter(|_| super::jobs::is_kind(&kind)) else {
            let kinds = super::jobs::names().join(", ");
            let reason = format!(
                "`{kind}` before the first {JOB}: expected tables with what jobs share, named {kinds}"
            );
            return Err(BatchError::Manifest { path: path.into(), line: 1, reason });
        };
        defaults.insert(kind, Fields::of_table(values, base)?);
    }
    Ok(Source::Toml { reader, next_line, defaults, ended: !more })
}

/// Text up to the next line `[[job]]`, and whether there is one.
fn until_job(
    reader: &mut BufReader<File>,
    path: &Path,
    next_line: &mut usize,
) -> Result<(String, bool), BatchError> {
    let mut text = String::new();
    let mut left = reader.take(JOB_BYTES_MAX);
    loop {
        let begin = text.len();
        let read = left.read_line(&mut text);
        let count = read.map_err(|source| BatchError::Read { path: path.into(), source })?;
        if count == 0 {
            break;
        }
        *next_line += 1;
        let line = text[begin..].split('#').next().unwrap_or_default();
        if line.chars().filter(|letter| !letter.is_whitespace()).eq(JOB.chars()) {
            text.truncate(begin);
            return Ok((text, true));
        }
    }
    if left.limit() == 0 {
        let reason = format!("more than {JOB_BYTES_MAX} bytes without a line {JOB}");
        return Err(BatchError::Manifest { path: path.into(), line: *next_line, reason });
    }
    Ok((text, false))
}

fn wrong_toml(path: &Path, before: usize, text: &str, error: &toml::de::Error) -> BatchError {
    let at = error.span().map_or(0, |span| text.get(..span.start).unwrap_or(text).matches('\n').count() + 1);
    BatchError::Manifest { path: path.into(), line: before + at, reason: error.message().into() }
}

fn wrong_csv(path: &Path, error: &csv::Error) -> BatchError {
    let line = error.position().map_or(0, |position| position.line() as usize);
    BatchError::Manifest { path: path.into(), line, reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Found = (usize, Result<(String, Fields), String>);

    fn all(name: &str, text: &str) -> Vec<Found> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a writable folder");
        let mut manifest = Manifest::open(&path).expect("a manifest");
        let mut found = Vec::new();
        while let Some(entry) = manifest.next().expect("readable") {
            assert_eq!(entry.number, found.len() + 1);
            found.push((entry.line, entry.job.map_err(|error| error.to_string())));
        }
        found
    }

    #[test]
    fn toml_and_csv_give_the_same_jobs() {
        let toml = "# shared\n[depth]\nsmooth = 9\n\n[[job]]\ndo = 'depth'\nfar = 'a.png'\n\n[[ job ]] # the second\ndo = 'correct'\n";
        let csv = "do, far, smooth\ndepth, a.png, 9\ncorrect,,\n";
        let jobs = |found: Vec<Found>| -> Vec<_> {
            let job = |(_, job): Found| {
                let (kind, fields) = job.expect("a job");
                (kind, fields.without("out"))
            };
            found.into_iter().map(job).collect()
        };
        let (of_toml, of_csv) = (all("a.toml", toml), all("a.csv", csv));
        assert_eq!(of_toml.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [5, 9]);
        assert_eq!(of_csv.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [2, 3]);
        let of_crlf = all("a.csv", &csv.replace('\n', "\r\n"));
        assert_eq!(of_crlf.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [2, 3]);
        let of_toml = jobs(of_toml);
        assert_eq!(of_toml, jobs(of_csv));
        assert_eq!(of_toml[0].1["smooth"], ["9"]);
    }

    #[test]
    fn semicolons_and_tabs_separate_as_commas_do() {
        for (separator, list) in [(",", "x;y"), (";", "x"), ("\t", "x;y")] {
            let text =
                format!("\u{feff}do{separator}far{separator}views\ndepth{separator}a.png{separator}{list}\n");
            let found = all("a.csv", &text);
            let (kind, fields) = found[0].1.as_ref().expect("a job");
            assert_eq!(
                (kind.as_str(), fields.without("out")["far"].as_slice()),
                ("depth", &["a.png".to_owned()][..])
            );
            assert_eq!(fields.without("out")["views"], [list]);
        }
    }

    #[test]
    fn a_byte_order_mark_and_empty_rows_are_ignored() {
        let job = "[[job]]\ndo = 'depth'\nfar = 'a.png'\n";
        for head in ["", "# shared\n", "[depth]\nsmooth = 9\n"] {
            let found = all("a.toml", &format!("\u{feff}{head}{job}"));
            assert!(found.len() == 1 && found[0].1.is_ok(), "{found:?}");
        }
        let found = all("a.csv", "do,far,near\n,,\ndepth,a,b\n , ,\n,,,,\ndepth,c,d\n,,\n");
        assert_eq!(found.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [3, 6]);
        assert!(found.iter().all(|(_, job)| job.is_ok()), "{found:?}");
    }

    #[test]
    fn an_invalid_job_does_not_hide_the_others() {
        let found =
            all("a.toml", "[[job]]\ndo = 'depth'\nfar = \n[[job]]\nfar = 'x'\n[[job]]\ndo = 'correct'\n");
        let error = found[0].1.as_ref().expect_err("no value");
        assert!(error.contains("line 3"), "{error}");
        assert!(found[1].1.as_ref().is_err_and(|error| error.contains("`do`")));
        assert!(found[2].1.is_ok());
        let found = all("a.csv", "do,far\ndepth,a,b\ncorrect,c\n");
        let error = found[0].1.as_ref().expect_err("a cell too many");
        assert!(error.contains("a.csv, line 2: found 3 fields, expected 2"), "{error}");
        assert!(found[1].1.is_ok());
        let found = all("a.csv", "do,far,,\ndepth,a,,\n");
        assert!(found[0].1.is_ok(), "empty columns of a spreadsheet");
    }

    #[test]
    fn an_invalid_manifest_is_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text, phrase) in [
            ("a.txt", "", ".toml or .csv"),
            ("a.csv", "far,near\n", "`do`"),
            ("a.csv", "do,out,out\n", "line 1: the field `out` is given twice"),
            ("a.toml", "[dept]\nsmooth = 1\n", "dept"),
            ("a.toml", "[depth\n", "line 1"),
            ("b.csv", "", "header"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("a writable folder");
            let error = Manifest::open(&path).err().expect("no manifest").to_string();
            assert!(error.contains(phrase), "{error}");
        }
        let long = format!("x = '{}'\n", "y".repeat(JOB_BYTES_MAX as usize));
        std::fs::write(folder.path().join("long.toml"), long).expect("a writable folder");
        let error = Manifest::open(&folder.path().join("long.toml")).err().expect("too long").to_string();
        assert!(error.contains("bytes"), "{error}");
    }
}
