"""Events: passing straight through a surface, a mirror's reflection, or a passage of a dielectric interface.

They have no density in solid angle, or none that is asked for, so they take no part in the mixture of strategies nor in
any MIS weight: one of them, or the rest of the scattering, is chosen at random, and the path's weight is divided by the
choice's probability.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.bsdf.albedo import coat_albedo, lobe_albedo, white_albedo
from warpmis.kernels.bsdf.dielectric import fresnel_pane, is_clear_pane
from warpmis.kernels.bsdf.microfacet import SMOOTH_ALPHA
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

NONE = wp.constant(0)
PASS = wp.constant(1)
MIRROR = wp.constant(2)
INTERFACE = wp.constant(3)


@wp.struct
class Event:
    """What happens at a vertex. weight multiplies the path's throughput, the choice's probability divided out;
    after NONE the smooth lobes are accounted for and the vertex scatters by the rest. u_remapped: the number that chose
    an interface, remapped to [0, 1)."""

    kind: int
    weight: wp.vec3
    u_remapped: float


@wp.struct
class Albedos:
    """What share of the light each event takes, per colour where colours differ. rest: of all that has a density;
    present: share of the surface that is there and no interface, or 1 where the lobes hold the opacity themselves."""

    through: wp.vec3
    interface: float
    base: wp.vec3
    coat: float
    rest: float
    present: float


def make_events(features: Features, transparency: wp.Function) -> SimpleNamespace:
    """Event functions: choose. transparency: intersect's share of light that goes straight through."""

    @wp.func
    def albedos(scene: SceneView, material: MaterialView, cos_theta: float) -> Albedos:
        a = Albedos()
        a.present = 1.0
        a.rest = luminance(material.diffuse)
        if wp.static(features.opacity):
            a.through = transparency(scene, material, cos_theta)
            if material.opacity_is_presence:
                a.present = material.opacity
            else:
                a.rest = a.rest * material.opacity
        if wp.static(features.transmission):
            a.interface = a.present * material.transmission
            a.present = a.present - a.interface
            if is_clear_pane(material):
                a.interface = a.interface * fresnel_pane(cos_theta, material.ior)
        if wp.static(features.specular):
            below = float(1.0)
            if wp.static(features.clearcoat):
                a.coat = coat_albedo(scene.albedos, material.coat, material.coat_f0, material.coat_alpha, cos_theta)
                below = 1.0 - a.coat
                if material.coat_alpha >= SMOOTH_ALPHA:
                    a.rest = a.rest + a.coat
                    a.coat = 0.0
            if material.has_specular:
                white = white_albedo(scene.albedos, cos_theta, material.alpha)
                a.base = lobe_albedo(material.specular_f0, white) * below
                if material.alpha >= SMOOTH_ALPHA:
                    a.rest = a.rest + luminance(a.base)
                    a.base = wp.vec3(0.0, 0.0, 0.0)
        a.base = a.base * a.present
        a.coat = a.coat * a.present
        a.rest = a.rest * a.present
        return a

    @wp.func
    def choose(scene: SceneView, material: MaterialView, cos_theta: float, u: float) -> Event:
        """Choose by the albedo of each: interface, pass, mirror of the base, mirror of the coat, rest."""
        a = albedos(scene, material, cos_theta)
        event = Event()
        w_through = luminance(a.through)
        w_base = luminance(a.base)
        total = w_through + w_base + a.coat + a.rest
        if wp.static(features.transmission):
            total += a.interface
        if total <= 0.0:
            return event
        target = u * total
        if wp.static(features.transmission):
            if target < a.interface:
                event.kind = INTERFACE
                event.weight = wp.vec3(1.0, 1.0, 1.0) * total
                event.u_remapped = wp.min(target / a.interface, ONE_MINUS_EPSILON)
                return event
            target -= a.interface
        if target < w_through:
            event.kind = PASS
            event.weight = a.through * (total / w_through)
        elif target < w_through + w_base:
            event.kind = MIRROR
            event.weight = a.base * (total / w_base)
        elif target < w_through + w_base + a.coat:
            event.kind = MIRROR
            event.weight = wp.vec3(1.0, 1.0, 1.0) * total
        elif a.rest > 0.0:
            event.weight = wp.vec3(1.0, 1.0, 1.0) * (a.present * total / a.rest)
        return event

    return SimpleNamespace(choose=choose)
