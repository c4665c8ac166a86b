//! From the remembered rests to what they determine of each triad. How one model of the primary accelerometer is tried is
//! left to `attempt`, how rests become observations to `observe`.

use nalgebra::Vector3;

use super::Config;
use super::attempt::{self, Attempt, Trial};
use super::book::{Entry, Verdict};
use super::drift::Drift;
use super::judge::{Judge, Poses};
use super::observe::{self, Placed};
use super::preset::secondary_bounds;
use super::reference::Reference;
use super::suspicion::Suspicion;
use super::words;
use crate::fit::{
    self, Calibration, Estimate, Gravity, Model, Place, Reading, Shape, Source, directions, guess, gyroscope, secondary,
};
use crate::imu::SecondaryModel;

/// A slow turn may pass for a rest until a quieter one is seen: so many times the least rest that is fitted must have been
/// seen before a gyroscope's bias is believed.
const LEAST_RESTS: f64 = 3.0;

/// What the rests determine.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) gravity: Gravity,
    /// Or why not.
    pub(super) accelerometer: Result<Estimate, String>,
    /// Richer models than that of the accelerometer, and why each is none.
    pub(super) refused: Vec<(Shape, String)>,
    pub(super) gyroscope: Option<Estimate>,
    pub(super) secondary: Vec<Result<Estimate, String>>,
    /// Accepted placements, all faces together.
    pub(super) placements: usize,
    /// Those that repeat what others say and so may contradict.
    pub(super) repeats: usize,
    /// The accelerometer's quantisation step, if it is so coarse beside the noise that rounding biases the means, m/s².
    pub(super) coarse_step: Option<f64>,
    /// Of the gyroscope's bias.
    pub(super) gyro_placements: usize,
    /// Mean rates at the ends of a rest in which the gyroscope went to zero, rad/s, if there was one.
    pub(super) gyro_relaxed: Option<(f64, f64)>,
    /// The accelerometer's calibration as it was guessed before anything was fitted.
    pub(super) guessed: Calibration,
    /// What speaks against the readings.
    pub(super) suspicions: Vec<Suspicion>,
    /// What contradicts itself and cannot be decided, in words.
    pub(super) doubts: Vec<String>,
    pub(super) drift: Option<Drift>,
    /// What would determine the accelerometer if it is not.
    pub(super) missing: Missing,
}

/// What a model of the accelerometer needs more of.
#[derive(Clone, Debug)]
pub(super) enum Missing {
    /// The faces of the fixture.
    Faces,
    /// Any directions; the one furthest from those seen, by name.
    Direction(String),
    /// Motion beside the reference.
    Motion,
}

/// The gravity to fit with.
pub(super) fn gravity(config: &fit::Config, fix: Option<Place>) -> Gravity {
    match (config.gravity, config.place(), fix) {
        (Some(value), place, fix) => Gravity { place: place.or(fix), ..Gravity::configured(value) },
        (None, Some(place), _) => Gravity::at(&place, Source::Latitude),
        (None, None, Some(place)) => Gravity::at(&place, Source::FixTopic),
        (None, None, None) => Gravity::standard(),
    }
}

/// What is known beside the rests.
pub(super) struct Known<'a> {
    pub(super) gravity: Gravity,
    /// The accelerometer's quantisation step, m/s².
    pub(super) step: Option<f64>,
    /// The model that was published last.
    pub(super) kept: Option<Shape>,
    pub(super) reference: Option<&'a Reference>,
}

/// Judges every rest anew and fits what the good ones, or a reference, determine.
pub(super) fn solve(entries: &mut [Entry], judge: &Judge<'_>, config: &Config, known: &Known<'_>) -> Solution {
    judge.sort_out(entries);
    let faultless = entries.iter().filter(|entry| entry.verdict.is_accepted());
    let means: Vec<_> = faultless.map(|entry| entry.rest.accelerometer.mean).collect();
    let start = guess(means.iter(), judge.gravity);
    let verdicts: Vec<Verdict> = entries.iter().map(|entry| entry.verdict.clone()).collect();

    let mut refused = Vec::new();
    let mut attempt = Attempt::new(Poses::OnFaces);
    for &shape in candidates(config.fit.model, known.reference.is_some()) {
        entries.iter_mut().zip(&verdicts).for_each(|(entry, verdict)| entry.verdict = verdict.clone());
        attempt = match known.reference {
            Some(reference) if beside_reference(shape) => {
                attempt::on_reference(entries, judge, &Trial { shape, known }, reference, start)
            }
            _ => attempt::on_rests(entries, judge, &Trial { shape, known }, start),
        };
        match &attempt.fit {
            Ok(_) => break,
            Err(why) => refused.push((shape, why.clone())),
        }
    }
    if attempt.fit.is_err() {
        refused.pop();
    }
    Solution { guessed: start, ..others(entries, judge, config, known, refused, attempt) }
}

/// Models to try, the richest first.
fn candidates(model: Model, reference: bool) -> &'static [Shape] {
    match model {
        Model::Full => &[Shape::FULL_ACCELEROMETER],
        Model::Auto if reference => &[Shape::FULL_ACCELEROMETER, Shape::TRIANGULAR, Shape::DIAGONAL],
        Model::Auto => &[Shape::TRIANGULAR, Shape::DIAGONAL],
        Model::BiasScale => &[Shape::DIAGONAL],
        Model::Triangular => &[Shape::TRIANGULAR],
        Model::CrossAxis => &[Shape::MATRIX],
    }
}

/// Whether a model of the accelerometer is fitted on a reference where there is one.
fn beside_reference(shape: Shape) -> bool {
    shape == Shape::FULL_ACCELEROMETER || shape == Shape::MATRIX
}

/// Of one axis, what is √(Σ variance) of three.
pub(super) fn per_axis(floor: f64) -> f64 {
    floor / 3_f64.sqrt()
}

/// Fits the other triads that the rests determine, beside an attempt at the primary accelerometer.
fn others(
    entries: &[Entry],
    judge: &Judge<'_>,
    Config { fit: config, secondary, still, .. }: &Config,
    known: &Known<'_>,
    refused: Vec<(Shape, String)>,
    Attempt { fit: accelerometer, seen, ups, poses, doubts, drift }: Attempt,
) -> Solution {
    let primary = accelerometer.as_ref().ok();
    let secondary = secondary.iter().enumerate().map(|(i, secondary)| {
        let mut bounds = config.bounds.clone();
        let mut placement_std = config.placement_std;
        if let Some(preset) = secondary.preset {
            bounds = secondary_bounds(bounds, preset);
            placement_std = preset.datasheet().accelerometer.placement.unwrap_or(placement_std);
        }
        fit_secondary(entries, (i, secondary.model), &fit::Config { bounds, placement_std, ..config.clone() }, primary)
    });
    let secondary = secondary.collect();
    let calibration = primary.map(Estimate::calibration);
    let noise = observe::gyroscope_noise(judge.segmenter);
    let mut rates = observe::rates(entries, noise, config, calibration.as_ref());
    if let Some(place) = known.gravity.place {
        rates.iter_mut().for_each(|reading| turn_with_the_earth(reading, &place));
    }
    let at_rest = entries.iter().filter(|entry| observe::tells_of_rates(entry, noise));
    let believed = at_rest.map(|entry| entry.seconds).sum::<f64>() >= LEAST_RESTS * still.min_fit_s;
    let gyroscope = |shape| gyroscope::fit(shape, &rates, config.rate_std, &config.bounds, config.loss);
    let floor = judge.segmenter.status().gyro_floor.map(per_axis);
    let rich = match (primary.map(|fit| fit.shape), known.reference) {
        (Some(Shape::FULL_ACCELEROMETER), Some(reference)) => {
            reference.gyroscope(Shape::FULL_GYROSCOPE, config, floor).ok()
        }
        (Some(Shape::MATRIX), Some(reference)) => reference.gyroscope(Shape::GYROSCOPE_AT_REST, config, floor).ok(),
        (Some(Shape::MATRIX), None) => gyroscope(Shape::GYROSCOPE_AT_REST).ok(),
        _ => None,
    };
    Solution {
        gravity: known.gravity,
        placements: seen.len(),
        missing: match poses {
            _ if config.model == Model::Full => Missing::Motion,
            Poses::Any => Missing::Direction(unseen(&ups)),
            Poses::OnFaces => Missing::Faces,
        },
        repeats: primary.map_or(0, |_| repeats(&seen, &ups, poses)),
        coarse_step: known.step.filter(|&step| observe::is_coarse(entries, step)),
        accelerometer,
        refused,
        doubts: doubts.into_iter().map(|doubt| doubt.text).collect(),
        drift,
        gyro_placements: rates.len(),
        gyro_relaxed: entries
            .iter()
            .filter(|entry| entry.verdict.is_at_rest())
            .find_map(|entry| observe::relaxed(entry, noise)),
        gyroscope: rich.or_else(|| gyroscope(Shape::BIAS).ok().filter(|_| believed)),
        secondary,
        guessed: Calibration::default(),
        suspicions: Vec::new(),
    }
}

/// At rest a gyroscope turns with the Earth. About the vertical, that is; where north is, nobody knows.
fn turn_with_the_earth(reading: &mut Reading, place: &Place) {
    if let Some(up) = reading.truth.other.try_normalize(f64::MIN_POSITIVE) {
        reading.truth.own = up * place.vertical_rate();
    }
}

/// The face, edge or corner of a cube that is furthest from every direction seen, by the axes between which it lies.
fn unseen(ups: &[Vector3<f64>]) -> String {
    let nearness = |direction: &Vector3<f64>| ups.iter().map(|up| up.dot(direction)).fold(-1.0, f64::max);
    let furthest = directions().min_by(|a, b| nearness(a).total_cmp(&nearness(b))).unwrap_or_default();
    let axes = ["X", "Y", "Z"].into_iter().zip(&furthest).filter(|(_, part)| **part != 0.0);
    let axes: Vec<_> = axes.map(|(axis, part)| format!("{}{axis}", if *part > 0.0 { "+" } else { "-" })).collect();
    match axes.as_slice() {
        [axis] => axis.clone(),
        axes => format!("the direction between {}", axes.join(" and ")),
    }
}

/// Placements beyond those that the model needs. No more than three in one direction count, since a bump of the table is
/// easily taken for a placement.
fn repeats(seen: &[Placed], ups: &[Vector3<f64>], poses: Poses) -> usize {
    const MOST: usize = 3;
    /// Cosine of 15°.
    const SAME: f64 = 0.966;
    let mut directions: Vec<(Vector3<f64>, usize)> = Vec::new();
    for (placed, up) in seen.iter().zip(ups) {
        let up = if poses == Poses::OnFaces { placed.observation.normal } else { *up };
        match directions.iter_mut().find(|(known, _)| known.dot(&up) > SAME) {
            Some((_, count)) => *count += 1,
            None => directions.push((up, 1)),
        }
    }
    let counted: usize = directions.iter().map(|(_, count)| (*count).min(MOST)).sum();
    let needed = if poses == Poses::OnFaces { directions.len() } else { Shape::TRIANGULAR.unknowns() };
    counted.saturating_sub(needed)
}

fn fit_secondary(
    entries: &[Entry],
    (index, model): (usize, SecondaryModel),
    config: &fit::Config,
    primary: Option<&Estimate>,
) -> Result<Estimate, String> {
    let primary = primary.ok_or("waits for the calibration of the primary accelerometer")?;
    let pairs = observe::pairs(entries, config, index);
    if pairs.is_empty() {
        return Err("was silent during every rest: check its topic and its time stamps".to_owned());
    }
    let fit = |shape| secondary::fit(shape, &pairs, primary, config.placement_std, &config.bounds, config.loss);
    let shape = match model {
        SecondaryModel::BiasScale => Shape::DIAGONAL,
        SecondaryModel::CrossAxis => Shape::MATRIX,
    };
    let fit = (fit(shape).map_err(|error| error.to_string())?, fit);
    let (fit, with) = fit;
    if !fit.agrees() {
        return Err(format!(
            "does not follow the primary accelerometer: the residuals have an rms of {:.3} m/s², more than {:.3}. {}{}",
            fit.residual_rms,
            fit.residual_limit,
            match shape == Shape::DIAGONAL && with(Shape::MATRIX).is_ok_and(|other| other.agrees()) {
                true => "It is turned beside it, or its axes are skewed: set its model = \"cross-axis\"",
                false => "Check its axes, unit and time stamps",
            },
            words::also(&words::active_bounds(&fit))
        ));
    }
    Ok(fit)
}
