"""The trace kernel's adders run on their own: each sample's addition to the moments, to be averaged without noise."""

from functools import cache

import numpy as np
import warp as wp

from warpmis.kernels.moments import Layout, make_moments


@cache
def of_mixture(layout: Layout) -> wp.Kernel:
    """Kernel: (F, early cost, late cost, q, a) -> what one sample of the mixture adds."""
    moments = make_moments(layout)
    vec_k = layout.vec
    vec_s = wp.types.vector(length=layout.strategies, dtype=wp.float32)

    @wp.kernel(module="unique", enable_backward=False)
    def mixture(
        F: wp.array(dtype=wp.vec3),
        early: wp.array(dtype=float),
        late: wp.array(dtype=float),
        q: wp.array(dtype=vec_s),
        a: vec_s,
        out: wp.array(dtype=vec_k),
    ):
        i = wp.tid()
        sums = moments.add(vec_k(), F[i], q[i])
        out[i] = moments.add_statistics(sums, F[i], early[i], late[i], q[i], a)

    return mixture


def added_by_mixture(
    layout: Layout,
    F: np.ndarray,
    q: np.ndarray,
    a: np.ndarray,
    early: np.ndarray,
    late: np.ndarray,
) -> np.ndarray:
    """Shape (n, K), of F, shape (n, 3), q, shape (n, S), costs, shape (n,)."""
    vec_s = wp.types.vector(length=layout.strategies, dtype=wp.float32)
    out = wp.zeros(len(F), dtype=layout.vec, device="cpu")
    arrays = [
        array(F, wp.vec3),
        array(early, float),
        array(late, float),
        array(q, vec_s),
    ]
    wp.launch(of_mixture(layout), dim=len(F), inputs=[*arrays, vec_s(*a), out], device="cpu")
    return out.numpy()


def array(values: np.ndarray, dtype: type) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=dtype, device="cpu")


def grey(values: np.ndarray) -> np.ndarray:
    """Radiances of which all three colours are the same."""
    return np.repeat(np.asarray(values)[:, None], 3, axis=1)
