"""The random numbers of a path's decisions, except for the choice of strategy and what the spatial cache decides."""

from types import SimpleNamespace

from warpmis.kernels import lattice, rng
from warpmis.scene.features import Features


def make_sampler(features: Features) -> SimpleNamespace:
    """Functions of_pixel(key, block), of_step(key, step, purpose) and independent_of_step, which is on no lattice: four
    numbers in [0, 1) each."""
    independent = rng.uniform4_of_step
    if features.sampler == "lattice":
        return SimpleNamespace(of_pixel=lattice.point4, of_step=lattice.point4_of_step, independent_of_step=independent)
    return SimpleNamespace(of_pixel=rng.uniform4, of_step=independent, independent_of_step=independent)
