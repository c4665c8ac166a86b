//! Earlier calibration that a recording is compared with: which of its IMUs is which of the recording's.

use super::Findings;

/// Earlier calibration, beside the IMUs of the recording that is compared with it.
#[derive(Clone, Debug)]
pub struct Earlier<'a> {
    imus: &'a [Findings],
    /// Names and topics of the recording's IMUs.
    recorded: Vec<(&'a str, &'a str)>,
}

/// IMU of an earlier calibration that one of the recording is compared with.
#[derive(Clone, Debug)]
pub struct Counterpart<'a> {
    /// Its findings.
    pub findings: &'a Findings,
    /// Reason for comparing with this one, if it goes by another name.
    pub note: Option<String>,
}

impl<'a> Earlier<'a> {
    /// Earlier calibration, and the IMUs of the recording.
    pub fn new(imus: &'a [Findings], recorded: impl IntoIterator<Item = &'a Findings>) -> Self {
        Self::among(imus, recorded.into_iter().map(|imu| (imu.name.as_str(), imu.topic.as_str())))
    }

    /// The same by the names and topics of the recording's IMUs.
    pub fn among(imus: &'a [Findings], recorded: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        Self { imus, recorded: recorded.into_iter().collect() }
    }

    /// Its IMU of this name, or else the only one on this topic. Only where both sides have a single IMU, names do not
    /// matter. Several merged sensors may share a name, and none of them says which this one is.
    ///
    /// # Errors
    ///
    /// If none is this one, or none says so: the reason, and what to do.
    pub fn of(&self, name: &str, topic: &str) -> Result<Counterpart<'a>, String> {
        let as_it_is = |findings| Counterpart { findings, note: None };
        let mut alike = self.imus.iter().filter(|then| then.name == name || then.key.as_deref() == Some(name));
        if let Some(named) = alike.next() {
            return if alike.next().is_none() { Ok(as_it_is(named)) } else { Err(self.namesakes(name)) };
        }
        // Several on one topic have frames of their own, which are in their names.
        let is_alone = self.recorded.iter().filter(|(_, recorded)| *recorded == topic).count() <= 1;
        let on_topic: Vec<_> = self.imus.iter().filter(|then| !then.topic.is_empty() && then.topic == topic).collect();
        if let ([only], true) = (on_topic.as_slice(), is_alone) {
            return Ok(as_it_is(only));
        }
        match self.imus {
            [only] if self.recorded.len() <= 1 => Ok(Counterpart { findings: only, note: other_name(only, name) }),
            [only] if only.name.is_empty() => Err(format!(
                "the earlier calibration does not say which of the {} IMUs it is of: stillpoint import FILE --topic {name} says so",
                self.recorded.len()
            )),
            [only] => Err(format!("the earlier calibration is of {}, not of {name}", only.name)),
            several => {
                let names: Vec<_> =
                    several.iter().map(|imu| imu.name.as_str()).filter(|name| !name.is_empty()).collect();
                let named = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
                Err(format!("the earlier calibration holds {} IMUs{named}, none is called {name}", several.len()))
            }
        }
    }
}

impl Earlier<'_> {
    /// Refusal where several sensors go by one name.
    fn namesakes(&self, name: &str) -> String {
        /// Most that are named.
        const NAMED: usize = 8;
        let alike: Vec<_> = self.imus.iter().filter(|then| then.name == name).collect();
        let keys: Vec<_> = alike.iter().filter_map(|then| then.key.as_deref()).take(NAMED).collect();
        let more = if alike.len() > keys.len() { ", …" } else { "" };
        format!(
            "the earlier calibration holds {} sensors called {name} ({}{more}), and the recording does not say which of them it is \
             of: stillpoint merge --imu KEY --format json writes one alone",
            alike.len(),
            keys.join(", ")
        )
    }
}

/// Note where the only IMU of an earlier calibration stands for the only one of a recording.
fn other_name(then: &Findings, now: &str) -> Option<String> {
    Some(match then.name.as_str() {
        "" => format!(
            "the earlier calibration does not say which IMU it is of: taken for that of {now}, the only one here"
        ),
        name => format!("the earlier calibration is of {name}, its only IMU: compared with {now}, the only one here"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn imus(names: &[(&str, &str)]) -> Vec<Findings> {
        names.iter().map(|(name, topic)| Findings::new(name, topic)).collect()
    }

    #[test]
    fn an_imu_is_compared_with_itself_and_never_with_another() {
        let of = |earlier: &[(&str, &str)], recorded: &[(&str, &str)], (name, topic): (&str, &str)| {
            let (earlier, recorded) = (imus(earlier), imus(recorded));
            let found = Earlier::new(&earlier, &recorded).of(name, topic);
            found.map(|found| (found.findings.name.clone(), found.note.is_some()))
        };
        let (a, b, c) = (("/a", "/a"), ("/b", "/b"), ("/c", "/c"));
        for (earlier, recorded, now, expected) in [
            (&[a, b][..], &[b, a][..], b, "/b"),
            (&[a], &[a, b], a, "/a"),
            // By the topic, where the name has changed.
            (&[("/front", "/a"), b], &[a, b], a, "/front"),
        ] {
            assert_eq!(of(earlier, recorded, now), Ok((expected.to_owned(), false)));
        }
        for (earlier, recorded, now, says) in [
            (&[a][..], &[a, b][..], b, "is of /a, not of /b"),
            (&[("", "")], &[a, b], b, "does not say which of the 2 IMUs"),
            (&[a, b], &[c], c, "holds 2 IMUs (/a, /b), none is called /c"),
            // Two frames on one topic.
            (&[a], &[a, ("/a/tail", "/a")], ("/a/tail", "/a"), "is of /a, not of /a/tail"),
        ] {
            assert!(of(earlier, recorded, now).unwrap_err().contains(says), "{says}");
        }
        // Several sensors in turn on one topic.
        let fleet: Vec<_> =
            ["s1", "s2"].map(|key| Findings { key: Some(key.to_owned()), ..Findings::new("/a", "/a") }).into();
        let recorded = imus(&[a]);
        let found = Earlier::new(&fleet, &recorded).of("/a", "/a").map(|found| found.findings.key.clone());
        let said = found.unwrap_err();
        assert!(said.contains("2 sensors called /a (s1, s2)") && said.contains("merge --imu KEY"), "{said}");
        // The only ones are told of each other.
        for earlier in [[a], [("", "")]] {
            assert!(of(&earlier, &[c], c).unwrap().1, "{earlier:?}");
        }
    }
}
