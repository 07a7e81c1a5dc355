"""slams: the commands with a line each; `slams run ...` is `python -m slams.run ...`."""

from __future__ import annotations

import sys
from importlib import import_module

from slams import __version__, cli
from slams.params import nearest
from slams.registry import IDEAS, names

PROGRAM = "slams"
# known as text alone, as the algorithms are: slams is complete without bench
COMMANDS = {
    "info": "slams.info",
    "run": "slams.run",
    "live": "slams.live.__main__",
    "play": "slams.play",
    "compare": "bench.compare",
    "sweep": "bench.sweep",
    "ablation": "bench.ablation",
    "localize": "bench.localize",
    "loops": "bench.loops",
    "simulate": "bench.simulate",
    "convert": "slams.convert",
    "check": "slams.check",
}


def main(argv: list[str] | None = None) -> int:
    """Run a command by its name; without one, list them. Returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help"):
        sys.stdout.write(listed())
        return 0
    if words[0] == "--version":
        sys.stdout.write(f"{PROGRAM} {__version__}\n")
        return 0
    return cli.run_command(PROGRAM, lambda: _command(words[0], words[1:]))


def listed() -> str:
    """The commands and the algorithms with a line each."""
    commands = {f"{PROGRAM} {name}": purpose(module) for name, module in COMMANDS.items()}
    algorithms = {name: IDEAS.get(name, "of another package") for name in names()}
    return (
        "Classic 2D laser SLAM algorithms, and the benchmark that compares them.\n\n"
        f"{_aligned(commands)}\n\nAlgorithms:\n\n{_aligned(algorithms)}\n\n"
        f"{PROGRAM} COMMAND --help tells the rest of a command.\n"
    )


def purpose(module: str) -> str:
    """What a command does: its module's first line, behind the colon."""
    line = (import_module(module).__doc__ or "").partition("\n")[0]
    return line.partition(": ")[2].rstrip(".")


def _aligned(lines: dict[str, str]) -> str:
    width = max(map(len, lines))
    return "\n".join(f"  {name:{width}}  {text}" for name, text in lines.items())


def _command(name: str, words: list[str]) -> int:
    if name not in COMMANDS:
        hint, known = nearest(name, COMMANDS), ", ".join(COMMANDS)
        raise cli.RefusedError(f"unknown command {name!r}{hint} (known: {known})")
    code: int = import_module(COMMANDS[name]).main(words)
    return code


if __name__ == "__main__":
    sys.exit(main())
