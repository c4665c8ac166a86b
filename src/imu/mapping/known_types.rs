//! Types whose vectors are known by name, at any place in a message.

use crate::imu::schema::layout::Layout;
use crate::imu::schema::path::FieldPath;

/// Places of the vectors of a well-known type in a message.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::imu) struct KnownType {
    /// Path of the message of that type; empty if it is the whole message.
    pub(in crate::imu) inside: FieldPath,
    pub(in crate::imu) accel: Option<KnownVector>,
    pub(in crate::imu) gyro: Option<KnownVector>,
    /// Temperature of the sensor, °C.
    pub(in crate::imu) temperature: Option<FieldPath>,
    /// Stamp in microseconds, if it has no header.
    pub(in crate::imu) micros: Option<FieldPath>,
    /// Number that identifies the sensor, if several share a topic.
    pub(in crate::imu) device: Option<FieldPath>,
    /// Arrangement of several readings in its lists, if they say so.
    pub(in crate::imu) batch: Option<KnownBatch>,
    /// Whether its topics are IMUs even if the configuration does not mention them.
    pub(in crate::imu) imu: bool,
}

/// Several readings in a message, of which the last one was at its stamp.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::imu) struct KnownBatch {
    /// Number of readings; the lists may be longer.
    pub(in crate::imu) count: FieldPath,
    /// Microseconds from one to the next.
    pub(in crate::imu) period: FieldPath,
}

/// A vector, and further information about it in the message.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::imu) struct KnownVector {
    pub(in crate::imu) vector: FieldPath,
    /// Microseconds over which the vector is an increment.
    pub(in crate::imu) over: Option<FieldPath>,
    /// Number of m/s² or rad/s in a count.
    pub(in crate::imu) scale: Option<FieldPath>,
    /// Numbers that are not zero if the sensor reached the end of its range.
    pub(in crate::imu) clipping: Vec<FieldPath>,
    /// Number that changes with the calibration that the driver applies.
    pub(in crate::imu) round: Option<FieldPath>,
}

/// Known types in a message: its own, or else the IMUs inside it.
pub(in crate::imu) fn known(layout: &Layout) -> Vec<KnownType> {
    if let Some(known) = of_type(layout.name(), &FieldPath::default()) {
        return vec![known];
    }
    let inside = layout.messages_inside().into_iter();
    inside.filter_map(|(path, name)| of_type(name, &path)).filter(|known| known.imu).collect()
}

/// Known type by the name `package/Type`, of a message at `inside`.
///
/// px4_msgs as of PX4 1.17: values are in the body or board frame (forward, right, down), and stay so. Stamps count
/// from the start of the system. In `SensorCombined` it is the stamp of the gyroscope; the accelerometer's differs by a
/// few milliseconds, which is irrelevant to rests. In `SensorAccelFifo` and `SensorGyroFifo` it is the stamp of the last of
/// the readings, and `x`, `y`, `z` are counts (PX4's own Flight Review expands them in this way).
///
/// `dai.proto.imu_data.IMUData` is what depthai-core 3 records of an OAK camera, in m/s² and rad/s. The gyroscope of a
/// packet has a stamp of its own, likewise irrelevant.
fn of_type(name: &str, inside: &FieldPath) -> Option<KnownType> {
    let at = |text: &str| text.parse().ok().map(|path| inside.within(&path));
    let part =
        |vector| Some(KnownVector { vector: at(vector)?, over: None, scale: None, clipping: Vec::new(), round: None });
    let px4 = |vector, over: &str, clipping: &[&str], round: &str| {
        let some = |text: &str| if text.is_empty() { None } else { at(text) };
        let clipping = clipping.iter().filter_map(|path| at(path)).collect();
        Some(KnownVector { vector: at(vector)?, over: some(over), scale: None, clipping, round: some(round) })
    };
    let known = |accel, gyro, imu| {
        let (temperature, micros, device) = (None, None, None);
        KnownType { inside: inside.clone(), accel, gyro, temperature, micros, device, batch: None, imu }
    };
    let fifo = |known| {
        let batch = Some(KnownBatch { count: at("samples")?, period: at("dt")? });
        Some(KnownType { micros: at("timestamp_sample"), device: at("device_id"), batch, ..known })
    };
    let counts = || Some(KnownVector { scale: at("scale"), ..part("")? });
    let stamped = |device: &str, temperature: &str, known| KnownType {
        micros: at("timestamp_sample"),
        device: at(device),
        temperature: at(temperature),
        ..known
    };
    const COUNTS: [&str; 3] = ["clip_counter[0]", "clip_counter[1]", "clip_counter[2]"];
    Some(match name {
        "sensor_msgs/Imu" => known(part("linear_acceleration"), part("angular_velocity"), true),
        "px4_msgs/SensorCombined" => {
            let accel = px4("accelerometer_m_s2", "", &["accelerometer_clipping"], "accel_calibration_count");
            let gyro = px4("gyro_rad", "", &["gyro_clipping"], "gyro_calibration_count");
            KnownType { micros: at("timestamp"), ..known(accel, gyro, true) }
        }
        "px4_msgs/VehicleImu" => {
            let accel =
                px4("delta_velocity", "delta_velocity_dt", &["delta_velocity_clipping"], "accel_calibration_count");
            let gyro = px4("delta_angle", "delta_angle_dt", &["delta_angle_clipping"], "gyro_calibration_count");
            KnownType { micros: at("timestamp_sample"), device: at("accel_device_id"), ..known(accel, gyro, true) }
        }
        "px4_msgs/SensorAccel" => {
            let accel = px4("", "", &COUNTS, "");
            stamped("device_id", "temperature", known(accel, None, true))
        }
        "px4_msgs/SensorGyro" => {
            let gyro = px4("", "", &COUNTS, "");
            stamped("device_id", "temperature", known(None, gyro, false))
        }
        "px4_msgs/SensorAccelFifo" => fifo(known(counts(), None, true))?,
        "px4_msgs/SensorGyroFifo" => fifo(known(None, counts(), false))?,
        "px4_msgs/VehicleImuStatus" => {
            let (micros, device) = (at("timestamp"), at("accel_device_id"));
            KnownType { micros, device, temperature: at("temperature_accel"), ..known(None, None, false) }
        }
        "dai.proto.imu_data.IMUData" => {
            known(part("packets[*].accelerometer.vec"), part("packets[*].gyroscope.vec"), true)
        }
        "sensor_msgs/Temperature" => KnownType { temperature: at("temperature"), ..known(None, None, false) },
        "geometry_msgs/Vector3" => known(part(""), part(""), false),
        "geometry_msgs/Vector3Stamped" => known(part("vector"), part("vector"), false),
        "geometry_msgs/Accel" => known(part("linear"), None, false),
        "geometry_msgs/AccelStamped" => known(part("accel.linear"), None, false),
        "geometry_msgs/AccelWithCovarianceStamped" => known(part("accel.accel.linear"), None, false),
        "geometry_msgs/Twist" => known(None, part("angular"), false),
        "geometry_msgs/TwistStamped" => known(None, part("twist.angular"), false),
        _ => return None,
    })
}
