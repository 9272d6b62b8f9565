"""Russian roulette: how likely a path is to go on, and what becomes of its light at other densities of its direction.

From DEPTH bounces on, a path goes on with the probability of its throughput, MAX_SURVIVAL at most, and is divided by
it. Let T be f / p of all its directions, without these divisions: after several roulettes it is alive with a
probability of about s(T) = min(T, 1). With another density of its direction, p' = ratio p, it would have T / ratio and
be alive with another probability. Of what it then finds, F_l, the second moment becomes

    E'[F_l'^2] = E[F_l^2 s(T) / s(T / ratio) / ratio] = E[F_l^2 s(T) / min(T, ratio)]

which is E[F_l^2] as long as s(T) = T: such a path is as bright whatever p, and only as often alive as it is worth.

Reference: Arvo, Kirk (1990), "Particle Transport and Image Synthesis".
"""

import warp as wp

# Bounces before the first roulette.
DEPTH = wp.constant(3)
MAX_SURVIVAL = wp.constant(0.95)


@wp.func
def survival(throughput: float) -> float:
    return wp.min(throughput, MAX_SURVIVAL)


@wp.func
def late_response(throughput: float, ratio: float) -> float:
    """The factor of F_l^2, had its direction been drawn with `ratio` times the density; `throughput`: T."""
    return wp.min(throughput, 1.0) / wp.max(wp.min(throughput, ratio), 1.0e-20)
