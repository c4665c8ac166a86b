"""Every system call fails once: faults.py STILLPOINT [--some N] [--only WAY] [--seed SEED]

Each way of working runs once undisturbed, and its calls that open, read, write, sync, lock, copy, cut, link, rename or
remove are counted. Then it runs once for each of them, in which that one fails (EIO, ENOSPC, EINTR, …) or does less than
it was asked for. What may come of that: the whole result; or an error that says what, with code 1 or 5, nothing under the
name of the result, and the recording as it was. The next run, undisturbed, must come to the undisturbed bytes and leave
nothing else behind. Without --some, all of it: some thousand runs. With it, so many at random.
"""

import argparse
import errno
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

# What each call may answer, apart from a short count.
READING = ["EIO", "EINTR", "ESTALE"]
WRITING = ["EIO", "ENOSPC", "EINTR", "EDQUOT"]
NAMING = ["EIO", "ENOSPC", "EACCES"]
ERRORS = {
    "read": READING, "pread64": READING, "readv": READING, "preadv": READING,
    "write": WRITING, "pwrite64": WRITING, "writev": WRITING, "pwritev": WRITING, "ftruncate": WRITING, "fallocate": WRITING,
    "copy_file_range": WRITING + ["EXDEV"], "sendfile": WRITING,
    "fsync": ["EIO", "ENOSPC", "EINTR"], "fdatasync": ["EIO", "ENOSPC", "EINTR"],
    "open": READING + ["EMFILE", "ENOSPC"], "openat": READING + ["EMFILE", "ENOSPC"],
    "rename": NAMING, "renameat": NAMING, "renameat2": NAMING, "link": NAMING, "linkat": NAMING,
    "unlink": ["EIO", "EACCES"], "unlinkat": ["EIO", "EACCES"], "mkdir": NAMING, "mkdirat": NAMING,
    "flock": ["EIO", "EINTR", "ENOLCK"], "fcntl": ["EIO"], "getdents64": ["EIO"],
}  # fmt: skip
# The same under their names in the C library. faults.c stands in front of it: it alone can shorten a call (strace would
# only pretend), and counts over all threads, where strace counts in each, so that with ever new threads none is the only one.
OF_LIBRARY = {
    "read": READING, "pread64": READING, "write": WRITING, "pwrite64": WRITING, "copy_file_range": WRITING,
    "open64": ERRORS["openat"], "fsync": ERRORS["fsync"], "fdatasync": ERRORS["fsync"], "ftruncate64": WRITING,
    "rename": NAMING, "unlink": ERRORS["unlink"], "flock": ERRORS["flock"],
}  # fmt: skip
# What belongs to the start of any program.
LOADER = re.compile(r"/etc/ld\.so|/usr/lib|/lib/|/lib64/|/proc/self/maps|/sys/fs/cgroup|/proc/self/cgroup|/usr/share|/etc/localtime")
PATIENCE = 45


class Way:
    """A way of working: the command, its result, and whether the recording itself is changed."""

    def __init__(self, name, command, result, setup=(), in_place=False, ends=None, killed=False):
        self.name, self.command, self.result = name, command, result
        self.setup, self.in_place, self.ends, self.killed = setup, in_place, ends, killed


WAYS = [
    Way("annotate", "annotate a.mcap -o out.mcap -q", "out.mcap"),
    Way("annotate-sync", "annotate a.mcap -o out.mcap -q --sync", "out.mcap"),
    Way("sidecar", "annotate --sidecar a.mcap -o out.stillpoint.mcap -q", "out.stillpoint.mcap"),
    Way("in-place", "annotate --in-place a.mcap -q", "a.mcap", in_place=True),
    Way("over", "annotate a.mcap -o out.mcap -q --force", "out.mcap", ["annotate b.mcap -o out.mcap -q"]),
    Way("same", "annotate a.mcap -o out.mcap -q", "out.mcap", ["annotate a.mcap -o out.mcap -q"]),
    Way("folder", "annotate bag -o out -q", "out"),
    Way("strip", "strip c.mcap -o out.mcap -q", "out.mcap", ["annotate a.mcap -o c.mcap -q"]),
    Way("tail", "tail a.mcap -o out.mcap -q --idle-timeout 300ms", "out.mcap"),
    Way("keep", "tail a.mcap -o out.mcap -q --idle-timeout 300ms --keep-sidecar", "out.mcap"),
    Way("resumed", "tail a.mcap -o out.mcap -q --idle-timeout 300ms", "out.mcap", killed=True),
    Way("merge", "merge a.mcap b.mcap --format json -o out.json -q", "out.json"),
    Way("export", "export a.mcap --format json -o out.json -q", "out.json"),
    Way("report", "report a.mcap -o out.html -q", "out.html"),
    Way("watch", "watch in --out-dir out --interval 50ms --idle-timeout 100ms", "out", ends="out/a.annotated.mcap"),
]  # fmt: skip


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("stillpoint", type=Path)
    parser.add_argument("--some", type=int)
    parser.add_argument("--only")
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    args = parser.parse_args()
    print(f"--seed {args.seed}", flush=True)
    random.seed(args.seed)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").exists() else None) as work:
        sweep = Sweep(args.stillpoint.resolve(), Path(work))
        ways = [way for way in WAYS if args.only in (None, way.name)]
        for way in ways:
            sweep.way(way, args.some and -(-args.some // len(ways)))
    print(f"{sweep.runs} calls failed, {len(sweep.problems)} exceptions")
    for problem in sweep.problems:
        print(f"  {problem}")
    sys.exit(1 if sweep.problems else 0)


class Sweep:
    def __init__(self, program, work):
        self.program, self.work = program, work
        self.runs, self.problems = 0, []
        self.library = work / "faults.so"
        source = Path(__file__).resolve().parent / "faults.c"
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", self.library, source, "-ldl"], check=True)
        for name, seed in (("a", 1), ("b", 2)):
            self.say(work, f"simulate demo -o {name}.mcap --set recording.seed={seed} --set recording.chunk_bytes=65536 -q")

    def say(self, folder, command):
        subprocess.run([self.program, *command.split()], cwd=folder, check=True, stdin=subprocess.DEVNULL)

    def fresh(self, way, name):
        """A folder with what the way of working starts from."""
        template = self.work / f"{way.name}.from"
        if not template.exists():
            self.prepare(way, template)
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        return Path(shutil.copytree(template, folder))

    def prepare(self, way, folder):
        folder.mkdir()
        needed = way.command.split() + " ".join(way.setup).split()
        for recording in ("a.mcap", "b.mcap"):
            if recording in needed:
                shutil.copy(self.work / recording, folder / recording)
        if "in" in needed:
            (folder / "in").mkdir()
            shutil.copy(self.work / "a.mcap", folder / "in/a.mcap")
        if "bag" in needed:
            (folder / "bag").mkdir()
            for n, recording in enumerate(("a.mcap", "b.mcap")):
                shutil.copy(self.work / recording, folder / f"bag/bag_{n}.mcap")
            (folder / "bag/metadata.yaml").write_text(BAG)
        for command in way.setup:
            self.say(folder, command)
        if way.killed:
            # Half way, as soon as there is something to go on from.
            whole = (folder / "a.mcap").read_bytes()
            (folder / "a.mcap").write_bytes(whole[: len(whole) * 2 // 3])
            command = [self.program, *way.command.replace("300ms", "60s").split()]
            process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL)
            checkpoints = lambda: [path for path in folder.glob("*.checkpoint") if path.stat().st_size > 2000]
            while not checkpoints():
                assert process.poll() is None
                time.sleep(0.05)
            process.kill()
            process.wait()
            with open(folder / "a.mcap", "ab") as file:
                file.write(whole[len(whole) * 2 // 3 :])

    def run(self, way, folder, before=(), environment=None):
        """Exit code and what was said. What has no end of its own is ended once its result is there."""
        command = [*before, self.program, *way.command.split()]
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=pipe, text=True,
            env={**os.environ, "NO_COLOR": "1", **(environment or {})}, start_new_session=True,
        )  # fmt: skip
        try:
            if way.ends:
                self.await_end(way, folder, process)
            said = process.communicate(timeout=PATIENCE)[1]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs", process.communicate()[1]
        return process.returncode, said

    def await_end(self, way, folder, process):
        """Ends what has no end of its own once its result is there, and nothing beside it, or after a while."""
        there = 0
        for _ in range(PATIENCE * 20):
            try:
                process.wait(0.05)
                return
            except subprocess.TimeoutExpired:
                there += (folder / way.ends).exists()
                beside = any("stillpoint" in path.name for path in (folder / way.result).rglob("*"))
                # Not before it listens for signals.
                if there > 10 and not beside or there > 60:
                    os.killpg(process.pid, signal.SIGTERM)
                    return

    def way(self, way, some):
        reference = self.fresh(way, "reference")
        before = snapshot(reference)
        code, said = self.run(way, reference)
        assert code == 0, f"{way.name}: {code} {said}"
        after = snapshot(reference)
        if way.in_place:
            assert after != before
        faults = self.faults(way)
        total = len(faults)
        if some is not None:
            faults = random.sample(faults, min(some, total))
        bad = len(self.problems)
        for fault in faults:
            self.runs += 1
            self.fault(way, fault, before, after)
        print(f"{way.name}: {len(faults)} of {total} faults, {len(self.problems) - bad} exceptions", flush=True)

    def faults(self, way):
        """Every fault of every call that the undisturbed run makes: (by which means, call, what, which one)."""
        folder, log = self.fresh(way, "counted"), self.work / "calls"
        log.write_text("")
        self.run(way, folder, environment={"LD_PRELOAD": str(self.library), "FAULT_COUNTS": str(log)})
        counts, faults = Counter(), []
        for line in log.read_text().splitlines():
            call, *short = line.split()
            counts[call] += 1
            errors = OF_LIBRARY[call] if way.ends else []
            faults += [("library", call, what, counts[call]) for what in [*errors, *short]]
        return faults if way.ends else faults + self.traced(way)

    def traced(self, way):
        folder, trace = self.fresh(way, "counted"), self.work / "trace"
        calls = ",".join(f"?{call}" for call in ERRORS)
        self.run(way, folder, ["strace", "-f", "-y", "-qq", "-o", trace, "-e", f"trace={calls}"])
        counts, loading, most = Counter(), set(), Counter()
        for line in trace.read_text(errors="replace").splitlines():
            found = re.match(r"(\d+) +(\w+)\((.*)", line)
            if not found or found[2] not in ERRORS:
                continue
            thread, call, rest = found.groups()
            counts[thread, call] += 1
            n = counts[thread, call]
            most[call] = max(most[call], n)
            if LOADER.search(rest.split("=")[0]) or call == "fcntl" and "LK" not in rest:
                loading.add((call, n))
        return [
            ("strace", call, error, n)
            for call, last in most.items() for n in range(1, last + 1) if (call, n) not in loading for error in ERRORS[call]
        ]  # fmt: skip

    def fault(self, way, fault, before, after):
        means, call, what, n = fault
        folder = self.fresh(way, "faulty")
        if means == "library":
            number = 0 if what == "short" else getattr(errno, what)
            code, said = self.run(way, folder, environment={"LD_PRELOAD": str(self.library), "FAULT": f"{call}:{n}:{number}"})
        else:
            inject = f"inject={call}:error={what}:when={n}"
            code, said = self.run(way, folder, ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={call}", "-e", inject])
        found = snapshot(folder)
        wrong = self.judge(way, code, said, found, before, after, what)
        code, again = self.run(way, folder)
        at_last = snapshot(folder)
        if wrong is None and code != 0:
            wrong = f"the next run: {code} {again.strip()}"
        if wrong is None and at_last != after:
            wrong = f"the next run leaves {differences(at_last, after)}"
        if wrong:
            self.problems.append(f"{way.name}, {call} {what} {n}: {wrong}")
            print(f"  {self.problems[-1]}", flush=True)

    def judge(self, way, code, said, found, before, after, what):
        """What is wrong with the end of a disturbed run, if anything is."""
        if "failed to wake I/O driver" in said:
            # Between two threads of tokio's, where there is no device.
            return None
        if "panicked" in said or code in ("hangs", 101) or isinstance(code, int) and code < 0:
            return f"{code} {said.strip()}"
        if code not in (0, 1, 5) and not (way.ends and code in (-15, 143)):
            return f"code {code}: {said.strip()}"
        of_result = {name: bytes for name, bytes in found.items() if (name + "/").startswith(way.result + "/")}
        if way.ends:
            # It is ended as soon as that is there; what it could not remove is the next run's.
            of_result = {name: bytes for name, bytes in of_result.items() if name == way.ends}
        whole = {name: bytes for name, bytes in after.items() if (name + "/").startswith(way.result + "/")}
        old = {name: bytes for name, bytes in before.items() if (name + "/").startswith(way.result + "/")}
        if code == 0 and of_result != whole:
            return f"code 0 without the whole result: {differences(of_result, whole)}"
        if code != 0 and not re.search(r"(?m)^(error|fatal)", said):
            return f"code {code} without a word: {said.strip()}"
        if code != 0 and of_result not in (whole, old) and not (way.in_place and "repair" in said or way.ends):
            return f"code {code}, and the result is half there: {differences(of_result, whole)}; {said.strip()}"
        if code == 1 and what in ("EIO", "ENOSPC", "EINTR", "ESTALE", "EDQUOT", "EMFILE"):
            return f"code 1 for trouble that passes: {said.strip()}"
        for name, bytes in before.items():
            # What is not the recording itself is the tail's own.
            if name not in whole and "stillpoint" not in name and found.get(name) != bytes:
                return f"{name} is another one"
        return None


def snapshot(folder):
    """Names and bytes of all files in a folder, hidden ones, too."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def differences(found, expected):
    names = sorted(found.keys() | expected.keys())
    tell = lambda name: "missing" if name not in found else "too much" if name not in expected else "different"
    return ", ".join(f"{name} {tell(name)}" for name in names if found.get(name) != expected.get(name))


BAG = """rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  duration:
    nanoseconds: 1
  starting_time:
    nanoseconds_since_epoch: 1
  message_count: 0
  topics_with_message_count: []
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - bag_0.mcap
    - bag_1.mcap
"""

if __name__ == "__main__":
    main()
