//! JSON's numbers as programs write them.

use serde_json::Value;

/// Some programs write numbers as text.
pub fn number(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_str()?.trim().parse().ok())
}

pub fn first_number(value: &Value) -> Option<f64> {
    match value {
        Value::Array(items) => first_number(items.first()?),
        other => number(other),
    }
}

/// An id as text. Decimals of one length sort by value.
pub fn text(id: &Value) -> Option<String> {
    match id {
        Value::String(name) => Some(name.clone()),
        Value::Number(number) if number.is_f64() => Some(format!("{:.6}", number.as_f64()?)),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// Without a byte-order mark; `NaN` and `Infinity`, which Python's json module writes, as `null`.
pub fn finite(bytes: &[u8]) -> Vec<u8> {
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut out = Vec::with_capacity(bytes.len());
    let (mut at, mut quoted) = (0, false);
    while let Some(&byte) = bytes.get(at) {
        let not_finite = ["NaN", "-Infinity", "Infinity"]
            .into_iter()
            .find(|word| !quoted && bytes[at..].starts_with(word.as_bytes()));
        if let Some(word) = not_finite {
            out.extend(b"null");
            at += word.len();
            continue;
        }
        let length = if quoted && byte == b'\\' { 2 } else { 1 };
        quoted ^= byte == b'"';
        out.extend(&bytes[at..bytes.len().min(at + length)]);
        at += length;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_left_out() {
        assert_eq!(finite("\u{feff}{\"a\": NaN}".as_bytes()), b"{\"a\": null}");
    }
}
