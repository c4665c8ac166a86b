//! Layout for Foxglove and Lichtblick, for the topics of a recording: the readings, the rest state, the faces, the
//! calibration with its intervals, which way was up in the sensor's frame, diagnostics, and the log.
//!
//! Scripts in the layout derive what no panel can: interval ends, a scene of directions, and diagnostics, which a
//! recording does not contain.

use serde_json::{Map, Value, json};

use crate::topic::{self, Kind};

/// Properties of an IMU that its layout depends on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LayoutImu {
    /// Prefix of its annotation topics.
    pub name: String,
    /// Message paths of the three axes of its accelerometer.
    pub acceleration: [String; 3],
    /// The same paths within a corrected message, where there are or may be such.
    pub corrected: Option<[String; 3]>,
    /// Frame of its readings.
    pub frame_id: String,
    /// Whether its annotations are plotted by their stamps. While a recording is followed, viewers otherwise know only
    /// the arrival time of a message, and recorders write many seconds at once.
    pub is_stamped: bool,
    /// Whether its readings are plotted by their stamps.
    pub are_readings_stamped: bool,
}

const COLOURS: [&str; 3] = ["#0072b2", "#d55e00", "#009e73"];
const AXES: [&str; 3] = ["x", "y", "z"];
/// Placeholders of topics in the scripts.
const TOPICS: [(&str, Kind); 4] = [
    ("STILLNESS_TOPIC", Kind::Stillness),
    ("SEGMENT_TOPIC", Kind::Segment),
    ("COVERAGE_TOPIC", Kind::Coverage),
    ("CALIBRATION_TOPIC", Kind::Calibration),
];

/// The layout, with a tab for each IMU if there are several.
pub fn layout(imus: &[LayoutImu]) -> Value {
    let mut panels = Map::new();
    let mut scripts = Map::new();
    let tabs: Vec<_> = imus.iter().enumerate().map(|(i, imu)| (imu, tab(i, imu, &mut panels, &mut scripts))).collect();
    let root = match tabs.as_slice() {
        [(_, only)] => only.clone(),
        _ => {
            let tabs = tabs.iter().map(|(imu, layout)| json!({"title": imu.name, "layout": layout}));
            panels.insert("Tab!imus".to_owned(), json!({"activeTabIdx": 0, "tabs": tabs.collect::<Value>()}));
            json!("Tab!imus")
        }
    };
    json!({
        "configById": panels,
        "globalVariables": {},
        "userNodes": scripts,
        "playbackConfig": {"speed": 1},
        "layout": root,
    })
}

/// The panels of one IMU and their arrangement.
fn tab(i: usize, imu: &LayoutImu, panels: &mut Map<String, Value>, scripts: &mut Map<String, Value>) -> Value {
    let [stillness, segment] = [Kind::Stillness, Kind::Segment].map(|kind| quoted(&topic::of(&imu.name, kind)));
    let [bands, gravity, diagnostics] =
        ["bands", "gravity", "diagnostics"].map(|name| format!("/studio_script/{name}{i}"));
    for (name, title, code) in [
        ("bands", "Intervals", include_str!("layout/bands.ts")),
        ("gravity", "Gravity", include_str!("layout/gravity.ts")),
        ("diagnostics", "Diagnostics", include_str!("layout/diagnostics.ts")),
    ] {
        let mut source = code.to_owned();
        for (place, kind) in TOPICS {
            source = source.replace(place, &plain(&topic::of(&imu.name, kind)));
        }
        let source = source.replace("IMU", &plain(&imu.name)).replace("PLACE", &i.to_string());
        let source = source.replace("FRAME", &plain(frame(imu)));
        let script = json!({"name": format!("{title} of {}", imu.name), "sourceCode": source});
        scripts.insert(format!("stillpoint-{name}-{i}"), script);
    }
    let mut put = |kind: &str, name: &str, mut config: Value| {
        let id = format!("{kind}!{name}{i}");
        config["lichtblickPanelTitle"] = config["foxglovePanelTitle"].clone();
        panels.insert(id.clone(), config);
        Value::from(id)
    };
    let time = |is_stamped| if is_stamped { "headerStamp" } else { "receiveTime" };
    let line = |path: &str, label: &str, colour: &str, is_stamped| {
        json!({
            "value": path, "label": label, "color": colour, "enabled": true, "timestampMethod": time(is_stamped),
            "showLine": true, "lineSize": 1.2,
        })
    };
    let reading = |path: &str, label: &str, colour| line(path, label, colour, imu.are_readings_stamped);
    let learned = |path: &str, label: &str, colour: &str| line(path, label, colour, imu.is_stamped);
    let raw = (0..3).map(|a| reading(&imu.acceleration[a], AXES[a], COLOURS[a]));
    let paths = imu.corrected.iter().flatten().enumerate();
    let corrected = paths.map(|(a, path)| reading(path, &format!("{} corrected", AXES[a]), COLOURS[a]));
    let acceleration = put("Plot", "acceleration", plot("Acceleration, m/s²", 170, raw.chain(corrected)));
    let rest = put(
        "StateTransitions",
        "rest",
        json!({
            "foxglovePanelTitle": "Rest",
            "isSynced": true,
            "paths": [
                {"value": format!("{stillness}.state"), "label": "state", "timestampMethod": time(imu.is_stamped)},
                {"value": format!("{segment}.face"), "label": "last rest on", "timestampMethod": time(imu.is_stamped)},
                {"value": format!("{segment}.reason"), "label": "and it was", "timestampMethod": time(imu.is_stamped)},
            ],
        }),
    );
    let mut deviation = plot(
        "Deviation over the noise floor",
        170,
        [
            learned(&format!("{stillness}.statistic"), "statistic", "#666666"),
            learned(&format!("{stillness}.enter"), "still below", COLOURS[2]),
            learned(&format!("{stillness}.leave"), "moving above", COLOURS[1]),
        ],
    );
    // In motion it is hundreds of times the floor; on that scale the thresholds could not be told from zero.
    (deviation["minYValue"], deviation["maxYValue"]) = (0.into(), 12.into());
    let statistic = put("Plot", "statistic", deviation);
    let summary = put(
        "DiagnosticSummary",
        "summary",
        json!({
            "foxglovePanelTitle": "How it stands",
            "topicToRender": diagnostics,
            "minLevel": 0, "pinnedIds": [], "hardwareIdFilter": "", "sortByLevel": false,
        }),
    );
    let mut detail = |what: &str, title: &str| {
        let config = json!({
            "foxglovePanelTitle": title,
            "topicToRender": diagnostics,
            "selectedHardwareId": plain(&imu.name), "selectedName": what, "splitFraction": 0.35,
        });
        put("DiagnosticStatusPanel", what, config)
    };
    let (calibration, faces) = (detail("calibration", "Calibration"), detail("faces", "Faces"));
    let intervals = |parameter: &str| {
        let line = |a: usize, end: &str, label: String, opacity: &str| {
            learned(&format!("{bands}.{parameter}.{}.{end}", AXES[a]), &label, &format!("{}{opacity}", COLOURS[a]))
        };
        let values = (0..3).map(|a| line(a, "value", AXES[a].to_owned(), ""));
        let ends = (0..3).flat_map(|a| ["low", "high"].map(|end| line(a, end, format!("{} {end}", AXES[a]), "66")));
        values.chain(ends).collect::<Vec<_>>()
    };
    let bias = put("Plot", "bias", plot("Bias with 95 % interval, m/s²", 110, intervals("bias")));
    let scale = put("Plot", "scale", plot("Scale with 95 % interval", 110, intervals("scale")));
    let log = put(
        "RosOut",
        "log",
        json!({"foxglovePanelTitle": "Log", "topicToRender": topic::of("", Kind::Log), "searchTerms": [], "minLogLevel": 1}),
    );
    let scene = put(
        "3D",
        "gravity",
        json!({
            "foxglovePanelTitle": "Up at each rest, in the sensor's frame",
            "followTf": frame(imu),
            "followMode": "follow-pose",
            "cameraState": {
                "perspective": true, "distance": 3.7, "phi": 60, "thetaOffset": 45, "targetOffset": [0, 0, 0], "target": [0, 0, 0],
                "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.05, "far": 100,
            },
            "topics": {gravity: {"visible": true}},
            "layers": {}, "scene": {"transforms": {"showLabel": false}}, "transforms": {}, "publish": {}, "imageMode": {},
        }),
    );
    let intervals = stack(&[(bias, 50.0), (scale, 100.0)], "row");
    let left = stack(&[(acceleration, 25.0), (rest, 41.0), (statistic, 35.0), (intervals, 100.0)], "column");
    let details = stack(&[(calibration, 54.0), (faces, 100.0)], "row");
    let right = stack(&[(summary, 15.0), (details, 57.0), (scene, 55.0), (log, 100.0)], "column");
    stack(&[(left, 61.0), (right, 100.0)], "row")
}

/// A topic at the start of a message path: quoted if its characters would end it.
pub fn quoted(topic: &str) -> String {
    let plain = topic.chars().all(|c| c.is_ascii_alphanumeric() || "/_-".contains(c));
    if plain { topic.to_owned() } else { format!("\"{}\"", plain_text(topic)) }
}

/// Text that cannot leave the string literal that contains it.
fn plain(text: &str) -> String {
    plain_text(text)
}

fn plain_text(text: &str) -> String {
    text.chars().filter(|c| !c.is_control() && !"\"\\`$".contains(*c)).collect()
}

fn frame(imu: &LayoutImu) -> &str {
    if imu.frame_id.is_empty() { "imu" } else { &imu.frame_id }
}

/// A plot of lines over time, with a legend of this width in pixels beside it.
fn plot(title: &str, legend: u32, paths: impl IntoIterator<Item = Value>) -> Value {
    json!({
        "foxglovePanelTitle": title,
        "paths": paths.into_iter().collect::<Value>(),
        "showLegend": true,
        "legendDisplay": "left",
        "showPlotValuesInLegend": false,
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "isSynced": true,
        "xAxisVal": "timestamp",
        "sidebarDimension": legend,
    })
}

/// Panels in a row or column; each gets its percentage of the space that those before it left.
fn stack(panels: &[(Value, f64)], direction: &str) -> Value {
    match panels {
        [] => Value::Null,
        [(only, _)] => only.clone(),
        [(first, share), rest @ ..] => {
            json!({"direction": direction, "splitPercentage": share, "first": first, "second": stack(rest, direction)})
        }
    }
}
