//! Results on standard output.

use std::io::{ErrorKind, Write as _};
use std::path::Path;

use stillpoint::{Error, printable_json};

/// Prints a result on standard output. A reader that stops early is no error.
pub fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Io { doing: "write to", path: "standard output".into(), source: e })
        }
        _ => Ok(()),
    }
}

/// Prints a result as one line of JSON.
pub fn print_json(value: &serde_json::Value) -> Result<(), Error> {
    print(&format!("{}\n", printable_json(&value.to_string())))
}

/// A path for JSON, which has only Unicode.
pub fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
