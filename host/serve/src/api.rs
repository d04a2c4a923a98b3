//! The route table and the OpenAPI document generated from it: every route has a description.

use std::{collections::HashMap, sync::Arc};

use axum::{
    Router,
    extract::DefaultBodyLimit,
    handler::Handler,
    http::Method,
    routing::{MethodFilter, MethodRouter, get, on, put},
};
use schemars::{JsonSchema, SchemaGenerator, generate::SchemaSettings};
use serde_json::{Map, Value, json};

use crate::{app::App, failure::Failure};

const SCHEMAS: &str = "/components/schemas";
pub const CLIENT_HEADER: &str = "x-farnear-client";

/// Routes and their OpenAPI paths.
pub struct Api {
    router: Router<Arc<App>>,
    paths: Map<String, Value>,
    access: Access,
    generator: SchemaGenerator,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum For {
    All,
    Control,
    Client,
}

/// Who may use each route; checked before the body is read.
pub type Access = HashMap<(String, Method), For>;

impl Default for Api {
    fn default() -> Self {
        let settings = SchemaSettings::draft2020_12().with(|settings| {
            settings.definitions_path = SCHEMAS.into();
            settings.meta_schema = None;
        });
        Self {
            router: Router::new(),
            paths: Map::new(),
            access: Access::new(),
            generator: settings.into_generator(),
        }
    }
}

impl Api {
    pub fn get<R: JsonSchema, H: Handler<T, Arc<App>>, T: 'static>(
        mut self,
        path: &str,
        about: &str,
        handler: H,
    ) -> Self {
        let responses = responses(self.json_of::<R>());
        self.add(path, "get", get(handler), json!({ "summary": about, "responses": responses }))
    }

    pub fn get_bytes<H: Handler<T, Arc<App>>, T: 'static>(
        self,
        path: &str,
        about: &str,
        media: &str,
        handler: H,
    ) -> Self {
        let responses = responses(json!({ media: {} }));
        self.add(path, "get", get(handler), json!({ "summary": about, "responses": responses }))
    }

    pub fn post<B: JsonSchema, R: JsonSchema, H: Handler<T, Arc<App>>, T: 'static>(
        self,
        path: &str,
        who: For,
        about: &str,
        handler: H,
    ) -> Self {
        self.change::<B, R, _, _>(path, Method::POST, who, about, handler)
    }

    pub fn put_bytes<R: JsonSchema, H: Handler<T, Arc<App>>, T: 'static>(
        mut self,
        path: &str,
        about: &str,
        handler: H,
    ) -> Self {
        let answer = self.json_of::<R>();
        let operation = json!({
            "summary": about,
            "requestBody": { "required": true, "content": { "application/octet-stream": {} } },
            "responses": responses(answer),
            "parameters": [client(For::Control)],
        });
        self.access.insert((path.into(), Method::PUT), For::Control);
        self.add(path, "put", put(handler).layer(DefaultBodyLimit::disable()), operation)
    }

    /// Adds a route of this method.
    pub fn change<B: JsonSchema, R: JsonSchema, H: Handler<T, Arc<App>>, T: 'static>(
        mut self,
        path: &str,
        method: Method,
        who: For,
        about: &str,
        handler: H,
    ) -> Self {
        let Ok(filter) = MethodFilter::try_from(method.clone()) else {
            unreachable!("a method that axum routes")
        };
        let (body, answer) = (self.json_of::<B>(), self.json_of::<R>());
        let mut operation = json!({
            "summary": about,
            "requestBody": { "required": true, "content": body },
            "responses": responses(answer),
        });
        if who != For::All {
            operation["parameters"] = json!([client(who)]);
        }
        let name = method.as_str().to_lowercase();
        self.access.insert((path.into(), method), who);
        self.add(path, &name, on(filter, handler), operation)
    }

    /// Adds a query parameter to the GET route of `path`.
    pub fn query(mut self, path: &str, name: &str, about: &str) -> Self {
        let parameter =
            json!({ "name": name, "in": "query", "description": about, "schema": { "type": "string" } });
        if let Some(operation) = self.paths.get_mut(path).and_then(|path| path.get_mut("get")) {
            add_parameter(operation, parameter);
        }
        self
    }

    fn json_of<T: JsonSchema>(&mut self) -> Value {
        json!({ "application/json": { "schema": self.generator.subschema_for::<T>() } })
    }

    fn add(mut self, path: &str, method: &str, route: MethodRouter<Arc<App>>, mut operation: Value) -> Self {
        let name = path.trim_matches('/').replace(['/', '.', '-'], "_").replace(['{', '}'], "");
        operation["operationId"] = json!(format!("{method}_{name}"));
        let in_path = path.split('/').filter_map(|part| part.strip_prefix('{')?.strip_suffix('}'));
        for name in in_path {
            let parameter =
                json!({ "name": name, "in": "path", "required": true, "schema": { "type": "string" } });
            add_parameter(&mut operation, parameter);
        }
        let entry = self.paths.entry(path).or_insert_with(|| json!({}));
        entry[method] = operation;
        self.router = self.router.route(path, route);
        self
    }

    pub fn finish(mut self) -> (Router<Arc<App>>, Value, Access) {
        let _ = self.generator.subschema_for::<Failure>();
        let schemas = self.generator.take_definitions(true);
        let document = json!({
            "openapi": "3.1.0",
            "info": {
                "title": "farnear",
                "version": env!("CARGO_PKG_VERSION"),
                "description": "The interface of the farnear page. Lengths carry their unit in the name.",
                "license": { "name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0" },
            },
            "servers": [{ "url": "/" }],
            "paths": self.paths,
            "components": { "schemas": schemas },
        });
        (self.router, document, self.access)
    }
}

fn add_parameter(operation: &mut Value, parameter: Value) {
    match operation.get_mut("parameters").and_then(Value::as_array_mut) {
        Some(parameters) => parameters.push(parameter),
        None => operation["parameters"] = json!([parameter]),
    }
}

fn client(who: For) -> Value {
    let about = match who {
        For::Control => "Secret of the client that has control.",
        For::Client | For::All => "Secret of a client, from the first message on the socket.",
    };
    json!({
        "name": CLIENT_HEADER,
        "in": "header",
        "required": true,
        "description": about,
        "schema": { "type": "string" },
    })
}

fn responses(answer: Value) -> Value {
    let failed = json!({ "application/json": { "schema": { "$ref": "#/components/schemas/Failure" } } });
    json!({
        "200": { "description": "Done.", "content": answer },
        "default": { "description": "Why not.", "content": failed },
    })
}
