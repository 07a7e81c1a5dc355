"""slams: lists all commands; `slams run ...` is `python -m slams.run ...`."""

from __future__ import annotations

import sys
from importlib import import_module

from slams import __version__, cli
from slams.params import did_you_mean
from slams.registry import DESCRIPTIONS, names

PROGRAM = "slams"
# names of modules, imported when used: slams works without bench
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
    """Run the command that the first word names, or list all; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help"):
        sys.stdout.write(listed())
        return 0
    if words[0] == "--version":
        sys.stdout.write(f"{PROGRAM} {__version__}\n")
        return 0
    return cli.run_command(PROGRAM, lambda: _command(words[0], words[1:]))


def listed() -> str:
    """A line for each command and each algorithm."""
    commands = {f"{PROGRAM} {name}": purpose(module) for name, module in COMMANDS.items()}
    algorithms = {name: DESCRIPTIONS.get(name, "of another package") for name in names()}
    return (
        "Classic 2D laser SLAM algorithms, and the benchmark that compares them.\n\n"
        f"{_aligned(commands)}\n\nAlgorithms:\n\n{_aligned(algorithms)}\n\n"
        f"{PROGRAM} COMMAND --help lists the options of a command.\n"
    )


def purpose(module: str) -> str:
    """What a command does: the first line of its module after the colon."""
    line = (import_module(module).__doc__ or "").partition("\n")[0]
    return line.partition(": ")[2].rstrip(".")


def _aligned(lines: dict[str, str]) -> str:
    width = max(map(len, lines))
    return "\n".join(f"  {name:{width}}  {text}" for name, text in lines.items())


def _command(name: str, words: list[str]) -> int:
    if name not in COMMANDS:
        hint, known = did_you_mean(name, COMMANDS), ", ".join(COMMANDS)
        raise cli.RefusedError(f"unknown command {name!r}{hint} (known: {known})")
    code: int = import_module(COMMANDS[name]).main(words)
    return code


if __name__ == "__main__":
    sys.exit(main())
