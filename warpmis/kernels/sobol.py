"""Low-discrepancy numbers: a Sobol sequence over a pixel's samples of one round, Owen-scrambled anew for each block.

The four numbers of a block are the first four dimensions of the sequence, each scrambled by its own hash; the blocks
are padded: each goes through the sequence in an order of its own. A function of (seed, pixel, round, sample, block):
nothing is stored. Each point alone is uniform in [0, 1)^4, so that no mean changes, and the points of one block are
independent of those of all others, also in other rounds, pixels and seeds.

Within this file integers have their bits reversed, the lowest one being a half: so scrambling is multiplication.

References: Owen (1995), "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences"; Joe, Kuo (2008), "Constructing Sobol
Sequences with Better Two-Dimensional Projections"; Burley (2020), "Practical Hash-based Owen Scrambling", JCGT 9(4).
"""

import warp as wp

from warpmis.kernels.rng import BLOCKS, RngKey, bits4, to_unit4

wp.set_module_options({"enable_backward": False})

# Scrambles are hashed as if of samples and of blocks that there are none of, so that they share no hash.
NO_SAMPLE = wp.constant(wp.uint32(1 << 31))
SHUFFLE = wp.constant(1 << 30)


@wp.func
def halves_swapped(x: wp.uint32) -> wp.uint32:
    return (x >> wp.uint32(16)) | (x << wp.uint32(16))


@wp.func
def reversed_bits(x: wp.uint32) -> wp.uint32:
    y = halves_swapped(x)
    y = ((y >> wp.uint32(8)) & wp.uint32(0x00FF00FF)) | ((y & wp.uint32(0x00FF00FF)) << wp.uint32(8))
    y = ((y >> wp.uint32(4)) & wp.uint32(0x0F0F0F0F)) | ((y & wp.uint32(0x0F0F0F0F)) << wp.uint32(4))
    y = ((y >> wp.uint32(2)) & wp.uint32(0x33333333)) | ((y & wp.uint32(0x33333333)) << wp.uint32(2))
    return ((y >> wp.uint32(1)) & wp.uint32(0x55555555)) | ((y & wp.uint32(0x55555555)) << wp.uint32(1))


@wp.func
def scrambled(x: wp.uint32, seed: wp.uint32) -> wp.uint32:
    """A permutation that flips each bit or not as the lower ones and the seed say: Owen's nested scramble.

    Reference: Laine, Karras (2011), "Stratified Sampling for Stochastic Transparency"; with the constants of Vegdahl
    (2021), "Building a Better LK Hash".
    """
    y = x ^ (x * wp.uint32(0x3D20ADEA))
    y = (y + seed) * ((seed >> wp.uint32(16)) | wp.uint32(1))
    y = y ^ (y * wp.uint32(0x05526C56))
    return y ^ (y * wp.uint32(0x53A22864))


@wp.func
def shuffled(index: wp.uint32, seed: wp.uint32) -> wp.uint32:
    """A random order of the indices in which each aligned 2^k of them stay together, and the first 2^k the first.

    The last, since 0 stays 0, keeps an index as short as it was. It costs nothing: where a constant is missing in the
    bits of all indices, one is missing in those of all points, and scrambling does not care.
    """
    return reversed_bits(scrambled(reversed_bits(index), seed) ^ scrambled(wp.uint32(0), seed))


@wp.func
def sobol4(index: wp.uint32) -> wp.vec4ui:
    """The first four dimensions of the point `index`, bits reversed.

    Each dimension is the sum modulo 2 of its direction numbers at the index's ones, and these follow from each other by
    the primitive polynomials 1 (van der Corput), x + 1, x^2 + x + 1 and x^3 + x + 1.

    Reference: Joe, Kuo (2008), table new-joe-kuo-6, dimensions 1 to 4.
    """
    y = wp.uint32(0)
    z = wp.uint32(0)
    w = wp.uint32(0)
    v_y = wp.uint32(1)
    v_z = wp.uint32(1)
    next_z = wp.uint32(3)
    v_w = wp.uint32(1)
    next_w = wp.uint32(3)
    after_w = wp.uint32(4)
    left = wp.uint32(index)
    while left != wp.uint32(0):
        one = wp.uint32(0) - (left & wp.uint32(1))  # all bits, or none
        y = y ^ (v_y & one)
        z = z ^ (v_z & one)
        w = w ^ (v_w & one)
        v_y = v_y ^ (v_y << wp.uint32(1))
        later_z = next_z ^ v_z ^ (v_z << wp.uint32(2))
        v_z = next_z
        next_z = later_z
        later_w = next_w ^ v_w ^ (v_w << wp.uint32(3))
        v_w = next_w
        next_w = after_w
        after_w = later_w
        left = left >> wp.uint32(1)
    return wp.vec4ui(index, y, z, w)


@wp.func
def seeds4(key: RngKey, block: int) -> wp.vec4ui:
    """Seeds of scrambles, the same for all samples of a round.

    A hash's upper bits are the better ones, and the lower bits of a seed are those that scrambling does most with: with
    the hashes as they are, neighbouring pixels would be correlated.
    """
    x = bits4(key.seed, key.pixel, key.round | NO_SAMPLE, block)
    return wp.vec4ui(halves_swapped(x[0]), halves_swapped(x[1]), halves_swapped(x[2]), halves_swapped(x[3]))


@wp.func
def point4(key: RngKey, block: int) -> wp.vec4:
    """Four numbers in [0, 1); over a round's samples the first two are a (0, 2)-sequence."""
    seeds = seeds4(key, block)
    x = sobol4(shuffled(key.sample - key.round, seeds4(key, block ^ SHUFFLE)[0]))
    return to_unit4(
        wp.vec4ui(
            reversed_bits(scrambled(x[0], seeds[0])),
            reversed_bits(scrambled(x[1], seeds[1])),
            reversed_bits(scrambled(x[2], seeds[2])),
            reversed_bits(scrambled(x[3], seeds[3])),
        )
    )


@wp.func
def point4_of_step(key: RngKey, step: int, purpose: int) -> wp.vec4:
    """The same for one purpose at one step of a path, whose directions are drawn from the second and third number."""
    u = point4(key, purpose + step * BLOCKS)
    return wp.vec4(u[2], u[0], u[1], u[3])
