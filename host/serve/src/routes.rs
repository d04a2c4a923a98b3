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
    body::{Bytes, to_bytes},
    extract::{ConnectInfo, DefaultBodyLimit, FromRequest, MatchedPath, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::{Next, from_fn},
    response::{IntoResponse, Response},
    routing::get,
};
use serde::de::DeserializeOwned;

use crate::{
    api::{Access, Api, CLIENT_HEADER, For},
    app::App,
    assets,
    connections::{Connection, Peer},
    failure::Failure,
    guard::Refused,
};

const BODY_MAX: usize = 256 * 1024;
/// Prevents other sites from embedding images of captures.
const RESOURCE_POLICY: HeaderName = HeaderName::from_static("cross-origin-resource-policy");
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; \
                      frame-ancestors 'none'; form-action 'self'";

pub type Shared = State<Arc<App>>;

pub fn api() -> (Router<Arc<App>>, serde_json::Value, Access) {
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

pub fn service(app: &Arc<App>) -> Router {
    let (routes, document, access) = api();
    let access = Arc::new(access);
    let shared = Arc::clone(app);
    let guarded =
        move |request: Request, next: Next| guarded(Arc::clone(&shared), Arc::clone(&access), request, next);
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
        .layer(from_fn(guarded))
        .with_state(Arc::clone(app))
}

/// Applies the guard and sets the content policy.
async fn guarded(app: Arc<App>, access: Arc<Access>, mut request: Request, next: Next) -> Response {
    let headers = request.headers();
    let peer =
        request.extensions().get::<ConnectInfo<Peer>>().map(|ConnectInfo(Peer(peer))| Arc::clone(peer));
    let allowed = app.guard.check_names(request.uri(), headers).and_then(|()| match request.uri().path() {
        "/login" | "/login.js" | "/style.css" => Ok(()),
        _ => app.guard.check_token(headers),
    });
    if allowed.is_ok()
        && let Some(peer) = &peer
    {
        peer.begin_request();
    }
    let mut response = match allowed {
        Ok(()) => {
            let who = who_may(&access, &request);
            match permitted(&app, who, secret(headers)) {
                Ok(()) => {
                    request.extensions_mut().insert(who);
                    next.run(request).await
                }
                Err(failure) => failure.into_response(),
            }
        }
        Err(Refused::Token) if app.guard.has_token(headers) && !delayed(&app, peer.as_deref()).await => {
            too_many()
        }
        Err(Refused::Token) if request.uri().path() == "/" => assets::login_page(),
        Err(Refused::Token) => {
            Failure::new(StatusCode::UNAUTHORIZED, Refused::Token.to_string()).into_response()
        }
        Err(refused) => Failure::new(StatusCode::FORBIDDEN, refused.to_string()).into_response(),
    };
    response = as_json(response).await;
    if let Some(peer) = &peer {
        match response.status() {
            StatusCode::SWITCHING_PROTOCOLS => peer.upgrade(),
            _ => peer.end_request(),
        }
    }
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(RESOURCE_POLICY, HeaderValue::from_static("same-origin"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// An error of axum is plain text; the page and programs read JSON.
async fn as_json(response: Response) -> Response {
    let status = response.status();
    let media = response.headers().get(header::CONTENT_TYPE);
    let is_text = media.is_some_and(|media| media.as_bytes().starts_with(b"text/plain"));
    if !is_text || !(status.is_client_error() || status.is_server_error()) {
        return response;
    }
    let text = to_bytes(response.into_body(), BODY_MAX).await.unwrap_or_default();
    Failure::new(status, String::from_utf8_lossy(&text)).into_response()
}

fn who_may(access: &Access, request: &Request) -> For {
    let path = request.extensions().get::<MatchedPath>();
    path.and_then(|path| access.get(&(path.as_str().to_owned(), request.method().clone())))
        .copied()
        .unwrap_or(For::All)
}

/// Checked before the body is read, and again after it: control may change hands meanwhile.
fn permitted(app: &App, who: For, secret: &str) -> Result<(), Failure> {
    match who {
        For::Control if !app.with_control(|control| control.has_control(secret)) => {
            Err(Failure::new(StatusCode::FORBIDDEN, "another browser has control of the rig")
                .with_hint("Ask for control first."))
        }
        For::Client if app.with_control(|control| control.id_of(secret)).is_none() => Err(unknown_client()),
        For::Control | For::Client | For::All => Ok(()),
    }
}

pub fn unknown_client() -> Failure {
    let error = "unknown client: send the secret of a connected socket in x-farnear-client";
    Failure::new(StatusCode::FORBIDDEN, error)
}

pub async fn delayed(app: &App, peer: Option<&Connection>) -> bool {
    match peer {
        Some(peer) => app.throttle.delay(peer.address()).await,
        None => true,
    }
}

pub fn too_many() -> Response {
    Failure::new(StatusCode::TOO_MANY_REQUESTS, "too many wrong tokens: try again in a second")
        .into_response()
}

/// A JSON body with JSON errors, of a client that may still use the route.
pub struct Body<T>(pub T);

impl<T: DeserializeOwned> FromRequest<Arc<App>> for Body<T> {
    type Rejection = Failure;

    async fn from_request(request: Request, app: &Arc<App>) -> Result<Self, Failure> {
        let json = request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
        // A form of another site cannot send this type.
        if json.is_none_or(|media| media.split(';').next() != Some("application/json")) {
            let error = "expected the header Content-Type: application/json";
            return Err(Failure::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, error));
        }
        let who = request.extensions().get::<For>().copied().unwrap_or(For::All);
        let client = secret(request.headers()).to_owned();
        let within = app.limits.body_timeout;
        let body = tokio::time::timeout(within, Bytes::from_request(request, app)).await;
        let late = |_| {
            Failure::new(
                StatusCode::REQUEST_TIMEOUT,
                format!("the body took longer than {} s", within.as_secs()),
            )
        };
        let bytes = body.map_err(late)?.map_err(|error| Failure::new(error.status(), error.body_text()))?;
        permitted(app, who, &client)?;
        match Json::<T>::from_bytes(&bytes) {
            Ok(Json(body)) => Ok(Self(body)),
            Err(rejection) => Err(Failure::new(rejection.status(), plain(&rejection.body_text()))),
        }
    }
}

/// The reason without the library's prefix.
fn plain(text: &str) -> String {
    [
        "Failed to deserialize the JSON body into the target type: ",
        "Failed to parse the request body as JSON: ",
    ]
    .iter()
    .find_map(|start| text.strip_prefix(start))
    .map_or_else(|| text.to_owned(), |reason| format!("request body: {reason}"))
}

pub fn secret(headers: &HeaderMap) -> &str {
    headers.get(CLIENT_HEADER).and_then(|value| value.to_str().ok()).unwrap_or_default()
}

/// Runs slow work in a thread of its own.
pub async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> Result<T, Failure> {
    let ended = tokio::task::spawn_blocking(work).await;
    ended.unwrap_or_else(|error| Err(Failure::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())))
}
