//! Two servers and one session.

use std::fs;

use farnear_serve::{Listen, serve};
use farnear_workflows::{Cancel, Context, Unattended};
use serde_json::json;

use super::client::{Served, settings};

#[test]
fn a_session_has_one_server_at_a_time() {
    let served = Served::captures_only();
    assert_eq!(served.get("/api/captures").json()["captures"], json!([]));
    let folder = served.session.parent().unwrap().to_owned();
    let cancel = Cancel::default();
    cancel.cancel();
    let context = Context::new(&Unattended, &Unattended, cancel);
    let again = || {
        let served = serve(settings(&folder, Listen::Loopback { port: 0 }), &context, |_| ());
        served.map_err(|error| error.to_string())
    };
    let optics = fs::read(served.session.join("optics.toml")).unwrap();
    let refused = again().unwrap_err();
    assert!(refused.contains(&served.session.display().to_string()), "{refused}");
    assert!(refused.contains("another farnear serve") && refused.contains("--session"), "{refused}");
    assert_eq!(fs::read(served.session.join("optics.toml")).unwrap(), optics);
    let _folder = served.stop();
    again().unwrap();
}
