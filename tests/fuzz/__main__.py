"""python -m tests.fuzz --cases 20000: the longer run. A case that fails is named and repeatable."""

import argparse
import resource
import sys
import time

from tests.fuzz.campaign import run
from tests.fuzz.families import FAMILIES

parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
parser.add_argument("--cases", type=int, default=20000, help="in all, spread over the families")
parser.add_argument(
    "--family", choices=FAMILIES, action="append", help="only this; may be repeated"
)
parser.add_argument("--first", type=int, default=0, help="the first case; they are numbered")
parser.add_argument("--algorithm", default="odometry", help="what the logs and scans are given to")
parser.add_argument("--memory", type=float, default=6.0, help="GB that the process may take")
arguments = parser.parse_args()

limit = int(arguments.memory * 2**30)
resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
families = arguments.family or list(FAMILIES)
failed = 0
for name in families:
    start, cases = time.perf_counter(), max(1, arguments.cases // len(families))
    taken, broken = run(name, cases, arguments.algorithm, arguments.first)
    spent = time.perf_counter() - start
    print(f"{name}: {cases} cases in {spent:.0f} s, {taken} taken, {len(broken)} broken")
    print("".join(f"  {line}\n" for line in broken), end="")
    failed += len(broken)
sys.exit(1 if failed else 0)
