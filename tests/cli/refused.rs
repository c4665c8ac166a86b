//! What the program refuses: each time one clear line, the right exit code, nothing left behind.

use std::process::Command;

use crate::common::needs::needed;
use crate::common::{Folder, finish, program};
use stillpoint::simulate::Scenario;

#[test]
fn inputs_that_are_no_recording_are_refused() {
    let folder = Folder::new();
    folder.write("text.mcap", b"stamp,ax,ay,az\n0,0,0,9.81\n");
    folder.write("empty.mcap", b"");
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    std::fs::write(folder.path().join("bag/metadata.yaml"), "").unwrap();
    for verb in ["annotate", "topics", "export --format json", "strip -o out.mcap"] {
        folder.refuses(&format!("{verb} text.mcap"), 1, &["text.mcap: "]);
        folder.refuses(&format!("{verb} empty.mcap"), 1, &["empty.mcap: ", "empty"]);
        folder.refuses(&format!("{verb} missing.mcap"), 1, &["missing.mcap: ", "no such file"]);
        folder.refuses(&format!("{verb} folder"), 1, &["folder: is a folder"]);
        folder.refuses(&format!("{verb} bag"), 1, &["bag: ", "rosbag2", "name a .mcap file"]);
    }
    folder.refuses("annotate text.mcap", 1, &["not an MCAP"]);
    folder.refuses("annotate /dev/null", 1, &["not a regular file"]);
}

#[test]
fn an_output_that_exists_is_not_touched() {
    let folder = Folder::with_demo();
    folder.write("out.mcap", b"precious");
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    folder.refuses("annotate demo.mcap -o out.mcap", 1, &["out.mcap: exists", "--force"]);
    folder.refuses("annotate demo.mcap -o demo.mcap", 1, &["demo.mcap: is itself read by this command", "--in-place"]);
    folder.refuses("simulate demo -o out.mcap", 1, &["out.mcap: exists"]);
    folder.refuses("export demo.mcap --format json -o out.mcap", 1, &["out.mcap: exists"]);
    folder.refuses("annotate demo.mcap -o folder", 1, &["folder: is a folder"]);
    folder.refuses("annotate demo.mcap -o /dev/null --force", 1, &["/dev/null: is not a regular file"]);
    folder.refuses("annotate demo.mcap -o no/such/out.mcap", 1, &["no/such/out.mcap: cannot write: no such"]);
    assert_eq!(folder.read("out.mcap"), b"precious");
    folder.say("annotate demo.mcap -o out.mcap --force").ok();
    folder.refuses("strip out.mcap -o out.mcap --force", 1, &["out.mcap: is itself read by this command"]);
    folder.say("strip out.mcap -o back.mcap").ok();
    assert_eq!(folder.read("back.mcap"), folder.read("demo.mcap"));
}

#[test]
fn what_says_the_same_already_is_left_as_it_is() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap").ok();
    for line in [
        "export demo.annotated.mcap --format yaml -o x",
        "report demo.annotated.mcap -o x",
        "config layout demo.annotated.mcap -o x",
        "simulate demo -o x",
    ] {
        folder.say(&format!("{line} --force")).ok();
        let inode = || std::os::unix::fs::MetadataExt::ino(&std::fs::metadata(folder.path().join("x")).unwrap());
        let before = inode();
        folder.say(line).ok();
        assert_eq!(inode(), before, "{line}");
        folder.write("x", b"precious");
        folder.refuses(line, 1, &["x: exists", "--force"]);
    }
}

#[test]
fn a_link_that_leads_nowhere_is_not_replaced() {
    let folder = Folder::with_demo();
    std::os::unix::fs::symlink("nowhere.mcap", folder.path().join("out.mcap")).unwrap();
    folder.refuses("annotate demo.mcap -o out.mcap", 1, &["out.mcap: exists"]);
}

#[test]
fn names_that_are_not_unicode_are_worked_on() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let folder = Folder::with_demo();
    let name = OsStr::from_bytes(b"z\xff.mcap");
    std::fs::copy(folder.path().join("demo.mcap"), folder.path().join(name)).unwrap();
    for verb in ["annotate", "topics", "report"] {
        let run = folder.run([OsStr::new(verb), name, OsStr::new("--json")]).ok();
        assert!(run.json().is_object(), "{verb}");
    }
}

#[test]
fn a_topic_that_is_mapped_in_vain_is_named() {
    let folder = Folder::with_demo();
    // Without an IMU that is used by itself.
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut out).unwrap();
    let channel = writer.add_channel(0, "/rig/blob", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    drop(writer);
    folder.write("blob.mcap", &out.into_inner());
    let setting = r#"imu=[{topic="/rig/blog", accel="a", gyro="g"}]"#;
    for verb in ["annotate", "report"] {
        let run = folder.run([verb, "blob.mcap", "--set", setting]);
        assert_eq!(run.code, 1);
        assert!(run.stderr.contains("/rig/blog: configured"), "{}", run.stderr);
        assert!(run.stderr.contains("did you mean /rig/blob?"), "{}", run.stderr);
    }
}

#[test]
fn no_permission_is_said() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = Folder::with_demo();
    let mode = |name: &str, mode| {
        std::fs::set_permissions(folder.path().join(name), std::fs::Permissions::from_mode(mode)).unwrap();
    };
    std::fs::create_dir(folder.path().join("locked")).unwrap();
    mode("locked", 0o555);
    // Nothing is forbidden to root, unless it gives that right up.
    let capabilities = "-dac_override,-dac_read_search";
    let limits = ["--bounding-set", capabilities, "--inh-caps", capabilities];
    let is_root = std::fs::write(folder.path().join("locked/x"), "").is_ok();
    let _ = std::fs::remove_file(folder.path().join("locked/x"));
    let works = !is_root || Command::new("setpriv").args(limits).arg("true").status().is_ok_and(|s| s.success());
    let Some(()) = needed(works.then_some(()), "setpriv, by which root gives up its rights") else { return };
    let refuses = |line: &str, words: &str| {
        let program = program();
        let mut command = if is_root { Command::new("setpriv") } else { Command::new(&program) };
        if is_root {
            command.args(limits).arg(program);
        }
        let run = finish(command.args(line.split_whitespace()).current_dir(folder.path()));
        assert!(run.code == 1 && run.error().contains(words), "{line}: {}", run.stderr);
        assert_eq!(folder.names(), ["demo.mcap", "locked"]);
    };
    refuses("annotate demo.mcap -o locked/out.mcap", "locked/out.mcap: cannot write: permission denied");
    mode("demo.mcap", 0o000);
    refuses("annotate demo.mcap", "demo.mcap: cannot read: permission denied");
}

#[test]
fn a_write_that_fails_half_way_leaves_nothing_behind() {
    let folder = Folder::with_demo();
    let program = program();
    for verb in ["annotate demo.mcap -o out.mcap", "simulate demo -o out.mcap"] {
        // A limit of 64 blocks of 512 bytes; the signal that comes with it is to be ignored, as a full disk has none.
        let script = format!("trap '' XFSZ; ulimit -f 64; exec {program} {verb}");
        let run = finish(Command::new("bash").args(["-c", &script]).current_dir(folder.path()));
        assert_eq!(run.code, 1, "{}", run.stderr);
        assert!(run.error().contains("out.mcap: cannot write"), "{}", run.stderr);
        assert_eq!(folder.names(), ["demo.mcap"]);
    }
}

#[test]
fn without_an_imu_the_topics_and_a_way_to_map_one_are_listed() {
    let text = "[recording]\nencoding = 'protobuf'";
    let mut scenario: toml::Table = include_str!("../../src/simulate/scenarios/demo.toml").parse().unwrap();
    stillpoint::config::overlay(&mut scenario, text.parse().unwrap());
    let folder = Folder::with_scenario("raw.mcap", &Scenario::from_table(scenario).unwrap());
    let words = ["raw.mcap: no usable IMU topic", "/imu/data_raw", "--set 'imu=["];
    folder.refuses("annotate raw.mcap", 1, &words);
    folder.refuses("export raw.mcap --format json", 1, &words);

    let run = folder.say("annotate raw.mcap --allow-no-imu --json").ok();
    assert_eq!(run.json()["imus"], serde_json::json!([]));
    assert_eq!(folder.names(), ["raw.annotated.mcap", "raw.mcap"]);
    folder.say("strip raw.annotated.mcap -o original.mcap").ok();
    assert_eq!(folder.read("original.mcap"), folder.read("raw.mcap"));
}

/// The configuration that a refusal offers, and the one that `topics` prints.
fn offers(folder: &Folder, recording: &str) -> (String, String) {
    let refusal = folder.say(&format!("annotate {recording} -o out.mcap"));
    assert_eq!(refusal.code, 1, "{}", refusal.stderr);
    let setting = refusal.error().split("--set '").nth(1).and_then(|rest| rest.split('\'').next()).unwrap().to_owned();
    let topics = folder.say(&format!("topics {recording}")).ok().stdout;
    let lines = topics.lines().skip_while(|line| !line.starts_with("[[imu]]")).take_while(|line| !line.is_empty());
    (setting, lines.map(|line| format!("{line}\n")).collect())
}

#[test]
fn what_is_offered_to_map_a_topic_works_as_it_stands() {
    for encoding in ["protobuf", "json"] {
        let mut scenario: toml::Table = include_str!("../../src/simulate/scenarios/demo.toml").parse().unwrap();
        let text = format!("[recording]\nencoding = '{encoding}'");
        stillpoint::config::overlay(&mut scenario, text.parse().unwrap());
        let folder = Folder::with_scenario("raw.mcap", &Scenario::from_table(scenario).unwrap());
        let (setting, lines) = offers(&folder, "raw.mcap");
        folder.write("map.toml", lines.as_bytes());
        folder.run(["annotate", "raw.mcap", "-o", "a.mcap", "--require-calibration", "--set", &setting]).ok();
        folder.say("annotate raw.mcap -o b.mcap --require-calibration -c map.toml").ok();
        assert_eq!(folder.read("a.mcap"), folder.read("b.mcap"), "{setting} is not {lines}");
    }
}

#[test]
fn faults_of_the_configuration_are_located() {
    let folder = Folder::with_demo();
    folder.write("unknown.toml", b"[still]\nwindow = 1\n");
    folder.write("bounds.toml", b"[fit.bounds]\naccel_bias = [8, -8]\n");
    folder.write("type.toml", b"[still]\nwindow_s = 'long'\n");
    folder.write("syntax.toml", b"[still\n");
    folder.write("good.toml", b"[still]\nmin_fit_s = 2\n");
    let did_you_mean = "unknown.toml:2: `still.window`: no such key `window`; did you mean `window_s`?";
    for verb in ["config check", "annotate demo.mcap -c", "topics demo.mcap -c", "export demo.mcap --format json -c"] {
        folder.refuses(&format!("{verb} unknown.toml"), 2, &[did_you_mean]);
        folder.refuses(&format!("{verb} bounds.toml"), 2, &["bounds.toml:2: ", "lower bound 8 is above the upper"]);
        folder.refuses(&format!("{verb} type.toml"), 2, &["type.toml:2: `still.window_s`", "expected a number"]);
        folder.refuses(&format!("{verb} syntax.toml"), 2, &["syntax.toml:1: "]);
        folder.refuses(&format!("{verb} missing.toml"), 2, &["missing.toml", "no such file"]);
    }
    for verb in ["annotate", "merge"] {
        folder.refuses(&format!("{verb} --inputs-from missing.txt"), 1, &["missing.txt: cannot read: no such file"]);
    }
    folder.refuses("annotate demo.mcap --set still.windw_s=1", 2, &["--set still.windw_s=1", "`window_s`"]);
    folder.refuses("annotate demo.mcap --set nonsense", 2, &["expected key=value"]);
    folder.say("config check good.toml").ok();
}

#[test]
fn command_lines_that_contradict_themselves_are_usage_errors() {
    let folder = Folder::with_demo();
    folder.write("other.mcap", &folder.read("demo.mcap"));
    folder.refuses("annotate demo.mcap other.mcap -o out.mcap", 2, &["--out-dir"]);
    folder.refuses("annotate demo.mcap ./demo.mcap --out-dir .", 2, &["named twice"]);
    folder.refuses("simulate no-such -o out.mcap", 2, &["no-such", "demo, thesis-sequence-1"]);
    folder.refuses("simulate demo -o out.mcap --set gravty=1", 2, &["gravty"]);
    for line in
        ["", "annotate", "annotate demo.mcap -v -q", "annotate demo.mcap --live", "frobnicate", "export demo.mcap"]
    {
        assert_eq!(folder.say(line).code, 2, "{line}");
    }
    for line in ["--help", "--version", "annotate --help"] {
        folder.say(line).ok();
    }
    assert_eq!(folder.names(), ["demo.mcap", "other.mcap"]);
}
