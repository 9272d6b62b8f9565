"""Which lattice the samples of a round lie on: point k of N is k z / N modulo 1, for the generating vector z.

z is found component by component: each as good as can be together with those before it, in the mean square error over
all shifts of the lattice of functions whose mixed first derivatives are bounded, of which the figure is

    sum_k prod_d (1 + w(k z_d / N)),    w(x) = 12 (x^2 - x + 1/6).

Here the product's terms of one, two and three dimensions are weighed apart: numbers that draw one direction count more
together than with the rest of the path. All arithmetic is in integers, so that every machine finds the same vector.

References: Sloan, Joe (1994), "Lattice Methods for Multiple Integration"; Sloan, Reztsov (2002),
"Component-by-Component Construction of Good Lattice Rules".
"""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

# The dimensions in the order of kernels/lattice.py, by what they help to draw. The choice helps with both directions,
# of the light sample and of the BSDF's.
CHOICE, LIGHT, SCATTER, PICTURE, EVENT, LENS = range(6)
DIMENSIONS = (CHOICE, LIGHT, SCATTER, PICTURE, PICTURE, EVENT, LENS, LENS, LIGHT)

# Weights of pairs that draw one direction and of those that do not, and of triples that do; relative to 4 of one alone.
TOGETHER, APART, TRIPLE = 8, 1, 2

# Points of one lattice at most: longer sequences are made of several.
LARGEST = 4096

# Components that are tried in each dimension times points, so that the search takes some hundredths of a second.
TRIED = 1 << 19

# w is counted in parts of 1 / SCALE.
SCALE = 1 << 8


def lattice_length(samples: int) -> int:
    """Points of each of the equal lattices that a sequence of so many samples is made of; the last may be cut short."""
    lattices = -(-samples // LARGEST)
    return -(-samples // lattices)


def lattice_steps(count: int) -> tuple[int, ...]:
    """From one of `count` points of a lattice to the next, in units of 2^-32, for all dimensions."""
    return tuple(round(2**32 * z / count) % 2**32 for z in generating_vector(count))


@cache
def generating_vector(count: int) -> tuple[int, ...]:
    """z for a lattice of `count` points, each component without a common factor with `count`.

    So every dimension alone is equidistant. The first is near to the golden ratio, so that any of its points in turn
    are evenly spread, too (Schroeder 1991, "Fractals, Chaos, Power Laws").
    """
    candidates = _candidates(count)
    vector = [coprime_near(count * GOLDEN, count)]
    known = [_w(np.array(vector), count)[0]]
    for dimension in range(1, len(DIMENSIONS)):
        of_candidates = _w(candidates, count)
        best = int(np.argmin(of_candidates @ _weight(known, dimension)))
        vector.append(int(candidates[best]))
        known.append(of_candidates[best])
    return tuple(vector)


def coprime_near(wanted: float, count: int) -> int:
    """The whole number from 1 to count - 1 nearest to `wanted` that has no common factor with `count`; else 1."""
    near = sorted((round(wanted) + step for step in range(-8, 9)), key=lambda z: abs(z - wanted))
    return next((z for z in near if 0 < z < count and math.gcd(z, count) == 1), 1)


def _candidates(count: int) -> NDArray[np.int64]:
    """Evenly among those up to the half: the others are their mirror images."""
    coprime = [z for z in range(1, count // 2 + 1) if math.gcd(z, count) == 1] or [1]
    every = max(1, len(coprime) * count // TRIED)
    return np.array(coprime[::every], dtype=np.int64)


def _w(z: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """w of each point's coordinate for each component, shape (components, count), in parts of 1 / SCALE."""
    k = np.outer(z, np.arange(count)) % count
    return 2 * (6 * k * (k - count) + count * count) * SCALE // (count * count)


def _weight(known: list[NDArray[np.int64]], dimension: int) -> NDArray[np.int64]:
    """What each point's w in one more dimension is multiplied by, for those known before it; shape (count,)."""
    own = DIMENSIONS[dimension]
    alike = [d for d in range(dimension) if DIMENSIONS[d] in (own, CHOICE) or own == CHOICE]
    total = np.full(len(known[0]), 4 * SCALE * SCALE)
    for d, w in enumerate(known):
        total += (TOGETHER if d in alike else APART) * SCALE * w
    for a, b in combinations(alike, 2):
        if DIMENSIONS[a] == own or DIMENSIONS[b] == own:
            total += TRIPLE * known[a] * known[b]
    return total
