//! # farnear-serve
//!
//! The rig in a browser. A page of plain ES modules, embedded, talks to a typed HTTP and WebSocket interface that describes itself
//! at `/openapi.json`; both only parse, show and ask: the tasks are in `farnear-workflows`.
//!
//! - [`app`]: what all requests share; [`job_queue`]: one job at a time on the rig, and one computation at a time;
//!   [`live`]: images and depth between jobs; [`rig_watch`]: how the rig is, ten times a second.
//! - [`control`]: one browser has control, others watch; [`guard`]: which requests are admitted.
//! - [`api`]: the table of routes and the document that follows from it; [`routes`]: one file per subject; [`socket`]: what is
//!   told without being asked.
//! - [`connections`]: time-outs and limits; [`transfer`]: files sent and received a piece at a time.
//! - [`assets`]: the page.
//!
//! A browser that disconnects leaves nothing moving: when the client that has control does not return, the rig is stopped.

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
pub mod picture_message;
pub mod rig_watch;
pub mod routes;
pub mod server;
pub mod socket;
pub mod stopping;
pub mod transfer;
pub mod view;

pub use connections::Limits;
pub use guard::{Listen, Token, TokenError};
pub use server::{ServeError, ServeSettings, serve};
