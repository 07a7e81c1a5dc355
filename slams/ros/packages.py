"""Files that a launch file names by their package, found without ROS: beside the launch file."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = re.compile(r"^\$\((?:find|find-pkg-share)\s+[^()]*\)/*")
HERE = "$(dirname)"


def beside(launch: Path, name: str) -> Path | None:
    """The file of a name such as "$(find pkg)/config/x.yaml"; None where there is none.

    The package is taken to be the launch file's own, which stands in its root or in a folder of
    it; last the file may lie beside the launch file itself.
    """
    rest = PACKAGE.sub("", name.replace(HERE, str(launch.parent)))
    if "$(" in rest or not rest:
        return None
    folders = (launch.parent.parent, launch.parent)
    places = [folder / rest for folder in folders]  # an absolute name stays what it is
    if PACKAGE.match(name):
        places.append(launch.parent / Path(rest).name)
    return next((place for place in places if place.is_file()), None)
