//! Access: by default the browser of this computer, otherwise holders of a token. A foreign page can send
//! requests to loopback, so `Host` and `Origin` are checked. A public DNS name could resolve to this
//! computer; it is refused unless allowed.

use std::{
    collections::HashSet,
    fmt, fs,
    net::{IpAddr, Ipv4Addr, SocketAddr},
    path::{Path, PathBuf},
    sync::Mutex,
    time::Duration,
};

use axum::http::{HeaderMap, Uri, header};
use subtle::ConstantTimeEq;

use crate::app::lock;

/// Shortest token: 16 characters of hexadecimal are 64 bits.
const SHORTEST: usize = 16;
const LONGEST: usize = 256;
const GUESS: Duration = Duration::from_secs(1);
/// Begins the cookie's name, which ends with the port: a browser sends a host's cookies to all of its ports.
const COOKIE: &str = "farnear-token";

#[derive(Debug)]
pub enum Listen {
    /// Port 0 selects a free one.
    Loopback { port: u16 },
    Network {
        address: SocketAddr,
        token: Token,
        /// Names of this computer, in addition to its addresses.
        names: Vec<String>,
    },
}

impl Listen {
    pub fn address(&self) -> SocketAddr {
        match self {
            Self::Loopback { port } => (Ipv4Addr::LOCALHOST, *port).into(),
            Self::Network { address, .. } => *address,
        }
    }
}

/// A secret, compared in constant time and never shown.
pub struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(...)")
    }
}

#[derive(Debug, thiserror::Error)]
pub enum TokenError {
    #[error("cannot read the token file {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error(
        "{} holds no token: expected one line of {SHORTEST} to {LONGEST} letters and digits, e.g. from `openssl rand -hex 16`",
        path.display()
    )]
    Content { path: PathBuf },
}

impl Token {
    pub fn read(path: &Path) -> Result<Self, TokenError> {
        let text =
            fs::read_to_string(path).map_err(|source| TokenError::Read { path: path.into(), source })?;
        // PowerShell writes a byte-order mark.
        let text = text.trim_start_matches('\u{feff}').trim();
        Self::new(text).ok_or_else(|| TokenError::Content { path: path.into() })
    }

    /// Accepts letters and digits; `None` for other or short texts.
    pub fn new(text: &str) -> Option<Self> {
        let fits =
            (SHORTEST..=LONGEST).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_alphanumeric());
        fits.then(|| Self(text.into()))
    }

    /// Compares in constant time for a given length.
    pub fn is(&self, text: &str) -> bool {
        self.0.as_bytes().ct_eq(text.as_bytes()).into()
    }
}

#[derive(Debug, Default)]
pub struct Guard {
    token: Option<Token>,
    names: Vec<String>,
    /// Port of the page.
    port: u16,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Refused {
    #[error("this computer is not known by that name; use its address, or allow the name with --name")]
    Host,
    #[error("the header Host or Origin occurs twice; expected one of each")]
    Doubled,
    #[error("a page from elsewhere may not talk to the rig")]
    Origin,
    #[error("the token is missing or wrong")]
    Token,
}

impl Guard {
    /// `port` is the one that the system has bound.
    pub fn new(listen: &Listen, port: u16) -> Self {
        match listen {
            Listen::Loopback { .. } => Self { port, ..Self::default() },
            Listen::Network { token, names, .. } => {
                Self { token: Some(Token(token.0.clone())), names: names.clone(), port }
            }
        }
    }

    /// Checks `Host` and `Origin`.
    pub fn check_names(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refused> {
        if [header::HOST, header::ORIGIN].iter().any(|name| headers.get_all(name).iter().count() > 1) {
            return Err(Refused::Doubled);
        }
        let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
        let host = text(header::HOST).ok_or(Refused::Host)?;
        // `GET http://name/path`: the name must be that of the `Host` header.
        let same = uri.authority().is_none_or(|authority| authority.as_str() == host);
        if !self.is_ours(host) || !same {
            return Err(Refused::Host);
        }
        match text(header::ORIGIN) {
            Some(origin) if origin.strip_prefix("http://") != Some(host) => Err(Refused::Origin),
            _ => Ok(()),
        }
    }

    pub fn check_token(&self, headers: &HeaderMap) -> Result<(), Refused> {
        let Some(token) = &self.token else { return Ok(()) };
        let bearer = texts(headers, header::AUTHORIZATION).filter_map(|value| value.strip_prefix("Bearer "));
        if bearer.chain(self.cookies(headers)).any(|given| token.is(given)) {
            Ok(())
        } else {
            Err(Refused::Token)
        }
    }

    pub fn has_token(&self, headers: &HeaderMap) -> bool {
        headers.contains_key(header::AUTHORIZATION) || self.cookies(headers).next().is_some()
    }

    /// Values of this port's cookies.
    fn cookies<'a>(&self, headers: &'a HeaderMap) -> impl Iterator<Item = &'a str> {
        let name = format!("{COOKIE}-{}=", self.port);
        let pairs = texts(headers, header::COOKIE).flat_map(|value| value.split(';'));
        pairs.filter_map(move |pair| pair.trim().strip_prefix(&*name))
    }

    /// The cookie for a correct token.
    pub fn cookie(&self, typed: &str) -> Option<String> {
        let known = self.token.as_ref().is_some_and(|token| token.is(typed));
        known.then(|| format!("{COOKIE}-{}={typed}; HttpOnly; SameSite=Strict; Path=/", self.port))
    }

    /// Whether this host, with or without a port, is this computer.
    fn is_ours(&self, host: &str) -> bool {
        // A browser sends names in lower case, however they were typed.
        let host = host.to_ascii_lowercase();
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) && !name.ends_with(':') => name,
            _ => host.as_str(),
        };
        let bare = name.trim_start_matches('[').trim_end_matches(']');
        let address = bare.parse::<IpAddr>().ok();
        if name == "localhost" || address.is_some_and(|address| address.is_loopback()) {
            return true;
        }
        // Beyond loopback: an address, or a name without a dot, cannot be a foreign host's name.
        let local = !name.contains('.') || name.ends_with(".local");
        self.token.is_some()
            && (address.is_some()
                || (local && !name.is_empty())
                || self.names.iter().any(|known| known.eq_ignore_ascii_case(name)))
    }
}

/// Delays answers to wrong tokens: one per second and address. A right cookie or bearer is answered immediately, so this
/// does not limit guesses; the token's length does.
#[derive(Debug, Default)]
pub struct Throttle(Mutex<HashSet<IpAddr>>);

impl Throttle {
    /// Waits after a wrong token; `false` immediately while an earlier guess of this address waits.
    pub async fn delay(&self, address: IpAddr) -> bool {
        if !lock(&self.0).insert(address) {
            return false;
        }
        let _waiting = Waiting { throttle: self, address };
        tokio::time::sleep(GUESS).await;
        true
    }

    pub fn is_delayed(&self, address: IpAddr) -> bool {
        lock(&self.0).contains(&address)
    }
}

/// Ends when the client disconnects, too.
struct Waiting<'a> {
    throttle: &'a Throttle,
    address: IpAddr,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        lock(&self.throttle.0).remove(&self.address);
    }
}

fn texts(headers: &HeaderMap, name: header::HeaderName) -> impl Iterator<Item = &str> {
    headers.get_all(name).iter().filter_map(|value| value.to_str().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "0123456789abcdef0123";

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    fn network() -> Guard {
        let names = vec!["Rig.lab.example".into()];
        Guard { token: Token::new(SECRET), names, port: 8080 }
    }

    #[test]
    fn loopback_answers_to_loopback_names_only() {
        let guard = Guard::default();
        let asked = |host: &str| guard.check_names(&Uri::default(), &headers(&[("host", host)]));
        for host in ["localhost", "localhost:8080", "127.0.0.1:8080", "[::1]:8080", "[::1]", "::1"] {
            assert_eq!(asked(host), Ok(()), "{host}");
        }
        for host in [
            "evil.example:8080",
            "192.168.0.7",
            "rig",
            "",
            "localhost:x",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
        ] {
            assert_eq!(asked(host), Err(Refused::Host), "{host}");
        }
        assert_eq!(guard.check_names(&Uri::default(), &HeaderMap::new()), Err(Refused::Host));
    }

    #[test]
    fn the_network_answers_to_addresses_local_names_and_allowed_ones() {
        let guard = network();
        let asked = |host: &str| guard.check_names(&Uri::default(), &headers(&[("host", host)]));
        for host in
            ["192.168.0.7:8080", "[fe80::1]:8080", "rig:8080", "RIG.local", "rig.lab.example:80", "localhost"]
        {
            assert_eq!(asked(host), Ok(()), "{host}");
        }
        for host in ["evil.example", "", "rig.lab.example.evil.example"] {
            assert_eq!(asked(host), Err(Refused::Host), "{host}");
        }
    }

    #[test]
    fn the_token_comes_as_cookie_or_bearer() {
        let guard = network();
        let asked = |name, value: &str| guard.check_token(&headers(&[(name, value)]));
        assert_eq!(asked("authorization", &format!("Bearer {SECRET}")), Ok(()));
        assert_eq!(asked("cookie", &format!("a=b; farnear-token-8080={SECRET}")), Ok(()));
        for (name, value) in [
            ("authorization", SECRET),
            ("cookie", "farnear-token-8080="),
            ("cookie", "farnear-token-8080=0123"),
            ("accept", SECRET),
        ] {
            assert_eq!(asked(name, value), Err(Refused::Token), "{name}: {value}");
        }
        assert_eq!(Guard::default().check_token(&HeaderMap::new()), Ok(()));
        assert!(guard.cookie(SECRET).is_some_and(|cookie| cookie.contains("HttpOnly")));
        assert_eq!(guard.cookie("0123456789abcdef0124"), None);
    }

    #[test]
    fn servers_at_two_ports_of_a_host_keep_their_cookies() {
        let guard = network();
        let own = guard.cookie(SECRET).unwrap();
        assert!(own.starts_with(&format!("farnear-token-8080={SECRET};")), "{own}");
        let sent = headers(&[("cookie", &format!("farnear-token-8081=other; farnear-token-8080={SECRET}"))]);
        assert_eq!(guard.check_token(&sent), Ok(()));
        let sent = headers(&[("cookie", &format!("farnear-token-8081={SECRET}"))]);
        assert_eq!(guard.check_token(&sent), Err(Refused::Token));
    }

    #[test]
    fn doubled_headers_and_other_names_in_the_request_line_are_refused() {
        let guard = Guard::default();
        for name in ["host", "origin"] {
            let mut twice = headers(&[("host", "localhost:1"), ("origin", "http://localhost:1")]);
            twice.append(name, "http://evil.example".parse().unwrap());
            assert_eq!(guard.check_names(&Uri::default(), &twice), Err(Refused::Doubled), "{name}");
        }
        let headers = headers(&[("host", "localhost:1")]);
        let asked = |uri: &'static str| guard.check_names(&Uri::from_static(uri), &headers);
        assert_eq!(asked("http://localhost:1/api/state"), Ok(()));
        for uri in ["http://evil.example/api/state", "http://localhost:2/", "http://user@localhost:1/"] {
            assert_eq!(asked(uri), Err(Refused::Host), "{uri}");
        }
    }

    #[test]
    fn tokens_are_long_and_plain() {
        for text in ["", "short", "0123456789abcde\n", "0123456789abcdef; Path=/", &"x".repeat(300)] {
            assert!(Token::new(text).is_none(), "{text:?}");
        }
        assert_eq!(format!("{:?}", network().token), "Some(Token(...))");
    }

    #[test]
    fn a_token_file_of_windows_is_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), format!("\u{feff}{SECRET}\r\n")).unwrap();
        assert!(Token::read(file.path()).unwrap().is(SECRET));
    }

    #[test]
    fn a_token_that_is_sent_is_noticed_whether_or_not_it_is_right() {
        for (name, value, sent) in [
            ("authorization", "Bearer 0123", true),
            ("cookie", "a=b; farnear-token-8080=0123", true),
            ("cookie", "farnear-token-1=0123", false),
            ("cookie", "a=b; c=d", false),
            ("accept", "farnear-token=0123", false),
        ] {
            assert_eq!(network().has_token(&headers(&[(name, value)])), sent, "{name}: {value}");
        }
    }

    #[test]
    fn one_wrong_token_per_address_waits_and_others_are_refused_at_once() {
        let [guessing, other] = [1, 2].map(|last| IpAddr::from([192, 168, 0, last]));
        let throttle = Throttle::default();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(async {
            let mut waiting = Box::pin(throttle.delay(guessing));
            let waits = std::future::poll_fn(|context| {
                std::task::Poll::Ready(waiting.as_mut().poll(context).is_pending())
            });
            assert!(waits.await && throttle.is_delayed(guessing) && !throttle.is_delayed(other));
            assert!(!throttle.delay(guessing).await);
            assert!(throttle.is_delayed(guessing), "the first still waits");
            drop(waiting);
            assert!(!throttle.is_delayed(guessing), "a dropped request frees the address");
            let began = std::time::Instant::now();
            assert!(throttle.delay(guessing).await && began.elapsed() >= GUESS);
            assert!(!throttle.is_delayed(guessing));
        });
    }
}
