//! A job's fields as typed values. A TOML table and a CSV row give the same.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Display,
    path::{Path, PathBuf},
    str::FromStr,
};

use serde_json::{Map, Value};

use super::BatchError;

/// Values by field name; a list has several.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Fields {
    values: BTreeMap<String, Vec<String>>,
    taken: BTreeSet<&'static str>,
    base: PathBuf,
}

impl Fields {
    pub fn new(base: &Path) -> Self {
        Self { base: base.into(), ..Self::default() }
    }

    /// `min-confidence` and `min_confidence` are the same field.
    pub fn insert(&mut self, name: &str, values: Vec<String>) {
        self.values.insert(name.trim().replace('-', "_"), values);
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
            fields.insert(name, values);
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
        self.taken.remove(name);
    }

    pub fn take_all(&mut self) -> Map<String, Value> {
        let all = std::mem::take(&mut self.values).into_iter();
        all.map(|(name, values)| {
            let value = match <[String; 1]>::try_from(values) {
                Ok([one]) => Value::from(one),
                Err(several) => Value::from(several),
            };
            (name, value)
        })
        .collect()
    }

    /// All fields but `name`, as written, sorted by name.
    pub fn without(&self, name: &str) -> BTreeMap<String, Vec<String>> {
        let mut values = self.values.clone();
        values.remove(name);
        values
    }

    pub fn text(&mut self, name: &'static str) -> Result<String, BatchError> {
        self.optional_text(name)?.ok_or(BatchError::MissingField { name })
    }

    pub fn optional_text(&mut self, name: &'static str) -> Result<Option<String>, BatchError> {
        self.taken.insert(name);
        match self.values.get(name).map(Vec::as_slice) {
            None => Ok(None),
            Some([one]) => Ok(Some(one.clone())),
            Some(several) => Err(BatchError::field(name, several.join(", "), "expected one value")),
        }
    }

    /// A list, in CSV separated by `;`; empty by default.
    pub fn texts(&mut self, name: &'static str) -> Vec<String> {
        self.taken.insert(name);
        let parts = self.values.get(name).into_iter().flatten().flat_map(|value| value.split(';'));
        parts.map(str::trim).filter(|part| !part.is_empty()).map(Into::into).collect()
    }

    pub fn path(&mut self, name: &'static str) -> Result<PathBuf, BatchError> {
        let text = self.text(name)?;
        Ok(self.base.join(text))
    }

    pub fn optional_path(&mut self, name: &'static str) -> Result<Option<PathBuf>, BatchError> {
        Ok(self.optional_text(name)?.map(|text| self.base.join(text)))
    }

    /// A built-in name or a file; an existing file takes precedence.
    pub fn name_or_file(&mut self, name: &'static str) -> Result<Option<PathBuf>, BatchError> {
        let text = self.optional_text(name)?;
        Ok(text.map(|text| {
            let file = self.base.join(&text);
            if file.exists() { file } else { text.into() }
        }))
    }

    pub fn base(&self) -> &Path {
        &self.base
    }

    pub fn optional<T: FromStr<Err: Display>>(
        &mut self,
        name: &'static str,
    ) -> Result<Option<T>, BatchError> {
        let Some(text) = self.optional_text(name)? else { return Ok(None) };
        match text.parse() {
            Ok(value) => Ok(Some(value)),
            Err(error) => Err(BatchError::field(name, text, error)),
        }
    }

    pub fn or<T: FromStr<Err: Display>>(&mut self, name: &'static str, usual: T) -> Result<T, BatchError> {
        Ok(self.optional(name)?.unwrap_or(usual))
    }

    /// Value of a field of true or false; false by default.
    pub fn flag(&mut self, name: &'static str) -> Result<bool, BatchError> {
        match self.optional_text(name)?.as_deref() {
            None | Some("false") => Ok(false),
            Some("true") => Ok(true),
            Some(other) => Err(BatchError::field(name, other, "expected true or false")),
        }
    }

    /// Rejects unknown fields, so that a typing error does not select a default.
    pub fn all_taken(&self) -> Result<(), BatchError> {
        match self.values.keys().find(|name| !self.taken.contains(name.as_str())) {
            None => Ok(()),
            Some(name) => Err(BatchError::UnknownField {
                name: name.clone(),
                known: self.taken.iter().copied().collect::<Vec<_>>().join(", "),
            }),
        }
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
    fn fields_have_types_and_paths_a_base() {
        let mut fields = fields(
            "far = 'a/far.png'\nmin-confidence = 0.5\nfill = true\nsmooth = 9\nviews = ['x', 'y;z']\ntime = 2014-06-23T11:30:00Z",
        );
        assert_eq!(fields.path("far").expect("well"), Path::new("/base/a/far.png"));
        assert_eq!(fields.optional("min_confidence").expect("well"), Some(0.5));
        assert!(fields.flag("fill").expect("well"));
        assert!(!fields.flag("centred").expect("well"));
        assert_eq!(fields.or("median", 3_usize).expect("well"), 3);
        assert_eq!(fields.texts("views"), ["x", "y", "z"]);
        assert_eq!(fields.text("time").expect("well"), "2014-06-23T11:30:00Z");
        assert!(matches!(fields.text("near"), Err(BatchError::MissingField { name: "near" })));
        let error = fields.all_taken().expect_err("smooth").to_string();
        assert!(error.contains("smooth") && error.contains("min_confidence"), "{error}");
        assert_eq!(fields.or("smooth", 7_usize).expect("well"), 9);
        fields.all_taken().expect("well");
    }

    #[test]
    fn wrong_values_are_named() {
        let mut fields = fields("smooth = 'wide'\nfill = 'yes'\nfar = ['a', 'b']\n");
        for (error, phrases) in [
            (fields.or("smooth", 7_usize).map(|_| ()), ["smooth", "wide"]),
            (fields.flag("fill").map(|_| ()), ["fill", "yes"]),
            (fields.path("far").map(|_| ()), ["far", "one value"]),
        ] {
            let error = error.expect_err("wrong").to_string();
            assert!(phrases.iter().all(|phrase| error.contains(phrase)), "{error}");
        }
    }
}
