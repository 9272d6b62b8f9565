"""Counter-based random numbers: a pure function of (seed, pixel, sample, dimension).

Nothing is stored and nothing advances, so any pixel can be replayed and the image does not depend on tiles, threads,
batches or machines.
"""

import math

import warp as wp

wp.set_module_options({"enable_backward": False})

# Dimensions come in blocks of four numbers. The camera has the first block; every step of a path has BLOCKS of them.
CAMERA = wp.constant(0)
EVENT = wp.constant(1)
SCATTER = wp.constant(2)
LIGHT = wp.constant(3)
DELTA_LIGHT = wp.constant(4)
BLOCKS = wp.constant(4)
# The block of the choice of strategy: one that no step of a path reaches.
CHOICE = wp.constant(-1)
# The block of the point on the camera's lens.
LENS = wp.constant(-2)

# The largest float32 below 1.
ONE_MINUS_EPSILON = wp.constant(1.0 - 2.0**-24)


@wp.struct
class RngKey:
    """round: the first sample of the round that the sample belongs to."""

    seed: wp.uint32
    pixel: wp.uint32
    sample: wp.uint32
    round: wp.uint32


@wp.func
def to_unit(bits: wp.uint32) -> float:
    """The upper 24 bits as a float32 in [0, 1): 1 itself cannot come out."""
    return float(bits >> wp.uint32(8)) * 5.9604644775390625e-08


@wp.func
def to_unit4(bits: wp.vec4ui) -> wp.vec4:
    return wp.vec4(to_unit(bits[0]), to_unit(bits[1]), to_unit(bits[2]), to_unit(bits[3]))


@wp.func
def bits4(seed: wp.uint32, pixel: wp.uint32, sample: wp.uint32, block: int) -> wp.vec4ui:
    """Four independent hashes.

    Reference: Jarzynski and Olano (2020), "Hash Functions for GPU Rendering", JCGT 9(3), function pcg4d.
    """
    multiplier = wp.uint32(1664525)
    increment = wp.uint32(1013904223)
    x = seed * multiplier + increment
    y = pixel * multiplier + increment
    z = sample * multiplier + increment
    w = wp.uint32(block) * multiplier + increment
    x = x + y * w
    y = y + z * x
    z = z + x * y
    w = w + y * z
    x = x ^ (x >> wp.uint32(16))
    y = y ^ (y >> wp.uint32(16))
    z = z ^ (z >> wp.uint32(16))
    w = w ^ (w >> wp.uint32(16))
    x = x + y * w
    y = y + z * x
    z = z + x * y
    w = w + y * z
    return wp.vec4ui(x, y, z, w)


@wp.func
def uniform4(key: RngKey, block: int) -> wp.vec4:
    """Four independent numbers in [0, 1)."""
    return to_unit4(bits4(key.seed, key.pixel, key.sample, block))


def lattice_step(count: int) -> int:
    """From one of `count` points of the lattice to the next, in units of 2^-32: a fraction of `count` without a common
    factor, so that none is met twice, as near to the golden ratio as can be, so that any of them in turn are evenly
    spread too (Schroeder 1991, "Fractals, Chaos, Power Laws")."""
    wanted = count * (math.sqrt(5.0) - 1.0) / 2.0
    near = sorted((round(wanted) + step for step in range(-8, 9)), key=lambda place: abs(place - wanted))
    places = next((place for place in near if 0 < place and math.gcd(place, count) == 1), 1)
    return round(2**32 * places / count) % 2**32


@wp.func
def lattice(key: RngKey, step: wp.uint32) -> float:
    """One number a sample: over a round of samples equidistant points from a random start, `lattice_step` of the round
    apart from one sample to the next.

    A round that went on with the numbers of the last one would be biased: its shares are learned from samples whose
    strategies tell where the sequence stands.

    Reference: Sloan, Joe (1994), "Lattice Methods for Multiple Integration"; Cranley, Patterson (1976) for the start.
    """
    start = bits4(key.seed, key.pixel, key.round, CHOICE)[0]
    return to_unit(start + (key.sample - key.round) * step)


@wp.func
def uniform4_of_step(key: RngKey, step: int, purpose: int) -> wp.vec4:
    """The four numbers of one purpose (EVENT, SCATTER, LIGHT, DELTA_LIGHT) at one step of a path."""
    return uniform4(key, purpose + step * BLOCKS)
