"""The random numbers of a path's decisions, except for the choice of strategy and for Russian roulette."""

from types import SimpleNamespace

from warpmis.kernels import lattice, rng
from warpmis.scene.features import Features


def make_sampler(features: Features) -> SimpleNamespace:
    """Functions of_pixel(key, block) and of_step(key, step, purpose): four numbers in [0, 1) each."""
    if features.sampler == "lattice":
        return SimpleNamespace(of_pixel=lattice.point4, of_step=lattice.point4_of_step)
    return SimpleNamespace(of_pixel=rng.uniform4, of_step=rng.uniform4_of_step)
