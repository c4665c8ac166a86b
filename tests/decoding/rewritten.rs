//! Copies of messages that hold several readings: each reading in its place replaced, and nothing else changed.

use prost_reflect::{DescriptorPool, DynamicMessage};
use serde_json::{Value, json};
use stillpoint::imu::Sensor::{self, Accelerometer};
use stillpoint::record::{Channel, Schema};

use super::batches::{DEPTHAI, FIFO, fifo, told};
use super::intake::{Door, channel, px4_schema, schema};

/// What stands in the place of the n-th reading of a message.
fn changed(sensor: Sensor, n: usize, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let by = if sensor == Accelerometer { 0.25 } else { -0.5 };
    [x + by, y - by, 2.0 * z + n as f64]
}

/// A message with each reading changed; `None` if it cannot be written.
fn rewritten(door: &Door, data: &[u8]) -> Option<Vec<u8>> {
    let change = |_, sensor, n: usize, value: nalgebra::Vector3<f64>| Some(changed(sensor, n, value.into()).into());
    door.intake.rewrite(1, data, change).pop().map(|(_, data)| data)
}

/// Reads a message, rewrites it, and reads that: each reading is as it was changed, at the same time. Returns the copy.
fn holds(lines: &str, channel: &Channel, schema: Option<&Schema>, data: &[u8], readings: usize) -> Vec<u8> {
    let read = |data: &[u8]| {
        let mut door = Door::new(lines);
        door.intake.channel(channel, schema);
        door.message(1, 9, data);
        door
    };
    let door = read(data);
    let before = told(&door);
    assert_eq!(before.iter().filter(|(sensor, ..)| *sensor == Accelerometer).count(), readings, "{lines}");
    let copy = rewritten(&door, data).unwrap_or_else(|| panic!("not rewritten: {lines}"));
    let mut counts = [0; 2];
    let expected = before.into_iter().map(|(sensor, stamp, value)| {
        let count = &mut counts[sensor.index()];
        *count += 1;
        (sensor, stamp, changed(sensor, *count - 1, value))
    });
    assert_eq!(told(&read(&copy)), expected.collect::<Vec<_>>(), "{lines}");
    copy
}

#[test]
fn each_reading_is_rewritten_in_every_encapsulation_of_cdr_and_in_ros_1() {
    let inner = "===\nMSG: acme/R\nuint8 flags\nfloat64[3] a\nfloat32[3] g\n";
    let acme =
        |encoding: &str| Schema { encoding: encoding.into(), ..schema("acme/msg/L", &format!("acme/R[] r\n{inner}")) };
    let message = |head: &[u8], sized: bool, align: usize, big: bool| {
        let mut body = Vec::new();
        let word = |n: u32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
        body.extend(word(3));
        for n in [1.0, 2.0, 4.0] {
            body.push(7);
            body.resize(body.len().next_multiple_of(align), 0);
            body.extend([n, 2.0, 9.5].map(|x: f64| if big { x.to_be_bytes() } else { x.to_le_bytes() }).concat());
            body.extend(
                [0.5, n as f32, 0.0].map(|x: f32| if big { x.to_be_bytes() } else { x.to_le_bytes() }).concat(),
            );
        }
        let size = if sized { word(body.len() as u32).to_vec() } else { Vec::new() };
        [head, &size, &body].concat()
    };
    for (message_encoding, encoding, data) in [
        ("cdr", "ros2msg", message(&[0, 1, 0, 0], false, 8, false)),
        ("cdr", "ros2msg", message(&[0, 0, 0, 0], false, 8, true)),
        ("cdr", "ros2msg", message(&[0, 7, 0, 0], true, 4, false)),
        ("ros1", "ros1msg", message(&[], false, 1, false)),
    ] {
        let channel = Channel { message_encoding: message_encoding.into(), ..channel(1, "/l") };
        let lines = "[[imu]]\ntopic = '/l'\naccel = 'r[*].a'\ngyro = 'r[*].g'";
        let copy = holds(lines, &channel, Some(&acme(encoding)), &data, 3);
        assert_eq!(copy.len(), data.len());
        let different = copy.iter().zip(&data).filter(|(a, b)| a != b).count();
        assert!(different <= 3 * 36, "{different} bytes changed, the numbers have {}", 3 * 36);
    }
}

#[test]
fn numbers_in_which_axes_follow_each_other_are_read_and_rewritten_by_their_distance() {
    // Two readings of six numbers behind one that is none, in ROS 2 and in JSON; nested and by columns in JSON.
    let numbers = [77.0, 1.0, 2.0, 9.5, 0.5, 0.0, 0.25, 3.0, 4.0, 9.25, 0.0, 0.5, 0.125];
    let axes = |from: u32| format!("['d[{}::6]', 'd[{}::6]', 'd[{}::6]']", from, from + 1, from + 2);
    let lines = format!("[[imu]]\ntopic = '/l'\naccel = {}\ngyro = {}", axes(1), axes(4));
    let flat = schema("acme/msg/Flat", "uint8 pad\nfloat64[] d\nuint8 status\n");
    let mut data = vec![0, 1, 0, 0, 5, 0, 0, 0];
    data.extend(13_u32.to_le_bytes());
    numbers.iter().for_each(|number: &f64| data.extend(number.to_le_bytes()));
    data.push(3);
    let copy = holds(&lines, &channel(1, "/l"), Some(&flat), &data, 2);
    assert_eq!((copy.len(), &copy[..20], copy[20 + 96]), (data.len(), &data[..20], 3), "what is no reading stays");
    let packed = super::protobuf::compile("syntax = \"proto3\"; package t; message Root { repeated double d = 1; }");
    let packed = Schema { id: 1, name: "t.Root".into(), encoding: "protobuf".into(), data: packed };
    let protobuf = Channel { message_encoding: "protobuf".into(), ..channel(1, "/l") };
    let bytes = numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>();
    holds(&lines, &protobuf, Some(&packed), &[&[0x0a, 104][..], &bytes].concat(), 2);

    let json_channel = Channel { schema_id: 0, message_encoding: "json".into(), ..channel(1, "/l") };
    let columns = json!({"d": numbers, "kept": [0.1, "a"]});
    let copy = holds(&lines, &json_channel, None, columns.to_string().as_bytes(), 2);
    assert_eq!(serde_json::from_slice::<Value>(&copy).unwrap()["kept"], columns["kept"]);
    let offered = |message: &Value| {
        let mut door = Door::new("");
        door.intake.channel(&json_channel, None);
        door.message(1, 2, message.to_string().as_bytes());
        super::batches::offered(door.intake.verdict(1))
    };
    let rows = json!({"accel": [[1, 2, 9.5], [3, 4, 9.25]], "gyro": [[0.5, 0, 0.25], [0.0, 0.5, 0.125]], "t": 5});
    let lines = offered(&rows);
    assert!(lines.contains("accel = \"accel[*]\"") && lines.contains("gyro = \"gyro[*]\""), "{lines}");
    holds(&lines, &json_channel, None, rows.to_string().as_bytes(), 2);
    let flat = json!({"accel": [1, 2, 9.5, 3, 4, 9.25], "gyro": [0.5, 0, 0.25, 0.0, 0.5, 0.125]});
    let lines = offered(&flat);
    assert!(lines.contains("accel = [\"accel[0::3]\", \"accel[1::3]\", \"accel[2::3]\"]"), "{lines}");
    holds(&lines, &json_channel, None, flat.to_string().as_bytes(), 2);
    let table = json!({"imu": [[0.1, 1, 2, 9.5], [0.2, 3, 4, 9.25]]});
    holds(
        "[[imu]]\ntopic = '/l'\naccel = ['imu[*][1]', 'imu[*][2]', 'imu[*][3]']",
        &json_channel,
        None,
        table.to_string().as_bytes(),
        2,
    );
}

#[test]
fn lists_whose_meaning_nothing_tells_are_named_with_what_to_do() {
    let json_channel = |topic: &str| Channel { schema_id: 0, message_encoding: "json".into(), ..channel(1, topic) };
    for (topic, message, words) in [
        ("/imu", json!({"data": [1, 2, 9, 0, 0, 0]}), &["`data` is a list of numbers", "\"data[0::3]\"", "[0::6]"][..]),
        ("/imu", json!({"rows": [[1, 1, 2, 9], [2, 1, 2, 9]]}), &["`rows[*]` are lists of numbers", "\"rows[*][0]\""]),
        ("/x", json!({"accel": [[[1, 2, 9]]]}), &["`accel` is a list of lists that is not read", "[x, y, z]"]),
    ] {
        let mut door = Door::new("");
        door.intake.channel(&json_channel(topic), None);
        door.message(1, 2, message.to_string().as_bytes());
        let role = door.intake.verdict(1).to_string();
        words.iter().for_each(|word| assert!(role.starts_with("skipped: ") && role.contains(word), "{role}"));
    }
    // Lists of other things are not taken for readings.
    for (topic, message) in [("/joints", json!({"position": [1, 2, 3, 4, 5, 6]})), ("/imu", json!({"cov": vec![0; 9]}))]
    {
        let mut door = Door::new("");
        door.intake.channel(&json_channel(topic), None);
        door.message(1, 2, message.to_string().as_bytes());
        assert_eq!(door.intake.verdict(1).to_string(), "not an IMU", "{message}");
    }
}

#[test]
fn integers_are_rounded_to_their_own_steps_and_elements_that_are_no_readings_stay() {
    let mut door = Door::new("");
    door.channel(1, "/fifo", &px4_schema("SensorAccelFifo", FIFO));
    let data = fifo(1_000_000.0, 7.0, 3.0);
    door.message(1, 5, &data);
    let change = |_, _, n: usize, v: nalgebra::Vector3<f64>| Some(v.map(|axis| axis + 0.3 + n as f64));
    let copy = door.intake.rewrite(1, &data, change).pop().unwrap().1;
    let mut after = Door::new("");
    after.channel(1, "/fifo", &px4_schema("SensorAccelFifo", FIFO));
    after.message(1, 5, &copy);
    // 1.3, -1.7 and 0.3, in steps of a half, and so on.
    let expected = [[1.5, -1.5, 0.5], [2.5, -0.5, 2.0], [3.5, 0.5, 3.5]];
    assert_eq!(told(&after).into_iter().map(|(.., value)| value).collect::<Vec<_>>(), expected);
    let rounding: Vec<_> = door.intake.rounding().into_iter().collect();
    assert_eq!(rounding, [(("/fifo", "accelerometer"), (Accelerometer, 0.5))]);
    let different = copy.iter().zip(&data).filter(|(a, b)| a != b).count();
    assert!(copy.len() == data.len() && different <= 18, "{different} bytes changed, nine counts have 18");
    // A count beyond the range cannot be written.
    assert_eq!(door.intake.rewrite(1, &data, |_, _, _, v| Some(v * 1e6)), vec![]);
}

#[test]
fn zeros_that_protobuf_leaves_out_of_the_elements_of_a_list_are_put_in() {
    let data = super::protobuf::compile(DEPTHAI);
    let of_type = DescriptorPool::decode(&data[..]).unwrap().get_message_by_name("dai.proto.imu_data.IMUData").unwrap();
    // The second packet has no gyroscope; the third neither x of the one nor anything of the other.
    let text = |values: [&str; 5]| {
        let report = |vec: &str, n: u32| format!("{{ report {{ sequence: {n} ts {{ sec: {n} }} }} vec {{ {vec} }} }}");
        let [a, b, c, d, e] = values;
        format!(
            "packets {{ accelerometer {} gyroscope {} }} packets {{ accelerometer {} }} \
             packets {{ accelerometer {} gyroscope {} }} sequenceNum: 3 ts {{ sec: 7 }}",
            report(a, 1),
            report(b, 2),
            report(c, 3),
            report(d, 4),
            report(e, 5)
        )
    };
    let message = |values| {
        let message = DynamicMessage::parse_text_format(of_type.clone(), &text(values)).unwrap();
        prost::Message::encode_to_vec(&message)
    };
    let before = message(["x: 1 y: 2 z: 9.5", "x: 0.5 z: 0.25", "y: 2 z: 9.5", "z: 9.5", ""]);
    let schema =
        Schema { id: 1, name: "dai.proto.imu_data.IMUData".into(), encoding: "protobuf".into(), data: data.clone() };
    let channel = Channel { message_encoding: "protobuf".into(), ..channel(1, "/oak/imu") };
    let mut door = Door::new("");
    door.intake.channel(&channel, Some(&schema));
    door.message(1, 1, &before);
    let copy = rewritten(&door, &before).unwrap();
    let read = DynamicMessage::decode(of_type.clone(), copy.as_slice()).unwrap();
    let expected = message([
        "x: 1.25 y: 1.75 z: 19.0",
        "x: 0 y: 0.5 z: 0.5",
        "x: 0.25 y: 1.75 z: 20.0",
        "x: 0.25 y: -0.25 z: 21.0",
        "x: -0.5 y: 0.5 z: 2",
    ]);
    assert_eq!(
        read.to_text_format().replace("x:0.0", ""),
        DynamicMessage::decode(of_type, &expected[..]).unwrap().to_text_format().replace("x:0.0", "")
    );
}
