//! Names and numbers for people.

use crate::messages::triad::Model;

/// Name of a measurement model, as in the configuration; `None` for no model.
pub fn model(model: Model) -> Option<&'static str> {
    Some(match model {
        Model::None => return None,
        Model::Bias => "bias",
        Model::BiasScale => "bias-scale",
        Model::Triangular => "triangular",
        Model::CrossAxis => "cross-axis",
        Model::Full => "full",
        Model::Turns => "turns",
    })
}

/// Model of that name.
pub(super) fn model_named(name: &str) -> Option<Model> {
    let all = [Model::Bias, Model::BiasScale, Model::Triangular, Model::CrossAxis, Model::Full, Model::Turns];
    all.into_iter().find(|&candidate| model(candidate) == Some(name))
}

/// Importance of a note for the use of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// Background: which richer models were refused, and what a number includes.
    Detail,
    /// Possible improvements.
    Hint,
    /// Reasons against the use of the calibration.
    Serious,
}

/// Weight of a note. An unknown one counts as serious until somebody reads it.
pub fn weight(note: &str) -> Weight {
    const DETAILS: [&str; 7] = [
        "no sensitivity from turns: ",
        "sensitivity from ",
        "worst_case_error allows for ",
        "no correction within its bars",
        "imported: ",
        "the bias is that at ",
        "the bias does not visibly depend on the temperature",
    ];
    const HINTS: [&str; 12] = [
        "gravity ",
        "with each face seen once",
        "with as many placements as unknowns",
        "without one of the turns",
        "the noise is below half a step",
        "the first rest reads ",
        "waits for ",
        "not seen at rest: ",
        "its bias is not known",
        "the rests so far are too short",
        "too few rests between ",
        "time explains the changes of the bias as well",
    ];
    /// These begin with numbers.
    const SHORT_RANGE: &str = " °C are too little of a range to tell how the bias depends on the temperature";
    const COUNTED: [&str; 3] =
        [" without use: ", " rests have no temperature, so ", " from recording to recording: followed to "];
    let refused = note.split_once(" is not determined: ").is_some_and(|(name, _)| model_named(name).is_some());
    match note {
        _ if refused || DETAILS.iter().any(|begin| note.starts_with(begin)) => Weight::Detail,
        _ if note.contains(SHORT_RANGE) => Weight::Detail,
        _ if HINTS.iter().any(|begin| note.starts_with(begin)) => Weight::Hint,
        _ if COUNTED.iter().any(|words| note.contains(words)) => Weight::Hint,
        // Bad rests were left out, good ones remain.
        _ if note.ends_with("to confirm its bias") || note.ends_with("left out") => Weight::Hint,
        _ => Weight::Serious,
    }
}

/// `value ± deviation` with the decimals of the deviation's (or an interval half's) first two digits.
pub fn estimate(value: f64, std: f64) -> String {
    let decimals = match std {
        std if std.is_finite() && std > 0.0 => (1.0 - std.log10().floor()).clamp(0.0, 9.0) as usize,
        _ => 5,
    };
    format!("{value:.decimals$} ± {std:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::temperature::Unclear;

    #[test]
    fn an_estimate_has_the_digits_that_its_deviation_allows() {
        assert_eq!(estimate(0.535_04, 0.005_9), "0.5350 ± 0.0059");
        assert_eq!(estimate(-7.946, 0.012), "-7.946 ± 0.012");
        assert_eq!(estimate(12.0, 34.0), "12 ± 34");
    }

    #[test]
    fn what_is_not_known_to_be_harmless_is_serious() {
        for (note, expected) in [
            ("triangular is not determined: 9 placements in spread directions are needed, 4 seen", Weight::Detail),
            ("no sensitivity from turns: more turns, about all axes", Weight::Detail),
            ("gravity 9.80665 ± 0.0400 m/s², assumed: set fit.gravity", Weight::Hint),
            ("turn 3 contradicts the others by 4.0°: left out", Weight::Hint),
            (
                "the gyroscope's z axis is flipped: gravity turns between rests against what the rates say",
                Weight::Serious,
            ),
            ("the moon is not determined: ask somebody", Weight::Serious),
            ("something new", Weight::Serious),
        ] {
            assert_eq!(weight(note), expected, "{note}");
        }
    }

    #[test]
    fn a_temperature_that_tells_nothing_is_no_reason_against_a_calibration() {
        let range = [20.0, 22.0];
        for (why, expected) in [
            (Unclear::Span { range }, Weight::Detail),
            (Unclear::Steady { range }, Weight::Detail),
            (Unclear::Few { range }, Weight::Hint),
            (Unclear::Gaps { without: 1, of: 9 }, Weight::Hint),
            (Unclear::Time { range }, Weight::Hint),
        ] {
            assert_eq!(weight(&why.to_string()), expected, "{why}");
        }
        assert_eq!(weight("3 turns without use: it lasted more than 20 s"), Weight::Hint);
    }

    #[test]
    fn a_model_is_found_by_its_name() {
        for name in ["bias", "bias-scale", "triangular", "cross-axis", "full"] {
            assert_eq!(model_named(name).and_then(model), Some(name));
        }
        assert_eq!(model_named("none"), None);
    }
}
