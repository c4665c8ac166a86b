//! Mistakes that people make: each is one line that says what, where and what next, with the right exit code; or it is
//! no mistake, and works.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt as _;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::{Folder, finish, program};

#[test]
fn all_files_of_a_folder_are_annotated_again_and_the_new_ones_done() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -q").ok();
    folder.say("annotate demo.mcap --sidecar -q").ok();
    let before = folder.read("demo.annotated.mcap");
    folder.write("new.mcap", &folder.read("demo.mcap"));
    let all = "demo.annotated.mcap demo.mcap demo.stillpoint.mcap new.mcap";
    let run = folder.say(&format!("annotate {all} --json")).ok();
    let inputs: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(
        inputs.iter().map(|result| result["input"].as_str().unwrap()).collect::<Vec<_>>(),
        ["demo.mcap", "new.mcap"]
    );
    assert!(
        run.stderr.contains("left out, as results of Stillpoint: demo.annotated.mcap and 1 more"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("demo.annotated.mcap is already the result"), "{}", run.stderr);
    assert_eq!(folder.read("demo.annotated.mcap"), before);
    let names = ["demo.annotated.mcap", "demo.mcap", "demo.stillpoint.mcap", "new.annotated.mcap", "new.mcap"];
    assert_eq!(folder.names(), names);

    // In the other forms, and into another folder, too.
    folder.say(&format!("annotate {all} --force -q")).ok();
    folder.say(&format!("annotate {all} --sidecar -q")).ok();
    folder.say(&format!("annotate {all} new.annotated.mcap --out-dir out -q")).ok();
    assert_eq!(folder.names(), [&names[..], &["new.stillpoint.mcap", "out"]].concat());
    // A recording that only has such a name is none of ours.
    folder.write("demo.annotated.mcap", &folder.read("demo.mcap"));
    folder.refuses("annotate demo.mcap demo.annotated.mcap", 2, &["would both be written to demo.annotated.mcap"]);
    // One that is asked for alone is annotated anew.
    folder.say("annotate new.annotated.mcap -q").ok();
}

#[test]
fn an_output_that_is_the_input_is_refused_with_the_way_to_do_it() {
    let folder = Folder::with_demo();
    folder.refuses("annotate demo.mcap -o demo.mcap --force", 1, &["demo.mcap: is itself read", "annotate --in-place"]);
    folder.refuses("annotate demo.mcap -o ./demo.mcap --sidecar", 1, &["demo.mcap: is itself read"]);
    // Other commands have no such way, and say the same with and without force.
    folder.say("annotate demo.mcap -q").ok();
    for line in [
        "tail demo.mcap -o demo.mcap",
        "tail later.mcap -o ./later.mcap",
        "strip demo.annotated.mcap -o demo.annotated.mcap",
        "report demo.mcap -o demo.mcap",
        "export demo.mcap --format json -o demo.mcap",
        "config layout demo.mcap -o demo.mcap",
        "merge demo.mcap --report demo.mcap",
    ] {
        for force in ["", " --force"] {
            let run = folder.say(&format!("{line}{force}"));
            let is_said = run.stderr.ends_with(".mcap: is itself read by this command; choose another name\n");
            assert!(run.code == 1 && is_said, "{line}{force}: {}", run.stderr);
        }
    }
    assert_eq!(folder.names(), ["demo.annotated.mcap", "demo.mcap"]);
}

#[test]
fn a_recording_where_a_calibration_should_be_is_called_one() {
    let folder = Folder::with_demo();
    for line in ["import demo.mcap", "report demo.mcap --against demo.mcap", "annotate demo.mcap --against demo.mcap"] {
        let words = ["demo.mcap: is a recording, no calibration", "stillpoint export demo.mcap --format json"];
        folder.refuses(line, 1, &words);
    }
    folder.refuses(
        "annotate demo.mcap -c demo.mcap",
        2,
        &["demo.mcap: cannot read the configuration: it is a recording"],
    );
    folder.refuses(
        "annotate --inputs-from demo.mcap",
        1,
        &["demo.mcap: cannot read: it is a recording (MCAP), no text"],
    );
}

#[test]
fn a_recording_that_is_named_twice_is_told_however_it_is_spelled() {
    let folder = Folder::with_demo();
    folder.refuses("annotate demo.mcap demo.mcap", 2, &["demo.mcap: is named twice; name each recording once"]);
    let spelled = ["demo.mcap: is named twice (and as ./demo.mcap)"];
    for how in ["", "--out-dir out", "--join --out-dir out", "--join --sidecar", "--join --sidecar -o out", "-o out"] {
        folder.refuses(&format!("annotate demo.mcap ./demo.mcap {how}"), 2, &spelled);
    }
    // Two of one name are not one, and their folders tell them apart.
    std::fs::create_dir(folder.path().join("other")).unwrap();
    std::fs::copy(folder.path().join("demo.mcap"), folder.path().join("other/demo.mcap")).unwrap();
    folder.say("annotate demo.mcap other/demo.mcap --out-dir out -q").ok();
    assert!(folder.read("out/demo.annotated.mcap") == folder.read("out/other/demo.annotated.mcap"));
}

#[test]
fn what_was_written_is_said_whatever_it_is() {
    let folder = Folder::with_demo();
    for line in [
        "export demo.mcap --format json -o e.json",
        "import e.json -o i.json",
        "config layout demo.mcap -o l.json",
        "merge demo.mcap -o m.txt",
        "merge demo.mcap --format json -o m.json",
        "report demo.mcap -o r.html",
    ] {
        let name = line.split_whitespace().last().unwrap();
        let stderr = folder.say(line).ok().stderr;
        assert_eq!(stderr.lines().last(), Some(&*format!("wrote {name}")), "{line}: {stderr}");
        assert_eq!(folder.say(&format!("{line} -q")).ok().stderr, "", "{line}");
    }
}

#[test]
fn a_folder_that_no_recorder_finished_is_refused_with_what_works() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("a bag")).unwrap();
    for name in ["a bag/x_0.mcap", "a bag/x_1.mcap"] {
        folder.write(name, b"");
    }
    for verb in [&["annotate"][..], &["topics"], &["report"], &["export", "--format", "json"], &["merge"]] {
        let run = folder.run([verb, &["a bag"]].concat());
        let advice = "error: a bag: is a folder without metadata.yaml; name a .mcap file in it; those that are one recording \
                      are annotated as one: stillpoint annotate --join 'a bag'/*.mcap --out-dir DIR";
        assert_eq!((run.code, run.stderr.trim_end()), (1, advice), "{verb:?}");
    }
}

#[test]
fn pipes_carry_text_and_no_recordings() {
    let folder = Folder::with_demo();
    for line in [
        "annotate -",
        "annotate demo.mcap -o -",
        "tail -",
        "tail demo.mcap -o -",
        "topics -",
        "report -",
        "export - --format json",
        "config layout -",
        "strip - -o x",
        "strip demo.mcap -o -",
        "repair -",
        "simulate demo -o -",
    ] {
        folder.refuses(line, 2, &["'-' for", "not through pipes", "name a file"]);
    }
    folder.refuses("annotate demo.mcap -c -", 2, &["-: a configuration is read by its name", "name a file"]);
    for line in ["export demo.mcap --format json", "config layout demo.mcap", "report demo.mcap"] {
        let (alone, piped) = (folder.say(line).ok().stdout, folder.say(&format!("{line} -o -")).ok().stdout);
        assert!(!piped.is_empty() && (alone == piped || piped.starts_with("<!doctype html>")), "{line}");
    }
    let exported = folder.say("export demo.mcap --format json -o demo.json").ok();
    assert_eq!(exported.stdout, "");
    let program = program();
    let script =
        format!("{program} import - < demo.json && {program} annotate demo.mcap -q --json --against - < demo.json");
    let run = finish(Command::new("bash").args(["-c", &script]).current_dir(folder.path())).ok();
    assert!(run.stdout.contains("\"drift\""), "{}", run.stdout);
    assert_eq!(folder.names(), ["demo.annotated.mcap", "demo.json", "demo.mcap"]);
}

#[test]
fn joined_files_keep_a_file_each_and_that_is_said() {
    let folder = Folder::with_demo();
    folder.write("two.mcap", &folder.read("demo.mcap"));
    let words = ["-o out: each of the joined files keeps a file", "--out-dir out", "--sidecar -o out"];
    folder.refuses("annotate --join demo.mcap two.mcap -o out", 2, &words);
}

#[test]
fn a_gravity_that_is_none_is_refused_and_one_from_elsewhere_said() {
    let folder = Folder::with_demo();
    for gravity in ["98", "98.0665", "1", "0.98", "980.665", "32.17", "nan", "-9.81", "0"] {
        let line = format!("annotate demo.mcap --set fit.gravity={gravity}");
        folder.refuses(&line, 2, &[&format!("--set fit.gravity={gravity}"), "`fit.gravity`"]);
    }
    folder.refuses(
        "annotate demo.mcap --set fit.gravity=98",
        2,
        &["98 is no gravity in m/s²", "9.76 to 9.84 on Earth"],
    );
    let run = folder.say("annotate demo.mcap --set fit.gravity=9.18 -o x.mcap").ok();
    assert!(run.stderr.starts_with("warning: fit.gravity = 9.18 m/s² is that of no place on Earth"), "{}", run.stderr);
    let run = folder.say("annotate demo.mcap --set fit.gravity=9.81 -o y.mcap").ok();
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
}

#[test]
fn a_topic_that_is_configured_in_vain_is_no_calibrated_imu() {
    let folder = Folder::with_demo();
    let setting = r#"imu=[{topic="/imu/data_row"}]"#;
    let run = |more: &[&str]| folder.run([&["annotate", "demo.mcap", "--force", "--set", setting], more].concat());
    let said = run(&[]).ok().stderr;
    let warning = "warning: /imu/data_row: configured, but the recording has no such topic; did you mean /imu/data_raw? It \
                   has /imu/data_raw";
    assert_eq!(said.lines().last(), Some(warning), "{said}");
    let required = run(&["--require-calibration"]);
    let unmet =
        "warning: demo.mcap: no accelerometer calibration for /imu/data_row, and --require-calibration asks for one";
    assert_eq!((required.code, required.stderr.lines().last()), (4, Some(unmet)), "{}", required.stderr);
    // Whatever calibrates.
    let exported = folder.run(["export", "demo.mcap", "--format", "json", "--set", setting]).ok().stderr;
    assert_eq!(exported.trim_end(), warning);
}

#[test]
fn files_of_other_kinds_are_called_by_their_name() {
    let folder = Folder::new();
    for (name, beginning, words) in [
        ("a.mcap.gz", &b"\x1f\x8b\x08\x00\0\0\0\0"[..], "gunzip"),
        ("a.mcap.zst", b"\x28\xb5\x2f\xfd\x04\0\0\0", "zstd -d"),
        ("a.mcap.lz4", b"\x04\x22\x4d\x18\x60\x40\x82\0", "lz4 -d"),
        ("a.mcap.xz", b"\xfd7zXZ\0\0\x04", "unxz"),
        ("a.zip", b"PK\x03\x04\x14\0\0\0", "unzip"),
        ("a.ulg", b"ULog\x01\x12\x35\x01", "PX4 ULog"),
        ("a.csv", b"t,ax,ay,az,gx\n", "text, CSV perhaps, which begins with \"t,ax,ay,\""),
        ("a.txt", b"hello\nworld", "text"),
        ("a.json", b"{\"imus\": []}", "JSON"),
        ("metadata.yaml", b"rosbag2_bagfile_information:\n", "name the folder"),
        ("a.bag", b"#ROSBAG V2.0\n", "ROS 1 bag"),
        ("a.db3", b"SQLite format 3\0", "sqlite3"),
        ("a.bin", b"\x01\x02\x03\x04\x05\x06\x07\x08", "begins with [01, 02"),
        ("short.mcap", b"\x89MC", "shorter than"),
    ] {
        folder.write(name, beginning);
        for verb in ["annotate", "topics", "report"] {
            folder.refuses(&format!("{verb} {name}"), 1, &[&format!("{name}: not an MCAP recording: "), words]);
        }
    }
}

#[test]
fn files_and_folders_that_are_not_there_are_named_with_what_helps() {
    let folder = Folder::with_demo();
    folder.refuses("annotate *.bag", 1, &["*.bag: ", "no such file: nothing matches the pattern"]);
    folder.refuses(
        "annotate demo.mcap -o no/such/x.mcap",
        1,
        &["no/such/x.mcap: ", "no such folder as no/such", "mkdir -p"],
    );
    folder.refuses("export demo.mcap --format json -o no/x.json", 1, &["no/x.json: ", "no such folder as no;"]);
    folder.refuses("simulate demo -o no/x.mcap", 1, &["no/x.mcap: ", "no such folder as no;"]);
    folder.refuses("watch demo.mcap", 1, &["demo.mcap: is a file; watch takes the folder", "annotate"]);
    folder.refuses("watch nowhere", 1, &["nowhere: ", "no such file or folder"]);
    folder.refuses("export demo.mcap --format json -o demo.mcap/x", 1, &["a part of its path is a file"]);
}

#[test]
fn ports_are_given_alone_by_name_or_by_number() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    for address in [format!("{port}"), format!("localhost:{port}"), format!("127.0.0.1:{port}")] {
        for option in ["--metrics", "--live"] {
            let words =
                [&*format!("127.0.0.1:{port}: cannot listen on"), "another program listens there", "another port"];
            folder.refuses(&format!("watch in {option} {address}"), 1, &words);
        }
    }
    for wrong in ["in", "9464x", "99999", ":9464", "localhost"] {
        folder.refuses(
            &format!("watch in --metrics {wrong}"),
            2,
            &[&format!("'{wrong}' for '--metrics"), "a port alone"],
        );
    }
    // The folder behind the option is taken for its address.
    folder.refuses("watch --metrics in", 2, &["stands before the option"]);
}

#[test]
fn names_keep_their_bytes() {
    let folder = Folder::with_demo();
    let name = OsStr::from_bytes(b"z\xff\xfe.mcap");
    std::fs::rename(folder.path().join("demo.mcap"), folder.path().join(name)).unwrap();
    for sidecar in [&[][..], &[OsStr::new("--sidecar")]] {
        folder.run([&[OsStr::new("annotate"), OsStr::new("-q"), name], sidecar].concat()).ok();
    }
    folder.run([OsStr::new("annotate"), OsStr::new("--json"), OsStr::new("--join"), name, name]);
    let entries = std::fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().as_bytes().to_owned()).collect();
    names.sort();
    assert_eq!(names, [&b"z\xff\xfe.annotated.mcap"[..], b"z\xff\xfe.mcap", b"z\xff\xfe.stillpoint.mcap"]);
}

#[test]
fn what_an_imported_calibration_does_not_say_is_null() {
    let folder = Folder::new();
    folder.write("imu_calib.yaml", b"SM: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbias: [0.1, 0, 0]\n");
    let imported = folder.say("import imu_calib.yaml").ok().json();
    for key in ["gravity", "gravity_source", "revision", "segments", "placements"] {
        assert_eq!(imported["imus"][0][key], Value::Null, "{key}");
    }
    // And what it says is kept.
    let folder = Folder::with_demo();
    let exported = folder.say("export demo.mcap --format json -o demo.json --set fit.gravity=9.81").ok();
    assert_eq!(exported.stdout, "");
    let imported = folder.say("import demo.json").ok().json();
    let exported: Value = serde_json::from_slice(&folder.read("demo.json")).unwrap();
    for key in ["gravity", "gravity_source", "revision", "segments", "placements"] {
        assert!(!exported["imus"][0][key].is_null() && imported["imus"][0][key] == exported["imus"][0][key], "{key}");
    }
}

#[test]
fn standard_input_that_is_no_calibration_is_refused() {
    let folder = Folder::new();
    let mut command = Command::new(program());
    let output = command.args(["import", "-"]).current_dir(folder.path()).stdin(Stdio::null()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: -: is no calibration"));
}

#[test]
fn a_mistake_in_the_command_line_is_one_line_with_what_helps() {
    let folder = Folder::with_demo();
    for (line, words) in [
        ("annotat demo.mcap", &["unrecognized subcommand 'annotat'", "'annotate'", "see stillpoint --help"][..]),
        (
            "annotate demo.mcap --forc",
            &["unexpected argument '--forc' found", "'--force'", "see stillpoint annotate --help"],
        ),
        ("annotate", &["required arguments were not provided: <INPUT>", "see stillpoint annotate --help"]),
        ("export demo.mcap", &["not provided: --format <FORMAT>", "see stillpoint export --help"]),
        (
            "export demo.mcap --format jsn",
            &[
                "invalid value 'jsn' for '--format <FORMAT>'",
                "possible values: json, yaml",
                "'json'",
                "stillpoint export --help",
            ],
        ),
        ("export demo.mcap --format", &["a value is required for '--format <FORMAT>'"]),
        (
            "annotate demo.mcap -o a --out-dir b",
            &["'--output <OUT>' cannot be used with '--out-dir <DIR>'", "stillpoint annotate --help"],
        ),
        ("annotate demo.mcap --quiet=yes", &["unexpected value 'yes' for '--quiet'"]),
        ("config shw", &["unrecognized subcommand 'shw'", "'show'", "see stillpoint config --help"]),
        (
            "strip demo.mcap -o a -o b",
            &["'--output <OUT>' cannot be used multiple times", "see stillpoint strip --help"],
        ),
        ("-v -q topics demo.mcap", &["cannot be used with"]),
        ("simulate demo -o x.mcap --set", &["a value is required for '--set <KEY=VALUE>'"]),
    ] {
        folder.refuses(line, 2, words);
    }
    // Help that is asked for, and that of no command at all, is as it was.
    for (line, code) in
        [("--help", 0), ("annotate --help", 0), ("help annotate", 0), ("--version", 0), ("config", 2), ("", 2)]
    {
        let run = folder.say(line);
        assert_eq!(run.code, code, "{line}");
        let said = if code == 0 { run.stdout } else { run.stderr };
        assert!(
            !said.contains("error:") && said.contains(if line == "--version" { "stillpoint " } else { "Usage: " }),
            "{said}"
        );
    }
}

#[test]
fn a_short_rest_is_accepted_for_its_placement_and_says_so() {
    let folder = Folder::with_demo();
    // Rests of 2.8 s are cut in two, of which the second is shorter than what enters the fit.
    let run = folder.say("annotate demo.mcap --set still.max_duration_s=2 --json").ok().json();
    assert!(run["rests"]["accepted"].as_u64() > Some(9), "{}", run["rests"]);
    let text = folder.say("report demo.annotated.mcap -o page.html").ok();
    assert_eq!(text.code, 0);
    let bytes = folder.read("demo.annotated.mcap");
    let segments = mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap());
    let segments = segments.filter(|message| message.channel.topic.ends_with("/stillpoint/segment"));
    let said: Vec<_> = segments.map(|message| String::from_utf8_lossy(&message.data).into_owned()).collect();
    let short = said.iter().filter(|said| said.contains(" s of 2.") && said.contains(" s at this placement, tilt"));
    assert!(short.count() > 3, "{said:?}");
    // And what is too short in all says how long it was.
    let run = folder.say(
        "annotate demo.mcap --force --set still.max_duration_s=2 --set still.min_rest_s=0.2 --set still.min_fit_s=1.9",
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(!run.stderr.contains("TOO_SHORT"), "{}", run.stderr);
}

#[test]
fn a_rotation_that_is_declared_wrongly_is_said_and_does_no_harm() {
    let folder = Folder::with_demo();
    let plain = folder.say("annotate demo.mcap --json").ok();
    for (rotation, says) in [
        (
            "{begin_s=0,end_s=3000,angle_deg=360}",
            "warning: /imu/data_raw: fit.rotations declares 360° about the vertical from 0 s to 3000 s, which is not used: it \
             holds 8 turns with rests between them",
        ),
        ("{begin_s=900,end_s=901,angle_deg=360}", "nothing turned between two rests then; nearest is "),
        ("{begin_s=0,end_s=3000,angle_deg=360,imu='front'}", "warning: fit.rotations: no IMU is called front"),
    ] {
        let run = folder.say(&format!("annotate demo.mcap --json --force --set fit.rotations=[{rotation}]")).ok();
        assert!(run.stderr.contains(says), "{}", run.stderr);
        assert_eq!(run.json()["imus"], plain.json()["imus"]);
    }
    // That of another IMU is none of this one's, which is called by its topic with or without the slash.
    let named =
        "annotate demo.mcap --force --set fit.rotations=[{begin_s=900,end_s=901,angle_deg=1,imu='imu/data_raw'}]";
    assert!(folder.say(named).ok().stderr.contains("nothing turned"));
    folder.refuses(
        "annotate demo.mcap --force --set fit.rotations=[{begin_s=5,end_s=4,angle_deg=360}]",
        2,
        &["`fit.rotations.0.end_s`: must come after `begin_s` (5), is 4"],
    );
}

#[test]
fn a_unit_that_the_configuration_has_wrong_is_told_and_calibrates_nothing() {
    let folder = Folder::with_demo();
    let set = "imu=[{topic=\"/imu/data_raw\", gyro={unit=\"deg/s\"}}]";
    let run = folder.run(["annotate", "demo.mcap", "--set", set]).ok();
    let told = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.contains("set gyro = { unit = \"rad/s\" } in its [[imu]]"), "{told}");
    assert!(told.contains("gyroscope UNDETERMINED"), "{told}");
}

#[test]
fn a_file_where_a_folder_should_be_is_named() {
    let folder = Folder::with_demo();
    folder.write("out", b"");
    folder.refuses("annotate demo.mcap --out-dir out", 1, &["out: is a file", "name a folder"]);
    folder.refuses("man out --force", 1, &["out: is a file", "name a folder"]);
    folder.refuses("man out", 1, &["out: is a file", "name a folder"]);
}
