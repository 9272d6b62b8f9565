"""Delta events: passing straight through a surface, or a mirror's reflection.

They have no density in solid angle, so they take no part in the mixture of strategies nor in any MIS weight: one of
them, or the rest of the scattering, is chosen at random, and the path's weight is divided by the choice's probability.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView
from warpmis.kernels.bsdf.microfacet import schlick, schlick_scalar
from warpmis.kernels.bsdf.surface import SMOOTH_ALPHA
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

NONE = wp.constant(0)
PASS = wp.constant(1)
MIRROR = wp.constant(2)


@wp.struct
class Event:
    """What happens at a vertex. weight multiplies the path's throughput, the choice's probability divided out;
    after NONE the smooth lobes are accounted for and the vertex scatters by the rest."""

    kind: int
    weight: wp.vec3


def make_events(features: Features, transparency: wp.Function) -> SimpleNamespace:
    """Event functions: choose. transparency: intersect's share of light that goes straight through."""

    @wp.func
    def choose(material: MaterialView, cos_theta: float, u: float) -> Event:
        """Choose by the albedo of each: pass, mirror of the base, mirror of the coat, rest."""
        through = wp.vec3(0.0, 0.0, 0.0)
        base = wp.vec3(0.0, 0.0, 0.0)
        coat = float(0.0)
        # Share of the surface that is there; 1 where the lobes hold the opacity themselves.
        present = float(1.0)
        rest = luminance(material.diffuse)
        if wp.static(features.opacity):
            through = transparency(material, cos_theta)
            if material.opacity_is_presence:
                present = material.opacity
            else:
                rest = rest * material.opacity
        if wp.static(features.specular):
            below = float(1.0)
            if wp.static(features.clearcoat):
                coat = material.coat * schlick_scalar(material.coat_f0, cos_theta)
                below = (1.0 - coat) * (1.0 - coat)
                if material.coat_alpha >= SMOOTH_ALPHA:
                    rest = rest + coat
                    coat = 0.0
            if material.has_specular:
                base = schlick(material.specular_f0, cos_theta) * below
                if material.alpha >= SMOOTH_ALPHA:
                    rest = rest + luminance(base)
                    base = wp.vec3(0.0, 0.0, 0.0)
        base = base * present
        coat = coat * present
        rest = rest * present

        event = Event()
        w_through = luminance(through)
        w_base = luminance(base)
        total = w_through + w_base + coat + rest
        if total <= 0.0:
            return event
        target = u * total
        if target < w_through:
            event.kind = PASS
            event.weight = through * (total / w_through)
        elif target < w_through + w_base:
            event.kind = MIRROR
            event.weight = base * (total / w_base)
        elif target < w_through + w_base + coat:
            event.kind = MIRROR
            event.weight = wp.vec3(1.0, 1.0, 1.0) * total
        elif rest > 0.0:
            event.weight = wp.vec3(1.0, 1.0, 1.0) * (present * total / rest)
        return event

    return SimpleNamespace(choose=choose)
