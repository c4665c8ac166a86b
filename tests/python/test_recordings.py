"""Recordings on disk, beside the command on the same ones."""

import shutil
import signal
import threading
import time

import numpy as np
import pytest

import stillpoint
from conftest import TOPIC, readings


def test_annotate_writes_what_the_command_writes(demo, arrays, learned, tmp_path):
    recording = shutil.copy(demo, tmp_path)
    done = stillpoint.annotate(recording)
    assert done.output == tmp_path / "demo.annotated.mcap"
    assert done.output.read_bytes() == learned.output.read_bytes()
    assert done.is_new and not stillpoint.annotate(recording).is_new
    assert [imu.to_dict() for imu in done.calibrations] == [learned.imu]
    assert (done.messages, done.damages, done.notes) == (len(arrays.t), 0, [])
    sidecar = stillpoint.annotate(recording, sidecar=True).output
    assert sidecar.name == "demo.stillpoint.mcap"
    assert stillpoint.annotate(recording, in_place=True).output.read_bytes() == learned.output.read_bytes()


def test_read_gives_what_was_learned_whether_from_annotations_or_anew(demo, learned, tmp_path):
    sidecar = stillpoint.annotate(demo, tmp_path / "sidecar.mcap", sidecar=True).output
    for path in (demo, str(learned.output), sidecar):
        (imu,) = stillpoint.read(path)
        assert imu.to_dict() == learned.imu
        assert (imu.name, imu.topic) == (TOPIC, TOPIC)
        assert len(imu.rests) == 9 and len(imu.turns) == 8


def test_arrays_give_the_same_rests_and_turns_as_the_recording(arrays, learned):
    (imu,) = stillpoint.read(learned.output)
    other = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro, name=TOPIC)
    for ours, theirs in ((other.rests, imu.rests), (other.turns, imu.turns)):
        for field in ours.dtype.names:
            assert np.array_equal(ours[field], theirs[field], equal_nan=ours[field].dtype != object), field


def test_correct_gives_what_is_written_as_corrected(demo, arrays, tmp_path):
    done = stillpoint.annotate(demo, tmp_path / "corrected.mcap", settings={"output.corrected": "final"})
    written = readings(done.output, f"{TOPIC}/stillpoint/corrected")
    accel, gyro = done.calibrations[0].correct(arrays.accel, arrays.gyro)
    assert np.array_equal(accel, written.accel) and np.array_equal(gyro, written.gyro)


def test_merge_gives_what_the_command_gives(demo, learned, command):
    merged = stillpoint.merge([demo, learned.output])
    expected = command("merge", demo, learned.output, "--format", "json").json["imus"]
    assert [imu.to_dict() for imu in merged] == expected
    assert merged[0].key == TOPIC
    assert merged[0].history["recordings"] == 1
    (imu,) = stillpoint.merge((path for path in [demo]), by="frame-id")
    assert imu.key == "imu_link"


def test_errors_have_the_texts_of_the_command(demo, command, tmp_path):
    text = tmp_path / "text.mcap"
    text.write_text("no recording")
    taken = tmp_path / "taken.mcap"
    taken.write_text("something else")
    missing = tmp_path / "missing.mcap"
    for call, arguments, error in [
        (lambda: stillpoint.annotate(text), ("annotate", text), stillpoint.RecordingError),
        (lambda: stillpoint.annotate(missing), ("annotate", missing), FileNotFoundError),
        (lambda: stillpoint.annotate(demo, taken), ("annotate", demo, "-o", taken), FileExistsError),
        (
            lambda: stillpoint.annotate(demo, demo, force=True),
            ("annotate", demo, "-o", demo, "--force"),
            FileExistsError,
        ),
        (lambda: stillpoint.merge([demo], by="color"), ("merge", demo, "--by", "color"), ValueError),
        (lambda: stillpoint.read(text), ("export", text, "--format", "json"), stillpoint.RecordingError),
        (
            lambda: stillpoint.read(demo, settings={"fit.model": "x"}),
            ("export", demo, "--format", "json", "--set", 'fit.model="x"'),
            ValueError,
        ),
    ]:
        with pytest.raises(error) as raised:
            call()
        done = command(*arguments)
        assert done.returncode != 0
        assert done.stderr == f"error: {raised.value}\n"
    with pytest.raises(ValueError, match="in_place"):
        stillpoint.annotate(demo, taken, in_place=True)
    assert taken.read_text() == "something else"


def test_ctrl_c_ends_work(demo):
    # Where it is ignored, as in the background of a shell, Python leaves it so.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        stillpoint.merge([demo] * 100_000)
    signal.signal(signal.SIGINT, before)
    assert time.monotonic() - began < 10
