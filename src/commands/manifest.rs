//! Manifest: the outcome of each recording of a list, one line of JSON each, written as soon as it is known.

use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use stillpoint::messages::triad::Status;
use stillpoint::report;
use stillpoint::run::{self, Reads, Report, Written};
use stillpoint::{Error, printable_json};

use super::code::Code;
use super::printing::name;

/// Path and open file, if a manifest is written.
pub struct Manifest(Option<(PathBuf, File)>);

impl Manifest {
    /// Begins a manifest. An existing file is replaced only if it is a manifest or empty.
    pub fn open(path: Option<&Path>, reads: &Reads) -> Result<Self, Error> {
        let Some(path) = path else { return Ok(Self(None)) };
        if run::is_url(path) {
            let why = "a manifest grows line by line, which no object can; name a file, and copy it there";
            return Err(Error::Usage(format!("{}: {why}", path.display())));
        }
        reads.refuse(path)?;
        let io = |error| Error::io("write", path)(error);
        if path.metadata().is_ok_and(|there| !there.is_file()) {
            return Err(Error::Exists(path.to_owned()));
        }
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
        let mut first = Vec::new();
        // A line of a manifest is no longer than this.
        std::io::Read::take(BufReader::new(&file), 1 << 20).read_until(b'\n', &mut first).map_err(io)?;
        let line = serde_json::from_slice::<Value>(&first).ok();
        if !first.is_empty() && line.is_none_or(|line| line.get("outcome").is_none()) {
            return Err(Error::Exists(path.to_owned()));
        }
        file.rewind().and_then(|()| file.set_len(0)).map_err(io)?;
        Ok(Self(Some((path.to_owned(), file))))
    }

    /// Writes the line of a recording that was finished.
    pub fn done(
        &mut self,
        input: &Path,
        output: &Path,
        report: &Report,
        written: Written,
        code: Code,
    ) -> Result<(), Error> {
        let outcome = match written {
            Written::Now => "written",
            Written::Before => "skipped",
        };
        let status = |imu: &report::Findings| {
            let triad = imu.calibration.as_ref().and_then(|calibration| calibration.accelerometer.as_ref());
            json!({"name": imu.name, "topic": imu.topic, "accelerometer": triad.map_or(Status::Undetermined, |triad| triad.status()).as_str_name()})
        };
        self.line(|| {
            json!({
                "input": name(input),
                "output": name(output),
                "outcome": outcome,
                "code": code.number(),
                "imus": report.imus.iter().map(status).collect::<Value>(),
                "rests": report::rests(&report.imus),
                "damages": report.damages,
            })
        })
    }

    /// Writes the line of a recording whose result a store had already, and which was not read.
    pub fn skipped(&mut self, input: &Path, output: &Path, code: Code) -> Result<(), Error> {
        let (input, output, code) = (name(input), name(output), code.number());
        self.line(|| json!({"input": input, "output": output, "outcome": "skipped", "code": code}))
    }

    /// Writes the line of a recording that was given up.
    pub fn failed(&mut self, input: &Path, error: &Error, again: bool) -> Result<(), Error> {
        let outcome = if again { "passing" } else { "hopeless" };
        let code = if again { Code::Passing } else { Code::Hopeless };
        self.line(
            || json!({"input": name(input), "outcome": outcome, "code": code.number(), "error": error.to_string()}),
        )
    }

    fn line(&mut self, line: impl FnOnce() -> Value) -> Result<(), Error> {
        let Some((path, file)) = &mut self.0 else { return Ok(()) };
        let text = format!("{}\n", printable_json(&line().to_string()));
        file.write_all(text.as_bytes()).map_err(Error::io("write", path))
    }
}
