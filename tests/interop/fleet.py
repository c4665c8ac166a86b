#!/usr/bin/env python3
"""A fleet in an object store, annotated by Ray on three local nodes, of which one is killed half-way.

    fleet.py STILLPOINT [--long]

STILLPOINT was built with the feature `object-store`. The recordings are of simulated sensors that drift; two are dropped, one
is exchanged, and some recordings are damaged. `--long`: 500 recordings of 25 sensors; else 24 of 6.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "tests/examples/fleet"
sys.path.insert(0, str(EXAMPLES))
# For the workers, too.
os.environ["PYTHONPATH"] = str(EXAMPLES)
os.environ["RAY_ENABLE_UV_RUN_RUNTIME_ENV"] = "0"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import ray
from ray.cluster_utils import Cluster

from store_server import BUCKET, Store

stillpoint = str(Path(sys.argv[1]).resolve())
SENSORS, EACH, BAD = (25, 20, 5) if "--long" in sys.argv else (6, 4, 3)
FACES = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"]
DAY = 86_400
folder = Path(tempfile.mkdtemp())
store = Store()
store.proxy.trouble = lambda request: None
os.environ.update(store.environment())


def bias_of(sensor, day):
    """True bias of the accelerometer in m/s²: it drifts; two sensors get a shock, one is exchanged."""
    bias = [0.2 + 0.01 * sensor, -0.1, 0.3 - 0.01 * sensor]
    bias = [value + 0.0005 * day for value in bias]
    if sensor in (1, 2) and day >= EACH // 2:
        bias = [value + 0.15 for value in bias]
    if sensor == 3 and day >= EACH // 2:
        bias = [-0.3, 0.25, -0.2]
    return bias


def scenario(sensor, day):
    """Two faces each, all six within three recordings."""
    faces = [FACES[(2 * (day % 3) + i) % 6] for i in range(2)]
    poses = "".join(f'[[pose]]\nface = "{face}"\nrest_s = 2.5\n' for face in faces)
    return f"""tilt_scatter_deg = 1.0
[recording]
seed = {1 + 1000 * sensor + day}
start_s = {1_700_000_000 + DAY * day}
[accelerometer]
rate_hz = 100
bias = {bias_of(sensor, day)}
noise = 0.02
[gyroscope]
rate_hz = 100
noise = 0.002
[motion]
duration_s = 1.0
start_s = 0.6
end_s = 0.6
{poses}"""


def local(*args, stdin=None):
    done = subprocess.run([stillpoint, *map(str, args)], capture_output=True, text=True, input=stdin)
    assert done.returncode in (0, 3), done.stderr
    return done.stdout


print(f"== {SENSORS * EACH} recordings of {SENSORS} sensors, {BAD} of them damaged", flush=True)
expected, bad = {}, {}
for number in range(SENSORS * EACH):
    sensor, day = divmod(number, EACH)
    name = f"{sensor:02}/{day:02}.mcap"
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    (folder / "scenario.toml").write_text(scenario(sensor, day))
    local("simulate", folder / "scenario.toml", "-o", path, "-q")
    content = path.read_bytes()
    # The first of them can still be used, the others not at all.
    if number % (SENSORS * EACH // BAD) == 1:
        kind = len(bad)
        content = [content[:-40], b"", b"no recording at all, and longer than its magic"][kind % 3]
        path.write_bytes(content)
        bad[name] = kind % 3
    store.put(f"in/{name}", content)
    if bad.get(name, 0) == 0:
        local("annotate", path, "--sidecar", "-q")
        expected[name] = path.with_suffix(".stillpoint.mcap").read_bytes()

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
doomed = cluster.add_node(num_cpus=1)
cluster.add_node(num_cpus=1)
ray.init(address=cluster.address, log_to_driver=False)

import ray_tasks

found = ray_tasks.recordings(f"s3://{BUCKET}/in/", store.client)
assert len(found) == SENSORS * EACH


def kill_half_way():
    while len(store.keys("in/")) < 1.4 * len(found):
        time.sleep(0.05)
    print(f"  a node is killed at {len(store.keys('in/')) - len(found)} of {len(found)}", flush=True)
    cluster.remove_node(doomed, allow_graceful=False)


print("== Annotated by tasks", flush=True)
killer = threading.Thread(target=kill_half_way)
killer.start()
began = time.monotonic()
manifest = ray_tasks.annotate_all(found, stillpoint)
killer.join()
print(f"  {time.monotonic() - began:.1f} s")
outcomes = {line["input"].split("/in/")[1]: line for line in manifest}
assert len(outcomes) == len(found)
hopeless = {name: line["error"] for name, line in outcomes.items() if line["outcome"] == "hopeless"}
assert set(hopeless) == {name for name, kind in bad.items() if kind > 0}, hopeless
for name, error in hopeless.items():
    print(f"  hopeless: {error}")
for name, sidecar in expected.items():
    assert outcomes[name]["outcome"] in ("written", "skipped"), outcomes[name]
    assert store.get(f"in/{name.removesuffix('.mcap')}.stillpoint.mcap") == sidecar, name

print("== The second run skips all", flush=True)
again = ray_tasks.annotate_all(found, stillpoint)
assert {line["outcome"] for line in again} == {"skipped", "hopeless"}

print("== One calibration per sensor", flush=True)
for calibration in ray_tasks.merge_all(again, stillpoint):
    sensor = calibration["sensor"]
    sidecars = [folder / name.replace(".mcap", ".stillpoint.mcap") for name in sorted(expected) if name.startswith(sensor)]
    here = json.loads(local("merge", *sidecars, "--format", "json", "--accept-damage"))
    assert calibration["imus"] == here["imus"], sensor
    changes = calibration["imus"][0]["history"]["changes"]
    if "--long" in sys.argv:
        assert len(changes) == (int(sensor) in (1, 2, 3)), (sensor, changes)
    if changes:
        print(f"  {sensor}: {changes[0]['kind'] if 'kind' in changes[0] else changes[0]}")

try:
    import ray_data
except ImportError as missing:
    print(f"== Skipped, the dataset of Ray: {missing}")
else:
    print("== As a dataset", flush=True)
    rows, calibrations = ray_data.pipeline(found, stillpoint)
    assert {row["outcome"] for row in rows.take_all()} == {"skipped", "hopeless"}
    calibrations = {row["sensor"]: json.loads(row["calibration"]) for row in calibrations.take_all()}
    for calibration in ray_tasks.merge_all(again, stillpoint):
        assert calibrations[calibration["sensor"]] == calibration

ray.shutdown()
cluster.shutdown()
store.stop()
print("all as it should be")
