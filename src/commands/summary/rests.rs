//! Rests in a summary: their number, the faces they lie on, those that were rejected, and spans that were nearly rests.

use console::style;
use stillpoint::messages::{Coverage, Face, Segment};
use stillpoint::printable;
use stillpoint::report::{Findings, NearMiss};

use crate::commands::text::Look;

/// Most rejected rests that are listed; there may be thousands.
const LISTED: usize = 12;

/// Most rests of one reason that are listed one by one; more share a line.
const ALIKE: usize = 3;

/// Number of rests, and how many of them were accepted.
pub fn count(findings: &Findings) -> String {
    let (found, accepted) = (findings.rests.len(), findings.accepted());
    match found {
        0 => "  rests    none found".to_owned(),
        _ => {
            let in_part = findings.rejected().filter(|rest| findings.is_used_in_part(rest)).count();
            let in_part =
                if in_part > 0 { format!(", {in_part} of them used for what is known in part") } else { String::new() };
            format!("  rests    {found} found, {accepted} accepted, {} rejected{in_part}", found - accepted)
        }
    }
}

/// The faces of the fixture; nothing where there are none to see.
pub fn faces(findings: &Findings, look: Look) -> Vec<String> {
    let between = match findings.between_faces() {
        0 => None,
        times => Some(format!("between faces {times}×")),
    };
    let faces = |coverage: &Coverage| {
        let faces = coverage.faces.iter().map(|of| face(of, coverage.complete));
        look.wrap("  faces    ", "   ", faces.chain(between))
    };
    findings.coverage.as_ref().map(faces).unwrap_or_default()
}

/// A face with its placements; one without any is missing, unless the calibration is complete.
fn face(face: &Face, complete: bool) -> String {
    match face.placements {
        0 if complete => format!("{} not seen", printable(&face.name)),
        0 => style(format!("{} missing", printable(&face.name))).for_stderr().yellow().to_string(),
        times => format!("{} {times}× {:.1} s", printable(&face.name), face.seconds),
    }
}

/// Length of a rest, in seconds.
pub fn seconds(rest: &Segment) -> f64 {
    nanos(&rest.end).saturating_sub(nanos(&rest.start)) as f64 * 1e-9
}

fn nanos(time: &Option<prost_types::Timestamp>) -> i64 {
    time.as_ref().map_or(0, |t| t.seconds.saturating_mul(1_000_000_000).saturating_add(t.nanos.into()))
}

/// Rejected rests, grouped by reason.
pub fn rejected(findings: &Findings, look: Look) -> Vec<String> {
    let origin = findings.origin();
    let at = |rest: &Segment| nanos(&rest.start).saturating_sub(origin) as f64 * 1e-9;
    let mut groups = Vec::<(String, Vec<&Segment>)>::new();
    for rest in findings.rejected() {
        let alike = format!("{} {}", rest.reason().as_str_name(), without_numbers(&rest.explanation));
        match groups.iter_mut().find(|(known, _)| *known == alike) {
            Some((_, rests)) => rests.push(rest),
            None => groups.push((alike, vec![rest])),
        }
    }
    let line = |rest: &Segment| {
        let label = format!("  {:>+7.1} s {:>5.1} s  ", at(rest), seconds(rest));
        look.sentence(
            &label,
            &format!("{} {}{}", rest.reason().as_str_name(), rest.explanation, in_part(findings, rest)),
        )
    };
    // One line per group, or one per rest, in time order.
    let mut lines = Vec::new();
    for (_, rests) in &groups {
        match rests.as_slice() {
            [first, .., last] if rests.len() > ALIKE => {
                let label = format!("  {:>+7.1} s to {:+.1} s  ", at(first), at(last));
                let (count, reason) = (rests.len(), first.reason().as_str_name());
                let text =
                    format!("{count} rests {reason}, the first: {}{}", first.explanation, in_part(findings, first));
                lines.push((at(first), look.sentence(&label, &text)));
            }
            few => lines.extend(few.iter().map(|rest| (at(rest), line(rest)))),
        }
    }
    lines.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let further = lines.len().saturating_sub(LISTED);
    let mut said: Vec<_> = lines.into_iter().take(LISTED).flat_map(|(_, lines)| lines).collect();
    if further > 0 {
        said.push(format!("  … and {further} more"));
    }
    if !said.is_empty() {
        said.insert(0, "  rejected, by time since the first reading and length".to_owned());
    }
    said
}

/// Remark on a rejected rest that counts in part.
fn in_part(findings: &Findings, rest: &Segment) -> &'static str {
    if findings.is_used_in_part(rest) { " (used for what is known in part)" } else { "" }
}

/// A text without its numbers, so that texts of one kind are equal.
fn without_numbers(text: &str) -> String {
    text.split(|c: char| c.is_ascii_digit() || c == '.').collect()
}

/// Spans that were nearly rests, where more rests would help.
pub fn near_misses(findings: &Findings, look: Look) -> Vec<String> {
    const NAMED: usize = 6;
    let (misses, Some(advice)) = (&findings.near_misses, findings.near_misses.advice()) else { return Vec::new() };
    if findings.is_done() && !look.verbose {
        return Vec::new();
    }
    let origin = findings.origin();
    let one = |miss: &NearMiss| {
        let at = |stamp: i64| stamp.saturating_sub(origin) as f64 * 1e-9;
        let face = findings.face_of(miss).map(|face| format!(", {} up", printable(face))).unwrap_or_default();
        let sensor = findings.sensor_of(miss).map(|sensor| format!(", {sensor}")).unwrap_or_default();
        let seconds = (at(miss.end) - at(miss.start)).max(1.0);
        format!("{:+.1} s ({:.1} for {seconds:.0} s{face}{sensor})", at(miss.start), miss.lowest)
    };
    let named: Vec<_> = misses.iter().take(NAMED).map(one).collect();
    let further = misses.count() - named.len();
    let more = if further > 0 { format!(" and {further} more") } else { String::new() };
    let below = misses.iter().next().map_or(0.0, |miss| miss.enter);
    let with = match (
        misses.iter().any(|m| findings.face_of(m).is_some()),
        misses.iter().any(|m| findings.sensor_of(m).is_some()),
    ) {
        (true, true) => ", with the face up and the louder sensor",
        (true, false) => ", with the face up",
        (false, true) => ", with the louder sensor",
        (false, false) => "",
    };
    let text = format!(
        "nearly still, in noise floors where {below} are asked{with}: {}{more}. To take them: {advice}",
        named.join(", ")
    );
    look.sentence("  missed   ", &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOK: Look = Look { columns: 100, verbose: false };

    #[test]
    fn rests_that_were_rejected_for_one_reason_are_one_line() {
        let mut findings = Findings::new("/imu", "/imu");
        for i in 0..9 {
            let stamp = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
            let explanation = format!("reads 1.0{i} m/s² at rest, where gravity is 9.81: it is in g");
            let (start, end) = (stamp(4 * i), stamp(4 * i + 2));
            findings.rests.insert(i, Segment { start, end, explanation, ..Segment::default() });
        }
        let lines = rejected(&findings, LOOK);
        assert_eq!(lines.len(), 3, "{lines:?}");
        assert!(lines[1].contains("+0.0 s to +32.0 s  9 rests") && lines[1].contains("the first: reads 1.00 m/s²"));
        findings.rests.retain(|key, _| *key < 2);
        assert_eq!(rejected(&findings, Look { columns: 120, verbose: false }).len(), 3, "two stand on their own");
    }
}
