"""The file of a state: a zip of head, nodes and the kept memory of the arrays, with a digest.

- `head.json`: format and version, the algorithm, the release that wrote it, sha256 of the rest.
- `nodes.json`: the graph of `slams.state.graph`, and the pieces of `slams.state.memory`.
- `memory.bin`: the kept blocks of the pieces, one after the other.

Written to a temporary name and renamed; read only as far as its sizes can be true.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slams.state.graph import Graph, Node
from slams.state.memory import Bytes, Piece, kept_size, pack, unpack

FORMAT, VERSION = "slams-state", 1
HEAD, NODES, MEMORY = "head.json", "nodes.json", "memory.bin"
LEVEL = 1  # of packing: more takes thrice the time for a few percent
MOST_HEAD = 1 << 16  # bytes
MOST_NODES = 1 << 29
CHUNK = 1 << 20
BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    KeyError,
    NotImplementedError,
    RecursionError,
    RuntimeError,
    TypeError,
    UnicodeDecodeError,
)


class Stored(NamedTuple):
    """A state as it lies in a file: its head, the graph and its pieces of memory."""

    head: dict[str, Any]
    roots: dict[str, Any]
    nodes: list[Node]
    pieces: list[Bytes]


def write(path: Path, head: dict[str, Any], graph: Graph) -> None:
    """Write a graph under `path`, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    packed = [pack(*span) for span in graph.spans]
    nodes = {"roots": graph.roots, "nodes": graph.nodes, "pieces": [piece for piece, _ in packed]}
    text = json.dumps(nodes, separators=(",", ":")).encode()
    digest = hashlib.sha256(text)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
            with archive.open(MEMORY, "w", force_zip64=True) as file:
                for _, blocks in packed:
                    for run in blocks:
                        digest.update(run.data)
                        file.write(run.data)
            _write(archive, NODES, text)
            head = {"format": FORMAT, "version": VERSION} | head | {"sha256": digest.hexdigest()}
            _write(archive, HEAD, json.dumps(head, indent=1).encode())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _write(archive: zipfile.ZipFile, name: str, text: bytes) -> None:
    """An entry with the fixed date of those that are opened: equal states are equal files."""
    with archive.open(name, "w") as file:
        file.write(text)


def read(path: Path) -> Stored:
    """What `write` wrote.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no state, damaged, or of a newer version; one sentence.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            return _read(archive)
    except BROKEN as error:
        raise ValueError(_sentence(path, error)) from error
    except MemoryError as error:
        raise ValueError(f"{path}: needs more memory than there is") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    except OSError as error:
        if error.strerror is None or error.filename is None:  # a place outside of the file
            raise ValueError(_sentence(path, error)) from error
        raise type(error)(f"{path}: {error.strerror.lower()}; expected a state") from error


def _sentence(path: Path, error: Exception) -> str:
    with path.open("rb") as file:
        if not file.read(4).startswith(b"PK"):
            return f"{path}: not a state; expected what --save-state wrote"
    reason = " ".join(str(error).split())
    return f"{path}: damaged or cut short ({reason}); copy or save it again"


def _read(archive: zipfile.ZipFile) -> Stored:
    missing = [name for name in (HEAD, NODES, MEMORY) if name not in archive.namelist()]
    if missing:
        raise ValueError(f"not a state: no {', '.join(missing)}; expected what --save-state wrote")
    head = _json(_bytes(archive, HEAD, MOST_HEAD))
    _check_head(head)
    text = _bytes(archive, NODES, MOST_NODES)
    known = _json(text)
    if not (isinstance(known["roots"], dict) and isinstance(known["nodes"], list)):
        raise EOFError("no nodes")
    pieces = [Piece(*piece) for piece in known["pieces"]]
    size, kept = archive.getinfo(MEMORY).file_size, kept_size(pieces)
    if size != kept:
        raise ValueError(f"its arrays have {size} bytes, expected {kept}; save it again")
    memory = np.frombuffer(_bytes(archive, MEMORY, kept), np.uint8)
    _check_digest(head, text, memory)
    return Stored(head, known["roots"], known["nodes"], list(_unpacked(pieces, memory)))


def _bytes(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """All of an entry, refused before memory is taken for it if it is larger than `most`."""
    entry = archive.getinfo(name)
    if entry.file_size > most:
        raise ValueError(f"{name} has {entry.file_size} bytes, expected {most} at most")
    with archive.open(entry) as file:
        parts = list(iter(lambda: file.read(CHUNK), b""))
    return b"".join(parts)


def _json(text: bytes) -> dict[str, Any]:
    known = json.loads(text)
    if not isinstance(known, dict):
        raise EOFError("no entries")
    return known


def _check_head(head: dict[str, Any]) -> None:
    if head.get("format") != FORMAT:
        raise ValueError(f"format: got {head.get('format')!r}, expected {FORMAT!r}")
    version = head.get("version")
    if not isinstance(version, int) or version > VERSION:
        raise ValueError(
            f"a state of version {version}, written by slams {head.get('slams')}; this one reads "
            f"up to version {VERSION}: update slams, or save the state with this one"
        )


def _check_digest(head: dict[str, Any], text: bytes, memory: Bytes) -> None:
    digest = hashlib.sha256(text)
    digest.update(memory.data)
    if digest.hexdigest() != head["sha256"]:
        raise ValueError("changed since it was saved: its sha256 differs; save it again")


def _unpacked(pieces: list[Piece], memory: Bytes) -> Iterator[Bytes]:
    for piece in pieces:
        data, memory = unpack(piece, memory)
        yield data
