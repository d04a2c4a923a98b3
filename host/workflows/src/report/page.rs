use std::fmt::Write as _;

use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::{pictures::decimals, style::STYLE};
use crate::{
    MADE_BY,
    measure::{PlaneFigures, RegionFigures},
};

const TEXT_MAX: usize = 20_000;

pub(super) struct Page(pub String);

impl Page {
    pub fn begin(title: &str) -> Self {
        let title = escaped(title);
        Self(format!(
            "<!doctype html><html lang=en><head><meta charset=utf-8><title>{title}</title>\
             <meta name=viewport content=\"width=device-width,initial-scale=1\"><style>{STYLE}</style></head><body><main>"
        ))
    }

    pub fn picture(&mut self, png: &[u8], caption: &str) {
        let (data, caption) = (STANDARD.encode(png), escaped(caption));
        let _ = write!(
            self.0,
            "<figure><img src=\"data:image/png;base64,{data}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>"
        );
    }

    pub fn figures(&mut self, found: &RegionFigures) {
        let unit = found.unit;
        // `scale` is the least length that must not be rounded away.
        let length = |value: Option<f64>, scale: Option<f64>| {
            let decimals = decimals(scale.unwrap_or_default(), 3);
            value.map_or_else(|| "-".into(), |value| format!("{value:.decimals$} {unit}"))
        };
        let mut rows = vec![
            ("fill rate", format!("{:.2} %", 100.0 * found.fill_rate)),
            ("mean depth", length(found.mean, found.standard_deviation)),
            ("standard deviation", length(found.standard_deviation, found.standard_deviation)),
            ("predicted deviation (RMS)", length(found.predicted_deviation, found.predicted_deviation)),
        ];
        if let Some([low, high]) = found.range {
            let decimals = decimals(high - low, 2);
            rows.push(("range", format!("{low:.decimals$} to {high:.decimals$} {unit}")));
        }
        if let Some(PlaneFigures { per_pixel, plane, .. }) = &found.plane {
            rows.push(("plane fit: RMS", length(Some(plane.rms_mm), Some(plane.rms_mm))));
            if !per_pixel {
                rows.push(("plane fit: tilt", format!("{:.3}°", plane.tilt_deg)));
            }
        }
        self.0.push_str("<table>");
        for (name, value) in rows {
            let _ = write!(self.0, "<tr><th>{name}</th><td>{value}</td></tr>");
        }
        self.0.push_str("</table>");
    }

    pub fn text(&mut self, heading: &str, text: &str) {
        let end = text.char_indices().nth(TEXT_MAX).map_or(text.len(), |(at, _)| at);
        let cut = if end < text.len() { "\n..." } else { "" };
        let text = escaped(&text[..end]);
        let _ = write!(self.0, "<section><h2>{}</h2><pre>{text}{cut}</pre></section>", escaped(heading));
    }

    pub fn end(mut self) -> String {
        let _ = write!(self.0, "<footer>{MADE_BY}</footer></main></body></html>");
        self.0
    }
}

/// Escapes text for HTML, also inside quotes.
pub(super) fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut escaped, letter| {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            letter => escaped.push(letter),
        }
        escaped
    })
}
