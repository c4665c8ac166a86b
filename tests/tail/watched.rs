//! A directory in which recordings appear, grow, split and get damaged, while the service is killed and restarted.

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use stillpoint::simulate::{Scenario, record};

use crate::common::Folder;
use crate::common::needs::needed;
use crate::following::{Running, wait_for};

/// How many recordings appear.
fn recordings() -> usize {
    std::env::var("STILLPOINT_RECORDINGS").map_or(16, |recordings| recordings.parse().unwrap())
}

/// A short session; no two seeds record the same.
fn session(seed: u64) -> Vec<u8> {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.pose.truncate(2);
    scenario.recording.seed = seed;
    let mut bytes = Vec::new();
    record(&scenario, &mut bytes).unwrap();
    bytes
}

/// A recording that appears, and what is to become of it.
struct Appearing {
    path: &'static str,
    bytes: Vec<u8>,
    grows: bool,
    refused: Option<&'static str>,
}

fn appearing(i: usize) -> Appearing {
    let whole = session(i as u64);
    let (half, middle) = (whole.len() * 2 / 3, whole.len() / 2);
    let of = |path, bytes, grows, refused| Appearing { path, bytes, grows, refused };
    match i % 8 {
        0 => of("whole", whole, false, None),
        1 => of("growing", whole, true, None),
        2 => of("given_up", whole[..half].to_vec(), true, None),
        3 => {
            let mut damaged = whole;
            damaged[middle] ^= 0x55;
            of("damaged", damaged, true, None)
        }
        4 => of("garbage", vec![7; 5000], false, Some("not an MCAP recording")),
        5 => of("split/of_0", whole, true, None),
        6 => of("split/of_1", whole, true, None),
        _ => of("no_imu", no_imu(), false, Some("no usable IMU topic")),
    }
}

fn no_imu() -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    let channel = writer.add_channel(0, "/chatter", "json", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

fn start(folder: &Folder) -> Running {
    let line = "watch in --out-dir out --metrics 127.0.0.1:0 --interval 50ms --idle-timeout 1s --poll 5ms";
    Running::start_logged(folder, line, "log")
}

/// What the service answers, once it has said where it listens.
fn get(folder: &Folder, page: &str) -> (String, String) {
    let address = || {
        let log = String::from_utf8_lossy(&folder.read("log")).into_owned();
        Some(log.split("http://").nth(1)?.split('/').next()?.to_owned())
    };
    wait_for("an address", || address().is_some());
    let mut stream = TcpStream::connect(address().unwrap()).unwrap();
    write!(stream, "GET {page} HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.lines().next().unwrap().to_owned(), body.to_owned())
}

fn metric(text: &str, name: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name} in {text}")).parse().unwrap()
}

/// Kilobytes that a running program has, by a line of its status.
fn memory(running: &Running, line: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", running.id())).unwrap_or_default();
    let found = status.lines().find_map(|found| found.strip_prefix(line)?.trim().strip_suffix(" kB")?.parse().ok());
    needed(found, "the memory of a program, as Linux tells it")
}

/// Inodes of the results.
fn results(folder: &Path, found: &mut BTreeMap<PathBuf, u64>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        if entry.file_type().unwrap().is_dir() {
            results(&entry.path(), found);
        } else if entry.file_name().to_string_lossy().ends_with(".annotated.mcap") {
            found.insert(entry.path(), entry.metadata().unwrap().ino());
        }
    }
}

#[test]
fn each_recording_of_a_directory_is_annotated_once_or_put_aside_with_the_reason() {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path().join("in/split")).unwrap();
    let all: Vec<_> = (0..recordings()).map(|i| (i, appearing(i))).collect();
    let path = |(i, one): &(usize, Appearing)| folder.path().join(format!("in/{}_{i}.mcap", one.path));
    let restarts = (recordings() / 10).max(2);
    let mut before = BTreeMap::new();
    std::thread::scope(|scope| {
        let writing = scope.spawn(|| {
            // A few at a time, in pieces.
            for some in all.chunks(8) {
                for piece in 0..10 {
                    for one in some {
                        let (from, until) = (one.1.bytes.len() * piece / 10, one.1.bytes.len() * (piece + 1) / 10);
                        if one.1.grows {
                            let mut file = std::fs::File::options().create(true).append(true).open(path(one)).unwrap();
                            file.write_all(&one.1.bytes[from..until]).unwrap();
                        } else if piece == 5 {
                            std::fs::write(path(one).with_extension("partial"), &one.1.bytes).unwrap();
                            std::fs::rename(path(one).with_extension("partial"), path(one)).unwrap();
                        }
                    }
                    std::thread::sleep(Duration::from_millis(60));
                }
            }
        });
        let mut restarts = 0..restarts;
        while !writing.is_finished() || restarts.next().is_some() {
            let running = start(&folder);
            std::thread::sleep(Duration::from_millis(700));
            running.kill();
            let mut now = BTreeMap::new();
            results(&folder.path().join("out"), &mut now);
            before.iter().for_each(|(path, ino)| assert_eq!(now.get(path), Some(ino), "{path:?} was done twice"));
            before = now;
        }
    });
    let running = start(&folder);
    let (refused, done): (Vec<_>, Vec<_>) = all.iter().partition(|(_, one)| one.refused.is_some());
    let began = Instant::now();
    loop {
        wait_for("a look through the directory", || get(&folder, "/readyz").0.contains("200"));
        let (_, text) = get(&folder, "/metrics");
        let state = |state| metric(&text, &format!("stillpoint_recordings{{state=\"{state}\"}}")) as usize;
        if (state("annotated"), state("quarantined")) == (done.len(), refused.len()) {
            assert_eq!((state("waiting"), state("following")), (0, 0));
            break;
        }
        let log = || String::from_utf8_lossy(&folder.read("log")).into_owned();
        assert!(began.elapsed() < Duration::from_secs(120), "not done: {text}\n{}", log());
        std::thread::sleep(Duration::from_millis(50));
    }
    if let Some(peak) = memory(&running, "VmHWM:") {
        assert!(peak < 400 << 10, "{peak} kB");
    }
    let mut now = BTreeMap::new();
    results(&folder.path().join("out"), &mut now);
    assert_eq!(now.len(), done.len());
    before.iter().for_each(|(path, ino)| assert_eq!(now.get(path), Some(ino), "{path:?} was done twice"));

    for one in &all {
        let (input, name) = (path(one), format!("{}_{}", one.1.path, one.0));
        assert!(std::fs::read(&input).unwrap() == one.1.bytes, "{name} was changed");
        let (result, quarantine) = (format!("out/{name}.annotated.mcap"), format!("out/{name}.quarantine.json"));
        match one.1.refused {
            None => {
                folder.say(&format!("annotate in/{name}.mcap -o batch.mcap --accept-damage --force -q")).ok();
                assert!(folder.read(&result) == folder.read("batch.mcap"), "{name}");
                assert!(!folder.path().join(quarantine).exists());
            }
            Some(reason) => {
                let said = String::from_utf8(folder.read(&quarantine)).unwrap();
                assert!(said.contains(reason), "{name}: {said}");
                assert!(!folder.path().join(result).exists());
            }
        }
    }
    let rest =
        |name: &String| !name.ends_with(".annotated.mcap") && !name.ends_with(".quarantine.json") && name != "split";
    let left: Vec<_> = std::fs::read_dir(folder.path().join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    let left: Vec<_> = left.into_iter().map(|name| name.into_string().unwrap()).filter(rest).collect();
    assert!(left.is_empty(), "{left:?}");

    let began = Instant::now();
    Command::new("kill").args(["-TERM", &running.id().to_string()]).status().unwrap();
    let run = running.finish();
    assert_eq!(run.code, 0, "{}", String::from_utf8_lossy(&folder.read("log")));
    assert!(began.elapsed() < Duration::from_secs(5));
}

#[test]
fn what_a_service_counts_adds_up() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let (mut messages, mut rests, mut bytes) = (0, 0, 0);
    for seed in 0..3 {
        folder.write(&format!("in/{seed}.mcap"), &session(seed));
        let result = folder.say(&format!("annotate in/{seed}.mcap -o {seed}.mcap --json -q")).ok().json();
        messages += result["messages"].as_u64().unwrap();
        rests += result["rests"]["found"].as_u64().unwrap();
        bytes += session(seed).len();
    }
    let running = start(&folder);
    wait_for("three results", || (0..3).all(|seed| folder.path().join(format!("out/{seed}.annotated.mcap")).exists()));
    let counted = || {
        let (_, text) = get(&folder, "/metrics");
        ["messages", "rests", "bytes", "damages", "errors"]
            .map(|name| metric(&text, &format!("stillpoint_{name}_total")))
    };
    let expected = [messages as f64, rests as f64, bytes as f64, 0.0, 0.0];
    wait_for("the last count", || counted() == expected);
    let (_, text) = get(&folder, "/metrics");
    let published = |seed| {
        let result = folder.read(&format!("out/{seed}.annotated.mcap"));
        let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
        messages.filter(|message| message.channel.topic.ends_with("/stillpoint/calibration")).count()
    };
    let refits: usize = (0..3).map(published).sum();
    assert_eq!((refits > 0, metric(&text, "stillpoint_refits_total")), (true, refits as f64));
    // Each message holds a reading of the accelerometer and one of the gyroscope.
    assert_eq!(metric(&text, "stillpoint_samples_total"), 2.0 * messages as f64);
    assert!(!text.contains("lag_bytes{"), "{text}");
    assert!(get(&folder, "/healthz").0.contains("200") && get(&folder, "/readyz").0.contains("200"));
    assert!(get(&folder, "/").0.contains("404"));

    // A new configuration is for new recordings, and a wrong one is for none.
    let hangup = || Command::new("kill").args(["-HUP", &running.id().to_string()]).status().unwrap();
    hangup();
    wait_for("the configuration", || String::from_utf8_lossy(&folder.read("log")).contains("was read again"));
    folder.write("in/again.mcap", &session(9));
    wait_for("another result", || folder.path().join("out/again.annotated.mcap").exists());
    Command::new("kill").args(["-TERM", &running.id().to_string()]).status().unwrap();
    assert_eq!(running.finish().code, 0);
    assert_eq!(String::from_utf8_lossy(&folder.read("log")).matches("annotated:").count(), 4);
}

#[test]
fn a_recording_that_is_recorded_anew_under_its_name_is_annotated_too() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("in/rec.mcap", &session(1));
    let running = start(&folder);
    wait_for("the first", || folder.path().join("out/rec.annotated.mcap").exists());
    folder.write("in/next.partial", &session(2)[..40_000]);
    std::fs::rename(folder.path().join("in/next.partial"), folder.path().join("in/rec.mcap")).unwrap();
    wait_for("the second", || folder.path().join("out/rec.before-1.annotated.mcap").exists());
    wait_for("the second", || folder.path().join("out/rec.annotated.mcap").exists());
    running.kill();
    let strip = |name: &str| {
        folder.say(&format!("strip out/{name} -o original.mcap --force")).ok();
        folder.read("original.mcap")
    };
    assert!(strip("rec.before-1.annotated.mcap") == session(1));
    assert!(strip("rec.annotated.mcap") == session(2)[..40_000]);
}

#[test]
fn what_a_killed_service_had_learned_of_a_recording_outlives_the_next_one_of_its_name() {
    let folder = Folder::new();
    ["in", "out"].iter().for_each(|name| std::fs::create_dir(folder.path().join(name)).unwrap());
    let whole = session(1);
    folder.write("in/rec.mcap", &whole[..whole.len() * 2 / 3]);
    let watch = || Running::start_logged(&folder, "watch in --out-dir out --interval 50ms --idle-timeout 60s", "log");
    let running = watch();
    let checkpoint = folder.path().join("out/rec.stillpoint.checkpoint");
    wait_for("a checkpoint", || crate::following::length(&checkpoint) > 5000);
    running.kill();
    let kept = ["mcap", "checkpoint", "indexes"].map(|ending| format!("out/rec.stillpoint.{ending}"));
    let kept = kept.map(|name| (folder.read(&name), name));
    let count = |name: &str| {
        let summary = mcap::Summary::read(&folder.read(name)).unwrap().unwrap();
        summary.stats.unwrap().message_count
    };

    folder.write("in/rec.mcap", &session(2));
    let running = watch();
    wait_for_results(&folder, &["rec.before-1.stillpoint.mcap", "rec.annotated.mcap"]);
    wait_for("its end", || !checkpoint.exists());
    running.kill();
    assert!(count("out/rec.before-1.stillpoint.mcap") > 0);

    // The same, but the recording in between had been annotated.
    kept.iter().for_each(|(bytes, name)| folder.write(name, bytes));
    folder.write("in/rec.mcap", &session(3));
    let running = watch();
    wait_for_results(&folder, &["rec.before-1.annotated.mcap", "rec.before-2.stillpoint.mcap", "rec.annotated.mcap"]);
    wait_for("its end", || !checkpoint.exists());
    running.kill();
    assert_eq!(count("out/rec.before-2.stillpoint.mcap"), count("out/rec.before-1.stillpoint.mcap"));
    for (n, name) in [(2, "rec.before-1.annotated.mcap"), (3, "rec.annotated.mcap")] {
        folder.say(&format!("strip out/{name} -o original.mcap --force")).ok();
        assert!(folder.read("original.mcap") == session(n), "{name}");
    }
}

#[test]
fn a_recording_that_is_touched_keeps_its_sidecar() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("in/rec.mcap", &session(1));
    let line = "watch in --out-dir out --interval 50ms --idle-timeout 1s --keep-sidecar";
    let running = Running::start_logged(&folder, line, "log");
    wait_for("the first", || logged(&folder).contains("annotated:"));
    let file = std::fs::File::options().write(true).open(folder.path().join("in/rec.mcap")).unwrap();
    file.set_modified(std::time::SystemTime::now()).unwrap();
    wait_for("the comparison", || logged(&folder).matches("annotated:").count() == 2);
    running.kill();
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path().join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["rec.annotated.mcap", "rec.stillpoint.mcap"]);
}

#[test]
fn a_folder_whose_last_file_was_lost_with_the_power_is_annotated_once() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let bag = folder.path().join("in/bag");
    crate::recorder::Session::of(&session(1)).record_bag(&bag, 1, Default::default(), f64::INFINITY);
    std::fs::remove_file(bag.join("metadata.yaml")).unwrap();
    folder.write("in/bag/bag_1.mcap", &[0; 5000]);
    for times in [1, 0] {
        let running = start(&folder);
        wait_for("its state", || get(&folder, "/metrics").1.contains("{state=\"annotated\"} 1"));
        wait_for_another_look(&folder);
        running.kill();
        assert_eq!(logged(&folder).matches("annotated:").count(), times + 1, "{}", logged(&folder));
        std::fs::remove_file(folder.path().join("in/another.mcap")).unwrap();
        std::fs::remove_file(folder.path().join("out/another.annotated.mcap")).unwrap();
    }
    assert!(folder.read("out/bag.annotated/bag_1.mcap") == [0; 5000]);
}

/// Waits until each of these is in the folder of results.
fn wait_for_results(folder: &Folder, names: &[&str]) {
    for name in names {
        wait_for(name, || folder.path().join("out").join(name).exists());
    }
}

/// Waits until the service has looked through its directory once more, and done what it found.
fn wait_for_another_look(folder: &Folder) {
    folder.write("in/another.mcap", &session(99));
    wait_for_results(folder, &["another.annotated.mcap"]);
    wait_for("its state", || logged(folder).contains("another.mcap"));
}

/// The same bytes, written at another time.
fn touch(path: &Path) {
    let file = std::fs::File::options().write(true).open(path).unwrap();
    let before = file.metadata().unwrap().modified().unwrap();
    file.set_modified(before + Duration::from_secs(1)).unwrap();
}

fn logged(folder: &Folder) -> String {
    String::from_utf8_lossy(&folder.read("log")).into_owned()
}

#[test]
fn folders_are_looked_through_and_a_rosbag2_folder_is_one_recording() {
    let folder = Folder::new();
    let within = |name: &str| folder.path().join("in").join(name);
    ["nested/deep", ".hidden"].iter().for_each(|name| std::fs::create_dir_all(within(name)).unwrap());
    folder.write("in/nested/deep/a.mcap", &session(1));
    folder.write("in/.hidden/b.mcap", &session(2));
    folder.write("in/.c.mcap", &session(3));
    std::os::unix::fs::symlink("nested/deep/a.mcap", within("latest.mcap")).unwrap();
    std::os::unix::fs::symlink("..", within("nested/up")).unwrap();
    let running = start(&folder);
    // One that is finished when it is found, and one that is recorded meanwhile.
    let session = crate::recorder::Session::of(&session(4));
    session.record_bag(&folder.path().join("done.2026.11"), 2, Default::default(), f64::INFINITY);
    std::fs::rename(folder.path().join("done.2026.11"), within("done.2026.11")).unwrap();
    session.record_bag(&within("nested/live"), 3, Default::default(), 20.0);
    wait_for_results(&folder, &["nested/deep/a.annotated.mcap", "done.2026.11.annotated", "nested/live.annotated"]);
    wait_for("all states", || get(&folder, "/metrics").1.contains("{state=\"annotated\"} 3"));
    Command::new("kill").args(["-TERM", &running.id().to_string()]).status().unwrap();
    assert_eq!(running.finish().code, 0);
    for (bag, result) in [("in/done.2026.11", "done.2026.11"), ("in/nested/live", "nested/live")] {
        folder.say(&format!("annotate {bag} -o batch --force -q")).ok();
        let result = folder.path().join(format!("out/{result}.annotated"));
        crate::common::same_folders(&result, &folder.path().join("batch"));
    }
    let mut found = BTreeMap::new();
    results(&folder.path().join("out"), &mut found);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(logged(&folder).matches("annotated:").count(), 3, "{}", logged(&folder));
}

#[test]
fn a_recording_that_is_changed_after_it_was_annotated_is_annotated_anew() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("in/rec.mcap", &session(1));
    let running = start(&folder);
    wait_for_results(&folder, &["rec.annotated.mcap"]);
    // As long as before.
    let mut changed = session(1);
    let middle = changed.len() / 2;
    changed[middle] ^= 0x55;
    folder.write("in/rec.mcap", &changed);
    touch(&folder.path().join("in/rec.mcap"));
    wait_for_results(&folder, &["rec.before-1.annotated.mcap", "rec.annotated.mcap"]);
    folder.say("annotate in/rec.mcap -o batch.mcap --accept-damage -q").ok();
    wait_for("the batch run's", || folder.read("out/rec.annotated.mcap") == folder.read("batch.mcap"));
    running.kill();

    // What was only touched is compared, once, and stays as it is.
    touch(&folder.path().join("in/rec.mcap"));
    let before = std::fs::metadata(folder.path().join("out/rec.annotated.mcap")).unwrap().ino();
    let running = start(&folder);
    wait_for("the comparison", || logged(&folder).contains("annotated:"));
    wait_for_another_look(&folder);
    running.kill();
    assert_eq!(logged(&folder).matches("annotated:").count(), 2, "{}", logged(&folder));
    assert_eq!(std::fs::metadata(folder.path().join("out/rec.annotated.mcap")).unwrap().ino(), before);
}

#[test]
fn a_recording_that_was_annotated_before_it_appeared_is_annotated_once() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("in/rec.mcap", &session(1));
    folder.say("annotate --in-place in/rec.mcap --set fit.gravity=9.81 -q").ok();
    let running = start(&folder);
    wait_for_results(&folder, &["rec.annotated.mcap"]);
    wait_for_another_look(&folder);
    running.kill();
    assert_eq!(logged(&folder).matches("annotated:").count(), 2, "{}", logged(&folder));
    let running = start(&folder);
    wait_for("an answer", || get(&folder, "/metrics").1.contains("{state=\"annotated\"} 2"));
    running.kill();
    let mut found = BTreeMap::new();
    results(&folder.path().join("out"), &mut found);
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn a_wrong_configuration_is_told_and_the_one_before_stays() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("conf.toml", b"[still]\nmin_fit_s = 1.5\n");
    let line = "watch in --out-dir out --interval 50ms -c conf.toml";
    let running = Running::start_logged(&folder, line, "log");
    wait_for("the start", || logged(&folder).contains("watching in"));
    folder.write("conf.toml", b"[still]\nmin_fitt_s = 2\n");
    Command::new("kill").args(["-HUP", &running.id().to_string()]).status().unwrap();
    wait_for("the refusal", || logged(&folder).contains("the configuration stays as it was"));
    assert!(logged(&folder).contains("min_fit_s"), "names the nearest key: {}", logged(&folder));
    folder.write("in/rec.mcap", &session(1));
    wait_for_results(&folder, &["rec.annotated.mcap"]);
    running.kill();
    folder.say("annotate in/rec.mcap -o batch.mcap -q --set still.min_fit_s=1.5").ok();
    assert!(folder.read("out/rec.annotated.mcap") == folder.read("batch.mcap"));
}

#[test]
fn what_one_configuration_refuses_is_tried_again_with_another() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.say("simulate demo --set recording.encoding=json -o in/rec.mcap").ok();
    folder.write("conf.toml", b"");
    let line = "watch in --out-dir out --interval 50ms -c conf.toml";
    let running = Running::start_logged(&folder, line, "log");
    wait_for_results(&folder, &["rec.quarantine.json"]);
    folder.write("conf.toml", b"[[imu]]\ntopic = '/imu/data_raw'\naccel = 'accel'\ngyro = 'gyro'\n");
    Command::new("kill").args(["-HUP", &running.id().to_string()]).status().unwrap();
    wait_for_results(&folder, &["rec.annotated.mcap"]);
    wait_for("the end", || !folder.path().join("out/rec.quarantine.json").exists());
    running.kill();

    // Likewise after a restart.
    std::fs::rename(folder.path().join("out"), folder.path().join("before")).unwrap();
    folder.write("conf.toml", b"");
    let running = Running::start_logged(&folder, line, "log");
    wait_for_results(&folder, &["rec.quarantine.json"]);
    running.kill();
    folder.write("conf.toml", b"[[imu]]\ntopic = '/imu/data_raw'\naccel = 'accel'\n");
    let running = Running::start_logged(&folder, line, "log");
    wait_for_results(&folder, &["rec.annotated.mcap"]);
    running.kill();
}

#[test]
fn a_recording_that_somebody_else_follows_is_waited_for() {
    let folder = Folder::new();
    ["in", "out"].iter().for_each(|name| std::fs::create_dir(folder.path().join(name)).unwrap());
    let whole = session(1);
    folder.write("in/rec.mcap", &whole[..whole.len() / 2]);
    let tail = Running::start(&folder, "tail in/rec.mcap -o out/rec.annotated.mcap");
    wait_for("the tail", || folder.path().join("out/rec.stillpoint.mcap").exists());
    let running = start(&folder);
    wait_for("a refusal", || logged(&folder).contains("another stillpoint"));
    let mut file = std::fs::File::options().append(true).open(folder.path().join("in/rec.mcap")).unwrap();
    file.write_all(&whole[whole.len() / 2..]).unwrap();
    tail.finish().ok();
    wait_for("the state", || get(&folder, "/metrics").1.contains("{state=\"annotated\"} 1"));
    running.kill();
    assert_eq!(std::fs::read_dir(folder.path().join("out")).unwrap().count(), 1, "no quarantine");
}

#[test]
fn a_service_does_not_grow_with_what_it_has_done() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let running = start(&folder);
    let mut grown = Vec::new();
    for round in 0..3 {
        for i in 0..recordings() / 2 {
            folder.write(&format!("in/{round}_{i}.mcap"), &session(i as u64));
        }
        let done = format!("{{state=\"annotated\"}} {}\n", (round + 1) * (recordings() / 2));
        wait_for("the results", || get(&folder, "/metrics").1.contains(&done));
        grown.extend(memory(&running, "VmRSS:"));
    }
    running.kill();
    eprintln!("resident after each third, kB: {grown:?}");
    if let [_, second, third] = grown[..] {
        assert!(third < second + (8 << 10), "{grown:?} kB");
    }
}
