"""One kernel for many scenes: rendered with the effects that they call for together, which a set of files shares.

An effect that is off costs nothing, one that is on without need a little time; each other set of them costs a kernel,
which is compiled for seconds. That a scene's own kernel traces the same paths is asserted in
unit/rendering/test_effects.py.
"""

from __future__ import annotations

import dataclasses

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
    specular=True,
    smooth=True,
    opacity=True,
    shading_normals=True,
    indirect=True,
)
CONTROLLED_LIGHTS = dataclasses.replace(
    LIGHTS,
    clearcoat=True,
    shaping=True,
    ies=True,
    light_pictures=True,
    light_tints=True,
    light_response=True,
    light_links=True,
    shadow_links=True,
)


def covering(features: Features, scene: warpmis.Scene) -> Features:
    """The features, of which none that the scene calls for is missing; the tree over the lights as the scene has it."""
    own = detect(scene)
    features = dataclasses.replace(features, light_tree=own.light_tree)
    missing = effects_of(own) - effects_of(features)
    assert not missing, f"the scene calls for {missing}"
    return features


def effects_of(features: Features) -> set[str]:
    return {name for name, on in dataclasses.asdict(features).items() if on is True}
