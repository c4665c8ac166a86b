//! Suggested mapping of an unknown message: its vectors recognised by their names, and the configuration for them, as
//! lines and as a setting.

use serde::{Deserialize, Serialize};

use super::known_types::known;
use crate::imu::config::{AccelUnit, CovarianceUse, ImuConfig, RateUnit, SecondaryConfig, VectorConfig, VectorPath};
use crate::imu::schema::layout::Layout;
use crate::imu::schema::path::FieldPath;
use crate::{printable, printable_json};

/// Suggested use of a channel, judging by its names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Suggestion {
    /// An IMU.
    Imu(Box<ImuConfig>),
    /// An accelerometer, of an IMU or by itself.
    Accelerometer(Box<SecondaryConfig>),
}

impl Suggestion {
    /// Suggestion for a channel of an unknown type, judging by its names.
    pub(in crate::imu) fn of(topic: &str, layout: &Layout) -> Option<Self> {
        // Vectors in lists are several readings of a message, and so are lists in which axes follow each other.
        let named = Self::named(topic, &candidates(layout)).or_else(|| Self::named(topic, &listed_candidates(layout)));
        let named = named.or_else(|| Self::named(topic, &flat_candidates(layout)));
        named.or_else(|| Self::accelerometer(topic, layout))
    }

    /// IMU whose vectors are among these.
    fn named(topic: &str, candidates: &[(String, VectorPath)]) -> Option<Self> {
        let find = |is: fn(&str) -> bool| candidates.iter().find(|(name, _)| is(name));
        let gravity = find(|name| name == "gravity").and_then(|(_, path)| match path {
            VectorPath::Whole(gravity) => Some(gravity),
            VectorPath::Axes(_) => None,
        });
        // Where a phone removes gravity, its sum with the acceleration is the reading of the accelerometer.
        let is_part = |name: &str| is_without_gravity(name) || gravity.is_some() && is_linear(name);
        let mut accels = candidates.iter().filter(|(name, _)| is_accel(name));
        let accel = accels.clone().find(|(name, _)| !is_part(name));
        let accel = accel.or_else(|| accels.next().filter(|_| gravity.is_some()));
        if let Some((name, accel)) = accel {
            let unit = is_in_g(name).then_some(AccelUnit::StandardGravity);
            let gyro = find(is_gyro).map(|(name, path)| {
                let degrees = is_in_degrees(name) || is_of_browser(path);
                let unit = degrees.then_some(RateUnit::DegreesPerSecond);
                VectorConfig { path: Some(path.clone()), unit, ..VectorConfig::default() }
            });
            let plus = gravity.filter(|_| is_part(name)).cloned();
            // In g if the names are Apple's.
            let is_apple = plus.is_some() && name == "useracceleration";
            let unit = if is_apple { Some(AccelUnit::StandardGravity) } else { unit };
            let accel = Some(VectorConfig { path: Some(accel.clone()), plus, unit, ..VectorConfig::default() });
            let imu = ImuConfig { topic: topic.to_owned(), accel, gyro, ..ImuConfig::default() };
            return Some(Self::Imu(Box::new(imu)));
        }
        None
    }

    /// The only vector of a message whose topic names an accelerometer.
    fn accelerometer(topic: &str, layout: &Layout) -> Option<Self> {
        let [_] = layout.vectors().as_slice() else { return None };
        if !is_accel(&topic.to_lowercase()) {
            return None;
        }
        let name = topic.trim_matches('/').split('/').next().filter(|name| !name.is_empty())?;
        let accel = only_vector(layout);
        let secondary = SecondaryConfig {
            name: name.to_owned(),
            topic: Some(topic.to_owned()),
            accel,
            ..SecondaryConfig::default()
        };
        Some(Self::Accelerometer(Box::new(secondary)))
    }

    /// Only vector of a message.
    pub(in crate::imu) fn only_vector(layout: &Layout) -> Option<VectorPath> {
        match candidates(layout).as_slice() {
            [(_, path)] => Some(path.clone()),
            _ => None,
        }
    }

    /// IMU whose halves are the only vectors of topics of unknown types.
    pub(in crate::imu) fn of_vectors((accel, path): (&str, VectorPath), (gyro, of_gyro): (&str, VectorPath)) -> Self {
        let unit = is_of_browser(&of_gyro).then_some(RateUnit::DegreesPerSecond);
        let gyro = VectorConfig { topic: Some(gyro.to_owned()), path: Some(of_gyro), unit, ..VectorConfig::default() };
        let accel_config = VectorConfig { path: Some(path), ..VectorConfig::default() };
        Self::Imu(Box::new(ImuConfig {
            topic: accel.to_owned(),
            accel: Some(accel_config),
            gyro: Some(gyro),
            ..ImuConfig::default()
        }))
    }

    /// IMU whose halves are topics of known types.
    pub(in crate::imu) fn of_halves(accel: &str, gyro: &str) -> Self {
        let gyro = VectorConfig { topic: Some(gyro.to_owned()), ..VectorConfig::default() };
        Self::Imu(Box::new(ImuConfig { topic: accel.to_owned(), gyro: Some(gyro), ..ImuConfig::default() }))
    }

    /// Configuration, in a recording whose first IMU is on `primary`.
    pub fn config(&self, primary: Option<&str>) -> ImuConfig {
        match (self, primary) {
            (Self::Imu(imu), _) => (**imu).clone(),
            (Self::Accelerometer(secondary), Some(primary)) => {
                ImuConfig { topic: primary.to_owned(), secondary: vec![(**secondary).clone()], ..ImuConfig::default() }
            }
            (Self::Accelerometer(secondary), None) => ImuConfig {
                topic: secondary.topic.clone().unwrap_or_default(),
                accel: secondary.accel.clone(),
                ..ImuConfig::default()
            },
        }
    }
}

/// Path to a message's only vector, for a configuration; `None` if the type is known by name.
fn only_vector(layout: &Layout) -> Option<VectorConfig<AccelUnit>> {
    if !known(layout).is_empty() {
        return None;
    }
    let path = layout.vectors().into_iter().next()?;
    Some(VectorConfig { path: Some(VectorPath::Whole(path)), ..VectorConfig::default() })
}

impl ImuConfig {
    /// Table for a configuration file.
    pub fn lines(&self) -> String {
        let mut text = "[[imu]]\n".to_owned();
        self.entries().iter().for_each(|entry| text += &format!("{entry}\n"));
        for secondary in &self.secondary {
            text += "[[imu.secondary]]\n";
            secondary.entries().iter().for_each(|entry| text += &format!("{entry}\n"));
        }
        text
    }

    /// Setting on one line: `imu=[{topic = "…"}]`.
    pub fn setting(&self) -> String {
        let mut entries = self.entries();
        if !self.secondary.is_empty() {
            let secondary = self.secondary.iter().map(|s| format!("{{{}}}", s.entries().join(", ")));
            entries.push(format!("secondary = [{}]", secondary.collect::<Vec<_>>().join(", ")));
        }
        format!("imu=[{{{}}}]", entries.join(", "))
    }

    fn entries(&self) -> Vec<String> {
        let name = self.name.as_ref().map(|name| format!("name = {}", quoted(name)));
        let accel = self.accel.as_ref().map(|accel| format!("accel = {}", accel.inline(AccelUnit::name)));
        let gyro = self.gyro.as_ref().map(|gyro| format!("gyro = {}", gyro.inline(RateUnit::name)));
        let topic = format!("topic = {}", quoted(&self.topic));
        let covariance = self.covariance.map(|CovarianceUse::Ignore| "covariance = \"ignore\"".to_owned());
        [Some(topic), name, accel, gyro, covariance].into_iter().flatten().collect()
    }
}

impl SecondaryConfig {
    fn entries(&self) -> Vec<String> {
        let topic = self.topic.as_ref().map(|topic| format!("topic = {}", quoted(topic)));
        let accel = self.accel.as_ref().map(|accel| format!("accel = {}", accel.inline(AccelUnit::name)));
        [Some(format!("name = {}", quoted(&self.name))), topic, accel].into_iter().flatten().collect()
    }
}

impl<Unit: Copy> VectorConfig<Unit> {
    /// Inline value; `name` gives the names of units.
    fn inline(&self, name: fn(Unit) -> &'static str) -> String {
        let path = self.path.as_ref().map(|path| match path {
            VectorPath::Whole(path) => quoted(&path.to_string()),
            VectorPath::Axes(axes) => {
                let axes: Vec<_> = axes.iter().map(|path| quoted(&path.to_string())).collect();
                format!("[{}]", axes.join(", "))
            }
        });
        let unit = self.unit.map(|unit| format!("unit = {}", quoted(name(unit))));
        let plus = self.plus.as_ref().map(|path| format!("plus = {}", quoted(&path.to_string())));
        let axes = self.axes.map(|axes| {
            let names = <[String; 3]>::from(axes).map(|name| quoted(&name));
            format!("axes = [{}]", names.join(", "))
        });
        match (&self.topic, path, plus, unit, axes) {
            (None, Some(path), None, None, None) => path,
            (topic, path, plus, unit, axes) => {
                let topic = topic.as_ref().map(|topic| format!("topic = {}", quoted(topic)));
                let path = path.map(|path| format!("path = {path}"));
                let entries: Vec<_> = [topic, path, plus, unit, axes].into_iter().flatten().collect();
                format!("{{ {} }}", entries.join(", "))
            }
        }
    }
}

fn quoted(text: &str) -> String {
    match printable(text) == text {
        true => toml::Value::String(text.to_owned()).to_string(),
        // On one line: the escapes of JSON are valid in TOML, too.
        false => printable_json(&serde_json::Value::from(text).to_string()).into_owned(),
    }
}

/// Vectors, and triples of numbers that are named like axes, by the lowercase name that shows their meaning.
fn candidates(layout: &Layout) -> Vec<(String, VectorPath)> {
    of_paths(layout.vectors(), layout.triples())
}

/// Candidates in every element of a list.
fn listed_candidates(layout: &Layout) -> Vec<(String, VectorPath)> {
    of_paths(layout.listed_vectors(), layout.listed_triples())
}

/// Lists of numbers in which x, y and z follow each other, reading by reading.
fn flat_candidates(layout: &Layout) -> Vec<(String, VectorPath)> {
    let lists = layout.flat_lists().into_iter();
    lists.map(|(path, axes)| (path.name().to_lowercase(), VectorPath::Axes(axes))).collect()
}

/// Lists that could be readings and are not understood by their names, and what to do about them; `None` where neither
/// the topic nor a field is called after a sensor.
pub(in crate::imu) fn puzzle(topic: &str, layout: &Layout) -> Option<String> {
    let topic = topic.to_lowercase();
    let on_sensor = ["imu", "accel", "gyro"].iter().any(|word| topic.contains(word));
    let is_told = |path: &FieldPath| {
        let name = path.name().to_lowercase();
        is_accel(&name) || is_gyro(&name) || (on_sensor || name.contains("imu")) && !name.contains("cov")
    };
    let flat = layout.flat_lists().into_iter().find(|(path, _)| is_told(path));
    let ragged = || layout.unread_lists().into_iter().find(|(path, _)| is_told(path));
    let row = || layout.rows().into_iter().find(is_told);
    if let Some((path, [x, y, z])) = flat {
        return Some(format!(
            "`{path}` is a list of numbers: if x, y, z follow each other in it, map it with accel = [\"{x}\", \"{y}\", \"{z}\"]; with \
             six numbers a reading, with [0::6], [1::6] and so on; if it is one reading, with [0], [1] and so on"
        ));
    }
    if let Some(path) = row() {
        let [x, y, z] = [0, 1, 2].map(|axis| path.inner(axis));
        return Some(format!(
            "`{path}` are lists of numbers: map them by their columns, for example accel = [\"{x}\", \"{y}\", \"{z}\"]"
        ));
    }
    let (path, what) = ragged()?;
    Some(format!(
        "`{path}` is {what} that is not read: write each reading as an object of numbers, {{\"x\": …, \"y\": …, \"z\": …}}, or as a \
         list of three numbers, [x, y, z]"
    ))
}

fn of_paths(vectors: Vec<FieldPath>, triples: Vec<(String, [FieldPath; 3])>) -> Vec<(String, VectorPath)> {
    let vectors = vectors.into_iter().map(|path| {
        // `accel.value` is named after the message around it.
        let own = path.name().to_lowercase();
        let around = path.parent().map(|parent| parent.name().to_lowercase()).filter(|name| !name.is_empty());
        let named = is_accel(&own) || is_gyro(&own) || own == "gravity";
        let name = if named { own } else { around.unwrap_or(own) };
        (name, VectorPath::Whole(path))
    });
    vectors.chain(triples.into_iter().map(|(name, axes)| (name, VectorPath::Axes(axes)))).collect()
}

fn is_accel(name: &str) -> bool {
    let words = ["acc", "specific_force", "specificforce"];
    name == "a"
        || words.iter().any(|word| name.contains(word)) && !["ang", "cov", "bias"].iter().any(|w| name.contains(w))
}

/// Whether gravity was removed from it, judging by its name.
fn is_without_gravity(name: &str) -> bool {
    name.contains("useracc") || name.contains("user_acc")
}

/// Whether gravity was removed from it if there is a vector of gravity beside it: Android's names. (Those of ROS are the
/// same for readings as they are.)
fn is_linear(name: &str) -> bool {
    name.contains("linear")
}

/// Whether it has the names that browsers give rates, which are in deg/s (W3C Device Orientation).
fn is_of_browser(path: &VectorPath) -> bool {
    matches!(path, VectorPath::Axes([first, ..]) if first.name() == "alpha")
}

fn is_gyro(name: &str) -> bool {
    let words = [
        "gyr",
        "angular_vel",
        "angular_rate",
        "angularvel",
        "angularrate",
        "ang_vel",
        "omega",
        "rotationrate",
        "rotation_rate",
        "rot_rate",
        "turn_rate",
        "turnrate",
        "body_rate",
    ];
    let others = ["cov", "bias", "acc"];
    matches!(name, "g" | "w")
        || words.iter().any(|word| name.contains(word)) && !others.iter().any(|w| name.contains(w))
}

fn is_in_g(name: &str) -> bool {
    name.ends_with("_g") || name.ends_with("_gs")
}

fn is_in_degrees(name: &str) -> bool {
    // `radps` ends in `dps`.
    name.contains("deg") || name.replace("radps", "").contains("dps")
}
