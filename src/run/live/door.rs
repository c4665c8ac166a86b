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
        for (name, value) in lines.filter_map(|line| line.split_once(':')) {
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                "host" => hosts.push(value),
                "origin" => origins.push(value),
                _ => {}
            }
        }
        let ([host], [] | [_]) = (&hosts[..], &origins[..]) else { return Err(malformed()) };
        let host = host_of(host);
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
        let page = host_of(rest);
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

/// Host name or address without the port.
fn host_of(authority: &str) -> &str {
    if let Some(rest) = authority.strip_prefix('[') {
        return rest.split(']').next().unwrap_or_default();
    }
    authority.split(':').next().unwrap_or_default()
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
    }

    #[test]
    fn what_is_no_request_is_refused() {
        let door = Door::new(Vec::new());
        for request in ["", "\r\n\r\n", "POST / HTTP/1.1\r\nHost: a\r\n\r\n", "GET / HTTP/1.1\r\n\r\n"] {
            assert_eq!(door.judge(request.as_bytes()).map_err(|refused| refused.status), Err("400 Bad Request"));
        }
        let twice = "GET / HTTP/1.1\r\nHost: a\r\nOrigin: file://\r\nOrigin: http://evil.example\r\n\r\n";
        assert!(door.judge(twice.as_bytes()).is_err());
    }
}
