//! The host's USB serial adapter: holds received bytes for its latency, counted from the first byte.

#[derive(Debug, Default)]
pub struct Adapter {
    kept: Vec<u8>,
    until_ns: u64,
}

impl Adapter {
    /// Returns the bytes that are due.
    pub fn pass(&mut self, bytes: Vec<u8>, now_ns: u64, latency_ns: u64) -> Vec<u8> {
        if self.kept.is_empty() {
            self.until_ns = now_ns + latency_ns;
        }
        self.kept.extend(bytes);
        if now_ns >= self.until_ns { std::mem::take(&mut self.kept) } else { Vec::new() }
    }

    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }
}
