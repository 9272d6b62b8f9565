"""Shares that are whole numbers of the next round's samples.

The choices of strategy are equidistant over a round (kernels/lattice.py: choice). If a strategy's share of the round's
samples is a whole number, it gets exactly that many, and nothing is left of the variance between the strategies' means.
Shares as learned would leave one sample too many or too few in most rounds: more than all other noise where a strategy
alone has none. A share moves by half a sample at most, or by one where a bound is in the way.
"""

import warp as wp

from warpmis.device.kernel_factory import KernelFunction, kernel_factory

# Samples for each strategy below which rounding would move the shares by more than it is worth.
FEWEST = 8
# Samples of a round beyond which float32 does not tell one from the next, nor does anybody miss it.
MOST = 1 << 20


def rounds_well(samples: int, strategies: int) -> bool:
    """Whether shares of a round of so many samples are to be rounded."""
    return FEWEST * strategies <= samples <= MOST


@kernel_factory
def make_whole_samples(count: int) -> KernelFunction:
    """Kernel: (first, allocation, samples of a round, min_share) -> allocation in place.

    A share at the bound or below it is rounded up, the others to the nearest; the sum is kept where that moves a share
    least. Shares of 0 throughout, next-event estimation's, stay.
    """
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)

    def whole_samples(first: int, allocation: wp.array(dtype=vec_s), samples: int, min_share: float):
        pixel = first + wp.tid()
        wanted = allocation[pixel] * float(samples)
        whole = vec_s()
        least = vec_s()
        left = float(samples)
        given = float(0.0)
        for s in range(wp.static(count)):
            least[s] = wp.ceil(wp.min(wanted[s], min_share * float(samples)) - 1.0e-3)
            whole[s] = wp.max(wp.round(wanted[s]), least[s])
            left -= whole[s]
            given += wanted[s]
        if not (given > 0.0):
            return
        for _one in range(wp.static(2 * count)):
            if left == 0.0:
                break
            chosen = int(-1)
            farthest = float(0.0)
            for s in range(wp.static(count)):
                off = (wanted[s] - whole[s]) * wp.sign(left)
                if (left > 0.0 or whole[s] > least[s]) and (chosen < 0 or off > farthest):
                    chosen = s
                    farthest = off
            whole[chosen] = whole[chosen] + wp.sign(left)
            left -= wp.sign(left)
        allocation[pixel] = whole / float(samples)

    return whole_samples
