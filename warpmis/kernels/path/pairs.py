"""Next-event estimation that learns, at the first vertex that is no mirror, what a mixture would do there.

The light sample and the BSDF sample are a pair, one direction of each strategy. kernels/moments.py has the formulas
from pairs to any mixture of the two. The picture is the same as with next-event estimation.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.on_ray import LightsOnRay
from warpmis.kernels.path.state import Vertex

wp.set_module_options({"enable_backward": False})


def make_pairs(
    PathState: type,
    strategies: SimpleNamespace,
    densities: SimpleNamespace,
    next_event: SimpleNamespace,
    record: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator, with the functions of `next_event`, for the strategies bsdf and light."""
    bsdf, light = strategies.index("bsdf"), strategies.index("light")

    @wp.func
    def scatter(scene: SceneView, path: wp.ref[PathState], vertex: wp.ref[Vertex]):
        is_first = not path.has_scattered
        if is_first:
            record.begin(path)
            path.estimate.is_pending = True
        from_light = next_event.add_light_sample(scene, path, vertex)
        if is_first:
            record.light_sample(path, from_light)
        next_event.draw_direction(path, vertex)

    @wp.func
    def weigh_ray(scene: SceneView, path: wp.ref[PathState], on_ray: wp.ref[LightsOnRay]) -> bool:
        """The direction's p_s / (p_bsdf + p_light), for the record alone."""
        if path.estimate.is_pending:
            densities.complete(scene, path, on_ray)
            p = path.estimate.densities
            path.estimate.q = p / (p[wp.static(bsdf)] + p[wp.static(light)])
        return True

    return SimpleNamespace(
        begin=next_event.begin,
        scatter=scatter,
        keep_densities=densities.keep,
        asks_whole_line=densities.asks_whole_line,
        weigh_ray=weigh_ray,
    )
