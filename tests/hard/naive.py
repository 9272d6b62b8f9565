"""Newton's step as one would first write it, in float32 and without a guard: what the hard cases do to it.

The switch is here, not in the product: `step(naive=True)` against the same samples by the kernels of learn/.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from toys import solve, sums

from warpmis.kernels.moments import Layout
from warpmis.learn.newton_seed import make_newton_seed

FloatArray = NDArray[np.float64]

# F of each sample, q_s of each, and the shares that they were drawn with.
Samples = tuple[FloatArray, FloatArray, FloatArray]


def step(samples: Samples, naive: bool) -> FloatArray:
    """The next shares."""
    F, q, a = samples
    if not naive:
        layout = Layout(len(a))
        return solve(make_newton_seed(layout), layout.vec, sums(F[None] ** 2, q[None]), a[None], 0.1, 0.9)[0]
    F2 = F.astype(np.float32) ** 2
    r = (q[:, :-1] - q[:, -1:]).astype(np.float32)
    gradient = -(F2 @ r)
    hessian = 2.0 * np.einsum("n,ns,nt->st", F2, r, r)
    others = a[:-1] - np.linalg.inv(hessian) @ gradient
    return np.append(others, 1.0 - others.sum())


def of_first_alone(F: float, share: float, count: int = 1) -> Samples:
    """Samples of the first of two strategies, where the second has density 0."""
    return np.full(count, F), np.array([[1.0 / share, 0.0]] * count), np.array([share, 1.0 - share])


def alike(count: int) -> Samples:
    """Densities that are equal but for float32's last digit."""
    rng = np.random.default_rng(1)
    q = 1.0 + 2.0**-23 * rng.integers(-1, 2, size=(64, count))
    return rng.exponential(size=64), q, np.full(count, 1.0 / count)


def eight() -> Samples:
    """Six strategies with one density that finds nothing, two with another that finds the lamp."""
    useless = np.array([True, False, True, True, False, True, True, True])
    lamp = np.where(useless, 0.04, 3.88)
    return np.array([1.0, 1.2, 0.8]), np.stack([lamp] * 3), np.full(8, 0.125)


SAMPLES: dict[str, Callable[[], Samples]] = {
    "no-light-reaches-a-pixel": lambda: of_first_alone(0.0, 0.5),
    "light-density-0-where-light-is": lambda: of_first_alone(1.0, 0.9),
    "thousand-rounds-of-one-sample": lambda: of_first_alone(1.0, 0.75),
    "equal-densities": lambda: alike(2),
    "eight-strategies-six-useless": eight,
    "light-of-1e+18": lambda: of_first_alone(5e17, 0.5, count=1024),
    "light-of-1e-30": lambda: of_first_alone(1e-30, 0.5),
}


def outcome(name: str, naive: bool) -> str:
    """What becomes of the first share, in words."""
    try:
        with np.errstate(all="ignore"):
            shares = step(SAMPLES[name](), naive)
    except np.linalg.LinAlgError:
        return "no solution: the matrix is singular"
    if not np.isfinite(shares).all():
        return "a share that is no number"
    if shares.min() < 0.0 or shares.max() > 1.0:
        return f"a share of {shares[np.abs(shares).argmax()]:.3g}"
    return f"shares from {shares.min():.3g} to {shares.max():.3g}"
