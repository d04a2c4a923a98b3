//! The OpenAPI document, the guard, and every route once.

use std::collections::BTreeSet;

use farnear_scripted_board::Faults;
use serde_json::{Value, json};

use super::{
    attacks::{TOKEN, network},
    client::{Served, Socket},
};

/// Every `$ref` in a document.
fn references(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            if let Some(Value::String(reference)) = fields.get("$ref") {
                found.push(reference.clone());
            }
            fields.values().for_each(|value| references(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| references(value, found)),
        _ => {}
    }
}

#[test]
fn the_document_describes_the_routes_and_refers_to_nothing_that_is_not_there() {
    let served = Served::captures_only();
    let document = served.get("/openapi.json").json();
    assert_eq!(document["openapi"], "3.1.0");
    let mut found = Vec::new();
    references(&document, &mut found);
    assert!(found.len() > 20, "{found:?}");
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap();
        assert!(document.pointer(pointer).is_some(), "{reference} leads nowhere");
    }
    let size = &document["components"]["schemas"]["OneRecording"]["properties"]["megabytes"]["description"];
    assert_eq!(size, "Size of its file, MB.");
    let mut ids = BTreeSet::new();
    for (path, methods) in document["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            assert!(ids.insert(operation["operationId"].as_str().unwrap()), "{method} {path}");
            assert!(operation["summary"].as_str().unwrap().ends_with('.'), "{method} {path}");
            let named: Vec<_> = operation["parameters"].as_array().into_iter().flatten().collect();
            for part in path.split('/').filter_map(|part| part.strip_prefix('{')?.strip_suffix('}')) {
                assert!(named.iter().any(|one| one["name"] == part && one["in"] == "path"), "{path}: {part}");
            }
        }
    }
}

/// Numbers that may have a fraction have one.
fn body_of(method: &str, path: &str) -> &'static str {
    match (method, path) {
        ("post", "/api/answer") => r#"{"text":""}"#,
        ("post", "/api/control/answer") => r#"{"to":1,"give":false}"#,
        ("post", "/login") => r#"{"token":"x"}"#,
        ("post", "/api/rig/move") => r#"{"axis":["fine"],"to_um":[20.50]}"#,
        ("post", "/api/rig/goto") => r#"{"focus":"far"}"#,
        ("post", "/api/rig/scene") => r#"{"scene":"plane:900"}"#,
        ("post", "/api/live") => r#"{"mode":"off","light_percent":[0.50,1.25]}"#,
        ("post", "/api/rig/alarms/clear") => r#"{"number":1}"#,
        ("put", "/api/optics") => {
            r#"{"optics":{"lens":{"focal_length_mm":50.50,"aperture_mm":12.8},"sensor":{"pixel_um":7.4},"focus":{"far_mm":900.50,"max_blur_px":2.7},"psf":{"model":"pillbox"}}}"#
        }
        ("post", "/api/optics/calculate") => {
            r#"{"optics":{"lens":{"focal_length_mm":50.50,"aperture_mm":12.8},"sensor":{"pixel_um":7.4},"focus":{"far_mm":900.50,"max_blur_px":2.7}}}"#
        }
        ("post", "/api/captures") => {
            r#"{"kind":"stack","axis":"fine","from_um":20.50,"to_um":180.25,"steps":3}"#
        }
        ("post", "/api/captures/{capture}/stack") => {
            r#"{"smoothing_px":1.50,"min_reliability":0.50,"positions_um":[0.50,1.50]}"#
        }
        ("post", "/api/captures/{capture}/rename") => r#"{"name":"renamed"}"#,
        ("put", "/api/captures/{capture}/note") => r#"{"rating":1,"text":"n"}"#,
        ("post", "/api/captures/{capture}/region") => r#"{"x":0,"y":0,"width":2,"height":2}"#,
        ("post", "/api/captures/{capture}/profile") => r#"{"from":[0,0],"to":[3,3]}"#,
        ("post", "/api/calibrate/psf") => {
            r#"{"targets":[{"capture":"absent","depth_mm":900.50}],"model":"gaussian"}"#
        }
        ("post", "/api/calibrate/stack") => r#"{"slices":11}"#,
        ("post", "/api/calibrate/series") => r#"{"distances":[890.50,900.50]}"#,
        ("post", "/api/rig/focus") => r#"{"start_mm":900.50,"range_mm":20.50}"#,
        ("post", "/api/calibrate/correction") => r#"{"method":"cdc","smoothing_px":1.50}"#,
        ("post", "/api/people/recognise") => r#"{"video":"absent.y4m"}"#,
        ("post", "/api/people/sun") => r#"{"lat":52.50,"lon":-1.50,"time":"2026-06-21T12:00:00Z"}"#,
        ("post", "/api/people/shadow") => {
            r#"{"video":"absent.y4m","sun":{"lat":52.50,"lon":-1.50,"time":"2026-06-21T12:00:00Z"},"camera":{"height_m":1.50,"azimuth_deg":0.50,"pitch_deg":0.50,"focal_length_mm":4.50,"pixel_um":6.50}}"#
        }
        ("post", "/api/recordings") => r#"{"on":true}"#,
        ("post", "/api/recordings/play") => r#"{"recording":"absent.pairs"}"#,
        ("post", "/api/quality") => r#"{"pairs":2,"true_mm":920.50}"#,
        _ => "{}",
    }
}

#[test]
fn every_route_answers_in_its_own_words() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let socket = Socket::open(&served);
    let document = served.get("/openapi.json").json();
    let mut asked = 0;
    for (path, methods) in document["paths"].as_object().unwrap() {
        for method in methods.as_object().unwrap().keys() {
            let place =
                path.replace("{capture}", "absent").replace("{other}", "other").replace("{file}", "a.png");
            let place = place.replace("{variant}", "favaro").replace("{video}", "absent.y4m");
            let place = place.replace("{shadow}", "absent").replace("{masks}", "with-shadow");
            let client = [("x-farnear-client", socket.secret.as_str())];
            let answer = served.ask(&method.to_uppercase(), &place, &client, body_of(method, path));
            asked += 1;
            let fits = match answer.status {
                200 => true,
                400..600 => !answer.error().is_empty(),
                _ => false,
            };
            assert!(fits, "{method} {path}: {answer:?}");
            assert!(
                answer.status != 404 || place.contains("absent") || answer.error().contains("absent"),
                "{method} {path}: {answer:?}"
            );
            assert!(answer.status != 422, "{method} {path}: the body of this test does not fit: {answer:?}");
            served.post("/api/stop", "", "{}");
            served.state_when(|state| state["job"].is_null() || state["job"]["phase"] != "running");
        }
    }
    assert!(asked >= 35, "{asked} routes");
}

#[test]
fn captures_take_numbers_of_any_form() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let socket = Socket::open(&served);
    for body in [
        r#"{"kind":"series","pairs":2,"interval_s":2.5}"#,
        r#"{"kind":"series","pairs":2,"interval_s":2}"#,
        r#"{"kind":"series","pairs":2,"interval_s":2.50}"#,
        r#"{"kind":"stack","axis":"fine","from_um":20.5,"to_um":1.8e2,"steps":3}"#,
    ] {
        let answer = served.post("/api/captures", &socket.secret, body);
        assert_eq!(answer.status, 200, "{body}: {answer:?}");
        served.post("/api/stop", "", "{}");
        served.ended("job", &answer.json()["job"]);
    }
    for (wrong, words) in [
        ("1e999", "expected a number below 1e308"),
        (r#""2""#, "expected a JSON number"),
        ("-0.5", "0 to 86400"),
    ] {
        let body = format!(r#"{{"kind":"series","pairs":2,"interval_s":{wrong}}}"#);
        let answer = served.post("/api/captures", &socket.secret, &body);
        assert!((400..500).contains(&answer.status) && answer.error().contains(words), "{body}: {answer:?}");
    }
}

#[test]
fn a_setting_that_no_camera_has_is_refused_by_name() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let socket = Socket::open(&served);
    let refused = served.post("/api/camera", &socket.secret, r#"{"set":["gian=1"]}"#);
    assert_eq!(refused.status, 400);
    assert!(refused.error().contains("gian") && refused.error().contains("black_level"), "{refused:?}");
}

#[test]
fn the_page_and_its_files_are_there_with_a_policy() {
    let served = Served::captures_only();
    for (path, media) in [("/", "text/html"), ("/main.js", "text/javascript"), ("/style.css", "text/css")] {
        let answer = served.get(path);
        assert_eq!(answer.status, 200);
        assert!(answer.headers.contains(&format!("content-type: {media}")), "{}", answer.headers);
        assert!(answer.headers.contains("content-security-policy: default-src 'self'"), "{}", answer.headers);
    }
    // The text for a browser that is too old for the page.
    let page = String::from_utf8(served.get("/").body).unwrap();
    assert!(page.contains("it needs JavaScript, and a browser not older than"), "{page}");
    assert_eq!(served.get("/../Cargo.toml").status, 404);
    assert_eq!(served.get("/nothing").error(), "there is no such page");
    assert_eq!(served.ask("DELETE", "/api/state", &[], "").status, 405);
}

#[test]
fn requests_that_axum_refuses_are_answered_in_json() {
    let served = Served::captures_only();
    for path in ["/%ff", "/api/captures/%ff", "/api/captures?search=a&search=b", "/api/socket"] {
        let answer = served.get(path);
        assert_eq!(answer.status, 400, "{path}: {answer:?}");
        assert!(answer.headers.contains("content-type: application/json"), "{path}: {answer:?}");
        assert!(!answer.error().is_empty(), "{path}: {answer:?}");
    }
}

#[test]
fn the_network_needs_the_token() {
    let served = Served::start(None, None, network);
    let page = served.get("/");
    assert_eq!(page.status, 401);
    assert!(String::from_utf8_lossy(&page.body).contains("id=\"token\""));
    for path in ["/api/state", "/main.js", "/openapi.json"] {
        assert_eq!(served.get(path).status, 401, "{path}");
    }
    assert_eq!(served.get("/login.js").status, 200);
    let wrong = json!({ "token": "0123456789abcdef0124" }).to_string();
    assert_eq!(served.post("/login", "", &wrong).status, 401);
    let let_in = served.post("/login", "", &json!({ "token": TOKEN }).to_string());
    let cookie = served.cookie(TOKEN);
    assert!(let_in.headers.contains(&format!("set-cookie: {cookie}; HttpOnly")), "{let_in:?}");
    assert_eq!(served.ask("GET", "/api/state", &[("cookie", cookie.as_str())], "").status, 200);
    let bearer = format!("Bearer {TOKEN}");
    assert_eq!(served.ask("GET", "/api/state", &[("authorization", bearer.as_str())], "").status, 200);
}
