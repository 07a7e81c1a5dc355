"""Where things stand that tests look at."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"  # measured logs, which are not part of the project
