//! Parts of a calibration that a format may not be able to hold, and the next step then.

use crate::messages::Triad;

/// Advice for a model that the format cannot hold.
pub(super) const LEANER: &str = "calibrate the recording anew (stillpoint annotate RECORDING --set fit.model=bias-scale), or \
    use --format json, kalibr or imu-calib";

/// Name of the change of a bias with temperature.
pub(super) const BY_TEMPERATURE: &str = "change of bias with temperature";

/// Next step where a format cannot hold what a triad has beyond bias and S.
pub(super) fn instead(what: &str) -> &'static str {
    match what {
        BY_TEMPERATURE => {
            "calibrate the recording anew for one bias of all temperatures (stillpoint annotate RECORDING --set \
             fit.temperature=off), or use --format json, yaml, px4 or ardupilot"
        }
        _ => "use --format json or yaml",
    }
}

/// Names of what a triad has beyond bias and S: formats that cannot hold it refuse it.
pub(super) fn beyond(triad: &Triad) -> impl Iterator<Item = &'static str> {
    let said = |values: &[f64]| values.iter().any(|&value| value != 0.0);
    let named = [
        ("g-sensitivity", said(&triad.g_sensitivity)),
        ("g²-sensitivity", said(&triad.g2_sensitivity)),
        ("sensitivity to rotation", said(&triad.rate_sensitivity)),
        (BY_TEMPERATURE, triad.temperature.as_ref().is_some_and(|model| said(&model.coefficients))),
    ];
    named.into_iter().filter_map(|(name, is_said)| is_said.then_some(name))
}
