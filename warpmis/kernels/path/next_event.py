"""Next-event estimation: a light sample and a BSDF sample, which share the direct light by the balance heuristic.

Every vertex that is not a mirror does this, except the first one where a kernel has a mixture of strategies
(mixture.py). An estimator is a namespace of functions; those that next-event estimation does not need do nothing.

References: Kajiya (1986), "The Rendering Equation"; Veach (1997), section 9.2.2, the multi-sample model.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels import rng
from warpmis.kernels.bsdf.surface import Scattering
from warpmis.kernels.direct_light import ScatteredLight
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.path.state import Vertex
from warpmis.kernels.shading_frame import Frame, to_world

wp.set_module_options({"enable_backward": False})


@wp.struct
class NoEstimate:
    """Next-event estimation keeps nothing of a path beside its state."""


def make_next_event(
    PathState: type,
    vec_s: type,
    surface: SimpleNamespace,
    direct_light: SimpleNamespace,
    contributions: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator: begin, draws_by_bsdf, scatter, add_light, keep_densities, asks_whole_line, weigh_ray; its parts
    add_light_sample, draw_direction."""

    @wp.func
    def begin(scene: SceneView, path: wp.ref[PathState], key: rng.RngKey, allocation: vec_s, u_choice: float):
        """Before the camera ray: u_choice will choose at the first vertex that is no mirror."""
        path.u_choice = u_choice
        path.u_remapped = u_choice

    @wp.func
    def add_light_sample(
        scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex], count: float, ratio: float
    ) -> ScatteredLight:
        """One of `count`; ratio: of the weight of their density to that of the directions' that are drawn."""
        sample = direct_light.light_sample(scene, path.receiver, vertex)
        if sample.pdf > 0.0:
            weight = balance_weight(sample.pdf * ratio, sample.pdf_bsdf) / (sample.pdf * count)
            radiance = wp.cw_mul(path.beta, direct_light.shadowed(scene, path.receiver, sample) * weight)
            path.L += radiance
            contributions.light_sample(scene, path, radiance, sample.diffuse, path.receiver.choice.light)
            path.shadow_rays += 1
        return sample

    @wp.func
    def add_light(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """On the side of an interface to which the path does not go."""
        add_light_sample(scene, path, vertex, 1.0, 1.0)

    @wp.func
    def draw_direction(path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """The path's next direction, from the BSDF."""
        path.wi = to_world(vertex.frame, surface.sample(vertex.surface, vertex.u_bsdf))
        path.weighs_emission = True

    @wp.func
    def draws_by_bsdf(
        scene: SceneView, path: wp.ref[PathState], frame: Frame, beyond: float, key: rng.RngKey, step: int
    ) -> bool:
        """Whether the BSDF will draw the path's direction at an interface; beyond: the chance of the side there."""
        return True

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        """Add the direct light that the vertex samples, and draw the path's next direction."""
        add_light_sample(scene, path, vertex, 1.0, 1.0)
        draw_direction(path, vertex)

    @wp.func
    def keep_densities(path: wp.ref[PathState], vertex: wp.ref[Vertex], scattering: wp.ref[Scattering]):
        """Keep what is needed of the vertex until the ray has met its lights."""

    @wp.func
    def asks_whole_line(path: wp.ref[PathState]) -> bool:
        """Whether the density of the ray's direction needs all lights on its line, also those hidden."""
        return False

    @wp.func
    def weigh_ray(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> bool:
        """Divide by the density of the ray, where it is known only now; False where the path ends here."""
        return True

    return SimpleNamespace(
        begin=begin,
        draws_by_bsdf=draws_by_bsdf,
        scatter=scatter,
        add_light=add_light,
        keep_densities=keep_densities,
        asks_whole_line=asks_whole_line,
        weigh_ray=weigh_ray,
        add_light_sample=add_light_sample,
        draw_direction=draw_direction,
    )
