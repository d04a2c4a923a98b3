//! The page: plain files, embedded and served unchanged.

use axum::{
    extract::Path,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};

use crate::failure::Failure;

struct Asset {
    path: &'static str,
    media: &'static str,
    bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";
const TEXT: &str = "text/plain; charset=utf-8";

macro_rules! assets {
    ($($media:ident $path:literal,)*) => {
        &[$(Asset { path: $path, media: $media, bytes: include_bytes!(concat!("../page/", $path)) }),*]
    };
}

#[rustfmt::skip]
const ASSETS: &[Asset] = assets![
    HTML "index.html", HTML "login.html",
    CSS "style.css", CSS "vendor/uplot.css",
    SVG "icon.svg",
    JS "main.js", JS "link.js", JS "ui.js", JS "keys.js", JS "login.js",
    JS "rig.js", JS "stages.js", JS "live.js", JS "camera.js", JS "plot.js", JS "language.js", JS "viewer.js",
    JS "lens.js", JS "capture.js", JS "depth.js", JS "measure.js", JS "reasons.js", JS "maps.js", JS "npy.js", JS "png.js", JS "mesh.js",
    JS "sessions.js", JS "log.js", JS "quality.js", JS "guides.js", JS "guide-pictures.js", JS "people.js",
    JS "vendor/three.js", JS "vendor/uplot.js",
    TEXT "vendor/LICENSES.txt",
];

pub async fn page() -> Response {
    of("index.html", StatusCode::OK)
}

pub fn login_page() -> Response {
    of("login.html", StatusCode::UNAUTHORIZED)
}

pub async fn asset(Path(path): Path<String>) -> Response {
    of(&path, StatusCode::OK)
}

fn of(path: &str, status: StatusCode) -> Response {
    match ASSETS.iter().find(|asset| asset.path == path) {
        // Not cached: another version may serve the next page at this address.
        Some(asset) => {
            let headers = [(header::CONTENT_TYPE, asset.media), (header::CACHE_CONTROL, "no-cache")];
            (status, headers, asset.bytes).into_response()
        }
        None => Failure::missing("such page").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use sha2::{Digest, Sha256};

    use super::*;

    /// All files of the page load fast over a slow connection.
    #[test]
    fn the_page_is_small() {
        let bytes: usize = ASSETS.iter().map(|asset| asset.bytes.len()).sum();
        assert!(bytes <= 1_500_000, "{bytes} bytes");
    }

    /// `npm run pictures` in `tests-browser` takes the pictures of the documents and writes these sums.
    #[test]
    fn the_pictures_of_the_documents_are_of_this_page() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/images/page.sha256");
        let sums = std::fs::read_to_string(file).unwrap();
        for asset in ASSETS.iter().filter(|asset| asset.media != TEXT) {
            let line = format!("{:x}  {}", Sha256::digest(asset.bytes), asset.path);
            let known = sums.lines().any(|known| known == line);
            assert!(known, "{} has changed: run `npm run pictures` in host/serve/tests-browser", asset.path);
        }
    }

    /// The HTML preloads all modules needed at the start; the 3-D surface loads on demand.
    #[test]
    fn modules_needed_at_the_start_are_preloaded() {
        let page = ASSETS.iter().find(|asset| asset.path == "index.html").map(|asset| asset.bytes).unwrap();
        let page = std::str::from_utf8(page).unwrap();
        for asset in ASSETS.iter().filter(|asset| asset.media == JS) {
            let later = ["login.js", "mesh.js", "vendor/three.js"].contains(&asset.path);
            let announced = page.contains(&format!("rel=\"modulepreload\" href=\"/{}\"", asset.path));
            assert!(announced != later, "{}", asset.path);
        }
    }

    #[test]
    fn every_module_that_is_imported_is_served() {
        for asset in ASSETS.iter().filter(|asset| asset.media == JS && !asset.path.starts_with("vendor/")) {
            let text = std::str::from_utf8(asset.bytes).unwrap();
            let names = text.split("\"./").skip(1).filter_map(|rest| rest.split('"').next());
            for name in names.filter(|name| name.ends_with(".js")) {
                assert!(ASSETS.iter().any(|other| other.path == name), "{} imports {name}", asset.path);
            }
        }
    }
}
