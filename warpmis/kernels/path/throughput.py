"""The path's throughput: what a vertex makes of it, and Russian roulette."""

from types import SimpleNamespace

import warp as wp

from warpmis.kernels import rng, roulette
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_throughput(features: Features, surface: SimpleNamespace, estimator: SimpleNamespace) -> SimpleNamespace:
    """Functions: survives_roulette, update."""
    PathState = estimator.PathState

    @wp.func
    def survives_roulette(path: wp.ref[PathState], key: rng.RngKey, step: int) -> bool:
        """Whether the path goes on, its throughput divided by the probability of that (kernels/roulette.py)."""
        if path.bounces < roulette.DEPTH:
            return True
        survival = roulette.survival(wp.max(path.beta))
        estimator.record.roulette(path, survival)
        path.beta = path.beta / survival
        return rng.uniform4_of_step(key, step, rng.EVENT)[2] < survival

    @wp.func
    def update(path: wp.ref[PathState], vertex: wp.ref[Vertex], key: rng.RngKey, step: int) -> bool:
        """Multiply by f cos / pdf of the direction that was drawn; False where the path ends."""
        if wp.dot(path.wi, vertex.ng) <= 0.0:
            return False
        scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, path.wi))
        path.pdf_bsdf = scattering.pdf_solid_angle
        if wp.static(features.light_response):
            path.receiver.diffuse = scattering.diffuse
        estimator.keep_densities(path, vertex, scattering)
        path.beta = wp.cw_mul(path.beta, scattering.f_cos)
        if luminance(path.beta) <= 0.0:
            return False
        # A direction of the mixture is divided by its density when the ray has met its lights: Estimator.weigh_ray.
        survives = bool(True)
        if path.weighs_emission:
            path.beta = path.beta / path.pdf_bsdf
            if wp.static(features.indirect):
                survives = survives_roulette(path, key, step)
        return survives

    return SimpleNamespace(survives_roulette=survives_roulette, update=update)
