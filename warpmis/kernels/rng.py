"""Counter-based random numbers: a pure function of (seed, pixel, sample, dimension).

Nothing is stored and nothing advances, so any pixel can be replayed and the image does not depend on tiles, threads,
batches or machines.
"""

import warp as wp

from warpmis.device.views import vec_lattice

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
    """round: the first sample of the lattice that the sample belongs to; lattice: that lattice's steps."""

    seed: wp.uint32
    pixel: wp.uint32
    sample: wp.uint32
    round: wp.uint32
    lattice: vec_lattice


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


@wp.func
def uniform4_of_step(key: RngKey, step: int, purpose: int) -> wp.vec4:
    """The four numbers of one purpose (EVENT, SCATTER, LIGHT, DELTA_LIGHT) at one step of a path."""
    return uniform4(key, purpose + step * BLOCKS)
