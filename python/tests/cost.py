"""Processor time of a trim and of a flight through Python, beside that of the program.

    python python/tests/cost.py PROGRAM [REPEATS]

Both must be of the same profile. Processor time of all threads, the least of
the repeats. Of Python the call alone is measured, and the whole process with
the start of the interpreter and the imports beside it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRELUDE = """
import json, time
import coaxdesign as cx
p = cx.Problem.load("coax2d")
s = cx.Schedule.load("designs/coax2d")
begin = time.process_time()
{work}
print(json.dumps(time.process_time() - begin))
"""
CASES = {
    "trim of 19 speeds": (
        ["trim", "--speeds", "0:90:5kt", "--format", "json", "--quiet"],
        "p.trim(cx.kt(range(0, 91, 5)))",
    ),
    "flight: accel-climb-turn": (
        ["simulate", "designs/coax2d", "-m", "accel-climb-turn", "--format", "json", "--quiet"],
        'cx.simulate(p, s, "accel-climb-turn")',
    ),
}


def processor_time(words: list[str]) -> tuple[float, str]:
    """Processor time of a command and all its threads, s, and what it prints."""
    before = os.times()
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    after = os.times()
    spent = after.children_user + after.children_system
    return spent - before.children_user - before.children_system, done.stdout


def main() -> None:
    program = str(Path(sys.argv[1]).resolve())
    repeats = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    for name, (arguments, work) in CASES.items():
        best = [float("inf")] * 3
        for _ in range(repeats):
            alone, _ = processor_time([program, *arguments])
            whole, told = processor_time([sys.executable, "-c", PRELUDE.format(work=work)])
            best = [min(a, b) for a, b in zip(best, (alone, json.loads(told), whole), strict=True)]
        alone, call, whole = best
        print(
            f"{name}: program {alone:.2f} s; call from Python {call:.2f} s "
            f"({100 * (call / alone - 1):+.1f} %); whole Python process {whole:.2f} s"
        )


if __name__ == "__main__":
    main()
