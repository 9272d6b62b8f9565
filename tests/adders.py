"""The trace kernel's adders run on their own: each sample's addition to the moments, to be averaged without noise."""

from functools import cache

import numpy as np
import warp as wp

from warpmis.kernels.moments import Layout, make_moments


@cache
def of_mixture(layout: Layout) -> wp.Kernel:
    """Kernel: (F, F_l, throughput at roulette, early cost, late cost, q, a) -> what one sample of the mixture adds."""
    moments = make_moments(layout)
    vec_k = layout.vec
    vec_s = wp.types.vector(length=layout.strategies, dtype=wp.float32)

    @wp.kernel(module="unique", enable_backward=False)
    def mixture(
        F: wp.array(dtype=wp.vec3),
        F_late: wp.array(dtype=wp.vec3),
        throughput: wp.array(dtype=float),
        early: wp.array(dtype=float),
        late: wp.array(dtype=float),
        q: wp.array(dtype=vec_s),
        a: vec_s,
        out: wp.array(dtype=vec_k),
    ):
        i = wp.tid()
        sums = moments.add(vec_k(), F[i], q[i])
        out[i] = moments.add_statistics(sums, F[i], F_late[i], throughput[i], early[i], late[i], q[i], a)

    return mixture


@cache
def of_pair(layout: Layout) -> wp.Kernel:
    """Kernel: (light, s_light, direct, indirect, late part, throughput at roulette, s_bsdf, early cost, late cost,
    shadow rays of the light sample) -> what one pair of next-event estimation adds."""
    moments = make_moments(layout)
    vec_k = layout.vec

    @wp.kernel(module="unique", enable_backward=False)
    def pair(
        light: wp.array(dtype=wp.vec3),
        s_light: wp.array(dtype=float),
        direct: wp.array(dtype=wp.vec3),
        indirect: wp.array(dtype=wp.vec3),
        F_late: wp.array(dtype=wp.vec3),
        throughput: wp.array(dtype=float),
        s_bsdf: wp.array(dtype=float),
        early: wp.array(dtype=float),
        late: wp.array(dtype=float),
        light_rays: wp.array(dtype=float),
        out: wp.array(dtype=vec_k),
    ):
        i = wp.tid()
        out[i] = moments.add_pair(
            vec_k(),
            light[i],
            s_light[i],
            direct[i],
            indirect[i],
            F_late[i],
            throughput[i],
            s_bsdf[i],
            early[i],
            late[i],
            int(light_rays[i]),
        )

    return pair


def added_by_mixture(
    layout: Layout,
    F: np.ndarray,
    q: np.ndarray,
    a: np.ndarray,
    early: np.ndarray,
    late: np.ndarray,
    F_late: np.ndarray | None = None,
    throughput: float = 1.0,
) -> np.ndarray:
    """Shape (n, K), of F and its late part (None: there is none), shape (n, 3), q, shape (n, S), costs, shape (n,)."""
    F_late = np.zeros_like(F) if F_late is None else F_late
    at_roulette = np.full(len(F), throughput)
    vec_s = wp.types.vector(length=layout.strategies, dtype=wp.float32)
    out = wp.zeros(len(F), dtype=layout.vec, device="cpu")
    arrays = [
        array(F, wp.vec3),
        array(F_late, wp.vec3),
        array(at_roulette, float),
        array(early, float),
        array(late, float),
        array(q, vec_s),
    ]
    wp.launch(of_mixture(layout), dim=len(F), inputs=[*arrays, vec_s(*a), out], device="cpu")
    return out.numpy()


def added_by_pair(layout: Layout, *samples: np.ndarray) -> np.ndarray:
    """Shape (n, K), of the arguments of `of_pair`, radiances of shape (n, 3), the rest of shape (n,)."""
    out = wp.zeros(len(samples[0]), dtype=layout.vec, device="cpu")
    arrays = [array(values, wp.vec3 if values.ndim == 2 else float) for values in samples]
    wp.launch(of_pair(layout), dim=len(samples[0]), inputs=[*arrays, out], device="cpu")
    return out.numpy()


def array(values: np.ndarray, dtype: type) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=dtype, device="cpu")


def grey(values: np.ndarray) -> np.ndarray:
    """Radiances of which all three colours are the same."""
    return np.repeat(np.asarray(values)[:, None], 3, axis=1)
