//! Whatever a tail finds in the place of its checkpoint, sidecar and index log, it makes what the batch run makes, or says
//! why not; with a checkpoint that lies but has the right checksum, it may be misled, but the recording stays within.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use arbitrary::{Result, Unstructured};
use stillpoint::config::Config;
use stillpoint::run::{self, Following, Input, Notice, Options, Stop};
use stillpoint::simulate::{Scenario, record};

use super::session;

/// Length of the head of a checkpoint: magic, and the checksum of the rest.
const HEAD: usize = 20;

/// A recording, the files of a tail that was killed half way, and the result.
struct Killed {
    recording: Vec<u8>,
    files: BTreeMap<String, Vec<u8>>,
    result: Vec<u8>,
}

static KILLED: LazyLock<Killed> = LazyLock::new(|| {
    let text = "[recording]\nchunk_bytes = 4000\n[accelerometer]\nrate_hz = 40\nnoise = 0.02\n\
                [gyroscope]\nrate_hz = 40\nnoise = 0.002\n[[pose]]\nface = \"+Z\"\nrest_s = 2.0\n\
                [[pose]]\nface = \"+X\"\nrest_s = 2.0\n[[pose]]\nface = \"-Z\"\nrest_s = 2.0\n";
    let mut recording = Vec::new();
    record(&Scenario::parse(text).unwrap(), &mut recording).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let batch = folder.path().join("batch.mcap");
    std::fs::write(&batch, &recording).unwrap();
    let result = session::annotated(&batch, &Config::default(), Options::default()).unwrap();
    std::fs::remove_file(batch).unwrap();
    std::fs::remove_file(folder.path().join("batch.batch")).unwrap();

    let half = recording.len() * 2 / 3;
    let path = folder.path().join("rec.mcap");
    std::fs::write(&path, &recording[..half]).unwrap();
    let (began, mut files) = (Instant::now(), BTreeMap::new());
    follow(folder.path(), Duration::from_secs(20), &mut |news| {
        if !matches!(news, Notice::Read(_)) || !files.is_empty() {
            return;
        }
        let is_saved = |(name, bytes): (&String, &Vec<u8>)| name.ends_with(".checkpoint") && bytes.len() > 2000;
        let found = beside(folder.path());
        if found.iter().any(is_saved) {
            files = found;
            let mut file = File::options().append(true).open(&path).unwrap();
            file.write_all(&recording[half..]).unwrap();
        }
        assert!(began.elapsed() < Duration::from_secs(15), "no checkpoint is saved");
    })
    .unwrap();
    Killed { recording, files, result }
});

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let Killed { recording, files, result } = &*KILLED;
    let mut files = files.clone();
    let names: Vec<String> = files.keys().cloned().collect();
    let (mut is_signed, mut is_touched) = (false, false);
    for _ in 0..u.int_in_range(1..=3)? {
        let name = u.choose(&names)?;
        let file = files.get_mut(name).unwrap();
        mistreat(file, u)?;
        is_touched |= !name.ends_with(".checkpoint");
        if name.ends_with(".checkpoint") && file.len() > HEAD && u.ratio(3, 4)? {
            let crc = crc32fast::hash(&file[HEAD..]);
            file[HEAD - 4..HEAD].copy_from_slice(&crc.to_le_bytes());
            is_signed = true;
        }
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rec.mcap"), recording).unwrap();
    files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).unwrap());
    if follow(folder.path(), Duration::from_millis(3), &mut |_| {}).is_err() {
        return Ok(());
    }
    let output = folder.path().join("out.mcap");
    let out = std::fs::read(&output).unwrap();
    // What a sidecar holds has checksums of its own, but they are as easily made.
    assert!(is_signed || is_touched || out == *result, "a damaged checkpoint changes the result");
    let stripped = folder.path().join("stripped.mcap");
    let input = Input::open_annotated(&output).expect("a result");
    run::strip(&input, &stripped, false, false, &|_| Ok(())).expect("a result that can be stripped");
    assert!(std::fs::read(&stripped).unwrap() == *recording, "strip gives something else");
    Ok(())
}

fn mistreat(file: &mut Vec<u8>, u: &mut Unstructured<'_>) -> Result<()> {
    if file.is_empty() {
        return Ok(());
    }
    let at = u.choose_index(file.len())?;
    match u.int_in_range(0..=5)? {
        0 => file.truncate(at),
        1 => _ = file.drain(at..file.len().min(at + u.int_in_range(1..=50)?)),
        2 => {
            let length = u.int_in_range(1..=50)?;
            let new = u.bytes(length)?.to_vec();
            file.splice(at..at, new);
        }
        // Lengths, numbers and kinds of MessagePack.
        3 => {
            file[at] = *u.choose(&[0xC0, 0xC2, 0xCB, 0xCF, 0xD3, 0xDB, 0xDD, 0xDF, 0xC6, 0x90, 0x80, 0xFF, 0x7F, 0])?
        }
        4 => {
            let end = file.len().min(at + 8);
            file[at..end].fill(*u.choose(&[0, 0xFF, 0x7F])?);
        }
        _ => file[at] ^= u.int_in_range(1..=255)?,
    }
    Ok(())
}

/// The files in a folder beside the recording.
fn beside(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| name != "rec.mcap");
    // One that is written anew may be gone.
    names.filter_map(|name| Some((name.clone(), std::fs::read(folder.join(name)).ok()?))).collect()
}

fn follow(
    folder: &Path,
    idle: Duration,
    notify: &mut dyn FnMut(Notice<'_>),
) -> std::result::Result<(), stillpoint::Error> {
    let following = Following {
        poll: Duration::from_micros(500),
        idle,
        patience: Some(Duration::ZERO),
        keep_sidecar: false,
        options: Options::default(),
    };
    let (input, output) = (folder.join("rec.mcap"), folder.join("out.mcap"));
    run::tail(&input, &output, &Config::default(), &following, &Stop::default(), notify).map(|_| ())
}
