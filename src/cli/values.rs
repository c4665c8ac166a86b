//! Values of options, from text.

use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs as _};
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};

pub(super) fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|&number| number > 0).ok_or_else(|| "expected a number from 1 on".to_owned())
}

/// A choice among values, each with its name and what is said of it.
pub(super) fn one_of<T: Copy + Send + Sync + 'static>(
    all: impl IntoIterator<Item = (T, &'static str, &'static str)>,
) -> impl TypedValueParser<Value = T> {
    let all: Vec<_> = all.into_iter().collect();
    let names = all.iter().map(|&(_, name, help)| PossibleValue::new(name).help(help)).collect::<Vec<_>>();
    PossibleValuesParser::new(names).try_map(move |typed| {
        let chosen = all.iter().find(|(_, name, _)| *name == typed);
        chosen.map(|&(value, ..)| value).ok_or("no such choice")
    })
}

/// Where to listen: `HOST:PORT`, or a port alone on this machine.
pub(super) fn address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse() {
        return Ok((Ipv4Addr::LOCALHOST, port).into());
    }
    let found: Vec<_> = text.to_socket_addrs().into_iter().flatten().collect();
    let found = found.iter().find(|address| address.is_ipv4()).or(found.first());
    found.copied().ok_or_else(|| {
        "expected HOST:PORT, such as 127.0.0.1:9464, or a port alone; what else the command takes stands before the option"
            .to_owned()
    })
}

/// A recording, which is no pipe.
pub(super) fn on_disk() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path: PathBuf| match path.as_os_str() == "-" {
        true => {
            Err("recordings are read and written as files, not through pipes; name a file (./- is one of this name)")
        }
        false => Ok(path),
    })
}

/// `500ms`, `30s`, `5min`, `2h`; a bare number is in seconds.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let seconds = match unit {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("`{unit}` is no unit of time; write 500ms, 30s, 5min or 2h")),
    };
    let number = text.strip_suffix(unit).and_then(|number| number.parse::<f64>().ok());
    let duration = number.and_then(|number| Duration::try_from_secs_f64(number * seconds).ok());
    duration.filter(|duration| !duration.is_zero()).ok_or_else(|| "expected a time such as 30s".to_owned())
}
