//! Names and numbers as people read them.

use crate::messages::triad::Model;

/// The name of a measurement model, as in the configuration; `None` where there is none.
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

/// The model of that name.
pub(super) fn model_named(name: &str) -> Option<Model> {
    let all = [Model::Bias, Model::BiasScale, Model::Triangular, Model::CrossAxis, Model::Full, Model::Turns];
    all.into_iter().find(|&candidate| model(candidate) == Some(name))
}

/// `value ± deviation` with as many decimals as the deviation, or an interval's half, gives meaning: two of its digits.
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

    #[test]
    fn an_estimate_has_the_digits_that_its_deviation_allows() {
        assert_eq!(estimate(0.535_04, 0.005_9), "0.5350 ± 0.0059");
        assert_eq!(estimate(-7.946, 0.012), "-7.946 ± 0.012");
        assert_eq!(estimate(12.0, 34.0), "12 ± 34");
    }

    #[test]
    fn a_model_is_found_by_its_name() {
        for name in ["bias", "bias-scale", "triangular", "cross-axis", "full"] {
            assert_eq!(model_named(name).and_then(model), Some(name));
        }
        assert_eq!(model_named("none"), None);
    }
}
