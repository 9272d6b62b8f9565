"""Low-discrepancy numbers: a rank-1 lattice over the samples that a pixel has in one round, shifted at random.

One lattice point a sample decides a path up to its first vertex, and the direction in which it leaves that vertex. So a
round's samples cover picture, lens, lights and lobes evenly. All later decisions take independent numbers, because a
lattice gains nothing there. The numbers are a function of (seed, pixel, round, sample), and nothing is stored. Each
point by itself is uniform, so the estimate stays unbiased. Rounds, pixels and seeds have independent shifts.

Reference: Cranley, Patterson (1976), "Randomization of Number Theoretic Methods for Multiple Integration".
"""

import warp as wp

from warpmis.kernels.rng import (
    CAMERA,
    CHOICE,
    EVENT,
    LIGHT,
    ONE_MINUS_EPSILON,
    SCATTER,
    RngKey,
    bits4,
    to_unit,
    to_unit4,
    uniform4_of_step,
)

wp.set_module_options({"enable_backward": False})


@wp.func
def choice(key: RngKey) -> float:
    """The lattice's first coordinate, which is even over any consecutive samples.

    It chooses strategy, light and lobe at the first vertex. Remapped after each choice, it is the first number of the
    direction. So the samples of each strategy, light and lobe are as even as all samples together.

    Each round starts a new sequence. A round that continued the last one's would be biased: its shares were learned
    from samples that depend on where the sequence is.
    """
    shift = bits4(key.seed, key.pixel, key.round, CHOICE)[0]
    return to_unit(shift + (key.sample - key.round) * key.lattice[0])


@wp.func
def moved_on(u: float, step: wp.uint32, part: float) -> float:
    """A coordinate, part of the way from its point to the lattice's next one."""
    moved = u + to_unit(step) * part
    return wp.min(moved - wp.floor(moved), ONE_MINUS_EPSILON)


@wp.func
def shifted4(key: RngKey, block: int, a: wp.uint32, b: wp.uint32, c: wp.uint32, d: wp.uint32) -> wp.vec4:
    """Four coordinates, by their steps."""
    shift = bits4(key.seed, key.pixel, key.round, block)
    k = key.sample - key.round
    return to_unit4(wp.vec4ui(shift[0] + k * a, shift[1] + k * b, shift[2] + k * c, shift[3] + k * d))


@wp.func
def point4(key: RngKey, block: int) -> wp.vec4:
    """Two coordinates for the point of the picture, or of the lens; the other numbers are not to be used."""
    step = key.lattice
    none = wp.uint32(0)
    if block == CAMERA:
        return shifted4(key, block, step[3], step[4], none, none)
    return shifted4(key, block, step[6], step[7], none, none)


@wp.func
def point4_of_step(key: RngKey, step: int, purpose: int) -> wp.vec4:
    """The numbers of one purpose at one step of a path: the lattice's at the first, else independent ones.

    At a path's first vertex `choice` replaces the first two numbers of LIGHT and SCATTER and the first of DELTA_LIGHT.
    """
    if step > 0:
        return uniform4_of_step(key, step, purpose)
    of = key.lattice
    none = wp.uint32(0)
    if purpose == LIGHT:
        return shifted4(key, purpose, none, none, of[1], of[8])
    if purpose == SCATTER:
        return shifted4(key, purpose, none, none, of[2], none)
    if purpose == EVENT:
        return shifted4(key, purpose, of[5], none, none, none)
    return wp.vec4()
