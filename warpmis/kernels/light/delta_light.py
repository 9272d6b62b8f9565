"""Delta lights: of one direction or one point, which no sampled direction can hit. They have a list of their own.

A few are weighed one by one. Of many points one is chosen by a tree (tree.py), whose root stands for all of them.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import DELTA_DISTANT, SceneView, vec8f
from warpmis.kernels.lanes import splat8
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.records import NO_LIGHT, Receiver
from warpmis.kernels.light.response import towards
from warpmis.kernels.shading_frame import luminance
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.struct
class DeltaSample:
    """One delta light, as a receiver meets it.

    index: row of SceneView.delta_lights, or NO_LIGHT; wi, distance: where it is; irradiance: across wi, unoccluded;
    importance: what it is chosen by, the irradiance' luminance times the cosine; inverse_pmf: one over the probability
    of the choice.
    """

    index: int
    wi: wp.vec3
    distance: float
    irradiance: wp.vec3
    importance: float
    inverse_pmf: float


def make_delta_light(features: Features, control: SimpleNamespace, tree: SimpleNamespace) -> wp.Function:
    """The function sample_delta_light; `tree` as of make_light_tree."""

    @wp.func
    def delta_light(scene: SceneView, index: int, r: wp.ref[Receiver]) -> DeltaSample:
        light = scene.delta_lights[index]
        s = DeltaSample()
        s.index = index
        s.wi = light.vector
        s.distance = INFINITE_DISTANCE
        falloff = float(1.0)
        if light.kind != DELTA_DISTANT:
            to_light = light.vector - r.x
            s.distance = wp.length(to_light)
            s.wi = to_light / wp.max(s.distance, 1.0e-20)
            falloff = 1.0 / wp.max(s.distance * s.distance, 1.0e-20)
        s.irradiance = light.intensity * falloff
        s.importance = light.luminance * falloff * wp.max(wp.dot(r.n, s.wi), 0.0)
        if wp.static(features.controlled):
            factor = control.factor(scene, scene.light_count + index, r, s.wi)
            s.irradiance = wp.cw_mul(s.irradiance, factor)
            seen = luminance(wp.cw_mul(light.intensity, factor))
            s.importance = seen * falloff * wp.max(wp.dot(r.n, s.wi), 0.0)
        if wp.static(features.glossy_choice):
            s.importance = s.importance * towards(r.response, r.n, s.wi, 0.0)
        return s

    @wp.func
    def sample_delta_light(scene: SceneView, r: wp.ref[Receiver], u: float) -> DeltaSample:
        """One of them, in proportion to its importance: a reservoir of one, with a single random number.

        Reference: Chao (1982), "A General Purpose Unequal Probability Sampling Plan".
        """
        chosen = DeltaSample()
        chosen.index = NO_LIGHT
        total = float(0.0)
        u_remapped = float(u)
        first = int(0)
        in_tree = float(0.0)
        of_root = vec8f()
        if wp.static(features.light_tree):
            if scene.delta_tree.child_nodes.shape[0] > 0:
                first = scene.delta_point_count
                of_root = tree.importances(scene.delta_tree, 0, r)
                in_tree = wp.dot(of_root, splat8(1.0)) * scene.delta_brightest
                total = in_tree
        for i in range(first, scene.delta_light_count):
            s = delta_light(scene, i, r)
            if s.importance > 0.0:
                total += s.importance
                p = s.importance / total
                if u_remapped < p or total == s.importance:
                    u_remapped = u_remapped / p
                    chosen = s
                else:
                    u_remapped = (u_remapped - p) / (1.0 - p)
        if chosen.index != NO_LIGHT:
            chosen.inverse_pmf = total / chosen.importance
        elif in_tree > 0.0:
            if wp.static(features.light_tree):
                leaf = tree.choose_leaf(scene.delta_tree, r, of_root, u_remapped)
                chosen = delta_light(scene, leaf.leaf, r)
                chosen.inverse_pmf = total / (in_tree * leaf.pmf)
        return chosen

    return sample_delta_light
