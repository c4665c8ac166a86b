"""Arrays in, calibrations out."""

import logging
import threading
import time

import numpy as np
import pytest

import stillpoint
from conftest import TOPIC


def test_the_result_is_the_commands_to_the_last_bit(arrays, learned, command):
    calibration = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro, name=TOPIC)
    assert calibration.to_dict() == learned.imu
    exported = command("export", learned.output, "--format", "json").json
    assert exported["imus"] == [calibration.to_dict()]


@pytest.mark.parametrize("length", [1, 77, 100_000])
def test_blocks_of_any_length_give_the_same(arrays, length):
    whole = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro)
    engine = stillpoint.Engine()
    assert engine.state == "UNKNOWN"
    for i in range(0, len(arrays.t), length):
        engine.push(arrays.t[i : i + length], arrays.accel[i : i + length], arrays.gyro[i : i + length])
    assert engine.state in ("MOVING", "STILL")
    seen = len(engine.calibration.rests)
    assert engine.finish().to_dict() == whole.to_dict()
    assert seen <= len(whole.rests)
    assert np.array_equal(engine.calibration.rests["start"], whole.rests["start"])
    with pytest.raises(ValueError, match="finished"):
        engine.push(arrays.t, arrays.accel)


def test_sensors_that_are_read_one_by_one(arrays):
    engine = stillpoint.Engine()
    for i in range(0, len(arrays.t), 5):
        engine.push(arrays.t[i : i + 5], accel=arrays.accel[i : i + 5])
        engine.push(arrays.t[i : i + 5], gyro=arrays.gyro[i : i + 5])
    calibration = engine.finish()
    whole = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro)
    # Where a rest begins may differ by a block.
    assert len(calibration.rests) == len(whole.rests)
    for ours, expected in ((calibration.accelerometer, whole.accelerometer), (calibration.gyroscope, whole.gyroscope)):
        assert (np.abs(ours.bias - expected.bias) < expected.bias_std).all()


def test_an_accelerometer_alone(arrays):
    calibration = stillpoint.calibrate(arrays.t, arrays.accel)
    assert calibration.is_calibrated
    assert calibration.gyroscope.status == "UNDETERMINED"
    assert calibration.gyroscope.bias is None
    assert np.isnan(calibration.rests["gyro"]).all()


def test_other_layouts_and_times_of_the_same_numbers_give_the_same(arrays):
    t, accel, gyro = arrays.t, arrays.accel, arrays.gyro
    expected = stillpoint.calibrate(t, accel, gyro).to_dict()
    wide = np.zeros((len(t), 8))
    wide[:, 1:4], wide[:, 4:7] = accel, gyro
    for other in [
        (t, wide[:, 1:4], wide[:, 4:7]),
        (t, np.asfortranarray(accel), np.asfortranarray(gyro)),
        (t, accel.astype(">f8"), gyro.tolist()),
        (t.astype("datetime64[ns]"), accel, gyro),
        (t.astype("uint64"), accel, gyro),
        (t.tolist(), accel, gyro),
    ]:
        assert stillpoint.calibrate(*other).to_dict() == expected
    # Seconds since 1970 are stamps to a quarter of a microsecond, those since the beginning to less than a nanosecond.
    seconds = stillpoint.calibrate(t * 1e-9, accel, gyro)
    bias, std = (np.array(expected["accelerometer"][key]) for key in ("bias", "bias_std"))
    assert (np.abs(seconds.accelerometer.bias - bias) < 0.1 * std).all()
    since = stillpoint.calibrate((t - t[0]) * 1e-9, accel, gyro)
    assert since.to_dict() == expected


def test_units_are_converted(arrays):
    expected = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro)
    other = stillpoint.calibrate(
        arrays.t, arrays.accel / 9.80665, np.rad2deg(arrays.gyro), accel_unit="g", gyro_unit="deg/s"
    )
    np.testing.assert_allclose(other.accelerometer.bias, expected.accelerometer.bias, rtol=1e-9)
    np.testing.assert_allclose(other.gyroscope.bias, expected.gyroscope.bias, rtol=1e-9)


def test_what_was_learned_is_near_the_truth_and_typed(arrays):
    calibration = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro, settings={"fit": {"gravity": 9.80665}})
    triad = calibration.accelerometer
    assert (triad.sensor, triad.model, triad.status) == ("accelerometer", "bias-scale", "PROVISIONAL")
    assert (np.abs(triad.bias - [0.255, -0.142, 0.31]) < 3 * triad.bias_std).all()
    assert triad.sensitivity.shape == (3, 3)
    assert np.isnan(triad.sensitivity_std[0, 1])
    assert triad.g_sensitivity is None
    assert calibration.gravity == 9.80665
    assert calibration.reason is None
    assert calibration.next_step
    assert calibration.key is None and calibration.history is None
    rests = calibration.rests
    assert len(rests) == 9 and rests["accepted"].all()
    assert set(rests["face"]) == {"+X", "-X", "+Y", "-Y", "+Z", "-Z"}
    assert (np.diff(rests["start"]) > 0).all() and (rests["end"] > rests["start"]).all()
    assert rests["accel"].shape == (9, 3) and rests["accel"].dtype == np.float64
    assert len(calibration.turns) == 8
    np.testing.assert_allclose(np.linalg.norm(calibration.turns["axis"], axis=1), 1)
    assert repr(calibration) == "<Calibration imu: accelerometer PROVISIONAL, gyroscope CONFIRMED, 9 rests>"


def test_nothing_learned_is_no_error():
    calibration = stillpoint.calibrate(np.zeros(0, "int64"), np.zeros((0, 3)))
    assert not calibration.is_calibrated
    assert calibration.reason == "no rest was found"
    assert len(calibration.rests) == len(calibration.turns) == 0
    with pytest.raises(ValueError, match="the accelerometer cannot be corrected: no rest was found"):
        calibration.correct(np.zeros(3))


def test_readings_are_corrected_in_their_own_shape(arrays):
    calibration = stillpoint.calibrate(arrays.t, arrays.accel, arrays.gyro)
    inverse = np.linalg.inv(calibration.accelerometer.sensitivity)
    expected = (arrays.accel - calibration.accelerometer.bias) @ inverse.T
    accel, gyro = calibration.correct(arrays.accel, arrays.gyro)
    np.testing.assert_allclose(accel, expected, atol=1e-12)
    np.testing.assert_allclose(gyro, arrays.gyro - calibration.gyroscope.bias, atol=1e-15)
    assert np.array_equal(calibration.correct(gyro=arrays.gyro), gyro)
    assert np.array_equal(calibration.correct(arrays.accel[5]), accel[5])
    assert np.array_equal(calibration.correct(arrays.accel[:6].reshape(2, 3, 3)), accel[:6].reshape(2, 3, 3))
    accel[0] = 0  # a new array, which may be changed


def test_readings_that_are_not_finite_are_left_out_and_that_is_said(arrays, caplog):
    accel = arrays.accel.copy()
    accel[100] = np.nan
    with caplog.at_level(logging.WARNING, "stillpoint"):
        calibration = stillpoint.calibrate(arrays.t, accel, arrays.gyro)
    assert calibration.is_calibrated
    assert "imu, accelerometer: 1 reading is NaN, infinite, or beyond what any sensor reads, and left out" in caplog.messages


@pytest.mark.parametrize(
    ("arguments", "settings", "error", "text"),
    [
        (([0], [[1, 2]]), {}, ValueError, r"accel: expected an array of shape (1, 3), has (1, 2)"),
        (([0], [[1, 2, 3]], [1, 2, 3]), {}, ValueError, r"gyro: expected an array of shape (1, 3), has (3,)"),
        (([[0]], [[1, 2, 3]]), {}, ValueError, r"t: expected an array of shape (n,), has (1, 1)"),
        (([0.0, np.nan], [[1, 2, 3]] * 2), {}, ValueError, "t: the time of row 1 is not finite"),
        ((["a"], [[1, 2, 3]]), {}, TypeError, "t: expected int64 nanoseconds, float64 seconds, or datetime64, has dtype"),
        (([0], [["a", "b", "c"]]), {}, TypeError, "accel: expected real numbers, has dtype"),
        (([0], [[1, 2, 3]]), {"preset": "mpu9251"}, ValueError, "mpu9251"),
        (([0], [[1, 2, 3]]), {"gyro_unit": "rpm"}, ValueError, "gyro_unit: unknown variant `rpm`"),
        (
            ([0], [[1, 2, 3]]),
            {"settings": {"still": {"window": 1}}},
            ValueError,
            "--set still.window=1: `still.window`: no such key `window`; did you mean `window_s`?",
        ),
        (([0], [[1, 2, 3]]), {"config": "missing.toml"}, FileNotFoundError, "missing.toml: cannot read the configuration"),
    ],
)
def test_mistakes_are_named(arguments, settings, error, text):
    with pytest.raises(error) as raised:
        stillpoint.calibrate(*arguments, **settings)
    assert text in str(raised.value)


def test_settings_may_be_dotted_nested_or_a_file(arrays, tmp_path):
    path = tmp_path / "stillpoint.toml"
    path.write_text("[fit]\ngravity = 9.81\n[fit.bounds]\naccel_bias = [-1, 1]\n")
    t, accel, gyro = arrays.t, arrays.accel, arrays.gyro
    expected = stillpoint.calibrate(t, accel, gyro, config=path).to_dict()
    assert expected["gravity"] == 9.81
    nested = {"fit": {"gravity": 9.81, "bounds": {"accel_bias": [-1, 1]}}}
    assert stillpoint.calibrate(t, accel, gyro, settings=nested).to_dict() == expected
    dotted = {"fit.gravity": 9.81, "fit.bounds.accel_bias": [-1, 1]}
    assert stillpoint.calibrate(t, accel, gyro, settings=dotted).to_dict() == expected
    over = stillpoint.calibrate(t, accel, gyro, config=path, settings={"fit.gravity": 9.8})
    assert over.gravity == 9.8


def test_other_threads_run_meanwhile():
    rng = np.random.default_rng(1)
    n = 400_000
    t, accel = np.arange(n) * 1_000_000, rng.normal([0, 0, 9.81], 0.02, (n, 3))
    work = threading.Thread(target=stillpoint.calibrate, args=(t, accel, accel * 0.001))
    work.start()
    gaps, last = [], time.perf_counter()
    while work.is_alive():
        time.sleep(0.001)
        gaps.append(time.perf_counter() - last)
        last += gaps[-1]
    work.join()
    assert len(gaps) > 10 and np.median(gaps) < 0.05
