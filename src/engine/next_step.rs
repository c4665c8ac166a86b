//! Next step of the operator, as a text.

use super::drift::Drift;
use super::solution::{Advice, Missing, Solution};
use super::status::Unconfirmed;
use crate::fit::{Estimate, Parameterisation};
use crate::messages::Face;

/// Least time that further poses are to be held, s.
const TOLD_S: u32 = 3;

/// Next step of the operator.
pub(super) fn next_step(faces: &[Face], found: u64, solution: &Solution, confirmed: Result<(), Unconfirmed>) -> String {
    let missing = faces.iter().filter(|face| face.placements == 0 && solution.accelerometer.is_err());
    let missing: Vec<_> = missing.map(|face| face.name.as_str()).collect();
    let hold = seconds(solution.hold_s);
    match (&solution.missing, &solution.accelerometer) {
        (Missing::Motion, Err(why)) => return format!("no calibration: {why}"),
        (Missing::Direction(unseen), Err(why)) if found > 0 => {
            return format!("{why}. Turn the sensor so that {unseen} points up and let it rest for {hold}");
        }
        _ => {}
    }
    match (missing.as_slice(), &solution.accelerometer, confirmed) {
        ([first, ..], _, _) if found == 0 || missing.len() == faces.len() => {
            format!("put the sensor down with {first} up (any face will do) and let it rest for {hold}")
        }
        ([only], _, _) => format!("turn the sensor so that {only} points up and let it rest for {hold}"),
        ([first, ..], _, _) => format!(
            "still to see: {}. Turn the sensor so that {first} points up and let it rest for {hold}",
            missing.join(", ")
        ),
        ([], Err(why), _) if !why.asks_for_rests() => format!("no calibration: {why}"),
        ([], Err(why), _) => format!("no calibration: {why}. Repeat the {} faces on a flat, firm surface", faces.len()),
        ([], Ok(_), _) if !solution.doubts.is_empty() => solution.doubts.join("; "),
        ([], Ok(_), _) if solution.drift.as_ref().is_some_and(|drift| !drift.followed) => {
            solution.drift.as_ref().map(Drift::explanation).unwrap_or_default()
        }
        ([], Ok(_), Err(Unconfirmed::Doubted)) => {
            solution.faults.iter().find(|fault| fault.doubts()).map(|fault| fault.text.clone()).unwrap_or_default()
        }
        ([], Ok(_), Ok(())) => match &solution.advice {
            Some(advice) => format!("done: repeated placements agree. {}", further(advice, solution.hold_s)),
            None => "done: repeated placements agree".to_owned(),
        },
        ([], Ok(fit), Err(why)) => unconfirmed(fit, solution, why),
    }
}

/// Text on what would confirm a provisional calibration.
fn unconfirmed(fit: &Estimate, solution: &Solution, why: Unconfirmed) -> String {
    match (why, solution.unchecked.first(), fit.shape) {
        (Unconfirmed::AtBound, ..) => {
            "a parameter stands at its bound, so the bound and not the data made it: check fit.bounds and the preset".to_owned()
        }
        (Unconfirmed::Warmed, ..) => {
            "the bias depends on the temperature, which placements check in part: show every face once more at the one temperature that \
             it is to work at"
                .to_owned()
        }
        (Unconfirmed::Unchecked, Some(face), shape) => {
            let hidden = metres(fit.hidden_error(solution.gravity.value));
            let promise = solution.advice.as_ref().map_or_else(String::new, |advice| format!(". {}", promise(advice, solution.hold_s)));
            match (shape, &solution.advice) {
                (Parameterisation::TRIANGULAR, Some(advice)) => format!(
                    "let it rest once more near {}{}: a wrong rest near {face} would not show, and could hide an error of {hidden} \
                     m/s²{promise}",
                    advice.first,
                    after_it(advice.poses)
                ),
                (Parameterisation::TRIANGULAR, None) => format!(
                    "let it rest once more near {face}{}: a wrong rest there would not show, and could hide an error of {hidden} m/s²",
                    after_it(solution.unchecked.len())
                ),
                _ => format!(
                    "lift it and place {face} up once more{}: a wrong placement there would not show, and could hide an error of \
                     {hidden} m/s²{promise}",
                    after_it(solution.unchecked.len())
                ),
            }
        }
        (_, _, Parameterisation::FULL_ACCELEROMETER) => {
            "the readings follow the reference less evenly than noise would: check its time stamps, and that both are fixed to \
             each other"
                .to_owned()
        }
        (_, _, Parameterisation::TRIANGULAR) => {
            let first = solution.advice.as_ref().map(|advice| format!(", with {} up first", advice.first));
            format!(
                "the rests disagree by more than placements do: let it rest in further directions, on a firm surface{}",
                first.unwrap_or_default()
            )
        }
        _ => "repeated placements disagree: place every face once more on a flat, firm surface".to_owned(),
    }
}

/// Text on what further poses would bring to a calibration that needs none.
fn further(advice: &Advice, hold_s: u32) -> String {
    let [now, then] = advice.error.map(metres);
    match advice.worthwhile {
        true => format!(
            "To know it better, hold it for {} s with {} up{}: worst-case error {now} → {then} m/s²",
            hold_s.max(TOLD_S),
            advice.first,
            after_it(advice.poses)
        ),
        false => {
            format!(
                "{} further poses, with {} up first, would take its worst-case error from {now} to {then} m/s²: enough",
                advice.poses, advice.first
            )
        }
    }
}

/// Text on what the poses of an advice will bring.
fn promise(advice: &Advice, hold_s: u32) -> String {
    let [now, then] = advice.error.map(metres);
    let held = if advice.poses == 1 { "Held" } else { "Each held" };
    format!("{held} for {} s: worst-case error {now} → {then} m/s²", hold_s.max(TOLD_S))
}

/// Time in words.
pub(super) fn seconds(count: u32) -> String {
    if count == 2 { "two seconds".to_owned() } else { format!("{count} s") }
}

/// Text on the number of poses after the first one.
fn after_it(poses: usize) -> String {
    match poses {
        0 | 1 => String::new(),
        _ => format!(" (and {} more after it)", poses - 1),
    }
}

/// Number with two digits that count, or three decimals.
fn metres(error: f64) -> String {
    if error < 0.0995 { format!("{error:.3}") } else { format!("{error:.2}") }
}
