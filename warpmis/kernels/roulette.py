"""Russian roulette: the probability that a path survives, and what its light would be with another density.

From DEPTH bounces on, a path survives with the probability SAFETY times its throughput, at most MAX_SURVIVAL, and is
divided by it. With the throughput alone, paths die as fast as surfaces absorb light. Where the light to come is
brighter than the pixel, what the survivors bring in place of the others is then most of a picture's noise. This
roulette knows nothing of the light to come, so it lets paths live that may be worth it.

Let T be SAFETY times the product of f / p of all its directions, without these divisions. After several roulettes the
path is alive with a probability of about s(T) = min(T, 1), but for those whose probability is MAX_SURVIVAL, which no
density changes. With another density of its direction, p' = ratio p, it would have T / ratio, and another probability.
Let F_l be the light that it finds after that. Its second moment becomes

    E'[F_l'^2] = E[F_l^2 s(T) / s(T / ratio) / ratio] = E[F_l^2 s(T) / min(T, ratio)]

which is E[F_l^2] as long as s(T) = T: with another p such a path is as bright as before, and alive more or less often.

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


@wp.func
def late_response(throughput: float, ratio: float) -> float:
    """The factor of F_l^2, had its direction been drawn with `ratio` times the density; `throughput`: T / SAFETY."""
    T = SAFETY * throughput
    return wp.min(T, 1.0) / wp.max(wp.min(T, ratio), 1.0e-20)
