//! Pushes state and pictures to each browser over its WebSocket.

use std::{pin::pin, sync::Arc, time::Duration};

use axum::{
    extract::{
        Query, State, WebSocketUpgrade,
        ws::{Message, WebSocket},
    },
    response::Response,
};
use futures_util::{
    SinkExt, StreamExt,
    stream::{SplitSink, SplitStream},
};
use serde::Deserialize;
use serde_json::json;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

use crate::{app::App, control::RESERVED, routes::Shared, view::Hello};

/// Interval between pings to the browser.
const ASK: Duration = Duration::from_secs(1);
/// Interval between messages without content: a page does not see pings, and must notice that the server has vanished.
const HERE: Duration = Duration::from_secs(2);
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

async fn run(socket: WebSocket, app: Arc<App>, resumed: Option<String>) {
    let Ok(client) = app.with_control(|control| control.join(resumed.as_deref())) else { return };
    let hello = Hello { client: client.id, secret: client.secret, server: app.run.clone() };
    let hello = json!({ "type": "hello", "hello": hello }).to_string();
    // In two halves, because a stop must be received while a picture is sent.
    let (mut sink, mut stream) = socket.split();
    if send(&mut sink, Message::text(hello)).await {
        talk(&mut sink, &mut stream, &app).await;
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
async fn send(sink: &mut SplitSink<WebSocket, Message>, message: Message) -> bool {
    matches!(timeout(SILENCE, sink.send(message)).await, Ok(Ok(())))
}

async fn talk(sink: &mut SplitSink<WebSocket, Message>, stream: &mut SplitStream<WebSocket>, app: &Arc<App>) {
    let (mut state, mut pictures) = (app.follow(), app.pictures.subscribe());
    let mut ask = interval(ASK);
    ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut here = interval(HERE);
    here.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut browser = Browser { heard: Instant::now(), on_the_way: 0, wrong: None };
    let mut pictured = Instant::now();
    loop {
        let message = match browser.wrong.take() {
            Some(text) => Message::text(json!({ "type": "error", "error": text }).to_string()),
            None => {
                let ready = browser.on_the_way < ON_THE_WAY || pictured.elapsed() >= UNSEEN;
                tokio::select! {
                    () = app.ended() => return,
                    said = stream.next() => {
                        if !browser.receive(said, app) {
                            return;
                        }
                        continue;
                    }
                    _ = state.changed() => {
                        let state = Arc::clone(&state.borrow_and_update());
                        Message::text(format!("{{\"type\":\"state\",\"state\":{state}}}"))
                    }
                    // The newest only: pictures that arrive during sending are skipped.
                    _ = pictures.changed(), if ready => {
                        browser.on_the_way = (browser.on_the_way + 1).min(ON_THE_WAY);
                        pictured = Instant::now();
                        Message::Binary(pictures.borrow_and_update().clone())
                    }
                    _ = here.tick() => Message::text(r#"{"type":"here"}"#),
                    _ = ask.tick() => {
                        if browser.heard.elapsed() > SILENCE {
                            return;
                        }
                        Message::Ping(Vec::new().into())
                    }
                }
            }
        };
        let mut sending = pin!(send(sink, message));
        loop {
            tokio::select! {
                biased;
                sent = &mut sending => {
                    if !sent {
                        return;
                    }
                    break;
                }
                said = stream.next() => {
                    if !browser.receive(said, app) {
                        return;
                    }
                }
            }
        }
    }
}

struct Browser {
    /// Time of its last message.
    heard: Instant,
    /// Pictures without acknowledgement.
    on_the_way: u32,
    /// Error to answer its last invalid message.
    wrong: Option<String>,
}

impl Browser {
    /// Returns `false` if the browser has disconnected.
    fn receive(&mut self, said: Option<Result<Message, axum::Error>>, app: &Arc<App>) -> bool {
        self.heard = Instant::now();
        let Some(Ok(said)) = said else { return false };
        match hear(said, app) {
            Heard::Nothing => {}
            Heard::Bye => return false,
            Heard::Seen => self.on_the_way = self.on_the_way.saturating_sub(1),
            Heard::Wrong(text) => self.wrong = Some(text),
        }
        true
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

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        net::{SocketAddr, TcpStream},
    };

    use axum::{Router, routing::get};
    use tokio::net::TcpListener;

    use super::*;
    use crate::live::tests::app;

    const HANDSHAKE: &[u8] = b"GET / HTTP/1.1\r\nhost: localhost\r\nconnection: upgrade\r\n\
        upgrade: websocket\r\nsec-websocket-version: 13\r\n\
        sec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n";
    /// More than the system's buffers of a connection hold.
    const PICTURE_BYTES: usize = 64 << 20;

    fn read_until(client: &mut TcpStream, end: &[u8]) {
        let mut bytes = Vec::new();
        while !bytes.ends_with(end) {
            let mut byte = [0];
            client.read_exact(&mut byte).expect("a byte");
            bytes.push(byte[0]);
        }
    }

    /// Whether the server receives a stop from a client that reads only the first bytes of a picture.
    fn receives_a_stop(address: SocketAddr, app: &App) -> bool {
        let mut client = TcpStream::connect(address).expect("a server");
        client.write_all(HANDSHAKE).expect("an open connection");
        // The state follows the subscription to pictures.
        read_until(&mut client, b"\"type\":\"state\"");
        app.pictures.send_replace(vec![0; PICTURE_BYTES].into());
        // The head of a long binary message.
        read_until(&mut client, &[0x82, 127]);
        let stop = br#"{"type":"stop"}"#;
        let head = [0x81, 0x80 | stop.len() as u8, 0, 0, 0, 0];
        client.write_all(&[&head[..], stop].concat()).expect("an open connection");
        let until = Instant::now() + SILENCE / 2;
        while Instant::now() < until {
            if app.log().iter().any(|line| line.text == "stop") {
                return true;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        false
    }

    #[tokio::test]
    async fn receives_a_stop_while_a_large_picture_is_sent() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let routes = Router::new().route("/", get(open)).with_state(Arc::clone(&app));
        let server = tokio::spawn(async move { axum::serve(listener, routes).await });
        let received = tokio::task::spawn_blocking(move || receives_a_stop(address, &app)).await;
        assert!(received.expect("the client ends"));
        server.abort();
    }
}
