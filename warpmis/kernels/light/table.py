"""The lights of a scene as one sampler of directions, specialised to the kinds that the scene holds.

choice.py chooses a light, kinds.py samples it, control.py changes what it sends, on_ray.py has those that a ray meets.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.choice import choose, density, importance, receiver
from warpmis.kernels.light.control import make_control
from warpmis.kernels.light.kinds import make_kinds
from warpmis.kernels.light.on_ray import make_on_ray, pdf_emitter_triangles
from warpmis.kernels.light.records import NO_LIGHT, LightSample, Receiver
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_lights(features: Features) -> SimpleNamespace:
    """Light functions for the kinds in `features`: receiver, importance, density, sample, sample_range, sample_light,
    hit, gather, pdf_emitter_triangles, and those of `control`."""
    kinds = make_kinds(features)
    control = make_control(features)

    @wp.func
    def sample_chosen(scene: SceneView, r: Receiver, chosen: int, chance: float, u: wp.vec4) -> LightSample:
        """A direction towards the light that was chosen with this chance, which the density holds; none of NO_LIGHT."""
        s = LightSample()
        if chosen != NO_LIGHT:
            s = kinds.sample_light(scene, scene.lights[chosen], r, u)
            s.light = chosen
            s.pdf_of_light = s.pdf_solid_angle
            s.pdf_solid_angle = s.pdf_of_light * chance
        return s

    @wp.func
    def sample(scene: SceneView, r: Receiver, u: wp.vec4) -> LightSample:
        """A direction towards the receiver's light. u[0] made that choice."""
        return sample_chosen(scene, r, r.chosen, r.chosen_importance / r.total, u)

    @wp.func
    def sample_range(scene: SceneView, r: Receiver, first: int, end: int, total: float, u: wp.vec4) -> LightSample:
        """The same among the lights first to end - 1, whose importances sum to `total`; u[0] chooses one, and
        remapped stands in for u[1]."""
        choice = choose(scene, r, first, end, total, u[0])
        v = wp.vec4(u[0], choice.u_remapped, u[2], u[3])
        return sample_chosen(scene, r, choice.light, choice.importance / total, v)

    return SimpleNamespace(
        receiver=receiver,
        importance=importance,
        density=density,
        sample=sample,
        sample_range=sample_range,
        sample_light=kinds.sample_light,
        hit=kinds.hit,
        gather=make_on_ray(features, kinds, control),
        pdf_emitter_triangles=pdf_emitter_triangles,
        control=control,
    )
