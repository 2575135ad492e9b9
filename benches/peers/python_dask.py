"""A planned run on two Dask workers beside the command; see python_dask.sh."""

import hashlib
import json
import os
import platform
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import distributed
import skysweep
import skysweep.dask
from distributed import Client

#: Settings of all runs: chunks as with a small machine's memory.
SETTINGS = {"gsd_m": 0.5, "memory_mb": 2000}
OPTIONS = ["--gsd", "0.5", "--memory", "2000"]
#: Runs of each kind, one after another in turn; the median counts.
RUNS = int(os.environ.get("SKYSWEEP_RUNS", "3"))
#: Chunks after which a worker is killed, in the middle of its next one.
KILLS = (1, 4)


def processor_s():
    """Processor time of this process and of its children that have ended, seconds."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def rasters(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(Path(folder, "dsm").glob("*.tif"))}


def timed(work):
    before, start = processor_s(), time.monotonic()
    result = work()
    return {"cpu_s": processor_s() - before, "wall_s": time.monotonic() - start, **result}


def by_command(command, images, folder):
    subprocess.run([command, "dsm", *images, "-o", folder, *OPTIONS, "--quiet"], check=True)
    return {}


def by_dask(images, folder, kills):
    plan = skysweep.Plan.make(images, folder, **SETTINGS)
    killed = []
    with skysweep.dask.local_cluster(plan, workers=2, silence_logs="CRITICAL") as cluster, Client(cluster) as client:

        def kill(step):
            if step.stage == "sweeping chunks" and len(killed) < len(kills) and step.done >= kills[len(killed)]:
                # Half of a chunk later, so that work is lost.
                time.sleep(0.5 * statistics.median(plan.cpu_seconds(chunk) for chunk in range(len(plan))))
                victim = sorted(client.run(os.getpid).values())[0]
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)

        report = skysweep.dask.run(plan, client, progress=kill)
    return {"chunks": len(plan), "killed": len(killed), "tried_again": sum(report.dask.tried_again.values())}


def main(results, command, *images):
    kinds = {
        "skysweep dsm": lambda folder: by_command(command, images, folder),
        "Dask": lambda folder: by_dask(images, folder, ()),
        "Dask, two workers killed": lambda folder: by_dask(images, folder, KILLS),
    }
    found, bytes_of = {kind: [] for kind in kinds}, {}
    with tempfile.TemporaryDirectory(prefix="skysweep") as scratch:
        for number in range(RUNS):
            for kind, run in kinds.items():
                folder = os.path.join(scratch, f"{number}_{len(bytes_of)}")
                found[kind].append(timed(lambda run=run, folder=folder: run(folder)))
                bytes_of[kind, number] = rasters(folder)
                print(kind, found[kind][-1], flush=True)
                subprocess.run(["rm", "-r", folder], check=True)
    first = bytes_of["skysweep dsm", 0]
    assert first, "no rasters"
    middle = {kind: {key: statistics.median(run[key] for run in runs) for key in runs[0]} for kind, runs in found.items()}
    base = middle["skysweep dsm"]["cpu_s"]
    report = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "distributed": distributed.__version__,
        "images": [Path(image).name for image in images],
        "runs": RUNS,
        "equal_bytes": all(hashes == first for hashes in bytes_of.values()),
        "rasters": len(first),
        "kinds": {kind: {**row, "cpu_to_command": row["cpu_s"] / base} for kind, row in middle.items()},
    }
    Path(results, "python_dask.json").write_text(json.dumps(report, indent=2) + "\n")
    turns = f"medians of {RUNS} runs in turn" if RUNS > 1 else "one run of each"
    lines = [
        "# A planned run on Dask beside the command",
        "",
        f"Written by `benches/peers/python_dask.sh`. {report['machine']}, distributed {report['distributed']}, two workers of",
        f"one thread. {', '.join(report['images'])} with `{' '.join(OPTIONS)}`, {turns}. Processor time is user and",
        "system time of all processes, the planning, the cluster's start and lost work included.",
        "",
        "| run | chunks | CPU, s | wall, s | CPU to the command | workers killed | chunks tried again |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind, row in report["kinds"].items():
        chunks = middle["Dask"]["chunks"]
        lines.append(
            f"| {kind} | {chunks:.0f} | {row['cpu_s']:.1f} | {row['wall_s']:.1f} | {row['cpu_to_command']:.3f} |"
            f" {row.get('killed', 0):.0f} | {row.get('tried_again', 0):.0f} |"
        )
    same = "the same bytes" if report["equal_bytes"] else "DIFFERENT BYTES"
    lines += ["", f"All runs have {same} in {report['rasters']} rasters.", ""]
    Path(results, "python_dask.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main(*sys.argv[1:])
