#!/usr/bin/env python3
"""Fits what Stillpoint fitted, from the rests that it published, with SciPy.

    refit.py STILLPOINT RECORDINGS

Every rest's mean, noise and placement stand in the Segment annotations, what placements scatter by in the Calibration.
From these alone `scipy.optimize.least_squares` refines ‖S⁻¹(m − b)‖ = g and `lsq_linear` regresses on the faces, and the
secondary on the primary, within the same bounds. Where the model has no word for the entries of S off the diagonal, these
are unknowns, too, held to zero by as much as is assumed of them. Both must find Stillpoint's parameters to 1e-6.
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from scipy.optimize import least_squares, lsq_linear

AGREE = 1e-6
# m/s²: fit.placement_std, what the first of two passes is weighted with.
ASSUMED = 0.01
# Standard deviation of an entry of S that bias-scale leaves out, of the primary and of a secondary beside it.
LEAK, MOUNTING = 0.01, 0.0363
HIGHG = 'imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]'
FACES = {"+X": 0, "-X": 0, "+Y": 1, "-Y": 1, "+Z": 2, "-Z": 2}


def main(stillpoint, recordings):
    nilspod = recordings / "nilspod_six_face.ros2.mcap"
    magnitude(Run(stillpoint, nilspod, ["fit.model=bias-scale"]), triangular=False)
    magnitude(Run(stillpoint, nilspod, ["fit.model=bias-scale", "fit.bounds.accel_scale=[1.0, 1.25]"]), triangular=False)
    magnitude(Run(stillpoint, recordings / "xsens_38_poses.ros2.mcap", ["fit.gravity=9.81744", "fit.model=triangular"]), triangular=True)
    magnitude(Run(stillpoint, recordings / "mpu9150_0_19_poses.ros2.mcap", ["fit.model=triangular"]), triangular=True)
    fixture(Run(stillpoint, nilspod, ["fit.model=bias-scale", "fit.estimator=fixture"]))
    fixture(Run(stillpoint, nilspod, ["fit.model=bias-scale", "fit.estimator=fixture", "fit.bounds.accel_bias=[-0.6, 0.6]"]))
    run = Run(stillpoint, nilspod, ["fit.model=bias-scale", HIGHG])
    secondary(run, cross_axis=False)
    secondary(Run(stillpoint, nilspod, ["fit.model=bias-scale", HIGHG.replace("acceleration", 'acceleration", model="cross-axis')]), cross_axis=True)


class Run:
    """One annotated recording: the calibration it ends with, and the rests it is made of."""

    def __init__(self, stillpoint, recording, settings):
        self.name = f"{recording.name} {' '.join(settings)}"
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out.mcap"
            command = [stillpoint, "annotate", recording, "-o", out, "--json", "-q"]
            for setting in settings:
                command += ["--set", setting]
            result = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
            self.imu = result["imus"][0]
            topic = self.imu["name"] + "/stillpoint/segment"
            segments = {}
            for record in read_ros2_messages(out, topics=[topic]):
                start = record.ros_msg.start
                segments[start.sec, start.nanosec] = record.ros_msg
        self.gravity = self.imu["gravity"]
        self.segments = list(segments.values())
        self.bounds = {"bias": (-8.0, 8.0), "scale": (0.8, 1.25)}
        for setting in settings:
            for key in self.bounds:
                if setting.startswith(f"fit.bounds.accel_{key}="):
                    self.bounds[key] = tuple(json.loads(setting.split("=", 1)[1]))
        assert not any("half a step" in note for note in self.imu["accelerometer"]["notes"]), "rounding is not refitted"

    def placements(self, accept):
        """Rests of one placement as one: mean, variance by noise, and face, of each sensor."""
        groups = {}
        for segment in self.segments:
            if accept(segment):
                groups.setdefault(segment.placement, []).append(segment)
        found = []
        for segments in groups.values():
            sensors = {}
            for name in {mean.sensor for segment in segments for mean in segment.means}:
                means = [mean for segment in segments for mean in segment.means if mean.sensor == name]
                weights = np.array([mean.effective_samples for mean in means])
                share = weights / weights.sum()
                values = np.array([vector(mean.mean) for mean in means])
                noise = np.array([np.diag(np.array(mean.covariance).reshape(3, 3)) for mean in means])
                noise = noise / np.maximum(weights, 1.0)[:, None]
                sensors[name] = share @ values, (share**2) @ noise
            found.append((sensors, segments[0].face))
        return found

    def compare(self, what, found, expected):
        off = np.abs(np.asarray(found) - np.asarray(expected)).max()
        print(f"{self.name}: {what}: {len(np.ravel(found))} parameters within {off:.1e}")
        if not off < AGREE:
            sys.exit(f"{self.name}: {what}: {found}, Stillpoint says {expected}")


def vector(v):
    return np.array([v.x, v.y, v.z])


def parameters(triad, entries):
    sensitivity = np.array(triad["sensitivity"])
    return np.concatenate([triad["bias"], [sensitivity[entry] for entry in entries]])


def calibration(x, entries):
    sensitivity = np.eye(3)
    for entry, value in zip(entries, x[3:]):
        sensitivity[entry] = value
    return x[:3], sensitivity


DIAGONAL = [(0, 0), (1, 1), (2, 2)]
TRIANGULAR = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)]
MATRIX = [(i, j) for i in range(3) for j in range(3)]
OFF_DIAGONAL = [(i, j) for i, j in MATRIX if i != j]


def limits(run, entries):
    kinds = [run.bounds["bias"]] * 3 + [run.bounds["scale"] if i == j else (-0.2, 0.2) for i, j in entries]
    return tuple(np.array(side) for side in zip(*kinds))


def magnitude(run, triangular):
    """Weights follow the solution, so they are taken where Stillpoint ended: least_squares must stay there."""
    entries = TRIANGULAR if triangular else DIAGONAL
    triad = run.imu["accelerometer"]
    expected = parameters(triad, entries)
    between = triad["placement_std"][0] ** 2
    seen = [sensors["accelerometer"] for sensors, _ in run.placements(lambda segment: segment.accepted)]

    def length(x, mean):
        bias, sensitivity = calibration(x, entries)
        return np.linalg.norm(np.linalg.solve(sensitivity, mean - bias))

    def linearised(mean, noise):
        bias, sensitivity = calibration(expected, entries)
        corrected = np.linalg.solve(sensitivity, mean - bias)
        by_measured = np.linalg.solve(sensitivity.T, corrected / np.linalg.norm(corrected))
        by_leaks = [] if triangular else [by_measured[i] * corrected[j] for i, j in OFF_DIAGONAL]
        return 1.0 / math.sqrt(by_measured**2 @ (noise + between)), np.array(by_leaks)

    lines = [linearised(mean, noise) for mean, noise in seen]
    count = len(expected)

    def residuals(x):
        own, leaks = x[:count], x[count:]
        off = [length(own, mean) - run.gravity - by_leaks @ leaks for (mean, _), (_, by_leaks) in zip(seen, lines)]
        return np.concatenate([[off * weight for off, (weight, _) in zip(off, lines)], leaks / LEAK])

    low, high = limits(run, entries)
    free = np.full(0 if triangular else len(OFF_DIAGONAL), np.inf)
    # From aside, and inside the bounds, where SciPy wants to start.
    start = np.concatenate([np.clip(expected + 0.01, low + 1e-3, high - 1e-3), np.zeros(len(free))])
    bounds = np.concatenate([low, -free]), np.concatenate([high, free])
    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "x_scale": "jac", "jac": "3-point", "max_nfev": 500}
    found = least_squares(residuals, start, bounds=bounds, method="dogbox", **tight).x
    run.compare("magnitude, by least_squares", found[:count], expected)


def design(truths, entries, axes=range(3)):
    """One row for each axis of each truth: by bias, then by the entries of S."""
    rows = []
    for truth in truths:
        for axis in axes:
            rows.append([float(axis == i) for i in range(3)] + [truth[j] if i == axis else 0.0 for i, j in entries])
    return np.array(rows)


def weighted(rows, targets, variances, bounds):
    weights = 1.0 / np.sqrt(variances)
    return lsq_linear(rows * weights[:, None], targets * weights, bounds=bounds, method="bvls", tol=1e-15).x


def fixture(run):
    """The component along the face of each placement, twice: what the tilts take is in the weights of the second pass."""
    triad = run.imu["accelerometer"]
    between = triad["placement_std"][0] ** 2
    seen = [(*sensors["accelerometer"], face) for sensors, face in run.placements(lambda segment: segment.accepted)]
    normals = [np.eye(3)[FACES[face]] * (1 if face[0] == "+" else -1) for *_, face in seen]
    rows = np.array([normal @ design([normal * run.gravity], DIAGONAL) for normal in normals])
    targets = np.array([normal @ mean for normal, (mean, *_) in zip(normals, seen)])
    noise = np.array([normal**2 @ noise for normal, (_, noise, _) in zip(normals, seen)])
    bounds = limits(run, DIAGONAL)
    first = weighted(rows, targets, noise + ASSUMED**2, bounds)
    bias, sensitivity = calibration(first, DIAGONAL)
    felt = [normal @ np.linalg.solve(sensitivity, mean - bias) for normal, (mean, *_) in zip(normals, seen)]
    lost = run.gravity - np.array(felt)
    found = weighted(rows, targets, noise + between + lost**2, bounds)
    run.compare("on the fixture, by lsq_linear", found, parameters(triad, DIAGONAL))


def secondary(run, cross_axis):
    """On the primary as Stillpoint calibrates it, twice: the sensitivity of the first pass weights the second."""
    entries = MATRIX if cross_axis else DIAGONAL
    triad = run.imu["secondary"][0]
    primary = run.imu["accelerometer"]
    bias, sensitivity = np.array(primary["bias"]), np.array(primary["sensitivity"])
    inverse = np.linalg.inv(sensitivity)
    at_rest = run.placements(lambda segment: segment.accepted or segment.reason == 1)
    seen = [(sensors["accelerometer"], sensors["highg"]) for sensors, _ in at_rest if "highg" in sensors]
    truths = [inverse @ (mean - bias) for (mean, _), _ in seen]
    rows = design(truths, entries)
    targets = np.concatenate([mean for _, (mean, _) in seen])

    leaks = [] if cross_axis else OFF_DIAGONAL
    by_leaks = np.array([[truth[j] if i == axis else 0.0 for i, j in leaks] for truth in truths for axis in range(3)])

    def variances(own, between):
        spread = [inverse @ np.diag(noise + primary["placement_std"][0] ** 2) @ inverse.T for (_, noise), _ in seen]
        return np.concatenate([noise + between + np.diag(own @ s @ own.T) for (_, (_, noise)), s in zip(seen, spread)])

    scale = (-2.0, 2.0) if cross_axis else (0.5, 2.0)
    bounds = tuple(np.array(side) for side in zip(*[(-20.0, 20.0)] * 3, *[scale] * len(entries)))
    # The leaks as further unknowns, each with a row that holds it to zero.
    count, free = rows.shape[1], np.full(len(leaks), np.inf)
    bounds = np.concatenate([bounds[0], -free]), np.concatenate([bounds[1], free])
    rows = np.block([[rows, by_leaks], [np.zeros((len(leaks), count)), np.eye(len(leaks))]])
    targets = np.concatenate([targets, np.zeros(len(leaks))])

    def solve(variances):
        return weighted(rows, targets, np.concatenate([variances, np.full(len(leaks), MOUNTING**2)]), bounds)[:count]

    first = solve(variances(np.eye(3), ASSUMED**2))
    found = solve(variances(calibration(first, entries)[1], triad["placement_std"][0] ** 2))
    run.compare("secondary, by lsq_linear", found, parameters(triad, entries))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
