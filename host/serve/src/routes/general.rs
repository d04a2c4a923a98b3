//! State, log, control, stopping, answers, the socket, the token.

use axum::{
    Json,
    extract::{ConnectInfo, State},
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, Shared, aside, delayed, secret, too_many, unknown_client};
use crate::{
    api::{Api, For},
    app::lock,
    connections::Peer,
    control::HandOverError,
    failure::Failure,
    socket,
    stopping::{PATIENCE, answered_within},
    view::{self, DONE, Done, Nothing},
};

/// Log lines of this session.
#[derive(Serialize, JsonSchema)]
pub struct Log {
    /// The oldest line first.
    pub lines: Vec<view::LogLine>,
}

/// Answer to a request for control.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandOver {
    /// Number of the client that requested control.
    pub to: u32,
    /// Whether it gets control.
    pub give: bool,
}

/// An answer to a question.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// As it was typed; empty where the person only agreed.
    pub text: String,
}

/// What lets a browser in.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Login {
    /// The token of the token file.
    pub token: String,
}

pub fn routes(api: Api) -> Api {
    api.get::<view::State, _, _>("/api/state", "The present state of everything that changes.", state)
        .get::<Log, _, _>("/api/log", "Messages, the oldest first.", log)
        .get_bytes(
            "/api/socket",
            "A WebSocket: first a Hello with the client's secret, then the State at every change, and live pictures (u32 length of a JSON \
             header, header, pixels), among them the depth of a pair that was just taken (type fresh). {\"type\":\"stop\"} stops the rig; {\"type\":\"seen\"} after each picture lets the next one come at once, \
             without it they come once a second. {\"type\":\"here\"} comes every two seconds.",
            "application/json",
            socket::open,
        )
        .post::<Nothing, Done, _, _>("/api/stop", For::All, "Stops all motion along the ramps, now.", stop)
        .post::<Nothing, Done, _, _>(
            "/api/halt",
            For::All,
            "Emergency stop: what moved has lost its position, an alarm is latched.",
            halt,
        )
        .post::<Nothing, Done, _, _>("/api/cancel", For::All, "Ends the computation that is under way.", cancel)
        .post::<Answer, Done, _, _>("/api/answer", For::Control, "Answers the question of a job.", answer)
        .post::<Nothing, Done, _, _>("/api/control/request", For::Client, "Requests control.", ask)
        .post::<HandOver, Done, _, _>("/api/control/answer", For::Control, "Grants or refuses a request for control.", hand_over)
        .post::<Login, Done, _, _>("/login", For::All, "Lets a browser in, by a cookie.", login)
}

async fn state(State(app): Shared) -> Json<view::State> {
    Json(app.state())
}

async fn log(State(app): Shared) -> Json<Log> {
    Json(Log { lines: app.log() })
}

async fn stop(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Done>, Failure> {
    app.note("stop");
    aside(move || Ok(app.stop()?)).await?;
    Ok(Json(DONE))
}

async fn halt(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Done>, Failure> {
    let Some(rig) = app.rig() else { return Err(Failure::missing("rig")) };
    app.note("emergency stop");
    aside(move || {
        let halted = answered_within(PATIENCE, move || rig.halt());
        app.rig_jobs.cancel(None);
        Ok(halted?)
    })
    .await?;
    Ok(Json(DONE))
}

async fn cancel(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Json<Done> {
    app.computing.cancel(None);
    Json(DONE)
}

async fn answer(State(app): Shared, Body(given): Body<Answer>) -> Result<Json<Done>, Failure> {
    if app.state().question.is_none() {
        return Err(Failure::new(StatusCode::CONFLICT, "nothing was asked"));
    }
    *lock(&app.answer) = Some(given.text);
    Ok(Json(DONE))
}

async fn ask(
    State(app): Shared,
    headers: HeaderMap,
    Body(Nothing {}): Body<Nothing>,
) -> Result<Json<Done>, Failure> {
    if app.with_control(|control| control.request(secret(&headers))) {
        return Ok(Json(DONE));
    }
    Err(unknown_client())
}

async fn hand_over(
    State(app): Shared,
    headers: HeaderMap,
    Body(HandOver { to, give }): Body<HandOver>,
) -> Result<Json<Done>, Failure> {
    let answered = app.with_control(|control| control.answer(secret(&headers), to, give));
    answered.map_err(|error| {
        let status = match error {
            HandOverError::NotHolder => StatusCode::FORBIDDEN,
            HandOverError::NotRequested(_) => StatusCode::CONFLICT,
        };
        Failure::new(status, error.to_string())
    })?;
    Ok(Json(DONE))
}

async fn login(
    State(app): Shared,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    Body(Login { token }): Body<Login>,
) -> Response {
    if app.throttle.is_delayed(peer.address()) {
        return too_many();
    }
    match app.guard.cookie(&token) {
        Some(cookie) => ([(header::SET_COOKIE, cookie)], Json(DONE)).into_response(),
        None if delayed(&app, Some(&peer)).await => {
            app.note(format!("warning: wrong token from {}", peer.address()));
            Failure::new(StatusCode::UNAUTHORIZED, "this is not the token").into_response()
        }
        None => too_many(),
    }
}
