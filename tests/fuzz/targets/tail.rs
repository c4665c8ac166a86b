//! A recording that grows by any steps, under a tail that is stopped and started again, gives the events and the bytes
//! of the batch run.

use std::fs::File;
use std::io::Write as _;
use std::time::Duration;

use arbitrary::{Result, Unstructured};
use stillpoint::config::Config;
use stillpoint::run::{self, Following, Notice, Options, Stop};

use super::{made, session};

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let mut places: Vec<usize> =
        (0..u.int_in_range(0..=6)?).map(|_| u.int_in_range(0..=200_000)).collect::<Result<_>>()?;
    let config = session::config(u)?;
    let file = if u.ratio(7, 8)? { session::recording(u)? } else { made::recording(u)? };
    // Not within the header: what the batch run makes of no header is not to be waited for.
    places.retain(|&place| (100..file.len()).contains(&place));
    places.sort_unstable();
    places.push(file.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("batch.mcap");
    std::fs::write(&path, &file).unwrap();
    let batch = session::annotated(&path, &config, Options::default());
    let mut told = [Vec::new(), Vec::new()];
    let whole = follow(&file, &[file.len()], &config, &mut told[0]);
    let grown = follow(&file, &places, &config, &mut told[1]);
    assert_eq!(told[0], told[1], "{places:?}");
    assert!(whole == grown, "the outputs differ, grown at {places:?}");
    assert!(
        whole == batch,
        "tail and batch differ: {:?} and {:?} bytes",
        whole.map(|out| out.len()),
        batch.map(|out| out.len())
    );
    Ok(())
}

/// The result of a recording that grows to each of these lengths, if there is one, and what is told meanwhile.
fn follow(bytes: &[u8], lengths: &[usize], config: &Config, events: &mut Vec<String>) -> Option<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("rec.mcap"), folder.path().join("out.mcap"));
    let following = Following {
        poll: Duration::from_micros(100),
        idle: Duration::from_millis(3),
        patience: None,
        keep_sidecar: false,
        options: Options::default(),
    };
    let (mut lengths, mut from) = (lengths.iter().filter(|&&until| until > 0), 0);
    let mut notify = |news: Notice<'_>| match news {
        Notice::Annotation { event, .. } => events.push(format!("{event:?}")),
        // Whenever all has been read, there is more.
        Notice::Awaited | Notice::Read(_) => {
            if let Some(&until) = lengths.next() {
                let mut file = File::options().create(true).append(true).open(&input).unwrap();
                file.write_all(&bytes[from..until]).unwrap();
                from = until;
            }
        }
        _ => {}
    };
    let done = run::tail(&input, &output, config, &following, &Stop::default(), &mut notify);
    done.ok().map(|_| std::fs::read(&output).unwrap())
}
