//! Recordings on a web server.

use stillpoint::simulate::{Compression, Scenario};

use crate::common::Folder;
use crate::server::Server;

/// A folder with the demo and its local sidecar.
fn demo() -> (Folder, Vec<u8>, Vec<u8>) {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap --sidecar -q").ok();
    let (recording, sidecar) = (folder.read("demo.mcap"), folder.read("demo.stillpoint.mcap"));
    (folder, recording, sidecar)
}

#[test]
fn a_recording_on_a_web_server_gives_the_local_sidecar_whatever_happens_on_the_way() {
    let (folder, recording, sidecar) = demo();
    for trouble in [|_| None, |n| (n % 2 == 0).then_some("cut"), |n| (n < 2).then_some("503 Service Unavailable")] {
        let server = Server::new(recording.clone(), trouble);
        folder.say(&format!("annotate {} --out-dir out --force -q", server.url)).ok();
        assert!(folder.read("out/x.stillpoint.mcap") == sidecar);
    }
    let server = Server::new(recording.clone(), |_| None);
    folder.say(&format!("annotate {} -o x.mcap -q", server.url)).ok();
    folder.say("annotate demo.mcap -q").ok();
    assert!(folder.read("x.mcap") == folder.read("demo.annotated.mcap"));
    let length = recording.len() as u64;
    assert_eq!(server.ranges()[0], (length.saturating_sub(256 << 10), length - 1), "the end comes first");
}

#[test]
fn chunks_that_lie_side_by_side_come_with_few_requests_none_of_which_asks_for_anything_twice() {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.accelerometer.rate_hz = 400.0;
    scenario.gyroscope.iter_mut().for_each(|triad| triad.rate_hz = 400.0);
    (scenario.recording.chunk_bytes, scenario.recording.compression) = (60_000, Compression::None);
    let folder = Folder::with_scenario("fast.mcap", &scenario);
    let recording = folder.read("fast.mcap");
    folder.say("annotate fast.mcap --sidecar -q").ok();
    assert!(recording.len() > 1_000_000, "{}", recording.len());
    let server = Server::new(recording, |_| None);
    folder.say(&format!("annotate {} --out-dir out -q", server.url)).ok();
    assert!(folder.read("out/x.stillpoint.mcap") == folder.read("fast.stillpoint.mcap"));
    let mut ranges = server.ranges();
    // The end, the start with the first chunk, and all the others.
    assert!(ranges.len() <= 3, "{ranges:?}");
    ranges.sort_unstable();
    assert!(ranges.windows(2).all(|pair| pair[0].1 < pair[1].0), "{ranges:?}");
}

#[test]
fn a_query_is_refused_before_anything_is_asked_for() {
    let (folder, recording, _) = demo();
    let server = Server::new(recording, |_| None);
    // The server has a file of the name of the result, too.
    let run = folder.run(["annotate", &format!("{}?signature=1", server.url), "-q"]);
    assert!(run.code == 2 && run.error().contains("presigned"), "{}", run.stderr);
    assert!(server.ranges().is_empty());
}

#[test]
fn a_recording_without_its_end_is_read_forward() {
    let (folder, recording, _) = demo();
    let cut = &recording[..recording.len() * 2 / 3];
    folder.write("cut.mcap", cut);
    let server = Server::new(cut.to_vec(), |_| None);
    assert_eq!(folder.say("annotate cut.mcap --sidecar -q").code, 3);
    assert_eq!(folder.say(&format!("annotate {} --out-dir out -q", server.url)).code, 3);
    assert!(folder.read("out/x.stillpoint.mcap") == folder.read("cut.stillpoint.mcap"));
}

#[test]
fn refusals_of_a_server_are_one_line_each_and_tell_what_passes() {
    let (folder, recording, _) = demo();
    let refused = |trouble, name: &str| {
        let server = Server::new(recording.clone(), trouble);
        let url = server.url.replace("x.mcap", name);
        let run = folder.run(["annotate", &url, "--out-dir", "out", "-q"]);
        (run.code, run.error().to_owned())
    };
    let (code, error) = refused(|_| Some("403 Forbidden"), "x.mcap");
    assert!(code == 1 && error.contains("denies it") && error.contains("credentials"), "{error}");
    let (code, error) = refused(|_| None, "none");
    assert!(code == 1 && error.contains("no such object"), "{error}");
    let (code, error) = refused(|_| Some("whole"), "x.mcap");
    assert!(code == 1 && error.contains("whole files only") && error.contains("copy"), "{error}");
    let (code, error) = refused(|_| Some("400 Bad Request"), "x.mcap");
    assert!(code == 1 && error.contains("400"), "{error}");
    let (code, error) = refused(|_| None, "x.mcap?signature=1");
    assert!(code == 2 && error.contains("presigned"), "{error}");
}
