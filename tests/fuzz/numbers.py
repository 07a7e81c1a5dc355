"""Numbers as broken drivers, other units and flipped bits make them."""

import warnings

import numpy as np

EXTREMES = np.array(
    [
        *(0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, np.pi),
        *(5e-324, 1e-310, 1e-12, 1e3, 1e7, 1e9, 1e18, 1e39, 1e300, -1e300),
        *(np.finfo(np.float64).max, 2.0**31, 2.0**32, 2.0**63),
    ]
)
SCALES = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9, -1.0, 180.0 / np.pi)


def number(rng):
    """One number that is hardly ever meant."""
    if rng.random() < 0.5:
        return float(rng.choice(EXTREMES))
    return float(np.frombuffer(rng.bytes(8), np.float64)[0])


def bits(array, rng):
    """The same shape and type, some values random bits."""
    raw = bytearray(array.tobytes())
    size = max(array.dtype.itemsize, 1)
    for _ in range(int(rng.integers(1, 4))):
        if len(raw) >= size:
            at = int(rng.integers(0, len(raw) // size)) * size
            raw[at : at + size] = rng.bytes(size)
    return np.frombuffer(bytes(raw), array.dtype).reshape(array.shape)


def some(array, rng):
    """A few values extreme; what the type cannot hold is as numpy makes it."""
    changed = np.array(array)
    with np.errstate(all="ignore"):
        for _ in range(int(rng.integers(1, 4))):
            if changed.size:
                changed.flat[int(rng.integers(0, changed.size))] = number(rng)
    return changed


def scaled(array, rng):
    with np.errstate(all="ignore"):
        return np.asarray(array * rng.choice(SCALES), array.dtype)


def shifted(array, rng):
    with np.errstate(all="ignore"):
        return np.asarray(array + number(rng), array.dtype)


def shuffled(array, rng):
    """Rows in another order, some twice."""
    return array[rng.integers(0, len(array), len(array))] if array.ndim and len(array) else array


def reshaped(array, rng):
    if not array.ndim:
        return array[None]
    ways = [array[..., None], array.ravel(), array[:0], array[:1], array[..., :1], array.T]
    return ways[rng.integers(0, len(ways))]


def retyped(array, rng):
    kinds = (np.float16, np.float32, np.int64, np.uint8, np.complex128, np.bool_, "U8", "S3")
    with np.errstate(all="ignore"):
        return array.astype(kinds[rng.integers(0, len(kinds))])


WAYS = (bits, some, some, scaled, shifted, shuffled, reshaped, retyped)
SAME_SHAPE = (bits, some, scaled, shifted, shuffled)


def mutated(array, rng, ways=WAYS):
    """An array gone wrong in one way."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it is what comes of it that must not warn
        return ways[rng.integers(0, len(ways))](np.asarray(array), rng)
