//! What each message must read as in ROS 2, written down by hand.

use prost_types::Timestamp;
use stillpoint::engine::Message;
use stillpoint::messages::{
    AllanSums, AxisNoise, Calibration, Combination, Coverage, Face, Header, Noise, Octaves, Segment, Stillness,
    TemperatureModel, Triad, TriadMean, Turn, Vector3, foxglove,
};

use super::reader::Value;

pub fn expected(message: &Message) -> Value {
    match message {
        Message::Stillness(message) => stillness(message),
        Message::Segment(message) => segment(message),
        Message::Turn(message) => turn(message),
        Message::Noise(message) => noise(message),
        Message::Coverage(message) => coverage(message),
        Message::Calibration(message) => calibration(message),
        Message::Log(message) => log(message),
    }
}

fn stillness(m: &Stillness) -> Value {
    record([
        ("header", header(&m.header)),
        ("state", integer(m.state)),
        ("statistic", Value::Float(m.statistic)),
        ("enter", Value::Float(m.enter)),
        ("leave", Value::Float(m.leave)),
    ])
}

fn segment(m: &Segment) -> Value {
    record([
        ("header", header(&m.header)),
        ("start", time(m.start)),
        ("end", time(m.end)),
        ("accepted", Value::Bool(m.accepted)),
        ("face", text(&m.face)),
        ("tilt_deg", number(m.tilt_deg)),
        ("reason", integer(m.reason)),
        ("explanation", text(&m.explanation)),
        ("means", sequence(&m.means, triad_mean)),
        ("placement", integer(m.placement)),
        ("temperature", number(m.temperature)),
    ])
}

fn triad_mean(m: &TriadMean) -> Value {
    record([
        ("sensor", text(&m.sensor)),
        ("samples", integer(m.samples)),
        ("effective_samples", Value::Float(m.effective_samples)),
        ("mean", vector(m.mean)),
        ("covariance", numbers(&m.covariance)),
        ("std", vector(m.std)),
    ])
}

fn turn(m: &Turn) -> Value {
    record([
        ("header", header(&m.header)),
        ("start", time(m.start)),
        ("end", time(m.end)),
        ("angle", Value::Float(m.angle)),
        ("residual", number(m.residual)),
        ("used", Value::Bool(m.used)),
        ("reason", integer(m.reason)),
        ("explanation", text(&m.explanation)),
        ("axis", vector(m.axis)),
        ("path", Value::Float(m.path)),
        ("vertical", number(m.vertical)),
        ("declared", number(m.declared)),
        ("declared_residual", number(m.declared_residual)),
        ("before", integer(m.before)),
        ("after", integer(m.after)),
        ("seconds", Value::Float(m.seconds)),
        ("roughness", Value::Float(m.roughness)),
        ("integrals", numbers(&m.integrals)),
        ("declared_std", number(m.declared_std)),
    ])
}

fn noise(m: &Noise) -> Value {
    record([("header", header(&m.header)), ("triads", sequence(&m.triads, allan_sums))])
}

fn allan_sums(m: &AllanSums) -> Value {
    let octaves_or_absent = |sums: &Option<Octaves>| octaves(sums.as_ref());
    record([
        ("sensor", text(&m.sensor)),
        ("period", Value::Float(m.period)),
        ("all", octaves_or_absent(&m.all)),
        ("lasting", octaves_or_absent(&m.lasting)),
    ])
}

fn octaves(m: Option<&Octaves>) -> Value {
    let absent = Octaves { shortest: f64::NAN, ..Octaves::default() };
    let m = m.unwrap_or(&absent);
    record([
        ("samples", integer(m.samples)),
        ("rests", integer(m.rests)),
        ("shortest", Value::Float(m.shortest)),
        ("squares", numbers(&m.squares)),
        ("counts", sequence(&m.counts, |count| integer(*count))),
        ("white", numbers(&m.white)),
        ("wandering", numbers(&m.wandering)),
    ])
}

fn coverage(m: &Coverage) -> Value {
    record([
        ("header", header(&m.header)),
        ("faces", sequence(&m.faces, face)),
        ("complete", Value::Bool(m.complete)),
        ("next_step", text(&m.next_step)),
    ])
}

fn face(m: &Face) -> Value {
    record([
        ("name", text(&m.name)),
        ("normal", vector(m.normal)),
        ("placements", integer(m.placements)),
        ("seconds", Value::Float(m.seconds)),
    ])
}

fn calibration(m: &Calibration) -> Value {
    let triad_or_absent = |triad: &Option<Triad>| self::triad(&triad.clone().unwrap_or_default());
    record([
        ("header", header(&m.header)),
        ("revision", integer(m.revision)),
        ("accelerometer", triad_or_absent(&m.accelerometer)),
        ("gyroscope", triad_or_absent(&m.gyroscope)),
        ("secondary", sequence(&m.secondary, triad)),
        ("gravity", Value::Float(m.gravity)),
        ("gravity_source", text(&m.gravity_source)),
        ("segments", integer(m.segments)),
        ("placements", integer(m.placements)),
        ("begin", time(m.begin)),
        ("end", time(m.end)),
        ("temperature_min", number(m.temperature_min)),
        ("temperature_max", number(m.temperature_max)),
    ])
}

fn triad(m: &Triad) -> Value {
    record([
        ("sensor", text(&m.sensor)),
        ("topic", text(&m.topic)),
        ("model", integer(m.model)),
        ("status", integer(m.status)),
        ("bias", vector(m.bias)),
        ("scale", vector(m.scale)),
        ("sensitivity", numbers(&m.sensitivity)),
        ("bias_std", vector(m.bias_std)),
        ("scale_std", vector(m.scale_std)),
        ("sensitivity_std", numbers(&m.sensitivity_std)),
        ("g_sensitivity", numbers(&m.g_sensitivity)),
        ("g2_sensitivity", numbers(&m.g2_sensitivity)),
        ("rate_sensitivity", numbers(&m.rate_sensitivity)),
        ("residual_rms", number(m.residual_rms)),
        ("chi2_per_dof", number(m.chi2_per_dof)),
        ("worst_case_error", number(m.worst_case_error)),
        ("condition", number(m.condition)),
        ("covariance", numbers(&m.covariance)),
        ("notes", sequence(&m.notes, |note| text(note))),
        ("placement_std", numbers(&m.placement_std)),
        ("row_norms", vector(m.row_norms)),
        ("row_norms_std", vector(m.row_norms_std)),
        ("misalignment", numbers(&m.misalignment)),
        ("misalignment_std", numbers(&m.misalignment_std)),
        ("turns", integer(m.turns)),
        ("noise", sequence(&m.noise, axis_noise)),
        ("temperature", temperature_model(m.temperature.as_ref())),
        ("combinations", sequence(&m.combinations, combination)),
    ])
}

fn combination(m: &Combination) -> Value {
    record([
        ("coefficients", numbers(&m.coefficients)),
        ("value", Value::Float(m.value)),
        ("std", Value::Float(m.std)),
        ("explanation", text(&m.explanation)),
    ])
}

fn axis_noise(m: &AxisNoise) -> Value {
    record([
        ("density", Value::Float(m.density)),
        ("density_low", Value::Float(m.density_low)),
        ("density_high", Value::Float(m.density_high)),
        ("random_walk", number(m.random_walk)),
        ("random_walk_low", number(m.random_walk_low)),
        ("random_walk_high", number(m.random_walk_high)),
    ])
}

fn temperature_model(m: Option<&TemperatureModel>) -> Value {
    let nan = f64::NAN;
    let absent = TemperatureModel { reference: nan, minimum: nan, maximum: nan, ..TemperatureModel::default() };
    let m = m.unwrap_or(&absent);
    record([
        ("order", integer(m.order)),
        ("reference", Value::Float(m.reference)),
        ("minimum", Value::Float(m.minimum)),
        ("maximum", Value::Float(m.maximum)),
        ("coefficients", numbers(&m.coefficients)),
        ("coefficients_std", numbers(&m.coefficients_std)),
    ])
}

fn log(m: &foxglove::Log) -> Value {
    record([
        ("stamp", time(m.timestamp)),
        ("level", Value::Integer(i128::from(m.level) * 10)),
        ("name", text(&m.name)),
        ("msg", text(&m.message)),
        ("file", text(&m.file)),
        ("function", text("")),
        ("line", integer(m.line)),
    ])
}

fn header(header: &Option<Header>) -> Value {
    let header = header.clone().unwrap_or_default();
    record([("stamp", time(header.stamp)), ("frame_id", text(&header.frame_id))])
}

fn time(time: Option<Timestamp>) -> Value {
    let time = time.unwrap_or_default();
    record([("sec", Value::Integer(time.seconds.into())), ("nanosec", integer(time.nanos as u32))])
}

fn vector(vector: Option<Vector3>) -> Value {
    let Vector3 { x, y, z } = vector.unwrap_or(Vector3 { x: f64::NAN, y: f64::NAN, z: f64::NAN });
    record([("x", Value::Float(x)), ("y", Value::Float(y)), ("z", Value::Float(z))])
}

fn number(number: Option<f64>) -> Value {
    Value::Float(number.unwrap_or(f64::NAN))
}

fn numbers(numbers: &[f64]) -> Value {
    sequence(numbers, |number| Value::Float(*number))
}

fn sequence<T>(elements: &[T], value: impl Fn(&T) -> Value) -> Value {
    Value::Sequence(elements.iter().map(value).collect())
}

fn integer(number: impl Into<i128>) -> Value {
    Value::Integer(number.into())
}

fn text(text: &str) -> Value {
    Value::Text(text.to_owned())
}

fn record<const N: usize>(fields: [(&str, Value); N]) -> Value {
    Value::Message(fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
}
