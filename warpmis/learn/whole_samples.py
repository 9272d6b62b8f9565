"""Shares that are whole numbers of the next round's samples.

The choices of strategy are equidistant over a round (kernels/lattice.py: choice). If a strategy's share of the round's
samples is a whole number, it gets exactly that many, and nothing remains of the variance between the strategies' means.
Shares as learned would be off by a sample in most rounds: more than all other noise where a strategy alone has none. A
share moves by half a sample at most, or by one where a bound is in the way.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory

# Samples for each strategy below which rounding would move the shares by more than it is worth.
FEWEST = 8
# Samples of a round beyond which float32 cannot resolve single samples, nor do they matter.
MOST = 1 << 20

# In place of a strategy's index.
NO_STRATEGY = wp.constant(-1)


def rounds_well(samples: int, strategies: int) -> bool:
    """Whether shares of a round of so many samples are to be rounded."""
    return FEWEST * strategies <= samples <= MOST


@kernel_factory
def make_whole_samples(count: int) -> KernelFunction:
    """Kernel: (first cell, shares, samples of a round, min_share) -> shares in place.

    A share at the bound or below it is rounded up, the others to the nearest. Then whole samples are moved to or from
    the strategies that are farthest from their share, until the sum is the round's.
    """
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)

    def whole_samples(first: int, shares: wp.array(dtype=vec_s), samples: int, min_share: float):
        cell = first + wp.tid()
        exact = shares[cell] * float(samples)
        rounded = vec_s()
        lowest = vec_s()
        missing = float(samples)
        for s in range(wp.static(count)):
            lowest[s] = wp.ceil(wp.min(exact[s], min_share * float(samples)) - 1.0e-3)
            rounded[s] = wp.max(wp.round(exact[s]), lowest[s])
            missing -= rounded[s]
        for _move in range(wp.static(2 * count)):
            if missing == 0.0:
                break
            farthest = int(NO_STRATEGY)
            distance = float(0.0)
            for s in range(wp.static(count)):
                off = (exact[s] - rounded[s]) * wp.sign(missing)
                may_move = missing > 0.0 or rounded[s] > lowest[s]
                if may_move and (farthest == NO_STRATEGY or off > distance):
                    farthest = s
                    distance = off
            rounded[farthest] = rounded[farthest] + wp.sign(missing)
            missing -= wp.sign(missing)
        shares[cell] = rounded / float(samples)

    return whole_samples
