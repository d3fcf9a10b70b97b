"""Flies a small study by every recipe of examples/cluster whose tool is here, and compares.

    cluster.py PROGRAM [SNAKEMAKE]

The joined file of every recipe must be that of one process, byte for byte. A
recipe whose tool is missing is skipped, and said. Slurm runs with daemons of
its own, on this machine, for this test alone: munged, slurmctld and slurmd,
which Debian's packages munge and slurm-wlm hold; it needs root.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECIPES = ROOT / "examples" / "cluster"
SHARDS = 3
HOLD = 'title = "Hold"\nduration = "1 s"\nmode = "velocity"\n'


def run(*words: str | Path, **more: object) -> str:
    """Runs a command, and gives what it prints; what fails is shown whole."""
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **more)  # type: ignore[call-overload]
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return str(done.stdout)


def environment(program: Path, home: Path, out: str) -> dict[str, str]:
    return os.environ | {
        "COAXDESIGN": str(program),
        "DESIGN": str(ROOT / "designs" / "coax2d"),
        "MANEUVER": str(home / "hold.toml"),
        "RUNS": "7",
        "SEED": "3",
        "SHARDS": str(SHARDS),
        "OUT": str(home / out),
    }


def wait_for(what: str, ready: object, seconds: float = 60.0) -> None:
    """Waits until ``ready()`` is true."""
    end = time.monotonic() + seconds
    while not ready():  # type: ignore[operator]
        if time.monotonic() > end:
            sys.exit(f"waited {seconds} s for {what}")
        time.sleep(0.2)


@contextmanager
def slurm(home: Path) -> Iterator[dict[str, str]]:
    """A Slurm of one node, by daemons that end with the test."""
    place = home / "slurm"
    for folder in ("state", "spool", "munge"):
        (place / folder).mkdir(parents=True)
    (place / "munge").chmod(0o755)
    key = place / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    host = socket.gethostname().split(".")[0]
    ports = []
    for _ in range(2):
        with socket.socket() as free:
            free.bind(("", 0))
            ports.append(free.getsockname()[1])
    socket_file = place / "munge" / "socket"
    settings = place / "slurm.conf"
    settings.write_text(f"""
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={socket_file}
CryptoType=crypto/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation={place}/state
SlurmdSpoolDir={place}/spool
SlurmctldPidFile={place}/slurmctld.pid
SlurmdPidFile={place}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={max(1, os.cpu_count() or 1)} State=UNKNOWN
PartitionName=test Nodes={host} Default=YES MaxTime=INFINITE State=UP
""")
    variables = os.environ | {"SLURM_CONF": str(settings)}
    started: list[subprocess.Popen[bytes]] = []
    logs = {name: (place / f"{name}.log").open("wb") for name in ("munged", "slurmctld", "slurmd")}

    def daemon(name: str, *words: str) -> None:
        path = shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin")
        started.append(
            subprocess.Popen([str(path), *words], env=variables, stdout=logs[name], stderr=logs[name])
        )

    try:
        munge = place / "munge"
        daemon(
            "munged",
            "--foreground",
            "--force",
            f"--key-file={key}",
            f"--socket={socket_file}",
            f"--pid-file={munge}/pid",
            f"--log-file={munge}/log",
            f"--seed-file={munge}/seed",
        )
        wait_for("munged", socket_file.exists)
        daemon("slurmctld", "-D", "-i", "-f", str(settings))
        daemon("slurmd", "-D", "-N", host, "-f", str(settings))

        def idle() -> bool:
            shown = subprocess.run(
                ["sinfo", "--noheader", "--format=%t"], env=variables, capture_output=True, text=True
            )
            return shown.stdout.strip() in ("idle", "mix")

        try:
            wait_for("the node of Slurm", idle)
        except SystemExit:
            for name in logs:
                print(name, (place / f"{name}.log").read_text()[-2000:], file=sys.stderr)
            raise
        yield variables
    finally:
        for process in reversed(started):
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
        for log in logs.values():
            log.close()


def has_slurm() -> str:
    """Why Slurm cannot be tried here; empty where it can."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        return "needs root for daemons of its own"
    path = f"{os.environ.get('PATH', '')}:/usr/sbin"
    missing = [n for n in ("sbatch", "slurmctld", "slurmd", "munged") if not shutil.which(n, path=path)]
    return f"{', '.join(missing)} not installed" if missing else ""


def main() -> None:
    program = Path(sys.argv[1]).resolve()
    snakemake = sys.argv[2] if len(sys.argv) > 2 else shutil.which("snakemake")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        (home / "hold.toml").write_text(HOLD)
        alone = environment(program, home, "alone")
        run("sh", RECIPES / "shard.sh", "0", "1", env=alone, cwd=home)
        expected = (home / "alone" / "shard-0.jsonl").read_bytes()
        assert expected.count(b"\n") == 7, expected

        def compare(recipe: str) -> None:
            joined = (home / recipe / "runs.jsonl").read_bytes()
            assert joined == expected, f"{recipe}: another result than that of one process"
            print(f"{recipe}: {SHARDS} shards are the runs of one process, byte for byte")

        # A shard that is missing is no merge.
        partial = environment(program, home, "partial")
        run("sh", RECIPES / "shard.sh", "0", str(SHARDS), env=partial, cwd=home)
        merge = subprocess.run(
            ["sh", RECIPES / "shard.sh", "merge", str(SHARDS)],
            env=partial,
            cwd=home,
            capture_output=True,
        )
        assert merge.returncode != 0, "a merge without all shards must fail"

        if shutil.which("parallel"):
            run(RECIPES / "parallel.sh", "--jobs", "2", "--will-cite", env=environment(program, home, "parallel"), cwd=home)
            compare("parallel")
        else:
            print("SKIPPED: parallel is not installed")

        if snakemake:
            run(snakemake, "--cores", "2", "--snakefile", RECIPES / "Snakefile", "--quiet", "all",
                env=environment(program, home, "snakemake"), cwd=home)
            compare("snakemake")
        else:
            print("SKIPPED: snakemake is not installed")

        run("sh", "-n", RECIPES / "slurm.sh")
        missing = has_slurm()
        if missing:
            print(f"SKIPPED: Slurm {missing}; slurm.sh was only parsed")
            return
        with slurm(home) as variables:
            settings = environment(program, home, "slurm-study") | variables
            run(RECIPES / "slurm.sh", env=settings, cwd=home)
            wait_for("Slurm's merge", (home / "slurm-study" / "runs.jsonl").exists, 240.0)

            def done() -> bool:
                return run("squeue", "--noheader", env=variables).strip() == ""

            wait_for("Slurm's queue to empty", done)
        compare("slurm-study")


if __name__ == "__main__":
    main()
