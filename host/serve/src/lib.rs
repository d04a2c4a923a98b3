//! The rig in a browser: an embedded page of ES modules, and a typed HTTP and WebSocket API (`/openapi.json`) for the
//! tasks of `farnear-workflows`. The rig is stopped if the client in control disconnects and does not return.

pub mod api;
pub mod app;
pub mod assets;
pub mod connections;
pub mod control;
pub mod depth_message;
pub mod face;
pub mod failure;
pub mod guard;
pub mod job_queue;
pub mod live;
pub mod options;
pub mod picture_message;
pub mod rig_watch;
pub mod routes;
pub mod server;
pub mod session_lock;
pub mod socket;
pub mod stopping;
pub mod transfer;
pub mod upload_quota;
pub mod view;

pub use connections::Limits;
pub use guard::{Listen, Token, TokenError};
pub use server::{ServeError, ServeSettings, serve};
