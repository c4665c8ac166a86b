//! An earlier calibration beside recordings of several IMUs: each is compared with itself, and with no other.

use serde_json::{Value, json};

use crate::common::Folder;
use crate::real_recordings::{START, both, recording, six_faces};

/// `both.mcap` with /front and /rear, `front.mcap` with /front alone, and the calibration of the latter.
fn two_imus() -> (Folder, &'static str) {
    let folder = Folder::new();
    let at = |topic: &'static str| six_faces().into_iter().map(move |m| (topic, START + m.at, both(&m, START + m.at)));
    let mut all: Vec<_> = at("/front").chain(at("/rear")).collect();
    all.sort_by_key(|(_, log_time, _)| *log_time);
    folder.write("both.mcap", &recording(all));
    folder.write("front.mcap", &recording(at("/front")));
    folder.write("rear.mcap", &recording(at("/rear")));
    let imu = |topic: &str| format!("[[imu]]\ntopic = '{topic}'\naccel = 'a'\ngyro = 'g'\n");
    for (name, topics) in [("both", &["/front", "/rear"][..]), ("front", &["/front"]), ("rear", &["/rear"])] {
        let text: String = topics.iter().map(|topic| imu(topic)).collect();
        folder.write(&format!("{name}.toml"), text.as_bytes());
    }
    folder.say("export front.mcap -c front.toml --format json -o front.json").ok();
    (folder, "annotate both.mcap -c both.toml --json -q --force")
}

fn drift(folder: &Folder, line: &str, topic: &str) -> Value {
    let run = folder.say(line).ok().json();
    run["drift"].as_array().unwrap().iter().find(|drift| drift["topic"] == topic).unwrap().clone()
}

#[test]
fn the_only_imu_of_a_calibration_is_compared_with_itself_alone() {
    let (folder, annotate) = two_imus();
    let line = format!("{annotate} --against front.json");
    let (front, rear) = (drift(&folder, &line, "/front"), drift(&folder, &line, "/rear"));
    assert_eq!((&front["compared_with"], front["triads"].as_array().map(Vec::len)), (&json!("/front"), Some(2)));
    assert_eq!(rear["error"], "the earlier calibration is of /front, not of /rear");
    let said = folder.say("annotate both.mcap -c both.toml --force --against front.json").ok().stderr;
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("drift the earlier calibration is of /front, not of /rear"), "{said}");
    assert_eq!(said.matches("drift: now less the earlier calibration").count(), 1, "{said}");
    folder.say("report both.annotated.mcap -o page.html --against front.json").ok();
    let html = String::from_utf8(folder.read("page.html")).unwrap();
    assert_eq!(html.matches("Change since the earlier calibration").count(), 1);
    assert!(html.contains("the earlier calibration is of /front, not of /rear"));
}

#[test]
fn a_calibration_without_a_name_is_of_none_of_several_and_of_the_only_one() {
    let (folder, annotate) = two_imus();
    let mut nameless: Value = serde_json::from_slice(&folder.read("front.json")).unwrap();
    (nameless["imus"][0]["name"], nameless["imus"][0]["topic"]) = (json!(""), json!(""));
    folder.write("nameless.json", nameless.to_string().as_bytes());
    for topic in ["/front", "/rear"] {
        let error = drift(&folder, &format!("{annotate} --against nameless.json"), topic)["error"].to_string();
        let next = format!("import FILE --topic {topic}");
        assert!(error.contains("does not say which of the 2 IMUs it is of") && error.contains(&next), "{error}");
    }
    for (earlier, note) in [
        ("nameless.json", "does not say which IMU it is of: taken for that of /rear, the only one here"),
        ("front.json", "is of /front, its only IMU: compared with /rear, the only one here"),
    ] {
        let run = folder.say(&format!("annotate rear.mcap -c rear.toml --force --json --against {earlier}")).ok();
        let said = run.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(note), "{said}");
        assert_eq!(run.json()["drift"][0]["triads"].as_array().map(Vec::len), Some(2));
    }
}
