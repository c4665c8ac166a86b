//! Earlier calibration at the rests of a recording, in a summary: inside, suspicious or shifted.

use console::style;
use stillpoint::report::{Earlier, Findings, account, verdict_text};

use crate::commands::text::Look;

/// Verdicts on the earlier calibration; nothing if the drift says already why there are none.
pub fn at_rests(findings: &Findings, earlier: &Earlier<'_>, look: Look) -> Vec<String> {
    let Ok(accounts) = account(findings, earlier) else { return Vec::new() };
    let origin = findings.origin();
    let mut lines = Vec::new();
    if !accounts.is_empty() {
        let text = "earlier calibration at these rests; without any move one recording in 100 is suspicious, one in 10,000 shifted";
        lines.extend(look.sentence("  ", text).iter().map(|line| style(line).for_stderr().dim().to_string()));
    }
    for account in &accounts {
        let (verdict, text) = verdict_text(account, origin);
        let verdict = match verdict {
            "inside" => style(verdict).for_stderr().green(),
            _ => style(verdict).for_stderr().yellow(),
        };
        lines.extend(look.sentence(&format!("  {}  {verdict}  ", account.sensor), &text));
    }
    lines
}
