"""The lights of a scene as one sampler of directions, specialised to the kinds that the scene holds.

choice.py chooses a light, of many by the tree of tree.py; kinds.py samples it, control.py changes what it sends,
on_ray.py has those that a ray meets.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import SceneView
from warpmis.kernels.light.choice import density, make_choice
from warpmis.kernels.light.control import make_control
from warpmis.kernels.light.kinds import make_kinds
from warpmis.kernels.light.on_ray import make_on_ray
from warpmis.kernels.light.records import NO_LIGHT, LightChoice, LightSample, Receiver
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


def make_lights(features: Features) -> SimpleNamespace:
    """Light functions for the kinds in `features`: receiver, importance_of, density, sample, sample_finite,
    sample_infinite, sample_light, hit, gather, emitter_density, light_of_emitter, pdf_emitter_triangles; and those of
    `control` and `tree`."""
    chooser = make_choice(features)
    kinds = make_kinds(features)
    control = make_control(features)
    on_ray = make_on_ray(features, chooser, kinds, control)

    @wp.func
    def sample_chosen(scene: SceneView, r: wp.ref[Receiver], c: LightChoice, total: float, u: wp.vec4) -> LightSample:
        """A direction towards the light that was chosen among importances that sum to `total`, which the density holds;
        none if no light was."""
        s = LightSample()
        if c.light != NO_LIGHT:
            s = kinds.sample_light(scene, scene.lights[c.light], c.emitter, c.instance, r.x, r.n, u)
            s.light = c.light
            s.pdf_of_light = s.pdf_solid_angle
            s.pdf_solid_angle = s.pdf_of_light * (c.importance / total)
        return s

    @wp.func
    def sample(scene: SceneView, r: wp.ref[Receiver], u: wp.vec4) -> LightSample:
        """A direction towards the receiver's light. u[0] made that choice, in a tree with u[1] as the last digits."""
        v = u
        if chooser.has_tree(scene):
            v[1] = r.choice.u_remapped
        return sample_chosen(scene, r, r.choice, r.total, v)

    @wp.func
    def sample_finite(scene: SceneView, r: wp.ref[Receiver], u: wp.vec4) -> LightSample:
        """The same among the lights at a distance; u[0] chooses one and, remapped, stands in for u[1]."""
        choice = LightChoice()
        if chooser.has_tree(scene):
            if wp.static(features.light_tree):
                of_root = chooser.tree.importances(scene.light_tree, 0, r)
                choice = chooser.choose_from_tree(scene, r, of_root, u[0])
        else:
            choice = chooser.choose(scene, r, 0, scene.finite_light_count, 0.0, u[0] * r.finite)
        return sample_chosen(scene, r, choice, r.finite, wp.vec4(u[0], choice.u_remapped, u[2], u[3]))

    @wp.func
    def sample_infinite(scene: SceneView, r: wp.ref[Receiver], u: wp.vec4) -> LightSample:
        """The same among the lights at infinity."""
        choice = chooser.choose(scene, r, scene.finite_light_count, scene.light_count, 0.0, u[0] * r.infinite)
        return sample_chosen(scene, r, choice, r.infinite, wp.vec4(u[0], choice.u_remapped, u[2], u[3]))

    return SimpleNamespace(
        receiver=chooser.receiver,
        importance_of=chooser.importance_of,
        density=density,
        sample=sample,
        sample_finite=sample_finite,
        sample_infinite=sample_infinite,
        sample_light=kinds.sample_light,
        hit=kinds.hit,
        gather=on_ray.gather,
        emitter_density=on_ray.emitter_density,
        light_of_emitter=on_ray.light_of_emitter,
        pdf_emitter_triangles=on_ray.pdf_emitter_triangles,
        control=control,
        tree=chooser.tree,
    )
