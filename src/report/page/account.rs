//! The earlier calibration at the rests of this recording: whether they are as it predicts.

use maud::{Markup, html};

use super::elements;
use super::imu::Imu;
use crate::report::{Account, Earlier, account, verdict_text};

pub(super) fn section(imu: &Imu<'_>, earlier: &Earlier<'_>) -> Markup {
    let accounts = match account(imu.findings, earlier) {
        Ok(accounts) => accounts,
        Err(why) => return elements::section(HEADING, html! { p { (why) } }),
    };
    let origin = imu.origin.nanos();
    let line = |account: &Account| {
        let (verdict, text) = verdict_text(account, origin);
        let class = match verdict {
            "inside" => "badge confirmed",
            "suspicious" => "badge provisional",
            _ => "badge undetermined",
        };
        html! { p { span class=(class) { (account.sensor) " " b { (verdict) } } " " (text) } }
    };
    let content = html! {
        @if accounts.is_empty() { p { "It determines neither the accelerometer nor the gyroscope." } }
        @for account in &accounts { (line(account)) }
        p.dim {
            "Of a sensor that did not move, one recording in 100 is called suspicious, one in 10,000 shifted."
        }
    };
    elements::section(HEADING, content)
}

const HEADING: &str = "The earlier calibration at these rests";
