//! State, log, seats, stopping, answers, the socket, the token.

use axum::{
    Json,
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, Shared, aside, driver, secret};
use crate::{
    api::{Api, For},
    app::lock,
    failure::Failure,
    socket,
    view::{self, DONE, Done, Nothing},
};

/// The log.
#[derive(Serialize, JsonSchema)]
pub struct Log {
    /// Its lines, the oldest first.
    pub lines: Vec<String>,
}

/// What the driver says to who asked.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandOver {
    /// Whether they may drive now.
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

/// Adds the routes.
pub fn routes(api: Api) -> Api {
    api.get::<view::State, _, _>("/api/state", "Everything that changes, as it is now.", state)
        .get::<Log, _, _>("/api/log", "What was said, the oldest line first.", log)
        .get_bytes(
            "/api/socket",
            "A WebSocket: first a Hello with a seat, then the State at every change, and live pictures (u32 length of a JSON \
             header, header, pixels), among them the depth of a pair that was just taken (type fresh). {\"type\":\"stop\"} stops the rig; {\"type\":\"seen\"} after each picture lets the next one come at once, \
             without it they come once a second.",
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
        .post::<Answer, Done, _, _>("/api/answer", For::Driver, "Answers the question of a job.", answer)
        .post::<Nothing, Done, _, _>("/api/seat/ask", For::Seated, "Asks for the controls.", ask)
        .post::<HandOver, Done, _, _>("/api/seat/answer", For::Driver, "Gives the controls, or keeps them.", hand_over)
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
        let halted = rig.halt();
        app.rig_lane.cancel();
        Ok(halted?)
    })
    .await?;
    Ok(Json(DONE))
}

async fn cancel(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Json<Done> {
    app.computing.cancel();
    Json(DONE)
}

async fn answer(
    State(app): Shared,
    headers: HeaderMap,
    Body(given): Body<Answer>,
) -> Result<Json<Done>, Failure> {
    driver(&app, &headers)?;
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
    if app.with_seats(|seats| seats.ask(secret(&headers))) {
        return Ok(Json(DONE));
    }
    Err(Failure::new(StatusCode::FORBIDDEN, "no such seat; a seat comes with a socket"))
}

async fn hand_over(
    State(app): Shared,
    headers: HeaderMap,
    Body(HandOver { give }): Body<HandOver>,
) -> Result<Json<Done>, Failure> {
    driver(&app, &headers)?;
    app.with_seats(|seats| seats.answer(secret(&headers), give));
    Ok(Json(DONE))
}

async fn login(State(app): Shared, Body(Login { token }): Body<Login>) -> Response {
    match app.guard.cookie(&token) {
        Some(cookie) => ([(header::SET_COOKIE, cookie)], Json(DONE)).into_response(),
        None => Failure::new(StatusCode::UNAUTHORIZED, "this is not the token").into_response(),
    }
}
