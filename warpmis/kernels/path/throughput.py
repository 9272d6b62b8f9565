"""The path's throughput: what a vertex makes of it, and Russian roulette."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng, roulette
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_roulette(
    features: Features, PathState: type, record: SimpleNamespace, sampler: SimpleNamespace
) -> SimpleNamespace:
    """The function survives: Russian roulette by throughput, for paths that know nothing of the light to come."""

    @wp.func
    def survives(
        scene: SceneView,
        path: wp.ref[PathState],
        vertex: wp.ref[Vertex],
        scattering: wp.ref[Scattering],
        key: rng.RngKey,
        step: int,
    ) -> bool:
        """Whether the path goes on, its throughput divided by the probability of that (kernels/roulette.py)."""
        if wp.static(features.indirect):
            # The throughput of a direction of the mixture is not known yet.
            if path.bounces >= roulette.DEPTH and path.weighs_emission:
                survival = roulette.survival(wp.max(path.beta))
                record.roulette(path, survival)
                path.beta = path.beta / survival
                return sampler.independent_of_step(key, step, rng.EVENT)[2] < survival
        return True

    return SimpleNamespace(survives=survives)


def make_throughput(features: Features, surface: SimpleNamespace, estimator: SimpleNamespace) -> SimpleNamespace:
    """The function update."""
    PathState = estimator.PathState

    @wp.func
    def update(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], key: rng.RngKey, step: int) -> bool:
        """Multiply by f cos / pdf of the direction that was drawn; False where the path ends."""
        if wp.dot(path.wi, vertex.ng) <= 0.0:
            return False
        scattering = surface.evaluate(vertex.surface, to_local(vertex.frame, path.wi))
        path.pdf = scattering.pdf_solid_angle
        if wp.static(features.splits_lobes):
            path.receiver.diffuse = scattering.diffuse
        estimator.contributions.scatter(path, scattering.diffuse, vertex.surface.side.is_beyond)
        estimator.keep_densities(path, vertex, scattering)
        path.beta = wp.cw_mul(path.beta, scattering.f_cos)
        if luminance(path.beta) <= 0.0:
            return False
        # A direction of the mixture is divided by its density when the ray has met its lights: Estimator.weigh_ray.
        if path.weighs_emission:
            path.beta = path.beta / path.pdf
        return estimator.survives(scene, path, vertex, scattering, key, step)

    return SimpleNamespace(update=update)
