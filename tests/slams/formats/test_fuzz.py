"""Hundreds of damaged bags: each is read or refused in one sentence, and nothing is left."""

import numpy as np
import pytest

import slams
from slams import convert
from tests import bags

CASES = 800
EXTREMES = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\x80\x7f")
WORDS = (b"nan", b"inf", b"-1", b"1e400", b" ", b"\n", b"0", b"99999999999", b"-", b"\0")


def mutated(data, rng):
    """A few bytes changed, lost or put in between; sometimes the end missing."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        at, kind = int(rng.integers(0, len(data) + 1)), rng.integers(0, 7)
        if kind == 0:
            data[at : at + 1] = bytes([rng.integers(0, 256)])
        elif kind == 1 and at < len(data):
            data[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 2:
            del data[at : at + int(rng.integers(1, 64))]
        elif kind == 3:
            data[at:at] = rng.integers(0, 256, rng.integers(1, 16), np.uint8).tobytes()
        elif kind == 4:
            data[at : at + 4] = EXTREMES[rng.integers(0, len(EXTREMES))]
        elif kind == 5:
            data[at : at + int(rng.integers(0, 4))] = WORDS[rng.integers(0, len(WORDS))]
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def bag(make):
    messages = [("/tf_static", 1.0, make.tf(1.0, ("base_link", "laser", (0.1, 0, 0), 0.1, 0.0)))]
    for i in range(3):
        t = 1.0 + 0.1 * i
        messages += [
            ("/scan", t, make.scan(t, [1.0, 2.0, 3.0])),
            ("/imu", t, make.imu(t, (0.0, 0.0, 1.0))),
            ("/tf", t, make.tf(t, ("odom", "base_link", (i, 0, 0), 0.0, 0.0))),
        ]
    return messages


def check_damaged(kind, whole, tmp_path, capsys):
    """Every damaged copy of a log is read or refused in one sentence; the same copies each time."""
    rng = np.random.default_rng(0)
    folder = tmp_path / "cases"
    folder.mkdir()
    path, out = folder / f"x.{kind.partition('-')[0]}", folder / "out.npz"
    refused = 0
    for case in range(CASES):
        path.write_bytes(mutated(whole, rng))
        salvage = case % 2 == 1
        if case % 20 == 0:
            refused += convert.main([str(path), str(out), "-q"]) == 2
            check_output(out, capsys.readouterr().err)
        else:
            refused += refused_in_a_sentence(
                lambda: slams.load(path, salvage=salvage),  # noqa: B023
                folder,
            )
    assert list(folder.iterdir()) == [path]
    assert 0 < refused < CASES


def check_output(out, err):
    """Either the whole output or one line of refusal."""
    assert out.exists() == (err == "")
    if out.exists():
        slams.load(out)
        out.unlink()
    else:
        assert err.count("\n") == 1


def refused_in_a_sentence(work, folder):
    """Whether the work raised an error that users see; a line that names a file of the folder."""
    try:
        work()
    except (ValueError, OSError) as error:
        sentence = str(error)
    else:
        return False
    assert len(sentence.splitlines()) == 1, sentence
    assert str(folder) in sentence, sentence
    return True


@pytest.mark.parametrize("kind", ["bag", "bag-bz2", "bag-lz4", "mcap", "db3"])
def test_damaged_bags(kind, tmp_path, capsys):
    check_damaged(kind, bags.write(tmp_path / "whole", kind, bag).read_bytes(), tmp_path, capsys)


def test_damaged_metadata_of_a_folder(tmp_path, capsys):
    folder = bags.write(tmp_path, "folder-mcap", bag)
    whole = (folder / "metadata.yaml").read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(CASES // 4):  # the library takes long to read yaml
        (folder / "metadata.yaml").write_bytes(mutated(whole, rng))
        code = convert.main([str(folder), str(tmp_path / "out.npz"), "-q", "--force"])
        assert code in (0, 2)
        assert capsys.readouterr().err.count("\n") == (code == 2)
