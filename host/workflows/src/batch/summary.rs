//! Table of all jobs in the order of the manifest, with a column per figure.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::JobReport;

const FIXED: [&str; 6] = ["job", "line", "do", "out", "state", "error"];

#[derive(Default)]
pub(super) struct Summary {
    rows: BTreeMap<usize, ([String; 6], BTreeMap<String, String>)>,
}

impl Summary {
    pub fn add(&mut self, report: &JobReport) {
        let state = serde_json::to_value(report.state).unwrap_or_default();
        let fixed = [
            report.job.to_string(),
            report.line.to_string(),
            report.kind.clone(),
            report.out.clone().unwrap_or_default(),
            state.as_str().unwrap_or_default().into(),
            report.error.clone().unwrap_or_default(),
        ];
        let mut figures = BTreeMap::new();
        if let Some(Value::Object(all)) = &report.figures {
            for (name, value) in all {
                flatten(name, value, &mut figures);
            }
        }
        self.rows.insert(report.job, (fixed, figures));
    }

    /// Whether a file with this first line is a summary.
    pub fn begins(line: &str) -> bool {
        line.trim_end().split(',').take(FIXED.len()).eq(FIXED)
    }

    /// CSV; missing figures are empty cells.
    pub fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        let names: BTreeSet<&String> = self.rows.values().flat_map(|(_, figures)| figures.keys()).collect();
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(FIXED.iter().copied().chain(names.iter().map(|name| name.as_str())))?;
        for (fixed, figures) in self.rows.values() {
            let cells = names.iter().map(|name| figures.get(*name).map_or("", String::as_str));
            writer.write_record(fixed.iter().map(String::as_str).chain(cells))?;
        }
        writer.into_inner().map_err(|error| error.into_error().into())
    }
}

/// Objects become `outer.inner`, lists of texts are joined, other lists are omitted.
fn flatten(name: &str, value: &Value, into: &mut BTreeMap<String, String>) {
    match value {
        Value::Null => {}
        Value::Object(inner) => {
            inner.iter().for_each(|(part, value)| flatten(&format!("{name}.{part}"), value, into))
        }
        Value::Array(list) => {
            if list.iter().all(Value::is_string) {
                let texts: Vec<&str> = list.iter().filter_map(Value::as_str).collect();
                into.insert(name.into(), texts.join("; "));
            }
        }
        Value::String(text) => drop(into.insert(name.into(), text.clone())),
        other => drop(into.insert(name.into(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::State;

    #[test]
    fn a_table_has_a_row_for_each_job_and_a_column_for_each_figure() {
        let report = |job, figures: Option<Value>, error: Option<&str>| JobReport {
            job,
            line: job + 1,
            kind: "depth".into(),
            out: Some(format!("{job}/depth")),
            state: if error.is_some() { State::Failed } else { State::Already },
            seconds: 0.1,
            figures,
            warnings: vec![],
            error: error.map(Into::into),
        };
        let mut summary = Summary::default();
        summary.add(&report(2, None, Some("no such file, \"b.png\"")));
        summary.add(&report(
            1,
            Some(serde_json::json!({"valid": 0.9, "noise": {"mm": 0.5}, "warnings": ["a", "b"]})),
            None,
        ));
        let text = String::from_utf8(summary.csv().unwrap()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "job,line,do,out,state,error,noise.mm,valid,warnings");
        assert!(Summary::begins(lines[0]) && Summary::begins("job,line,do,out,state,error\n"));
        assert!(!Summary::begins(lines[1]) && !Summary::begins("do,far,out") && !Summary::begins("job,line"));
        assert_eq!(lines[1], "1,2,depth,1/depth,already,,0.5,0.9,a; b");
        assert_eq!(lines[2], "2,3,depth,2/depth,failed,\"no such file, \"\"b.png\"\"\",,,");
    }
}
