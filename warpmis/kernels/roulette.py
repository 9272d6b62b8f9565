"""Russian roulette: the probability that a path survives, and what its light would be with another density.

From DEPTH bounces on, a path survives with the probability SAFETY times its throughput, at most MAX_SURVIVAL, and is
divided by it. With the throughput alone, paths die as fast as surfaces absorb light. Where the light to come is
brighter than the pixel, what the survivors bring in place of the others is then most of a picture's noise. This
roulette knows nothing of the light to come, so it lets paths live that may be worth it.

Reference: Arvo, Kirk (1990), "Particle Transport and Image Synthesis".
"""

import warp as wp

# Bounces before the first roulette.
DEPTH = wp.constant(3)
SAFETY = wp.constant(5.0)
MAX_SURVIVAL = wp.constant(0.95)


@wp.func
def survival(throughput: float) -> float:
    return wp.min(SAFETY * throughput, MAX_SURVIVAL)
