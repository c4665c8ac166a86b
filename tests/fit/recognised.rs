//! What is wrong with a recording is recognised and said, and never calibrated into: a table of sessions that determine
//! no calibration, of sessions with a fault that leaves one, and of sessions that only look bad.
//!
//! Every session runs with several seeds, rates and noises. A triad is *wrong* when it is published where nothing
//! determines it, or when the truth is far outside its bars.

mod faults;
mod learned;
mod real;
mod sessions;

use faults::*;
use learned::{Learned, Triad};
pub use real::real_samples;
use sessions::{Session, Variation};
use stillpoint::imu::Sensor;

/// What must come of a session.
struct Case {
    name: &'static str,
    session: fn(&Variation) -> Session,
    accelerometer: Fate,
    gyroscope: Fate,
    /// Words of which one must be said, by a segment, coverage, note or log.
    says: &'static [&'static str],
}

/// What must become of a triad.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    /// Never published.
    Refused,
    /// Published or not, but never wrong.
    Honest,
    /// Published in the end, and right.
    Learned,
}

use Fate::{Honest, Learned as Right, Refused};

const CASES: &[Case] = &[
    // Too little was shown.
    Case {
        name: "five faces",
        session: |v| v.faces(&FACES[..5]),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["-Y points up"],
    },
    Case {
        name: "the same face six times",
        session: |v| v.faces(&["+Z"; 6]),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["still to see: +X, -X, +Y, -Y, -Z"],
    },
    Case {
        name: "turned about one axis only",
        session: |v| v.faces(&["+X", "+Y", "-X", "-Y", "+X", "+Y", "-X", "-Y"]),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["still to see: +Z, -Z"],
    },
    Case {
        name: "all tilted by 20°",
        session: |v| v.tilted(20.0),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["was the sensor lying flat?"],
    },
    Case {
        name: "rests too short",
        session: |v| v.rests_of(0.85),
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["hold it still for", "never still for"],
    },
    Case {
        name: "hours parked on one face",
        session: |v| v.parked(),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["still to see: +X, -X, +Y, -Y, -Z"],
    },
    // It never rested.
    Case {
        name: "never still",
        session: |v| v.moving(),
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["never seen still"],
    },
    Case {
        name: "steady vibration",
        session: |v| v.vibrating("amplitude = [0.4, 0.3, 0.6]\nfrequency_hz = 8.3"),
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["never seen still"],
    },
    Case {
        name: "modulated vibration",
        session: |v| {
            v.vibrating("amplitude = [0.8, 0.6, 1.2]\nfrequency_hz = 8.3\nmodulation = 0.3\nmodulation_hz = 0.2")
        },
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["never seen still"],
    },
    Case {
        name: "vibration in bursts",
        session: |v| v.vibrating("amplitude = [0.8, 0.6, 1.2]\nfrequency_hz = 8.3\nburst_s = 1.2\npause_s = 0.3"),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["never seen still", "hold it still", "quiet motion", "never still for"],
    },
    Case {
        name: "slow creep through the poses",
        session: |v| v.creeping(),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["wandered", "constant rate"],
    },
    Case {
        name: "constant turn on a table",
        session: |v| v.turning(),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["turns at a constant rate"],
    },
    // The readings are not what they are taken for.
    Case {
        name: "in g",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a / G),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["unit = \"g\""],
    },
    Case {
        name: "in mg",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a * 1000.0 / G),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["in mg", "never seen still"],
    },
    Case {
        name: "raw counts",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a * 16384.0 / G),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["raw counts", "never seen still"],
    },
    Case {
        name: "half the scale",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a / 2.0),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["full-scale range"],
    },
    Case {
        name: "twice the scale",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a * 2.0),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["full-scale range"],
    },
    Case {
        name: "gravity removed",
        session: |v| v.gravity_removed(),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["gravity was removed"],
    },
    Case {
        name: "rates in deg/s",
        session: |v| v.six().change(Sensor::Gyroscope, |w| w * 1_f64.to_degrees()),
        accelerometer: Honest,
        gyroscope: Refused,
        says: &["deg/s"],
    },
    Case {
        name: "all zeros",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a * 0.0),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["does not change at all", "never seen still"],
    },
    Case {
        name: "a constant accelerometer",
        session: |v| v.six().change(Sensor::Accelerometer, |_| Vector3::new(0.1, -0.2, 9.7)),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["does not change at all", "never seen still"],
    },
    // An axis is not what it should be.
    Case {
        name: "a frozen axis",
        session: |v| v.six().change(Sensor::Accelerometer, |a| Vector3::new(a.x, 0.3, a.z)),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["y axis does not change"],
    },
    Case {
        name: "an axis that freezes",
        session: |v| v.six().freezing(1),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["y axis does not change"],
    },
    Case {
        name: "a flipped axis",
        session: |v| v.six().change(Sensor::Accelerometer, |a| Vector3::new(a.x, a.y, -a.z)),
        accelerometer: Refused,
        gyroscope: Honest,
        says: &["accelerometer's z axis is flipped"],
    },
    Case {
        name: "a flipped gyroscope axis",
        session: |v| v.six().turned(|w| Vector3::new(-w.x, w.y, w.z)),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["gyroscope's x axis is flipped"],
    },
    Case {
        name: "two gyroscope axes swapped",
        session: |v| v.six().turned(|w| Vector3::new(w.y, w.x, w.z)),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["x and y axes are exchanged"],
    },
    Case {
        name: "a dead gyroscope axis",
        session: |v| v.six().change(Sensor::Gyroscope, |w| Vector3::new(w.x, 0.0, w.z)),
        accelerometer: Right,
        gyroscope: Refused,
        says: &["y axis never changes"],
    },
    Case {
        name: "all axes flipped",
        session: |v| v.six().flipped(),
        accelerometer: Honest,
        gyroscope: Right,
        says: &["FRD"],
    },
    // The stream is not the sensor's.
    Case {
        name: "a face clipped at ±2 g",
        session: |v| v.six().biased(Vector3::new(0.3, -0.2, 10.4)).change(Sensor::Accelerometer, |a| clamp(a, 2.0 * G)),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["an end of its range"],
    },
    Case {
        name: "half of a face's noise clipped",
        session: |v| v.six().biased(Vector3::new(0.3, -0.2, 6.0)).change(Sensor::Accelerometer, |a| clamp(a, 15.806)),
        accelerometer: Refused,
        gyroscope: Right,
        says: &["an end of its range"],
    },
    Case {
        name: "already corrected",
        session: |v| v.six().ideal(),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["residual calibration"],
    },
    Case {
        name: "published twice",
        session: |v| v.six().republished(),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["published twice"],
    },
    Case {
        name: "published twice with the same stamps",
        session: |v| v.six().duplicated(),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["published twice"],
    },
    Case {
        name: "two sensors in turn, mounted otherwise",
        session: |v| v.six().in_turn(2, |k, _, value| if k == 0 { value } else { value.yzx() }),
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["two sensors take turns"],
    },
    Case {
        name: "two sensors in turn, with biases of their own",
        session: |v| {
            v.six().in_turn(2, |k, sensor, value| {
                let size = if sensor == Sensor::Gyroscope { 0.1 } else { 1.0 };
                value + Vector3::new(1.5, -1.0, 1.0) * size * k as f64
            })
        },
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["two sensors take turns"],
    },
    Case {
        name: "three sensors in turn",
        session: |v| v.six().in_turn(3, |k, _, value| [value, value.yzx(), value.zxy()][k]),
        accelerometer: Refused,
        gyroscope: Refused,
        says: &["three sensors take turns"],
    },
    Case {
        name: "an estimator takes the bias of the gyroscope away",
        session: |v| v.six().relaxing(2.0),
        accelerometer: Honest,
        gyroscope: Refused,
        says: &["relaxes towards zero"],
    },
    Case {
        name: "the same, once",
        session: |v| v.resting_first(14).relaxing_once(3.0),
        accelerometer: Honest,
        gyroscope: Refused,
        says: &["relaxes towards zero"],
    },
    Case {
        name: "two poses without motion between them",
        session: |v| v.merged(),
        accelerometer: Right,
        gyroscope: Honest,
        says: &["no samples are missing between", "faster than any gyroscope"],
    },
    Case {
        name: "temperature drift",
        session: |v| v.drifting(),
        accelerometer: Honest,
        gyroscope: Honest,
        says: &["the readings drift"],
    },
    Case {
        name: "coarse steps",
        session: |v| v.six().change(Sensor::Accelerometer, |a| a.map(|x| (x / 0.2).round() * 0.2)),
        accelerometer: Honest,
        gyroscope: Right,
        says: &["below half a step", "rounding"],
    },
    // Only looks bad.
    Case { name: "six faces", session: |v| v.six(), accelerometer: Right, gyroscope: Right, says: &["provisional"] },
    Case {
        name: "starts in motion",
        session: |v| v.starting_in_motion(),
        accelerometer: Right,
        gyroscope: Right,
        says: &[],
    },
    Case {
        name: "a bias of 7.9 m/s²",
        session: |v| v.six().biased(Vector3::new(-7.9, 4.9, 0.2)),
        accelerometer: Right,
        gyroscope: Right,
        says: &[],
    },
    Case { name: "tilted by 3°", session: |v| v.tilted(3.0), accelerometer: Right, gyroscope: Right, says: &[] },
    Case {
        name: "gaps in the rests",
        session: |v| v.six().gaps(),
        accelerometer: Right,
        gyroscope: Right,
        says: &["the stamps jumped"],
    },
    Case {
        name: "jittered stamps",
        session: |v| v.six().jittered(),
        accelerometer: Right,
        gyroscope: Right,
        says: &[],
    },
    Case { name: "filtered noise", session: |v| v.filtered(), accelerometer: Right, gyroscope: Right, says: &[] },
    Case {
        name: "three times the noise",
        session: |v| v.noisy(3.0),
        accelerometer: Right,
        gyroscope: Right,
        says: &[],
    },
];

#[test]
fn every_case_is_recognised_and_nothing_is_calibrated_into() {
    let mut failures = Vec::new();
    for case in CASES {
        for variation in Variation::all() {
            let session = (case.session)(&variation);
            let learned = Learned::from(&session);
            let mut fail = |text: String| failures.push(format!("{} ({variation}): {text}", case.name));
            for (triad, fate) in [(Triad::Accelerometer, case.accelerometer), (Triad::Gyroscope, case.gyroscope)] {
                if let Err(why) = learned.meets(triad, fate, &session.truth) {
                    fail(why);
                }
            }
            if !case.says.is_empty() && !case.says.iter().any(|words| learned.says(words)) {
                fail(format!("none of {:?} in {:#?}", case.says, learned.said()));
            }
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}
