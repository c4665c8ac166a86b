//! `testdata/` holds two built-in scenarios, recorded, with their truth.
//!
//! `STILLPOINT_UPDATE=1 cargo test --test simulate testdata` records them anew after a scenario was edited.

use stillpoint::simulate::{Scenario, Truth, record};

use crate::needs::root;

fn testdata(name: &str, fresh: &[u8]) -> Vec<u8> {
    let path = root().join("testdata").join(name);
    if std::env::var_os("STILLPOINT_UPDATE").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, fresh).unwrap();
    }
    std::fs::read(path).unwrap()
}

#[test]
fn what_is_recorded_is_what_the_scenario_says() {
    for name in ["demo", "six-faces"] {
        let mut recording = Vec::new();
        let truth = record(&Scenario::builtin(name).unwrap(), &mut recording).unwrap();
        let mut json = serde_json::to_vec_pretty(&truth).unwrap();
        json.push(b'\n');
        assert!(
            testdata(&format!("{name}.mcap"), &recording) == recording,
            "run STILLPOINT_UPDATE=1 cargo test --test simulate testdata"
        );
        let stored: Truth = serde_json::from_slice(&testdata(&format!("{name}.truth.json"), &json)).unwrap();
        assert_eq!(stored, truth);
    }
}
