//! Verdicts on an earlier calibration, for people.

use super::verdict::{Account, Outcome};

/// The verdict, and what it comes from; rests are told by the seconds since `origin`, ns.
pub fn verdict_text(account: &Account, origin: i64) -> (&'static str, String) {
    let outcome = match &account.outcome {
        Ok(outcome) => outcome,
        Err(why) => return ("untold", (*why).to_owned()),
    };
    let Outcome { verdict, chance, placements, worst, states_uncertainty, .. } = outcome;
    let seconds = worst.start.saturating_sub(origin) as f64 * 1e-9;
    let place = if worst.face.is_empty() { String::new() } else { format!(", {}", worst.face) };
    let (what, unit) = match worst.axis {
        None => ("‖a‖ − g".to_owned(), "m/s²"),
        Some(axis) => (format!("the rate about {}", ["x", "y", "z"].get(axis).unwrap_or(&"?")), "rad/s"),
    };
    let half = 1.96 * worst.std;
    let decimals = (1.0 - libm::floor(libm::log10(half.max(1e-9)))).clamp(0.0, 9.0) as usize;
    let many = if *placements == 1 { "placement" } else { "placements" };
    let exact = if *states_uncertainty { "" } else { "; it states no uncertainty and counts as exact" };
    let text = format!(
        "at {placements} {many}: {what} is {:+.decimals$} {unit} at {seconds:+.1} s{place}, ± {half:.decimals$} allowed for; by chance \
         so far off in {}{exact}",
        worst.off,
        odds(*chance)
    );
    (verdict.name(), text)
}

/// A share of recordings.
fn odds(chance: f64) -> String {
    match chance {
        chance if chance >= 0.095 => format!("{:.0} % of recordings", 100.0 * chance),
        chance if chance > 1e-6 => format!("one recording in {:.0}", 1.0 / chance),
        _ => "less than one recording in a million".to_owned(),
    }
}
