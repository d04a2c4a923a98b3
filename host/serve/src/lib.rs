//! # farnear-serve
//!
//! The rig in a browser. A page of plain ES modules, embedded, talks to a typed HTTP and WebSocket interface that describes itself
//! at `/openapi.json`; both only parse, show and ask: what is done lies in `farnear-workflows`.
//!
//! - [`app`]: what all requests share; [`lane`]: one job after the other on the rig, and one beside it that computes;
//!   [`live`]: images and depth between jobs; [`rig_watch`]: how the rig is, ten times a second.
//! - [`seats`]: one browser drives, others watch; [`guard`]: who may talk to this program at all.
//! - [`api`]: the table of routes and the document that follows from it; [`routes`]: one file per subject; [`socket`]: what is
//!   told without being asked.
//! - [`assets`]: the page.
//!
//! A browser that goes away leaves nothing moving: when the socket of the one that drives ends, the rig is stopped.

pub mod api;
pub mod app;
pub mod assets;
pub mod depth_message;
pub mod face;
pub mod failure;
pub mod guard;
pub mod lane;
pub mod live;
pub mod picture_message;
pub mod rig_watch;
pub mod routes;
pub mod seats;
pub mod server;
pub mod socket;
pub mod stopping;
pub mod view;

pub use guard::{Listen, Token, TokenError};
pub use server::{ServeError, ServeSettings, serve};
