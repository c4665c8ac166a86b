//! Recordings of an IMU, made once and mistreated by each case, with places to keep them in.

use std::path::Path;
use std::sync::LazyLock;

use arbitrary::{Result, Unstructured};
use stillpoint::config::Config;
use stillpoint::run::{self, Access, Input, Options};
use stillpoint::simulate::{Scenario, record};

use super::made;

/// Short ones in each encoding and compression, and one that shows all faces.
static SESSIONS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let mut sessions = Vec::new();
    for (encoding, compression, faces) in [
        ("ros2", "zstd", &["+Z", "+X"][..]),
        ("ros1", "lz4", &["+Z", "-X"]),
        ("protobuf", "none", &["+Z", "+Y"]),
        ("json", "zstd", &["+Z", "+X"]),
        ("ros2", "none", &["+Z", "+X", "-Z", "-X", "+Y", "-Y", "+Z"]),
    ] {
        let poses: String = faces.iter().map(|face| format!("[[pose]]\nface = \"{face}\"\nrest_s = 1.5\n")).collect();
        let text = format!(
            "[recording]\nseed = 3\nencoding = \"{encoding}\"\ncompression = \"{compression}\"\nchunk_bytes = 6000\n\
             [accelerometer]\nrate_hz = 40\nbias = [0.2, -0.1, 0.3]\nnoise = 0.02\n\
             [gyroscope]\nrate_hz = 40\nbias = [0.01, -0.007, 0.004]\nnoise = 0.002\n\
             [motion]\nduration_s = 0.6\nstart_s = 0.3\nend_s = 0.3\n{poses}"
        );
        let mut bytes = Vec::new();
        record(&Scenario::parse(&text).unwrap(), &mut bytes).unwrap();
        sessions.push(bytes);
    }
    sessions
});

/// One of them, mistreated.
pub fn recording(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let session = u.choose(&SESSIONS)?.clone();
    made::mistreated(session, u)
}

/// A configuration under which they are read.
pub fn config(u: &mut Unstructured<'_>) -> Result<Config> {
    let settings =
        ["", "output.corrected=causal", "output.corrected=final", "still.detector=moving-std", "limits.chunk_mib=1"];
    let layers: Vec<_> = stillpoint::config::Layer::set(u.choose(&settings)?).into_iter().collect();
    Ok(Config::load(&layers).unwrap())
}

/// The annotated recording that the batch run makes of a file, if it makes one.
pub fn annotated(path: &Path, config: &Config, options: Options) -> Option<Vec<u8>> {
    let output = path.with_extension("batch");
    let input = Input::open_original(path, Access::Read).ok()?;
    let done = run::annotate(&input, std::slice::from_ref(&output), config, options, &|_| Ok(()));
    done.is_ok().then(|| std::fs::read(&output).unwrap())
}
