//! A layout for Foxglove and Lichtblick, for the topics of a recording: what the sensor reads, whether it rests, the faces,
//! the calibration with its intervals, gravity in the sensor's frame, and the log. Opening it is left to the viewer.
//!
//! Two scripts in the layout derive what no panel can: the ends of intervals, and a scene of directions.

use serde_json::{Map, Value, json};

/// An IMU as a layout needs to know it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LayoutImu {
    /// What its annotation topics begin with.
    pub name: String,
    /// Message paths of the three axes of its accelerometer.
    pub acceleration: [String; 3],
    /// The same within a corrected message.
    pub corrected: [String; 3],
    /// Frame that its readings are in.
    pub frame_id: String,
}

const COLOURS: [&str; 3] = ["#0072b2", "#d55e00", "#009e73"];
const AXES: [&str; 3] = ["x", "y", "z"];

/// The layout: a tab for each IMU, if there are several.
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

/// The panels of one IMU, and how they stand beside each other.
fn tab(i: usize, imu: &LayoutImu, panels: &mut Map<String, Value>, scripts: &mut Map<String, Value>) -> Value {
    let T { stillness, segment, coverage, .. } = &T::of(&imu.name);
    let (bands, gravity) = (format!("/studio_script/bands{i}"), format!("/studio_script/gravity{i}"));
    for (name, title, code) in [
        ("bands", "Intervals", include_str!("layout/bands.ts")),
        ("gravity", "Gravity", include_str!("layout/gravity.ts")),
    ] {
        let source = code.replace("IMU", &plain(&imu.name)).replace("PLACE", &i.to_string());
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
    let raw = (0..3).map(|a| line(&imu.acceleration[a], AXES[a], COLOURS[a]));
    let corrected = (0..3).map(|a| line(&imu.corrected[a], &format!("{} corrected", AXES[a]), COLOURS[a]));
    let acceleration = put("Plot", "acceleration", plot("Acceleration, m/s²", raw.chain(corrected)));
    let rest = put(
        "StateTransitions",
        "rest",
        json!({
            "foxglovePanelTitle": "Rest",
            "isSynced": true,
            "paths": [
                {"value": format!("{stillness}.state"), "label": "state", "timestampMethod": "receiveTime"},
                {"value": format!("{segment}.face"), "label": "face", "timestampMethod": "receiveTime"},
                {"value": format!("{segment}.accepted"), "label": "accepted", "timestampMethod": "receiveTime"},
            ],
        }),
    );
    let statistic = put(
        "Plot",
        "statistic",
        plot(
            "Deviation over the noise floor",
            [
                line(&format!("{stillness}.statistic"), "statistic", "#666666"),
                line(&format!("{stillness}.enter"), "still below", COLOURS[2]),
                line(&format!("{stillness}.leave"), "moving above", COLOURS[1]),
            ],
        ),
    );
    let faces = put("Table", "faces", json!({"foxglovePanelTitle": "Faces", "topicPath": format!("{coverage}.faces")}));
    let next = put(
        "RawMessages",
        "next",
        json!({
            "foxglovePanelTitle": "Next step",
            "topicPath": format!("{coverage}.next_step"),
            "diffEnabled": false,
            "diffMethod": "custom",
            "diffTopicPath": "",
            "showFullMessageForDiff": false,
        }),
    );
    let intervals = |parameter: &str| {
        let bands = bands.clone();
        let parameter = parameter.to_owned();
        (0..3).flat_map(move |a| {
            let path = format!("{bands}.{parameter}.{}", AXES[a]);
            let edge =
                |end: &str| line(&format!("{path}.{end}"), &format!("{} {end}", AXES[a]), &format!("{}66", COLOURS[a]));
            [line(&format!("{path}.value"), AXES[a], COLOURS[a]), edge("low"), edge("high")]
        })
    };
    let bias = put("Plot", "bias", plot("Bias with 95 % interval, m/s²", intervals("bias")));
    let scale = put("Plot", "scale", plot("Scale with 95 % interval", intervals("scale")));
    let log = put(
        "RosOut",
        "log",
        json!({"foxglovePanelTitle": "Log", "topicToRender": "/stillpoint/log", "searchTerms": [], "minLogLevel": 1}),
    );
    let scene = put(
        "3D",
        "gravity",
        json!({
            "foxglovePanelTitle": "Gravity in the sensor's frame",
            "followTf": frame(imu),
            "followMode": "follow-pose",
            "cameraState": {
                "perspective": true, "distance": 4, "phi": 60, "thetaOffset": 45, "targetOffset": [0, 0, 0], "target": [0, 0, 0],
                "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.05, "far": 100,
            },
            "topics": {gravity: {"visible": true}},
            "layers": {}, "scene": {}, "transforms": {}, "publish": {}, "imageMode": {},
        }),
    );
    let signals = stack(&[(acceleration, 50.0), (rest, 50.0), (statistic, 100.0)], "column");
    let calibration = stack(&[(bias, 50.0), (scale, 100.0)], "row");
    let left = stack(&[(signals, 68.0), (calibration, 100.0)], "column");
    let right = stack(&[(next, 14.0), (faces, 34.0), (scene, 60.0), (log, 100.0)], "column");
    stack(&[(left, 66.0), (right, 100.0)], "row")
}

/// Topics of an IMU's annotations.
struct T {
    stillness: String,
    segment: String,
    coverage: String,
}

impl T {
    fn of(name: &str) -> Self {
        let topic = |last: &str| quoted(&format!("{name}/stillpoint/{last}"));
        Self { stillness: topic("stillness"), segment: topic("segment"), coverage: topic("coverage") }
    }
}

/// A topic as a message path begins with it: quoted where its letters would end it.
pub fn quoted(topic: &str) -> String {
    let plain = topic.chars().all(|c| c.is_ascii_alphanumeric() || "/_-".contains(c));
    if plain { topic.to_owned() } else { format!("\"{}\"", plain_text(topic)) }
}

/// What cannot leave the string that it stands in.
fn plain(text: &str) -> String {
    plain_text(text)
}

fn plain_text(text: &str) -> String {
    text.chars().filter(|c| !c.is_control() && !"\"\\`$".contains(*c)).collect()
}

fn frame(imu: &LayoutImu) -> &str {
    if imu.frame_id.is_empty() { "imu" } else { &imu.frame_id }
}

fn line(path: &str, label: &str, colour: &str) -> Value {
    json!({"value": path, "label": label, "color": colour, "enabled": true, "timestampMethod": "receiveTime", "showLine": true, "lineSize": 1.2})
}

fn plot(title: &str, paths: impl IntoIterator<Item = Value>) -> Value {
    json!({
        "foxglovePanelTitle": title,
        "paths": paths.into_iter().collect::<Value>(),
        "showLegend": true,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": false,
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "isSynced": true,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
    })
}

/// Panels one after the other; each gets its percentage of what those before it have left.
fn stack(panels: &[(Value, f64)], direction: &str) -> Value {
    match panels {
        [] => Value::Null,
        [(only, _)] => only.clone(),
        [(first, share), rest @ ..] => {
            json!({"direction": direction, "splitPercentage": share, "first": first, "second": stack(rest, direction)})
        }
    }
}
