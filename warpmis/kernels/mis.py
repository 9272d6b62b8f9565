"""The only place where a multiple-importance-sampling weight is computed. All densities are in solid angle."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def balance_weight(pdf: float, other: float) -> float:
    """Balance heuristic of two strategies with a sample each: pdf / (pdf + other), with no overflow.

    Reference: Veach (1997), equation 9.8.
    """
    if pdf <= 0.0:
        return 0.0
    return 1.0 / (1.0 + other / pdf)
