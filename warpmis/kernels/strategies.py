"""The table of sampling strategies at the first non-specular vertex: each a name, a sampler and a density.

All densities are in solid angle and may be evaluated for any direction, whichever strategy drew it.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.features import Features
from warpmis.kernels.bsdf.surface import Surface
from warpmis.kernels.frame import Frame, to_world
from warpmis.kernels.light.table import Receiver

wp.set_module_options({"enable_backward": False})


@wp.struct
class Densities:
    """What the densities of all strategies are made of, for one direction."""

    bsdf: float
    light: float


def make_strategies(features: Features, surface: SimpleNamespace, lights: SimpleNamespace) -> SimpleNamespace:
    """Functions over the S = len(features.strategies) strategies: choose, sample, densities; type vec_s."""
    names = features.strategies
    count = len(names)
    vec_s = wp.types.vector(length=max(count, 1), dtype=wp.float32)

    @wp.func
    def choose(allocation: vec_s, u: float) -> int:
        """The strategy s with probability allocation[s]; never one of share 0."""
        chosen = int(-1)
        reached = float(0.0)
        for s in range(wp.static(count)):
            if allocation[s] > 0.0 and (chosen < 0 or u >= reached):
                chosen = s
            reached += allocation[s]
        return chosen

    @wp.func
    def sample(
        scene: SceneView, r: Receiver, frame: Frame, s: Surface, strategy: int, u: wp.vec4, v: wp.vec4
    ) -> wp.vec3:
        """A world direction from one strategy; the zero vector where it has none. u and v serve bsdf and light."""
        wi = wp.vec3(0.0, 0.0, 0.0)
        for i in range(wp.static(count)):
            if strategy == i:
                if wp.static(names[i] == "bsdf"):
                    local = surface.sample(s, u)
                    if local[2] > 0.0:
                        wi = to_world(frame, local)
                if wp.static(names[i] == "light"):
                    towards = lights.sample(scene, r, v)
                    if towards.pdf_solid_angle > 0.0:
                        wi = towards.wi
        return wi

    @wp.func
    def densities(parts: Densities) -> vec_s:
        p = vec_s()
        for i in range(wp.static(count)):
            if wp.static(names[i] == "bsdf"):
                p[i] = parts.bsdf
            if wp.static(names[i] == "light"):
                p[i] = parts.light
        return p

    return SimpleNamespace(choose=choose, sample=sample, densities=densities, vec_s=vec_s, count=count)
