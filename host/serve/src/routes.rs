//! All routes, one file per subject.

pub mod calibrate;
pub mod camera;
pub mod captures;
pub mod depth;
pub mod files;
pub mod general;
pub mod lens;
pub mod people;
pub mod quality;
pub mod recordings;
pub mod rig;

use std::sync::Arc;

use axum::{
    Json, Router,
    extract::{DefaultBodyLimit, FromRequest, Request, State},
    http::{HeaderMap, HeaderValue, StatusCode, header},
    middleware::{Next, from_fn_with_state},
    response::{IntoResponse, Response},
    routing::get,
};
use serde::de::DeserializeOwned;

use crate::{
    api::{Api, CLIENT_HEADER},
    app::App,
    assets,
    failure::Failure,
    guard::Refused,
};

/// Longest body of a request: a note, a program.
const BODY_MAX: usize = 256 * 1024;
/// What a page may load: its own files, and pictures it makes itself.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; \
                      frame-ancestors 'none'; form-action 'self'";

/// What every route may use.
pub type Shared = State<Arc<App>>;

/// All routes with what belongs to them, and the document about them.
pub fn api() -> (Router<Arc<App>>, serde_json::Value) {
    let api = general::routes(Api::default());
    let api = rig::routes(api);
    let api = camera::routes(api);
    let api = lens::routes(api);
    let api = captures::routes(api);
    let api = files::routes(api);
    let api = depth::routes(api);
    let api = quality::routes(api);
    let api = calibrate::routes(api);
    let api = people::routes(api);
    let api = recordings::routes(api);
    api.finish()
}

/// Everything that answers a request.
pub fn service(app: &Arc<App>) -> Router {
    let (routes, document) = api();
    let document = Json(document);
    routes
        .route("/openapi.json", get(move || std::future::ready(document.clone())))
        .route("/", get(assets::page))
        .route("/{*path}", get(assets::asset))
        .fallback(async || Failure::missing("such route"))
        .method_not_allowed_fallback(async || {
            Failure::new(
                StatusCode::METHOD_NOT_ALLOWED,
                "this route is not asked like that; see /openapi.json",
            )
        })
        .layer(DefaultBodyLimit::max(BODY_MAX))
        .layer(from_fn_with_state(Arc::clone(app), guarded))
        .with_state(Arc::clone(app))
}

/// Lets through what the guard allows, and says what a page may load.
async fn guarded(State(app): Shared, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let allowed = app.guard.check_names(headers).and_then(|()| match request.uri().path() {
        "/login" | "/login.js" | "/style.css" => Ok(()),
        _ => app.guard.check_token(headers),
    });
    let mut response = match allowed {
        Ok(()) => next.run(request).await,
        Err(Refused::Token) if request.uri().path() == "/" => assets::login_page(),
        Err(Refused::Token) => {
            Failure::new(StatusCode::UNAUTHORIZED, Refused::Token.to_string()).into_response()
        }
        Err(refused) => Failure::new(StatusCode::FORBIDDEN, refused.to_string()).into_response(),
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// A JSON body; what is wrong with it is said in JSON too.
pub struct Body<T>(pub T);

impl<T: DeserializeOwned> FromRequest<Arc<App>> for Body<T> {
    type Rejection = Failure;

    async fn from_request(request: Request, app: &Arc<App>) -> Result<Self, Failure> {
        match Json::<T>::from_request(request, app).await {
            Ok(Json(body)) => Ok(Self(body)),
            Err(rejection) => Err(Failure::new(rejection.status(), rejection.body_text())),
        }
    }
}

/// Refuses a client that does not have control.
///
/// # Errors
/// A failure that says how to.
pub fn require_control(app: &App, headers: &HeaderMap) -> Result<(), Failure> {
    let secret = secret(headers);
    if app.with_control(|control| control.has_control(secret)) {
        return Ok(());
    }
    Err(Failure::new(StatusCode::FORBIDDEN, "another browser has control of the rig")
        .with_hint("Ask for control first."))
}

/// Refuses a request without the secret of a connected client.
///
/// # Errors
/// 403.
pub fn require_client(app: &App, headers: &HeaderMap) -> Result<(), Failure> {
    match app.with_control(|control| control.id_of(secret(headers))) {
        Some(_) => Ok(()),
        None => Err(Failure::new(StatusCode::FORBIDDEN, "unknown client: send the secret of a connected socket in x-farnear-client")),
    }
}

/// The secret of the client; empty without one.
pub fn secret(headers: &HeaderMap) -> &str {
    headers.get(CLIENT_HEADER).and_then(|value| value.to_str().ok()).unwrap_or_default()
}

/// Does what takes a while, in a thread of its own.
///
/// # Errors
/// What `work` gives.
pub async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> Result<T, Failure> {
    let ended = tokio::task::spawn_blocking(work).await;
    ended.unwrap_or_else(|error| Err(Failure::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())))
}
