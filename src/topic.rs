//! Grammar of annotation topics: `IMU/stillpoint/KIND`, and `/stillpoint/log` for all of a recording.

/// Mark in a topic name that distinguishes annotations from sources.
pub const MARK: &str = "/stillpoint/";

/// Kind of annotation on a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// State of the IMU: at rest or moving.
    Stillness,
    /// Its rests.
    Segment,
    /// The turns between its rests.
    Turn,
    /// Its noise densities.
    Noise,
    /// The faces that were seen.
    Coverage,
    /// Its calibrations.
    Calibration,
    /// Its own messages, corrected.
    Corrected,
    /// Warnings and decisions, of all IMUs.
    Log,
}

impl Kind {
    const ALL: [Self; 8] = [
        Self::Stillness,
        Self::Segment,
        Self::Turn,
        Self::Noise,
        Self::Coverage,
        Self::Calibration,
        Self::Corrected,
        Self::Log,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Stillness => "stillness",
            Self::Segment => "segment",
            Self::Turn => "turn",
            Self::Noise => "noise",
            Self::Coverage => "coverage",
            Self::Calibration => "calibration",
            Self::Corrected => "corrected",
            Self::Log => "log",
        }
    }
}

/// Topic of this kind for the IMU of that output name. All IMUs share the log.
pub fn of(imu: &str, kind: Kind) -> String {
    let imu = if kind == Kind::Log { "" } else { imu };
    format!("{imu}{MARK}{}", kind.name())
}

/// Output name of the IMU that an annotation topic belongs to, empty for the log; `None` for a source.
pub fn imu_of(topic: &str) -> Option<&str> {
    topic.split_once(MARK).map(|(imu, _)| imu)
}

/// Output name of the IMU whose corrected messages a topic holds.
pub fn corrected_imu(topic: &str) -> Option<&str> {
    topic.strip_suffix(Kind::Corrected.name())?.strip_suffix(MARK)
}

/// Kind of the annotations on a topic; `None` if it is not one that Stillpoint writes.
pub fn kind_of(topic: &str) -> Option<Kind> {
    let (imu, name) = topic.rsplit_once(MARK)?;
    Kind::ALL.into_iter().find(|kind| kind.name() == name && (*kind == Kind::Log) == imu.is_empty())
}

/// Whether a topic holds annotations, and so is never a source.
pub fn is_annotation(topic: &str) -> bool {
    topic.contains(MARK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_tells_whose_it_is() {
        for kind in Kind::ALL.into_iter().filter(|kind| *kind != Kind::Log) {
            let topic = of("/imu/data", kind);
            assert!(is_annotation(&topic) && imu_of(&topic) == Some("/imu/data"), "{topic}");
            assert_eq!(corrected_imu(&topic).is_some(), kind == Kind::Corrected);
            assert_eq!(kind_of(&topic), Some(kind));
        }
        assert_eq!(of("/imu/data", Kind::Log), of("", Kind::Log));
        assert_eq!(imu_of(&of("", Kind::Log)), Some(""));
        assert_eq!(kind_of(&of("", Kind::Log)), Some(Kind::Log));
        for other in ["/imu/stillpoint/log", "/stillpoint/segment", "/imu/stillpoint/other", "/imu/segment"] {
            assert_eq!(kind_of(other), None, "{other}");
        }
        assert!(!is_annotation("/stillpoint") && imu_of("/imu/data").is_none());
    }
}
