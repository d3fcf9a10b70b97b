"""What a cluster engine costs, and that it loses nothing.

    python python/tests/cluster_proof.py [--runs 2000] [--aircraft coax2d] [--only cluster,...]

Not part of pytest, because it takes its time. Flies one study in several ways and
compares the rows of all:

one        in this process, on one thread
cluster    on a Dask LocalCluster of two processes, undisturbed
disturbed  the same, with a worker killed after a quarter, scheduler and workers
           gone after a half, and a new cluster that goes on from the dataset
ray        on two processors of Ray, where it is installed

For the first two the script measures the processor time of every process that takes
part, once the workers are up; their difference is the overhead.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import coaxdesign as cx
from coaxdesign.montecarlo import Study

ROOT = Path(__file__).resolve().parents[2]
HOLD = 'title = "A second of hover"\nduration = "1 s"\nmode = "velocity"\n'
DOUBLET = """
title = "Doublet"
duration = "2 s"
mode = "open_loop"
[inputs.doublet]
stick = "lat"
shape = "doublet"
start = "1 s"
amplitude = "1 %"
unit = "0.2 s"
"""


class Stop(Exception):
    """Raised in the middle."""


def local(n_workers: int = 2) -> Any:
    import distributed

    return distributed.LocalCluster(
        n_workers=n_workers, threads_per_worker=1, processes=True, dashboard_address=None
    )


def processor_time() -> float:
    """Processor time of this process and all below it, s."""
    import psutil

    own = psutil.Process()
    total = 0.0
    for process in [own, *own.children(recursive=True)]:
        times = process.cpu_times()
        total += times.user + times.system
    return total


def same(name: str, rows: cx.MonteCarlo, expected: cx.MonteCarlo) -> None:
    assert rows.columns == expected.columns, name
    for column in expected:
        np.testing.assert_array_equal(rows[column], expected[column], err_msg=f"{name}: {column}")
    print(f"{name}: the {len(rows)} rows of one process", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--aircraft", choices=["coax2d", "hummingbird"], default="hummingbird")
    parser.add_argument("--maneuver", default="hold")
    parser.add_argument("--only", default="cluster,disturbed,ray")
    options = parser.parse_args()
    ways = options.only.split(",")
    schedule: cx.Schedule | None = None
    if options.aircraft == "hummingbird":
        # A multicopter that nothing flies: the cheapest runs there are.
        problem = cx.Problem.load(ROOT / "problems" / "hummingbird.toml")
        maneuver = DOUBLET
    else:
        problem = cx.Problem.load("coax2d")
        schedule = cx.Schedule.load(ROOT / "designs" / "coax2d")
        maneuver = HOLD if options.maneuver == "hold" else options.maneuver
    runs: int = options.runs
    home = Path(tempfile.mkdtemp(prefix="coaxdesign-proof-"))
    figures: dict[str, float] = {"runs": runs}

    def fly(**more: Any) -> cx.MonteCarlo:
        return cx.montecarlo(problem, schedule, maneuver, runs=runs, seed=1, **more)

    def here() -> cx.MonteCarlo:
        study = Study(
            problem,
            schedule,
            cx.Maneuver.load(maneuver),
            cx.Variation(),
            {
                "control_rate": 100.0,
                "steps_per_revolution": 36,
                "pitch_rate_limit": None,
                "seed": 1,
            },
            runs,
            cx.Ranges(),
            cx.Criterion(),
        )
        rows = study.fly(range(runs), threads=1)
        return cx.MonteCarlo(rows, study.head, len(rows))

    begin = processor_time()
    expected = here()
    figures["one_cpu_s"] = processor_time() - begin
    figures["run_cpu_s"] = figures["one_cpu_s"] / runs
    print(f"one: {figures['one_cpu_s']:.1f} s of processor time", flush=True)

    if "cluster" in ways:
        import distributed

        with local() as cluster, distributed.Client(cluster) as client:
            client.wait_for_workers(2)
            begin, clock = processor_time(), time.monotonic()
            rows = fly(client=client, out=home / "cluster")
            figures["cluster_cpu_s"] = processor_time() - begin
            figures["cluster_wall_s"] = time.monotonic() - clock
        same("cluster", rows, expected)
        overhead = figures["cluster_cpu_s"] - figures["one_cpu_s"]
        figures["overhead_percent"] = 100.0 * overhead / figures["one_cpu_s"]
        figures["overhead_ms_per_run"] = 1000.0 * overhead / runs
        files = list((home / "cluster").rglob("*.parquet"))
        figures["bytes_per_run"] = sum(f.stat().st_size for f in files) / runs

    if "disturbed" in ways:
        import distributed

        killed: list[int] = []

        def disturb(done: int, total: int) -> None:
            if not killed and done > total // 4:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], getattr(signal, "SIGKILL", signal.SIGTERM))
            if done > total // 2:
                raise Stop

        try:
            with local() as cluster, distributed.Client(cluster) as client:
                client.wait_for_workers(2)
                fly(client=client, out=home / "disturbed", progress=disturb)
        except Stop:
            pass
        with local() as cluster, distributed.Client(cluster) as client:
            rows = fly(client=client, out=home / "disturbed")
        assert killed and 0 < rows.flown < runs
        print(f"disturbed: {rows.flown} of {runs} were missing after the restart", flush=True)
        same("disturbed", rows, expected)

    if "ray" in ways:
        try:
            import ray
        except ImportError:
            print("SKIPPED: ray is not installed")
        else:
            ray.init(num_cpus=2, include_dashboard=False, logging_level="error")
            try:
                same("ray", fly(client=ray, out=home / "ray"), expected)
            finally:
                ray.shutdown()

    shutil.rmtree(home)
    json.dump(figures, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
