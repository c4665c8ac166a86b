//! Admission of requests. A browser tells which page a connection comes from (`Origin`), and which name led to us
//! (`Host`); a stranger's page must not read what a robot records, not even one whose name resolves to this machine.

use std::net::IpAddr;

/// Pages of viewers that are served from elsewhere; a leading dot stands for all subdomains.
const VIEWERS: [&str; 2] = ["foxglove.dev", ".foxglove.dev"];
/// Origin of programs that show a page from their own files.
const OWN_FILES: &str = "file://";

/// Rules of admission.
#[derive(Debug)]
pub(super) struct Door {
    /// Hosts and origins besides ours.
    allowed: Vec<String>,
}

/// Refusal of a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Refused {
    pub(super) status: &'static str,
    pub(super) why: String,
}

impl Refused {
    fn forbidden(why: String) -> Self {
        Self { status: "403 Forbidden", why }
    }

    pub(super) fn full() -> Self {
        let why = "as many viewers are here as limits.viewers allows; try again later".to_owned();
        Self { status: "503 Service Unavailable", why }
    }
}

impl Door {
    pub(super) fn new(allowed: Vec<String>) -> Self {
        Self { allowed }
    }

    /// Admits or refuses a request by its head.
    pub(super) fn judge(&self, request: &[u8]) -> Result<(), Refused> {
        let malformed = || Refused { status: "400 Bad Request", why: "not a request for a WebSocket".to_owned() };
        let mut lines = std::str::from_utf8(request).map_err(|_| malformed())?.split("\r\n");
        lines.next().filter(|line| line.starts_with("GET ")).ok_or_else(malformed)?;
        let (mut hosts, mut origins) = (Vec::new(), Vec::new());
        for (name, value) in
            lines.take_while(|line| !line.is_empty()).map(|line| line.split_once(':').unwrap_or((" ", "")))
        {
            if name.is_empty() || name.contains(char::is_whitespace) {
                // Such as a line that continues the one before, which others may read otherwise.
                return Err(malformed());
            }
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                "host" => hosts.push(value),
                "origin" => origins.push(value),
                _ => {}
            }
        }
        let ([host], [] | [_]) = (&hosts[..], &origins[..]) else { return Err(malformed()) };
        // More than one, as a client joins them that repeats the field, is none of them.
        let host = host_of(host).ok_or_else(malformed)?;
        if !is_near(host) && !self.allows(host) {
            let why = format!("the host `{host}` is not known here: `--live-allow {host}` serves it");
            return Err(Refused::forbidden(crate::printable(&why).into_owned()));
        }
        let Some(&origin) = origins.first() else { return Ok(()) };
        if !self.welcomes(origin, host) {
            let why = format!("pages of `{origin}` are not served: `--live-allow {origin}` serves them");
            return Err(Refused::forbidden(crate::printable(&why).into_owned()));
        }
        Ok(())
    }

    fn welcomes(&self, origin: &str, host: &str) -> bool {
        if origin == OWN_FILES || self.allows(origin) {
            return true;
        }
        let Some((scheme, rest)) = origin.split_once("://").filter(|(scheme, _)| matches!(*scheme, "http" | "https"))
        else {
            return false;
        };
        let Some(page) = host_of(rest) else { return false };
        let is_viewer = scheme == "https"
            && VIEWERS
                .iter()
                .any(|viewer| if viewer.starts_with('.') { page.ends_with(viewer) } else { page == *viewer });
        // A page of this machine, or of the requested host, unless a stranger could own that name.
        is_viewer || is_loopback(page) || page == host && is_near(host)
    }

    fn allows(&self, name: &str) -> bool {
        self.allowed.iter().any(|allowed| allowed.eq_ignore_ascii_case(name))
    }
}

/// Host name or address without the port; `None` if it is no such, or several.
fn host_of(authority: &str) -> Option<&str> {
    let (host, port) = match authority.strip_prefix('[') {
        Some(rest) => rest.split_once(']')?,
        None => authority.split_at(authority.find(':').unwrap_or(authority.len())),
    };
    let is_port = |port: &str| port.bytes().all(|byte| byte.is_ascii_digit());
    let is_name = host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._:%".contains(&byte));
    (is_name && (port.is_empty() || port.strip_prefix(':').is_some_and(is_port))).then_some(host)
}

fn is_loopback(host: &str) -> bool {
    host.eq_ignore_ascii_case("localhost") || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Whether a stranger cannot own a name: an address, a name without dots, or one of the local network.
fn is_near(host: &str) -> bool {
    let is_local = || {
        let name = host.to_ascii_lowercase();
        let ends = [".local", ".lan", ".internal", ".home.arpa", ".localhost"];
        !name.contains('.') || ends.iter().any(|end| name.ends_with(end))
    };
    !host.is_empty() && (host.parse::<IpAddr>().is_ok() || is_local())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(host: &str, origin: Option<&str>) -> &'static str {
        let door = Door::new(vec!["https://viewer.example".to_owned(), "robot.example".to_owned()]);
        let origin = origin.map_or_else(String::new, |origin| format!("oRiGiN: {origin}\r\n"));
        let request = format!("GET / HTTP/1.1\r\nhost: {host}\r\n{origin}\r\n");
        door.judge(request.as_bytes()).map_or_else(|refused| refused.status, |()| "")
    }

    #[test]
    fn programs_viewers_and_pages_of_this_machine_are_served_and_those_of_strangers_are_not() {
        for host in ["127.0.0.1:8765", "localhost:8765", "[::1]:8765", "192.168.1.5:8765", "robot", "robot.local:1"] {
            assert_eq!(status(host, None), "", "{host}");
            for origin in ["https://app.foxglove.dev", "file://", "http://localhost:9090", "https://viewer.example"] {
                assert_eq!(status(host, Some(origin)), "", "{host} {origin}");
            }
            for origin in [
                "http://evil.example",
                "http://evil.example:8765",
                "null",
                "",
                "http://app.foxglove.dev",
                "https://evilfoxglove.dev",
                "https://foxglove.dev.evil.example",
                "http://localhost.evil.example",
                "https://127.0.0.1.evil.example",
                "http://user@evil.example",
                "http://localhost, http://evil.example",
                "http://localhost,http://evil.example",
                "http://localhost http://evil.example",
                "http://localhost:9090, http://evil.example",
                "http://localhost:9090/, http://evil.example",
                "http://localhost@evil.example",
                "http://[::1].evil.example",
                "https://app.foxglove.dev, http://evil.example",
                "file://, http://evil.example",
            ] {
                assert_eq!(status(host, Some(origin)), "403 Forbidden", "{host} {origin}");
            }
        }
        assert_eq!(status("192.168.1.5:8765", Some("http://192.168.1.5:8080")), "", "beside a viewer");
        assert_eq!(status("192.168.1.5:8765", Some("http://192.168.1.6:8080")), "403 Forbidden");
        // A page whose name was made to resolve to this machine.
        assert_eq!(status("evil.example:8765", Some("http://evil.example:8765")), "403 Forbidden");
        assert_eq!(status("evil.example", None), "403 Forbidden");
        assert_eq!(status("robot.example", None), "");
        assert_eq!(status("robot.example", Some("http://robot.example")), "403 Forbidden", "unless it is allowed, too");
        assert_eq!(status("", None), "403 Forbidden");
        for several in ["localhost, evil.example", "localhost:8765,evil", "robot evil.example", "[::1].evil.example"] {
            assert_eq!(status(several, None), "400 Bad Request", "{several}");
        }
    }

    #[test]
    fn what_is_no_request_is_refused() {
        let door = Door::new(Vec::new());
        for request in ["", "\r\n\r\n", "POST / HTTP/1.1\r\nHost: a\r\n\r\n", "GET / HTTP/1.1\r\n\r\n"] {
            assert_eq!(door.judge(request.as_bytes()).map_err(|refused| refused.status), Err("400 Bad Request"));
        }
        for twice in [
            "Host: a\r\nOrigin: file://\r\nOrigin: http://evil.example",
            "Host: a\r\nHost: evil.example",
            "Host: a\r\nOrigin : http://evil.example",
            "Host: a\r\nOrigin: file://\r\n , http://evil.example",
            "Host: a\r\nX: y\r\n\tOrigin: http://evil.example",
            "Host: a\r\nno field",
        ] {
            let request = format!("GET / HTTP/1.1\r\n{twice}\r\n\r\n");
            assert_eq!(
                door.judge(request.as_bytes()).map_err(|refused| refused.status),
                Err("400 Bad Request"),
                "{twice}"
            );
        }
    }
}
