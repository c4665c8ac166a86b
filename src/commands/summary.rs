//! Summary for people: the rests found, the faces seen, the calibration with its uncertainty, refusals with their
//! reasons, and the next step.

mod account;
mod parameters;
mod rests;

use console::style;
use stillpoint::printable;
use stillpoint::report::{Earlier, Findings};
use stillpoint::still;

use super::text::Look;

pub use self::rests::seconds;

/// Findings of one IMU, on several lines; with the drift since an earlier calibration, if there is one.
pub fn imu(findings: &Findings, earlier: Option<&Earlier<'_>>, look: Look) -> String {
    let mut lines = vec![heading(findings), rests::count(findings)];
    lines.extend(rests::faces(findings, look));
    lines.extend(parameters::calibration(findings, look));
    lines.extend(earlier.iter().flat_map(|earlier| parameters::since(findings, earlier, look)));
    lines.extend(earlier.iter().flat_map(|earlier| account::at_rests(findings, earlier, look)));
    lines.extend(rests::rejected(findings, look));
    lines.extend(rests::near_misses(findings, look));
    lines.extend(next(findings, look));
    lines.join("\n")
}

/// Findings of one IMU while it is followed: as [`imu`], with its state instead of the rejected rests.
pub fn live(findings: &Findings, status: &still::Status, look: Look) -> Vec<String> {
    let state = look.wrap(&format!("{}  ", heading(findings)), "  ", state(status).into_iter());
    let mut lines: Vec<_> = state.into_iter().chain([rests::count(findings)]).collect();
    lines.extend(rests::faces(findings, look));
    lines.extend(next(findings, look));
    lines.extend(parameters::calibration(findings, look));
    lines
}

/// The next step, once the faces are known.
fn next(findings: &Findings, look: Look) -> Vec<String> {
    if findings.coverage.is_none() {
        return Vec::new();
    }
    look.sentence(&format!("  {}     ", style("next").for_stderr().bold()), &findings.next_step())
}

fn state(status: &still::Status) -> [String; 2] {
    let state = match status.state {
        still::State::Unknown => style("UNKNOWN").for_stderr().yellow(),
        still::State::Moving => style("MOVING").for_stderr().cyan(),
        still::State::Still => style("STILL").for_stderr().green(),
    };
    let floor = |floor: Option<f64>, digits: usize, unit: &str| {
        floor.map_or_else(|| format!("none {unit}"), |floor| format!("{floor:.digits$} {unit}"))
    };
    let level = format!(
        "{:.1} × the noise floor of {}, {}",
        status.statistic,
        floor(status.accel_floor, 4, "m/s²"),
        floor(status.gyro_floor, 5, "rad/s")
    );
    [state.to_string(), level]
}

fn heading(findings: &Findings) -> String {
    let topic = match findings.topic == findings.name {
        true => String::new(),
        false => format!(" ({})", printable(&findings.topic)),
    };
    format!("{}{topic}", style(printable(&findings.name)).for_stderr().bold())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stillpoint::messages::triad::Status;
    use stillpoint::messages::{Coverage, Face, Triad};

    const LOOK: Look = Look { columns: 100, verbose: false };

    #[test]
    fn a_missing_face_and_the_next_step_are_said() {
        let faces = [("+X", 2), ("-X", 0)];
        let faces = faces.map(|(name, placements)| Face { name: name.into(), placements, seconds: 3.0, normal: None });
        let coverage = Coverage { faces: faces.to_vec(), next_step: "turn it".into(), ..Coverage::default() };
        let findings = Findings { coverage: Some(coverage), ..Findings::new("/imu", "/imu") };
        let text = console::strip_ansi_codes(&imu(&findings, None, LOOK)).into_owned();
        assert_eq!(text, "/imu\n  rests    none found\n  faces    +X 2× 3.0 s   -X missing\n  next     turn it");
    }

    #[test]
    fn every_entry_of_a_triangular_s_is_shown_and_the_background_is_asked_for() {
        let refused = "full is not determined: no reference";
        let triad = Triad {
            sensor: "accelerometer".into(),
            status: Status::Confirmed.into(),
            sensitivity: vec![1.0, 0.0, 0.0, 0.012, 1.0, 0.0, 0.0, -0.034, 1.0],
            sensitivity_std: vec![0.01, 0.0, 0.0, 0.01, 0.01, 0.0, 0.01, 0.01, 0.01],
            notes: vec![refused.into(), "misses gravity by 104°".into()],
            ..Triad::default()
        };
        let found = stillpoint::messages::Calibration { accelerometer: Some(triad), ..Default::default() };
        let findings = Findings { calibration: Some(found), ..Findings::new("/imu", "/imu") };
        let text = |verbose| imu(&findings, None, Look { columns: 100, verbose });
        for entry in ["0.012 ± 0.020", "-0.034 ± 0.020", "0 (fixed)", "! misses gravity by 104°"] {
            assert!(console::strip_ansi_codes(&text(false)).contains(entry), "{entry} is not in {}", text(false));
        }
        assert!(!text(false).contains(refused) && text(true).contains(refused));
        assert!(!findings.is_done());
    }
}
