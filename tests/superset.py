"""Kernels that tests share: a scene is traced with the effects of a common set on, where one holds its own.

An effect that is on without need costs a little time in each sample; a kernel of its own costs seconds to compile. That
a scene's own kernel traces the same paths is asserted in unit/rendering/test_effects.py. The whole suite by each
scene's own kernels: `pytest --own-kernels`.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import warpmis
from warpmis.scene.features import Features, detect

LIGHTS = Features(
    rect_light=True,
    disk_light=True,
    sphere_light=True,
    cylinder_light=True,
    distant_light=True,
    dome_constant=True,
    mesh_light=True,
    delta_light=True,
    glossy_choice=True,
    specular=True,
    smooth=True,
    opacity=True,
    shading_normals=True,
    clipping=True,
    indirect=True,
)
LOOKS = replace(
    LIGHTS,
    clearcoat=True,
    dome_picture=True,
    textures=True,
    vertex_colors=True,
    normal_maps=True,
    orthographic=True,
    depth_of_field=True,
)
CONTROLS = replace(
    LIGHTS,
    clearcoat=True,
    dome_picture=True,
    shaping=True,
    ies=True,
    light_pictures=True,
    light_tints=True,
    light_response=True,
    light_links=True,
    shadow_links=True,
)
GLASS = replace(LIGHTS, transmission=True, rough_transmission=True, absorption=True)
TREES = replace(LIGHTS, light_tree=True, shaping=True, light_response=True, light_links=True, shadow_links=True)
# What paths are built differently with is as the scene has it: those kernels are not the same code.
AS_THE_SCENE_HAS_IT = ("light_tree", "instances", "emissive_instances")


def shared(scene: warpmis.Scene) -> Features:
    """The first of the common sets of effects that holds those of the scene, or just these. A kernel of all effects
    takes as long to compile as three of a scene's own; so does one of the larger sets with a tree of lights, which few
    scenes have: they share a set of their own."""
    own = detect(scene)
    kept = {name: getattr(own, name) for name in AS_THE_SCENE_HAS_IT}
    alone = () if any(kept.values()) else (LOOKS, CONTROLS, GLASS)
    sets = (TREES,) if own.light_tree else (LIGHTS, *alone)
    candidates = (replace(one, **kept) for one in (*sets, own))
    return next(features for features in candidates if effects_of(own) <= effects_of(features))


def effects_of(features: Features) -> set[str]:
    return {name for name, on in asdict(features).items() if on is True}
