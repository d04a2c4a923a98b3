//! A job's fields. A TOML table and a CSV row give the same.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde_json::{Map, Value};

use super::BatchError;

/// Values by field name; a list has several.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Fields {
    values: BTreeMap<String, Vec<String>>,
    base: PathBuf,
}

impl Fields {
    pub fn new(base: &Path) -> Self {
        Self { base: base.into(), ..Self::default() }
    }

    /// `min-confidence` and `min_confidence` are the same field. Each may be given once.
    pub fn insert(&mut self, name: &str, values: Vec<String>) -> Result<(), BatchError> {
        match self.values.insert(name.trim().replace('-', "_"), values) {
            Some(_) => Err(BatchError::RepeatedField { name: name.trim().into() }),
            None => Ok(()),
        }
    }

    pub fn of_table(table: &toml::Table, base: &Path) -> Result<Self, BatchError> {
        let mut fields = Self::new(base);
        for (name, value) in table {
            let values = match value {
                toml::Value::Array(list) => list.iter().map(text).collect(),
                single => text(single).map(|text| vec![text]),
            };
            let values = values.ok_or_else(|| {
                BatchError::field(name, value, "expected a text, a number, true or false, or a list of these")
            })?;
            fields.insert(name, values)?;
        }
        Ok(fields)
    }

    pub fn with_defaults(mut self, defaults: &Self) -> Self {
        for (name, values) in &defaults.values {
            self.values.entry(name.clone()).or_insert_with(|| values.clone());
        }
        self
    }

    pub fn remove(&mut self, name: &str) {
        self.values.remove(name);
    }

    pub fn all(&self) -> Map<String, Value> {
        let value = |values: &Vec<String>| match values.as_slice() {
            [one] => Value::from(one.as_str()),
            several => Value::from(several),
        };
        self.values.iter().map(|(name, values)| (name.clone(), value(values))).collect()
    }

    /// All fields but `name`, as written, sorted by name.
    pub fn without(&self, name: &str) -> BTreeMap<String, Vec<String>> {
        let mut values = self.values.clone();
        values.remove(name);
        values
    }

    pub fn text(&self, name: &'static str) -> Result<String, BatchError> {
        match self.values.get(name).map(Vec::as_slice) {
            None => Err(BatchError::MissingField { name }),
            Some([one]) => Ok(one.clone()),
            Some(several) => Err(BatchError::field(name, several.join(", "), "expected one value")),
        }
    }

    pub fn base(&self) -> &Path {
        &self.base
    }
}

fn text(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(_)
        | toml::Value::Float(_)
        | toml::Value::Boolean(_)
        | toml::Value::Datetime(_) => Some(value.to_string()),
        toml::Value::Array(_) | toml::Value::Table(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(text: &str) -> Fields {
        Fields::of_table(&text.parse().expect("TOML"), Path::new("/base")).expect("fields")
    }

    #[test]
    fn a_table_gives_texts_and_lists() {
        let fields = fields(
            "far = 'a/far.png'\nmin-confidence = 0.5\nviews = ['x', 'y;z']\ntime = 2014-06-23T11:30:00Z",
        );
        assert_eq!(fields.text("far").expect("well"), "a/far.png");
        assert_eq!(fields.text("min_confidence").expect("well"), "0.5");
        assert_eq!(fields.text("time").expect("well"), "2014-06-23T11:30:00Z");
        assert!(matches!(fields.text("near"), Err(BatchError::MissingField { name: "near" })));
        let error = fields.text("views").expect_err("several").to_string();
        assert!(error.contains("views") && error.contains("one value"), "{error}");
        let all = fields.all();
        assert_eq!(all["views"], serde_json::json!(["x", "y;z"]));
        assert_eq!(all["far"], "a/far.png");
    }

    #[test]
    fn a_field_is_given_once() {
        let table = "min-confidence = 0.5\nmin_confidence = 0.6".parse().expect("TOML");
        let error = Fields::of_table(&table, Path::new("/base")).expect_err("twice").to_string();
        assert!(error.contains("`min_confidence` is given twice"), "{error}");
    }
}
