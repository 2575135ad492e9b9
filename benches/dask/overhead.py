"""What Dask and the plan cost beside the work on the chunks; see overhead.sh."""

import json
import os
import platform
import statistics
import sys
import tempfile
import time
from pathlib import Path

import dask
import distributed
import skysweep
import skysweep.dask as cluster
from distributed import Client, LocalCluster
from skysweep import _jobs, _tasks
from skysweep.reports import ChunkRunReport, DsmReport

TOWN = Path(__file__).resolve().parents[2] / "data-samples" / "town"
VIEWS = [TOWN / "view_1.tif", TOWN / "view_3.tif"]
#: Chunks of the least size, on so fine a grid that there are 10,000 of them.
SETTINGS = {"gsd_m": 0.068, "preset": "fast", "height_range_m": [175.0, 270.0], "chunk": 64}
WORKERS = int(os.environ.get("SKYSWEEP_WORKERS", "1000"))
#: Each worker looks after its own machine twice a second. A thousand of them in one process would take it whole.
MONITORS = {"distributed.admin.system-monitor.interval": "60s", "distributed.worker.profile.enabled": False}
#: Repetitions of what takes milliseconds.
REPEATS = 20


def timed(work):
    """Result, wall time and processor time of all threads, seconds."""
    before, start = time.process_time(), time.monotonic()
    result = work()
    return result, time.monotonic() - start, time.process_time() - before


def without_work(folder, plan, chunk, threads):
    """In the place of a sweep."""
    return ChunkRunReport(chunks=1, computed=1, done_before=0, elsewhere=0, failed=[])


def without_merge(folder, plan, partial, overwrite, threads):
    return DsmReport(plan=plan)


def main(results):
    found = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "distributed": distributed.__version__,
        "workers": WORKERS,
    }
    with tempfile.TemporaryDirectory(prefix="skysweep") as scratch:
        folder = os.path.join(scratch, "run")
        plan, _, cpu_s = timed(lambda: skysweep.Plan.make(VIEWS, folder, **SETTINGS))
        chunks = len(plan)
        # Pointing and the grid are those of the scene, whatever the number of its chunks: few large ones stand for none.
        _, _, scene_cpu_s = timed(lambda: skysweep.make_plan(VIEWS, os.path.join(scratch, "once"), **{**SETTINGS, "chunk": 3000}))
        found |= {
            "chunks": chunks,
            "plan_bytes": os.path.getsize(os.path.join(folder, "plan.json")),
            "plan_cpu_s": cpu_s,
            "plan_ms_per_chunk": 1e3 * (cpu_s - scene_cpu_s) / chunks,
        }
        _jobs.run_chunks(folder, chunks="0", threads=1)
        _, wall_s, _ = timed(lambda: skysweep.Plan(folder))
        found["plan_read_s"] = wall_s
        asked = [timed(lambda: _jobs.run_chunks(folder, chunks="0", threads=1, plan=plan.id)) for _ in range(REPEATS)]
        assert all(report.done_before == 1 for report, _, _ in asked)
        found["checks_ms_per_chunk"] = 1e3 * statistics.median(cpu for _, _, cpu in asked)
        _tasks._sweep, cluster.merge_task = without_work, without_merge
        resources = {"MEMORY": 1e6 * max(plan.merge_mb, plan.content.estimate.peak_mb), "CPU": 1}
        start = time.monotonic()
        with dask.config.set(MONITORS), LocalCluster(
            n_workers=WORKERS,
            threads_per_worker=1,
            processes=False,
            dashboard_address=None,
            worker_dashboard_address=None,
            resources=resources,
            memory_limit=0,
            silence_logs="CRITICAL",
        ) as local, Client(local) as client:
            found["start_s"] = time.monotonic() - start
            print(json.dumps(found), flush=True)
            report, wall_s, cpu_s = timed(lambda: cluster.run(plan, client))
        assert report.dask.computed == chunks and not report.dask.failed
        found |= {"run_s": wall_s, "run_cpu_s": cpu_s, "run_ms_per_chunk": 1e3 * cpu_s / chunks}
    print(json.dumps(found), flush=True)
    Path(results, "dask_overhead.json").write_text(json.dumps(found, indent=2) + "\n")
    lines = [
        "# What Dask and the plan cost beside the work on the chunks",
        "",
        f"Written by `benches/dask/overhead.sh`. {found['machine']}, distributed {found['distributed']}. {WORKERS:,} workers with one thread",
        f"each, scheduler and client in one process; {chunks:,} chunks that are sent, claimed and answered, but not swept, and a merge that",
        "writes nothing. The workers share the processors with the scheduler, so a cluster takes less wall time. They measure the load of",
        "their machine once a minute instead of twice a second, because all of them measure the same one.",
        "",
        "| what | cost |",
        "|---|---|",
        f"| the run with all chunks, wall time | {found['run_s']:.1f} s |",
        f"| the run, processor time of client, scheduler and workers | {found['run_cpu_s']:.1f} s, {found['run_ms_per_chunk']:.1f} ms a chunk |",
        f"| checks of plan and inputs in a worker, processor time | {found['checks_ms_per_chunk']:.1f} ms a chunk |",
        f"| reading the plan of {found['plan_bytes'] / 1e6:.1f} MB in Python, once | {found['plan_read_s']:.2f} s |",
        f"| planning, processor time beside pointing and grid | {found['plan_ms_per_chunk']:.2f} ms a chunk |",
        f"| starting {WORKERS:,} workers in one process, not counted | {found['start_s']:.0f} s |",
        "",
    ]
    Path(results, "dask_overhead.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main(sys.argv[1])
