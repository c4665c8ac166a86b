"""What annotating costs, beside what else one could do with the same files, in one run on one machine.

    python3 tests/benches/throughput.py [--gigabytes 1] [--rounds 3] [--only zstd] [--memory] [--smoke]

Needs Rust and Python 3.11; the readers that are not ours are installed into target/bench. Makes its recordings in
$STILLPOINT_BENCH (target/bench by default) and removes them. Everything is read from the page cache, and nothing is
synced, but what `--in-place` always syncs. A ratio is that of medians; the order of the programs changes from round to
round. `--memory` compares the peak memory of 1 GB, of 8 GB, and of 150,000 chunks; `--smoke` tries everything on little
files and judges nothing.

A bound on the lead over another program holds where there is room for it: nothing that copies can be further ahead than
`cp`, and nothing that decodes what stands in every chunk further than the read of it, so where 1.2 times the slower of
the two leaves no such lead, that is the bound. Where there is an IMU alone, the work is decoding and learning, which a
copy or a read of it does not do; it is bounded beside Python decoding it.

`--sidecar` checks the CRC of every chunk, and so does "checked", the same read with that check. Where chunks are hardly
compressed, that is a third of the read: `--sidecar` takes 0.95 to 1.04 of the read with zstd, and 1.3 to 1.55 without
compression, run by run, but 0.78 to 0.86 and 0.96 to 1.14 of the checked one. So it is bounded by that one there, and
without compression, where there is nothing else to be done on a second core, by 1.2 times that one.
"""

import argparse
import os
import random
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KINDS = ["none", "lz4", "zstd", "frames", "imu"]
PYTHON = """
import sys
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
with open(sys.argv[1], "rb") as file:
    for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/imu/data"]):
        pass
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=KINDS, action="append")
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    if options.smoke:
        options.gigabytes, options.rounds = 0.01, 1
    folder = Path(os.environ.get("STILLPOINT_BENCH", ROOT / "target/bench")).resolve() / "recordings"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    tools = Tools(smoke=options.smoke)
    try:
        if options.memory:
            failed = memory(tools, folder, options)
        else:
            failed = [line for kind in options.only or KINDS for line in throughput(tools, folder, kind, options)]
    finally:
        shutil.rmtree(folder)
    for line in failed:
        print("over its bound:", line)
    sys.exit(1 if failed and not options.smoke else 0)


class Tools:
    """The programs, built and installed."""

    def __init__(self, smoke):
        profile = ["--release"] if not smoke else []
        cargo = ["cargo", "build", "--locked", "--quiet", *profile, "--bin", "stillpoint", "--bench", "throughput"]
        subprocess.run(cargo, cwd=ROOT, check=True)
        target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / ("debug" if smoke else "release")
        self.stillpoint = target / "stillpoint"
        benches = [p for p in (target / "deps").glob("throughput-*") if os.access(p, os.X_OK) and not p.suffix]
        self.bench = max(benches, key=lambda path: path.stat().st_mtime)
        self.python = Path(os.environ.get("STILLPOINT_PYTHON", ROOT / "target/bench/venv/bin/python"))
        if not self.python.exists():
            subprocess.run([sys.executable, "-m", "venv", self.python.parents[1]], check=True)
            packages = ["mcap", "mcap-ros2-support", "pymcap-cli"]
            subprocess.run([self.python, "-m", "pip", "install", "--quiet", *packages], check=True)

    def work(self, file, out):
        """Each name with its command; what it needs beforehand; what it leaves."""
        pymcap = self.python.parent / "pymcap-cli"
        annotate = [self.stillpoint, "annotate", "-q", file]
        return {
            "cp": ["cp", file, out],
            "read": [self.bench, "read", file],
            "checked": [self.bench, "check", file],
            "annotate": [*annotate, "-o", out],
            "sidecar": [*annotate, "--sidecar", "-o", out],
            "in place": [self.stillpoint, "annotate", "-q", "--in-place", out],
            "pymcap-cli": [pymcap, "--quiet", "filter", file, out, "--force"],
            "mcap::Writer": [self.bench, "rewrite", file, out],
            "Python mcap": [self.python, "-c", PYTHON, file],
        }


def run(command):
    """Wall, CPU seconds and peak memory in MiB."""
    start = time.monotonic()
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.monotonic() - start
    if status != 0:
        sys.exit(f"{command[:3]}: status {status}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def make(tools, kind, gigabytes, path):
    subprocess.run([tools.bench, "make", kind, str(int(gigabytes * 1e9)), path], check=True)
    with open(path, "rb") as file:
        while file.read(1 << 24):
            pass


def throughput(tools, folder, kind, options):
    file, out = folder / f"{kind}.mcap", folder / "out.mcap"
    # An IMU alone fills its gigabyte slowly: FACTS' recording of it has 29 MB.
    make(tools, kind, options.gigabytes * (0.06 if kind == "imu" else 1), file)
    work = tools.work(file, out)
    measured = {name: [] for name in work}
    for number in range(options.rounds + 1):
        names = list(work)
        random.Random(number).shuffle(names)
        for name in names:
            out.unlink(missing_ok=True)
            if name == "in place":
                shutil.copyfile(file, out)
            # What is still to be written to the disk of others must not slow this one down.
            os.sync()
            result = run(work[name])
            # The first round warms up.
            if number > 0 or options.smoke:
                measured[name].append(result)
    out.unlink(missing_ok=True)
    median = {name: [statistics.median(column) for column in zip(*results)] for name, results in measured.items()}
    size = file.stat().st_size
    file.unlink()

    print(f"\n{kind}: {size / 1e6:.0f} MB, medians of {options.rounds}", flush=True)
    print(f"{'':14}{'wall s':>9}{'CPU s':>9}{'MiB':>8}")
    for name, (wall, cpu, peak) in median.items():
        print(f"{name:14}{wall:9.3f}{cpu:9.3f}{peak:8.0f}")
    wall = {name: values[0] for name, values in median.items()}
    slower = max(wall["cp"], wall["read"])
    alone = kind == "imu"
    checked = {"none": 1.2, "zstd": 1.0}.get(kind)

    def lead(name, least):
        has_room = least and (alone or wall[name] / (1.2 * slower) >= least)
        return f"{name} / annotate", wall[name] / wall["annotate"], ">=", least if has_room else None

    bounds = [
        ("annotate / slower of cp and read", wall["annotate"] / slower, "<=", None if alone else 1.2),
        ("sidecar / read", wall["sidecar"] / wall["read"], "<=", None if alone or checked else 1.0),
        ("sidecar / checked", wall["sidecar"] / wall["checked"], "<=", checked),
        lead("pymcap-cli", 3.0),
        lead("mcap::Writer", None if alone else 3.5),
        lead("Python mcap", 30.0),
        ("MiB of annotate", median["annotate"][2], "<=", 64.0),
    ]
    failed = []
    for what, value, sense, bound in bounds:
        met = bound is None or (value <= bound if sense == "<=" else value >= bound)
        said = f"{sense} {bound}" if bound else ""
        print(f"  {what:36}{value:8.2f}   {said}{'' if met else '   NOT MET'}".rstrip())
        failed += [] if met else [f"{kind}: {what}: {value:.2f}, bound {bound}"]
    return failed


def memory(tools, folder, options):
    peaks = {}
    for name, kind, gigabytes in [("1 GB", "zstd", 1), ("8 GB", "zstd", 8), ("150,000 chunks", "small", 1)]:
        file, out = folder / "in.mcap", folder / "out.mcap"
        make(tools, kind, gigabytes * options.gigabytes, file)
        annotate = [tools.stillpoint, "annotate", "-q", "--force", file]
        runs = [run([*annotate, "-o", out]) for _ in range(options.rounds)]
        sidecars = [run([*annotate, "--sidecar", "-o", out]) for _ in range(options.rounds)]
        peaks[name] = [statistics.median(peak for *_, peak in runs) for runs in (runs, sidecars)]
        print(f"{name:16} annotate {peaks[name][0]:6.1f} MiB   --sidecar {peaks[name][1]:6.1f} MiB", flush=True)
        file.unlink()
        out.unlink()
    failed = []
    for form in (0, 1):
        values = [peak[form] for peak in peaks.values()]
        # Small chunks take less room than those of a megabyte that wait to be read: less is no growth.
        if any(value / values[0] > 1.1 for value in values):
            failed.append(f"peak memory: {values} MiB")
    return failed


main()
