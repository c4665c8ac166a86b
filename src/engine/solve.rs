//! From the judged rests to what they determine of each triad.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::Config;
use super::book::Entry;
use super::words;
use crate::fit::accelerometer::Assumptions;
use crate::fit::{
    self, Bounds, Estimate, Fixture, Gravity, Place, Reading, Shape, Source, Truth, accelerometer, gyroscope, secondary,
};
use crate::still::TriadMean;

/// What the rests determine.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) gravity: Gravity,
    /// Or why not.
    pub(super) accelerometer: Result<Estimate, String>,
    pub(super) gyroscope: Option<Estimate>,
    pub(super) secondary: Vec<Result<Estimate, String>>,
    /// Accepted placements, all faces together.
    pub(super) placements: usize,
    /// Those that repeat a face and so may contradict: no more than two a face count, since a bump of the table is easily
    /// taken for a placement.
    pub(super) repeats: usize,
    /// The accelerometer's quantisation step, if it is so coarse beside the noise that rounding biases the means, m/s².
    pub(super) coarse_step: Option<f64>,
    /// Of the gyroscope's bias.
    pub(super) gyro_placements: usize,
}

/// The gravity to fit with.
pub(super) fn gravity(config: &fit::Config, fix: Option<Place>) -> Gravity {
    match (config.gravity, config.place(), fix) {
        (Some(value), _, _) => Gravity::configured(value),
        (None, Some(place), _) => Gravity::at(&place, Source::Latitude),
        (None, None, Some(place)) => Gravity::at(&place, Source::FixTopic),
        (None, None, None) => Gravity::standard(),
    }
}

/// Fits the primary accelerometer, or says why not.
pub(super) fn accelerometer(
    entries: &[Entry],
    config: &fit::Config,
    fixture: &Fixture,
    gravity: Gravity,
    step: Option<f64>,
) -> Result<Estimate, String> {
    fit_accelerometer(&placements_on_faces(entries, fixture, step), config, fixture, gravity)
}

/// Fits the other triads that the rests determine, beside a fit of the primary accelerometer.
pub(super) fn others(
    entries: &[Entry],
    Config { fit: config, secondary, .. }: &Config,
    fixture: &Fixture,
    gravity: Gravity,
    step: Option<f64>,
    accelerometer: Result<Estimate, String>,
) -> Solution {
    let primary = accelerometer.as_ref().ok();
    let secondary = secondary.iter().enumerate().map(|(i, secondary)| {
        let mut bounds = config.bounds.clone();
        if let Some(preset) = secondary.preset {
            (bounds.secondary_bias, bounds.secondary_scale) = (preset.bias(), preset.scale());
        }
        fit_secondary(entries, i, config.placement_std, &bounds, primary)
    });
    let secondary = secondary.collect();
    let rates = rates(entries);
    let seen = placements_on_faces(entries, fixture, step);
    let used = entries.iter().filter(|entry| entry.verdict.is_accepted());
    let rounded = used.map(|entry| rounding(&entry.rest.accelerometer, step)).any(|variance| variance.max() > 0.0);
    let on_face = |i: usize| seen.iter().filter(|(face, _)| *face == i).count();
    let repeats = (0..fixture.faces().len()).map(|i| on_face(i).saturating_sub(1).min(2)).sum();
    Solution {
        gravity,
        placements: seen.len(),
        repeats,
        coarse_step: step.filter(|_| rounded),
        accelerometer,
        gyro_placements: rates.len(),
        gyroscope: gyroscope::fit(Shape::BIAS, &rates, config.rate_std, &config.bounds).ok(),
        secondary,
    }
}

/// The accepted rests, those of one placement on one face as one observation.
fn placements_on_faces(
    entries: &[Entry],
    fixture: &Fixture,
    step: Option<f64>,
) -> Vec<(usize, accelerometer::Observation)> {
    let mut groups: BTreeMap<(u32, usize), Vec<&TriadMean>> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_accepted()) {
        if let Some((face, _)) = entry.verdict.face {
            groups.entry((entry.rest.placement, face)).or_default().push(&entry.rest.accelerometer);
        }
    }
    groups
        .into_iter()
        .filter_map(|((_, face), means)| {
            let normal = fixture.faces().get(face)?.normal;
            let (mean, noise) = pooled(&means);
            // However long a rest, what rounding does to its mean stays.
            let noise = noise + rounding(means.first()?, step);
            Some((face, accelerometer::Observation { mean, noise, normal }))
        })
        .collect()
}

fn fit_accelerometer(
    seen: &[(usize, accelerometer::Observation)],
    config: &fit::Config,
    fixture: &Fixture,
    gravity: Gravity,
) -> Result<Estimate, String> {
    let missing: Vec<_> = fixture
        .faces()
        .iter()
        .enumerate()
        .filter(|(i, _)| seen.iter().all(|(face, _)| face != i))
        .map(|(_, face)| face.name.as_str())
        .collect();
    if !missing.is_empty() {
        return Err(format!("not seen at rest: {}", missing.join(", ")));
    }
    let observations: Vec<_> = seen.iter().map(|(_, observation)| *observation).collect();
    let given = Assumptions {
        shape: Shape::DIAGONAL,
        estimator: config.estimator,
        gravity,
        placement_std: config.placement_std,
        bounds: &config.bounds,
    };
    let fit = accelerometer::fit(&observations, &given).map_err(|error| error.to_string())?;
    if !fit.agrees() {
        return Err(format!(
            "the rests contradict each other: ‖a‖ − g has an rms of {:.3} m/s², more than {:.3}{}",
            fit.residual_rms,
            fit.residual_limit,
            words::also(&words::active_bounds(&fit))
        ));
    }
    Ok(fit)
}

fn fit_secondary(
    entries: &[Entry],
    index: usize,
    assumed_std: f64,
    bounds: &Bounds,
    primary: Option<&Estimate>,
) -> Result<Estimate, String> {
    let primary = primary.ok_or("waits for the calibration of the primary accelerometer")?;
    let mut groups: BTreeMap<u32, (Vec<&TriadMean>, Vec<&TriadMean>)> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_at_rest()) {
        let second = entry.rest.secondary.get(index).and_then(Option::as_ref);
        if let Some(second) = second.filter(|mean| mean.clipped == 0) {
            let (primary, secondary) = groups.entry(entry.rest.placement).or_default();
            primary.push(&entry.rest.accelerometer);
            secondary.push(second);
        }
    }
    let pairs: Vec<_> = groups
        .into_values()
        .map(|(first, second)| {
            let ((primary, primary_noise), (secondary, secondary_noise)) = (pooled(&first), pooled(&second));
            secondary::Pair { primary, secondary, primary_noise, secondary_noise }
        })
        .collect();
    if pairs.is_empty() {
        return Err("was silent during every rest: check its topic and its time stamps".to_owned());
    }
    let fit =
        secondary::fit(Shape::DIAGONAL, &pairs, primary, assumed_std, bounds).map_err(|error| error.to_string())?;
    let held_back = words::active_bounds(&fit);
    if !fit.agrees() {
        return Err(format!(
            "does not follow the primary accelerometer: the residuals have an rms of {:.3} m/s², more than {:.3}. Check its \
             axes, unit and time stamps{}",
            fit.residual_rms,
            fit.residual_limit,
            words::also(&held_back)
        ));
    }
    Ok(fit)
}

/// What the gyroscope read during each placement that is no turn.
fn rates(entries: &[Entry]) -> Vec<Reading> {
    let mut groups: BTreeMap<u32, Vec<&TriadMean>> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_at_rest()) {
        if let Some(gyroscope) = &entry.rest.gyroscope {
            groups.entry(entry.rest.placement).or_default().push(gyroscope);
        }
    }
    groups
        .into_values()
        .map(|means| {
            let (mean, noise) = pooled(&means);
            Reading { mean, noise, truth: Truth::default(), truth_noise: Matrix3::zeros() }
        })
        .collect()
}

/// Variance that rounding to a step leaves in a mean, per axis: that of a uniform error where the noise is too small to
/// average it out (below half a step), else none.
fn rounding(mean: &TriadMean, step: Option<f64>) -> Vector3<f64> {
    let step = step.unwrap_or(0.0);
    mean.std().map(|std| if std < step / 2.0 { step * step / 12.0 } else { 0.0 })
}

/// Mean of several means of one placement, by their effective samples, and its noise variance.
fn pooled(means: &[&TriadMean]) -> (Vector3<f64>, Vector3<f64>) {
    let total: f64 = means.iter().map(|mean| mean.effective).sum();
    let share = |mean: &TriadMean| mean.effective / total.max(f64::MIN_POSITIVE);
    let mean = means.iter().map(|mean| mean.mean * share(mean)).sum();
    let noise = means.iter().map(|mean| mean.mean_variance() * share(mean) * share(mean)).sum();
    (mean, noise)
}
