//! Every command reads any recording or refuses it. What is annotated is annotated in the same way again, also on top of
//! itself, and gives the recording back.

use arbitrary::{Result, Unstructured};
use stillpoint::report::{self, Format, Page};
use stillpoint::run::{self, Form, Input, Options};

use super::{made, session};

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let config = session::config(u)?;
    let verify = u.arbitrary()?;
    let file = if u.ratio(7, 8)? { session::recording(u)? } else { made::recording(u)? };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, &file).unwrap();
    let Ok(input) = Input::open(&path) else { return Ok(()) };
    let _ = run::channels(&input, &config, &|_| Ok(()));
    if let Ok(found) = run::findings(&input, &config, &|_| Ok(())) {
        let _ = report::imus(&found.imus).to_string();
        for format in Format::ALL {
            let _ = report::export(&found.imus, *format, &report::Options::default());
        }
    }
    if let Ok(data) = run::report_data(&input, &config, &|_| Ok(())) {
        let (timelines, notes, settings) = (&data.imus, &data.notes, &data.settings);
        let page = Page { recording: "a.mcap", timelines, notes, settings, earlier: None };
        assert!(!page.html().is_empty());
    }
    let sidecar = Options { form: Form::Sidecar, ..Options::default() };
    let _ = session::annotated(&path, &config, Options { force: true, ..sidecar });

    let options = Options { force: true, allow_no_imu: true, verify, ..Options::default() };
    let Some(out) = session::annotated(&path, &config, options) else { return Ok(()) };
    assert!(session::annotated(&path, &config, options).as_ref() == Some(&out), "it differs from run to run");
    let again = folder.path().join("b.mcap");
    std::fs::write(&again, &out).unwrap();
    let stripped = folder.path().join("c.mcap");
    let input = Input::open_annotated(&again).expect("what was annotated");
    run::strip(&input, &stripped, false, false, &|_| Ok(())).expect("what was annotated can be stripped");
    // An original that is itself one of ours is not to be annotated on top of its annotations.
    if input.length() == file.len() as u64 {
        assert!(std::fs::read(&stripped).unwrap() == file, "strip gives something else");
        assert!(session::annotated(&again, &config, options) == Some(out), "on top of itself it differs");
    }
    Ok(())
}
