//! Request structs, one per task, shared by the command line, the page, batch and Python. Doc comments are
//! the help text; [`Default`] holds the defaults.

pub mod outputs;
mod paths;
pub mod reference;

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Number, Value};

use self::paths::{file_part, rebase};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    rig::{RigAddress, camera::CameraSettings},
};

/// A task for users, with its parameters.
pub trait Request:
    Clone + Default + Serialize + DeserializeOwned + JsonSchema + Send + Sync + 'static
{
    /// Words of the command: `depth`, `rig capture`.
    const NAME: &'static str;
    /// Fields without a usable default.
    const REQUIRED: &'static [&'static str];
    const PATHS: &'static [(&'static str, PathKind)];
    type Figures: Serialize;

    /// Finds contradictions between fields without reading or moving anything.
    fn check(&self) -> Result<()> {
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<Self::Figures>;

    /// Error for a complete result, for instance a failed comparison. Figures are printed before it.
    fn verdict(_: &Self::Figures) -> Result<()> {
        Ok(())
    }

    fn inputs(&self) -> Vec<PathBuf> {
        inputs(self)
    }
}

/// A rig's task; the caller chooses the rig.
pub trait RigRequest: Request {
    fn set_rig(&mut self, rig: RigAddress);
}

pub trait CameraRequest: RigRequest {
    fn set_camera(&mut self, camera: CameraSettings);
}

macro_rules! rig_request {
    ($request:ty) => {
        impl $crate::request::RigRequest for $request {
            fn set_rig(&mut self, rig: $crate::rig::RigAddress) {
                self.rig = rig;
            }
        }
    };
}

macro_rules! camera_request {
    ($request:ty) => {
        $crate::request::rig_request!($request);

        impl $crate::request::CameraRequest for $request {
            fn set_camera(&mut self, camera: $crate::rig::camera::CameraSettings) {
                self.camera = camera;
            }
        }
    };
}

pub(crate) use {camera_request, rig_request};

pub(crate) fn json(figures: &impl Serialize) -> Result<Value> {
    serde_json::to_value(figures)
        .map_err(|error| WorkflowError::parameter("figures", error, "figures that JSON can hold"))
}

pub fn inputs<R: Request>(request: &R) -> Vec<PathBuf> {
    let is_input = |(kind, path): &(PathKind, PathBuf)| match kind {
        PathKind::Input | PathKind::NamedInput => true,
        PathKind::InputOrName => path.exists(),
        PathKind::OutputFile | PathKind::OutputFolder => false,
    };
    paths_of(request).into_iter().filter(is_input).map(|(_, path)| path).collect()
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PathKind {
    Input,
    /// A built-in name or a file; text after a comma is not part of the path.
    InputOrName,
    /// A file after a name and `=`, or a file alone.
    NamedInput,
    OutputFile,
    OutputFolder,
}

/// Whether a source of fields may name files.
#[derive(Clone, Copy, Debug)]
pub enum Paths<'a> {
    RelativeTo(&'a Path),
    Refused,
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum RequestError {
    #[error("{task} has no field `{name}`; expected some of {}", known.join(", "))]
    UnknownField { task: &'static str, name: String, known: Vec<String> },
    #[error("{task} needs the field `{name}`")]
    MissingField { task: &'static str, name: &'static str },
    #[error("{field}: {reason}")]
    Value { field: String, reason: String },
}

/// Parses a request from named values. Names may use `-` or `_`. Text is converted to numbers, booleans and
/// lists (separated by `;`) by the fields' types, so CSV and TOML give the same request.
pub fn parse<R: Request>(fields: Map<String, Value>, paths: Paths<'_>) -> Result<R, RequestError> {
    let schema = schema::<R>();
    let is_path = |name: &str| R::PATHS.iter().any(|(path, _)| *path == name);
    let usable = |name: &&String| matches!(paths, Paths::RelativeTo(_)) || !is_path(name);
    let mut accepted = Map::new();
    for (name, value) in fields {
        let name = name.trim().replace('-', "_");
        let property = property(&schema, &name).filter(|_| usable(&&name));
        let Some(property) = property else {
            let known = properties(&schema).keys().filter(usable).cloned().collect();
            return Err(RequestError::UnknownField { task: R::NAME, name, known });
        };
        accepted.insert(name, in_shortest_form(coerce(value, property, &schema)));
    }
    for name in R::REQUIRED {
        let given_elsewhere = is_path(name) && matches!(paths, Paths::Refused);
        if !given_elsewhere && !accepted.contains_key(*name) {
            return Err(RequestError::MissingField { task: R::NAME, name });
        }
    }
    if let Paths::RelativeTo(base) = paths {
        for (name, kind) in R::PATHS {
            if let Some(value) = accepted.get_mut(*name) {
                rebase(value, *kind, base);
            }
        }
    }
    serde_path_to_error::deserialize(Value::Object(accepted)).map_err(|error| RequestError::Value {
        field: error.path().to_string(),
        reason: error.into_inner().to_string(),
    })
}

/// JSON schema of a request: names, types, defaults and help of its fields.
pub fn schema<R: Request>() -> Value {
    schemars::SchemaGenerator::default().into_root_schema_for::<R>().to_value()
}

/// Removes the path fields from the request's schema, for callers that may not name files.
pub fn without_paths<R: Request>(mut schema: Schema) -> Schema {
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        properties.retain(|name, _| R::PATHS.iter().all(|(path, _)| path != name));
    }
    schema
}

/// Tasks on files.
pub const TASKS: &[Task] = &[
    Task::of::<crate::depth::DepthRequest>(),
    Task::of::<crate::focus_stack::FocusStackRequest>(),
    Task::of::<crate::correct::CorrectRequest>(),
    Task::of::<crate::operators::OperatorRequest>(),
    Task::of::<crate::target::TargetRequest>(),
    Task::of::<crate::calibrate::psf::CalibratePsfRequest>(),
    Task::of::<crate::calibrate::correction::CalibrateCorrectionRequest>(),
    Task::of::<crate::calibrate::stack::CalibrateStackRequest>(),
    Task::of::<crate::measure::MeasureRegionRequest>(),
    Task::of::<crate::measure::MeasurePlaneRequest>(),
    Task::of::<crate::measure::MeasureProfileRequest>(),
    Task::of::<crate::measure::MeasureDifferenceRequest>(),
    Task::of::<crate::compare::CompareRequest>(),
    Task::of::<crate::report::ReportRequest>(),
    Task::of::<crate::optics::OpticsRequest>(),
    Task::of::<crate::camera_frames::CalibrateCameraRequest>(),
    Task::of::<crate::silhouettes::video::SilhouettesVideoRequest>(),
    Task::of::<crate::silhouettes::passages::PassagesRequest>(),
    Task::of::<crate::silhouettes::markers::MarkersRequest>(),
    Task::of::<crate::silhouettes::skeletons::SkeletonsRequest>(),
    Task::of::<crate::silhouettes::synthetic::SyntheticRequest>(),
    Task::of::<crate::activity::training::TrainRequest>(),
    Task::of::<crate::activity::shipped::TrainSyntheticRequest>(),
    Task::of::<crate::activity::recognise::RecogniseRequest>(),
    Task::of::<crate::activity::evaluate::EvaluateRequest>(),
    Task::of::<crate::shadow::removal::ShadowRemoveRequest>(),
    Task::of::<crate::shadow::score::ShadowScoreRequest>(),
    Task::of::<crate::sun::SunPositionRequest>(),
];

/// Tasks of a rig or a camera. Batch does not run them.
pub const DEVICE_TASKS: &[Task] = &[
    Task::of::<crate::rig::motion::HomeRequest>(),
    Task::of::<crate::rig::motion::MoveRequest>(),
    Task::of::<crate::rig::pair::CaptureRequest>(),
    Task::of::<crate::rig::focus::FocusRequest>(),
    Task::of::<crate::rig::sequence::SequenceRequest>(),
    Task::of::<crate::rig::continuous::ContinuousRequest>(),
    Task::of::<crate::rig::targets::TargetSeriesRequest>(),
    Task::of::<crate::rig::lens_stack::RigStackRequest>(),
    Task::of::<crate::rig::correction_fit::FitRequest>(),
    Task::of::<crate::rig::correct::BoardCorrectRequest>(),
    Task::of::<crate::rig::quality::QualityRequest>(),
    Task::of::<crate::rig::sun::SunRequest>(),
    Task::of::<crate::rig::check::CheckRequest>(),
    Task::of::<crate::camera::ShowRequest>(),
    Task::of::<crate::camera::grab::GrabRequest>(),
];

/// Reads a job from its fields; paths are relative to the folder.
type ReadJob = fn(Map<String, Value>, &Path) -> Result<Box<dyn Job>>;

/// A task known at run time only.
pub struct Task {
    pub name: &'static str,
    pub schema: fn() -> Value,
    pub required: &'static [&'static str],
    pub paths: &'static [(&'static str, PathKind)],
    pub job: ReadJob,
}

impl Task {
    pub const fn of<R: Request>() -> Self {
        Self {
            name: R::NAME,
            schema: schema::<R>,
            required: R::REQUIRED,
            paths: R::PATHS,
            job: |fields, base| {
                let request: R = parse(fields.clone(), Paths::RelativeTo(base))?;
                outputs::check(&request)?;
                Ok(Box::new(Parsed { request, fields, base: base.to_path_buf() }))
            },
        }
    }

    /// Field and kind of the result; `None` if nothing is written.
    pub const fn output(&self) -> Option<(&'static str, PathKind)> {
        let mut index = 0;
        while index < self.paths.len() {
            if let (_, PathKind::OutputFile | PathKind::OutputFolder) = self.paths[index] {
                return Some(self.paths[index]);
            }
            index += 1;
        }
        None
    }
}

/// A parsed request whose output can be redirected.
pub trait Job: Send {
    fn inputs(&self) -> Vec<PathBuf>;

    fn run(&self, out: &Path, context: &Context<'_>) -> Result<Value>;
}

struct Parsed<R> {
    request: R,
    fields: Map<String, Value>,
    base: PathBuf,
}

impl<R: Request> Job for Parsed<R> {
    fn inputs(&self) -> Vec<PathBuf> {
        self.request.inputs()
    }

    fn run(&self, out: &Path, context: &Context<'_>) -> Result<Value> {
        let mut fields = self.fields.clone();
        if let Some((name, _)) = Task::of::<R>().output() {
            // Make the path absolute, because relative paths are relative to the base.
            let out = std::path::absolute(out).map_err(WorkflowError::read("the result's folder", out))?;
            fields.insert(name.into(), out.display().to_string().into());
        }
        let request: R = parse(fields, Paths::RelativeTo(&self.base))?;
        json(&request.run(context)?)
    }
}

fn paths_of<R: Request>(request: &R) -> Vec<(PathKind, PathBuf)> {
    let Ok(Value::Object(fields)) = serde_json::to_value(request) else { return Vec::new() };
    let mut found = Vec::new();
    for (name, kind) in R::PATHS {
        let texts = match fields.get(*name) {
            Some(Value::String(text)) => vec![text.as_str()],
            Some(Value::Array(list)) => list.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        };
        found.extend(texts.into_iter().map(|text| (*kind, Path::new(file_part(text, *kind)).to_path_buf())));
    }
    found
}

fn properties(schema: &Value) -> Map<String, Value> {
    schema.get("properties").and_then(Value::as_object).cloned().unwrap_or_default()
}

fn property<'a>(schema: &'a Value, name: &str) -> Option<&'a Value> {
    schema.get("properties")?.get(name)
}

fn accepts(property: &Value, kind: &str, schema: &Value) -> bool {
    if let Some(target) = property.get("$ref").and_then(Value::as_str) {
        let target = target.trim_start_matches('#');
        return schema.pointer(target).is_some_and(|target| accepts(target, kind, schema));
    }
    if let Some(kinds) = property.get("type") {
        return kinds == kind || kinds.as_array().is_some_and(|kinds| kinds.iter().any(|one| one == kind));
    }
    if property.get("const").or_else(|| property.get("enum")).is_some() {
        return kind == "string";
    }
    let alternatives = ["anyOf", "oneOf"].iter().filter_map(|name| property.get(name)?.as_array());
    alternatives.flatten().any(|one| accepts(one, kind, schema))
}

/// Numbers as serde_json writes them: flattened fields take no others with `arbitrary_precision`, which defmt-decoder enables.
fn in_shortest_form(value: Value) -> Value {
    match value {
        Value::Number(number) if number.as_i64().is_none() && number.as_u64().is_none() => {
            number.as_f64().and_then(Number::from_f64).map_or(Value::Number(number), Value::Number)
        }
        Value::Array(items) => items.into_iter().map(in_shortest_form).collect(),
        Value::Object(all) => all.into_iter().map(|(name, one)| (name, in_shortest_form(one))).collect(),
        other => other,
    }
}

fn coerce(value: Value, property: &Value, schema: &Value) -> Value {
    let accepts = |kind: &str| accepts(property, kind, schema);
    match value {
        Value::String(text) if accepts("array") && !accepts("string") => {
            let parts = text.split(';').map(str::trim).filter(|part| !part.is_empty());
            let item = property.get("items").cloned().unwrap_or(Value::Bool(true));
            Value::Array(parts.map(|part| coerce(part.into(), &item, schema)).collect())
        }
        Value::String(text) if !accepts("string") => {
            let plain = text.trim();
            let boolean = plain.parse::<bool>().ok().filter(|_| accepts("boolean")).map(Value::Bool);
            let integer = plain.parse::<i64>().ok().map(Value::from);
            let number = || plain.parse::<f64>().ok().map(Value::from);
            boolean.or(integer).or_else(number).unwrap_or(Value::String(text))
        }
        Value::Number(number) if accepts("string") && !accepts("number") && !accepts("integer") => {
            Value::String(number.to_string())
        }
        single @ (Value::Number(_) | Value::Bool(_)) if accepts("array") => {
            coerce(Value::Array(vec![single]), property, schema)
        }
        Value::Array(parts) => Value::Array(match property.get("items") {
            Some(item) => parts.into_iter().map(|part| coerce(part, item, schema)).collect(),
            None => parts,
        }),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    struct Sample {
        file: PathBuf,
        views: Vec<PathBuf>,
        steps: Vec<f64>,
        psf: Option<String>,
        count: Option<NonZero<u32>>,
        share: f64,
        fill: bool,
        out: PathBuf,
        #[serde(flatten)]
        place: Place,
    }

    #[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    struct Place {
        lat: f64,
    }

    impl Request for Sample {
        const NAME: &'static str = "sample";
        const REQUIRED: &'static [&'static str] = &["file"];
        const PATHS: &'static [(&'static str, PathKind)] = &[
            ("file", PathKind::Input),
            ("views", PathKind::Input),
            ("psf", PathKind::InputOrName),
            ("out", PathKind::OutputFolder),
        ];
        type Figures = String;

        fn run(&self, _: &Context<'_>) -> Result<String> {
            Ok(self.out.display().to_string())
        }
    }

    fn read(fields: Value, paths: Paths<'_>) -> Result<Sample, RequestError> {
        let Value::Object(fields) = fields else { panic!("fields are an object") };
        parse(fields, paths)
    }

    #[test]
    fn texts_and_typed_values_give_the_same_request() {
        let base = Paths::RelativeTo(Path::new("/base"));
        let typed = json!({"file": "a", "views": ["b", "/c"], "count": 3, "share": 0.5, "fill": true, "psf": "gaussian:k=0.4,n=1"});
        let texts = json!({"file": "a", "views": "b; /c", "count": "3", "share": "0.5", "fill": "true", "psf": "gaussian:k=0.4,n=1"});
        let request = read(typed, base).expect("a request");
        assert_eq!(request, read(texts, base).expect("a request"));
        assert_eq!(request.file, Path::new("/base/a"));
        assert_eq!(request.views, [Path::new("/base/b"), Path::new("/c")]);
        assert_eq!(request.psf.as_deref(), Some("gaussian:k=0.4,n=1"));
        assert_eq!(request.inputs(), ["/base/a", "/base/b", "/c"].map(PathBuf::from));
    }

    #[test]
    fn numbers_of_a_list_may_be_texts() {
        for steps in [json!([1, 2.5]), json!(["1", "2.5"]), json!("1; 2.5")] {
            let fields = json!({"file": "a", "steps": steps});
            assert_eq!(read(fields, Paths::RelativeTo(Path::new(""))).expect("a request").steps, [1.0, 2.5]);
        }
    }

    #[test]
    fn numbers_may_have_any_form() {
        for (text, lat) in [("52.50", 52.5), ("1e-05", 1e-5), ("-0.10", -0.1), ("52", 52.0)] {
            let fields = serde_json::from_str(&format!(r#"{{"file":"a","lat":{text}}}"#)).unwrap();
            assert_eq!(read(fields, Paths::RelativeTo(Path::new(""))).expect("a request").place.lat, lat);
        }
    }

    #[test]
    fn rejects_unknown_missing_and_wrong_fields_by_name() {
        let base = Paths::RelativeTo(Path::new(""));
        for (fields, phrases) in [
            (json!({"file": "a", "fil": 1}), ["`fil`", "views"]),
            (json!({"share": 1}), ["needs", "`file`"]),
            (json!({"file": "a", "share": "wide"}), ["share", "wide"]),
            (json!({"file": "a", "count": 0}), ["count", "0"]),
        ] {
            let error = read(fields, base).expect_err("refused").to_string();
            assert!(phrases.iter().all(|phrase| error.contains(phrase)), "{error}");
        }
    }

    #[test]
    fn refuses_paths_where_the_caller_sets_them() {
        assert!(read(json!({"share": 1}), Paths::Refused).is_ok());
        assert!(read(json!({"file": "/etc/passwd"}), Paths::Refused).is_err());
        let schema = without_paths::<Sample>(schemars::schema_for!(Sample)).to_value();
        assert!(property(&schema, "file").is_none() && property(&schema, "share").is_some());
    }

    #[test]
    fn a_job_writes_where_it_is_sent() {
        let Value::Object(fields) = json!({"file": "a", "out": "there"}) else { panic!("an object") };
        let task = Task::of::<Sample>();
        assert_eq!(task.output(), Some(("out", PathKind::OutputFolder)));
        let job = (task.job)(fields, Path::new("/base")).expect("a job");
        assert_eq!(job.run(Path::new("/else"), &Context::unattended()).expect("a result"), json!("/else"));
    }
}
