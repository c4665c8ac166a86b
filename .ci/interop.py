"""What programs that are not ours make of Stillpoint's outputs: interop.py STILLPOINT

For every real recording: pymcap-cli doctor, Python mcap with CRC validation (every original message is there with the
same bytes, channel and times), the annotations decoded by the schema in the file, @mcap/core, rosbags, and strip.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Channel, Message
from rosbags.highlevel import AnyReader

HERE = Path(__file__).resolve().parent
BIN = Path(sys.executable).parent
SETTINGS = {
    "nilspod_six_face.ros2": 'imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]',
}
# Outputs that must hold a calibration of the accelerometer, so that an empty result cannot pass.
CALIBRATED = {"nilspod_six_face.ros2", "nilspod_six_face.ros1", "xsens_38_poses.ros2", "mpu9150_0_19_poses.ros2"}


def main(stillpoint):
    recordings = sorted((Path(os.environ["STILLPOINT_DATA"]) / "recordings").glob("*.mcap"))
    assert recordings, "no recordings"
    out = HERE.parent / "target/ci/out"
    out.mkdir(parents=True, exist_ok=True)
    for recording in recordings:
        annotated, sidecar = out / f"{recording.stem}.annotated.mcap", out / f"{recording.stem}.stillpoint.mcap"
        for path, options in ((annotated, []), (sidecar, ["--sidecar"])):
            imus = annotate(stillpoint, recording, path, options)
            check_doctor(recording, path)
            if imus:
                check_decodes(path)
            check_javascript(path)
        added = check_messages(recording, annotated)
        assert added == Counter(t for t, *_ in messages(sidecar)), "annotations differ between file and sidecar"
        check_rosbags(recording, annotated)
        check_strip(stillpoint, recording, annotated, out / "stripped.mcap")
        print(f"{recording.name}: {sum(added.values())} annotations on {len(added)} topics", flush=True)


def annotate(stillpoint, recording, output, options):
    command = [stillpoint, "annotate", recording, "-o", output, "--force", "--allow-no-imu", "--accept-damage", "--json", "-q"]
    if recording.stem in SETTINGS:
        command += ["--set", SETTINGS[recording.stem]]
    run = subprocess.run([*command, *options], stdout=subprocess.PIPE, check=True)
    result = json.loads(run.stdout)
    calibrated = any(imu["accelerometer"]["bias"] for imu in result["imus"])
    assert calibrated == (recording.stem in CALIBRATED), f"{recording.name}: calibrated: {calibrated}"
    return result["imus"]


def check_doctor(original, output):
    def errors(path):
        run = subprocess.run([BIN / "pymcap-cli", "doctor", "--format", "jsonl", path], stdout=subprocess.PIPE)
        findings = [json.loads(line) for line in run.stdout.splitlines()]
        assert findings[-1]["type"] == "summary" and findings[-1]["complete"], f"{path}: the doctor gave up"
        return {(f["code"], f["offset"]) for f in findings if f.get("severity") == "error" and f["section"] == "data"} | {
            (f["code"], f["section"]) for f in findings if f.get("severity") == "error" and f["section"] != "data"
        }

    def in_data_section(error):
        return isinstance(error[1], int)

    new = errors(output) - {error for error in errors(original) if in_data_section(error)}
    assert not new, f"{output}: the doctor finds {new}"


def messages(path):
    """Every message in the order of the file, from the data section and with all CRCs checked."""
    with open(path, "rb") as file:
        channels, schemas = {}, {}
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                key = (channel.topic, channel.message_encoding, record.sequence, record.log_time, record.publish_time)
                yield (*key, record.data)


def check_messages(original, output):
    theirs = Counter(messages(original))
    ours = Counter(messages(output))
    assert not theirs - ours, f"{output}: {sum((theirs - ours).values())} messages are lost or altered"
    with open(output, "rb") as file:
        indexed = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    assert indexed == sum(ours.values()), f"{output}: {indexed} of {sum(ours.values())} messages are indexed"
    added = Counter(topic for topic, *_ in (ours - theirs).elements())
    assert all("stillpoint/" in topic for topic in added), f"{output}: adds {added}"
    return added


def check_decodes(output):
    subprocess.run([sys.executable, HERE.parent / "tests/interop/annotations.py", output], check=True, stdout=subprocess.DEVNULL)


def check_javascript(output):
    run = subprocess.run(["node", HERE / "read.mjs", output], stdout=subprocess.PIPE, check=True)
    count = sum(1 for _ in messages(output))
    assert int(run.stdout) == count, f"{output}: @mcap/core reads {int(run.stdout)} of {count} messages"


def check_rosbags(original, output):
    with open(original, "rb") as file:
        if make_reader(file).get_header().profile != "ros2":
            return
    with AnyReader([output]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def check_strip(stillpoint, original, annotated, stripped):
    subprocess.run([stillpoint, "strip", annotated, "-o", stripped, "--force", "-q"], check=True)
    assert stripped.read_bytes() == original.read_bytes(), f"{annotated}: strip does not give the original back"


main(Path(sys.argv[1]).resolve())
