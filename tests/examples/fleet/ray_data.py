"""The same as ray_tasks.py for those who have their listing as a dataset of Ray: map, group by sensor, reduce.

    pip install stillpoint 'ray[data]' boto3
    python ray_data.py s3://bucket/prefix/
"""

import json
import sys
import time

import ray

from ray_tasks import Passing, recordings, run_annotate, run_merge, sensor_of, sidecar_of

ATTEMPTS = 5


def patiently(work, *args):
    """Passing trouble is tried again here, since a dataset would fail as a whole; what stays is told in the row."""
    for attempt in range(ATTEMPTS):
        try:
            return work(*args)
        except Passing as trouble:
            error = str(trouble)
            time.sleep(2**attempt)
    return {"outcome": "passing", "error": error}


def pipeline(found, *options):
    """The manifest and the calibrations as two datasets."""

    def annotate(row):
        line = patiently(run_annotate, row["recording"], *options)
        return {
            "recording": row["recording"],
            "sensor": sensor_of(row["recording"]),
            "outcome": line["outcome"],
            "line": json.dumps(line),
        }

    def merge(rows):
        sensor = str(rows["sensor"][0])
        sidecars = [sidecar_of(str(recording)) for recording in rows["recording"]]
        return {"sensor": [sensor], "calibration": [json.dumps(patiently(run_merge, sensor, sidecars, *options))]}

    rows = ray.data.from_items([{"recording": recording} for recording in found])
    # A recording is a row, and a row is a task's work.
    manifest = rows.repartition(len(found)).map(annotate).materialize()
    usable = manifest.filter(lambda row: row["outcome"] in ("written", "skipped"))
    return manifest, usable.groupby("sensor").map_groups(merge, batch_format="numpy")


if __name__ == "__main__":
    outcomes, calibrations = pipeline(recordings(sys.argv[1]))
    with open("manifest.jsonl", "w") as file:
        file.writelines(row["line"] + "\n" for row in outcomes.take_all())
    for row in calibrations.take_all():
        print(row["calibration"])
