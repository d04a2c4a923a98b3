//! Pushes state and pictures to each browser over its WebSocket.

use std::{sync::Arc, time::Duration};

use axum::{
    extract::{
        Query, State, WebSocketUpgrade,
        ws::{Message, WebSocket},
    },
    response::Response,
};
use serde::Deserialize;
use serde_json::json;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

use crate::{app::App, control::RESERVED, routes::Shared, view::Hello};

/// Interval between pings to the browser.
const ASK: Duration = Duration::from_secs(1);
/// Longest silence: a browser answers pings even while its page is busy.
const SILENCE: Duration = Duration::from_secs(5);
/// Pictures without acknowledgement: on display and in transit. More would delay the display by seconds.
const ON_THE_WAY: u32 = 2;
/// Picture interval for a browser that acknowledges nothing.
const UNSEEN: Duration = Duration::from_secs(1);
const DISCONNECTED: &str = "the browser that had control has disconnected";
const MESSAGE_MAX: usize = 4096;

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
enum ClientMessage {
    Stop,
    /// Acknowledges a picture.
    Seen,
}

#[derive(Deserialize)]
pub struct Resume {
    /// Secret of the same page before it was reloaded.
    resume: Option<String>,
}

pub async fn open(
    State(app): Shared,
    Query(Resume { resume }): Query<Resume>,
    upgrade: WebSocketUpgrade,
) -> Response {
    upgrade
        .max_message_size(MESSAGE_MAX)
        .max_frame_size(MESSAGE_MAX)
        .on_upgrade(move |socket| run(socket, app, resume))
}

async fn run(mut socket: WebSocket, app: Arc<App>, resumed: Option<String>) {
    let Ok(client) = app.with_control(|control| control.join(resumed.as_deref())) else { return };
    let version = env!("CARGO_PKG_VERSION").into();
    let hello = Hello { client: client.id, secret: client.secret, version };
    let hello = json!({ "type": "hello", "hello": hello }).to_string();
    if send(&mut socket, Message::text(hello)).await {
        talk(&mut socket, &app).await;
    }
    if !app.with_control(|control| control.leave(client.id)) {
        return;
    }
    tokio::select! {
        () = tokio::time::sleep(RESERVED) => {}
        () = app.ended() => {}
    }
    // Stops before the next holder can begin something.
    let stop =
        app.with_control(|control| control.expire(client.id).then(|| app.begin_stop_because(DISCONNECTED)));
    if let Some(stop) = stop {
        app.note(format!("{DISCONNECTED}: stopping"));
        let _ = tokio::task::spawn_blocking(move || app.tell_stop(stop)).await; // a failure is in the log
    }
}

/// Returns `false` if the browser accepts nothing in time.
async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SILENCE, socket.send(message)).await, Ok(Ok(())))
}

async fn talk(socket: &mut WebSocket, app: &Arc<App>) {
    let (mut state, mut pictures) = (app.follow(), app.pictures.subscribe());
    let mut ask = interval(ASK);
    ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut heard = Instant::now();
    let (mut on_the_way, mut pictured) = (0, Instant::now());
    loop {
        let ready = on_the_way < ON_THE_WAY || pictured.elapsed() >= UNSEEN;
        let message = tokio::select! {
            () = app.ended() => return,
            said = socket.recv() => {
                heard = Instant::now();
                let Some(Ok(said)) = said else { return };
                match hear(said, app) {
                    Heard::Nothing => continue,
                    Heard::Bye => return,
                    Heard::Seen => {
                        on_the_way = on_the_way.saturating_sub(1);
                        continue;
                    }
                    Heard::Wrong(text) => Message::text(json!({ "type": "error", "error": text }).to_string()),
                }
            }
            _ = state.changed() => {
                let state = Arc::clone(&state.borrow_and_update());
                Message::text(format!("{{\"type\":\"state\",\"state\":{state}}}"))
            }
            // The newest only: pictures that arrive during sending are skipped.
            _ = pictures.changed(), if ready => {
                (on_the_way, pictured) = ((on_the_way + 1).min(ON_THE_WAY), Instant::now());
                Message::Binary(pictures.borrow_and_update().clone())
            }
            _ = ask.tick() => {
                if heard.elapsed() > SILENCE {
                    return;
                }
                Message::Ping(Vec::new().into())
            }
        };
        if !send(socket, message).await {
            return;
        }
    }
}

enum Heard {
    Nothing,
    Seen,
    Bye,
    Wrong(String),
}

fn hear(said: Message, app: &Arc<App>) -> Heard {
    match said {
        Message::Text(text) => match serde_json::from_str(&text) {
            Ok(ClientMessage::Stop) => {
                app.note("stop");
                let (app, stop) = (Arc::clone(app), app.begin_stop());
                drop(tokio::task::spawn_blocking(move || app.tell_stop(stop)));
                Heard::Nothing
            }
            Ok(ClientMessage::Seen) => Heard::Seen,
            Err(error) => {
                Heard::Wrong(format!("expected {{\"type\":\"stop\"}} or {{\"type\":\"seen\"}}: {error}"))
            }
        },
        Message::Binary(_) => Heard::Wrong("expected text".into()),
        Message::Ping(_) | Message::Pong(_) => Heard::Nothing,
        Message::Close(_) => Heard::Bye,
    }
}
