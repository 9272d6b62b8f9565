"""How far from the best the allocation can be: a bound on what any other shares of the same strategies could save.

M2 is convex in the allocation, so its tangent at a bounds it from below:  V(a) - V* <= max_s m_s - M2,  which is 0 just
at the optimum, where m_s = M2 for every strategy in use.

Reference: Boyd and Vandenberghe (2004), "Convex Optimization", section 3.1.3; moments as in kernels/moments.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def excess_variance_bound(
    moments: NDArray[np.float64], allocation: NDArray[np.float32], samples: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Bound on the variance of one sample in excess of the best allocation's, per pixel; an estimate, from samples.

    Args:
        moments: sums, shape (pixels, K), the S first moments first.
        allocation: shares that the samples were taken with, shape (pixels, S).
        samples: samples in the sums, shape (pixels,).
    """
    count = allocation.shape[1]
    first = moments[:, :count] / np.maximum(samples, 1)[:, None]
    second_moment = np.einsum("ps,ps->p", first, allocation)
    return np.maximum(first.max(axis=1) - second_moment, 0.0)
