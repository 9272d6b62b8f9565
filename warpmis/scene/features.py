"""Which effects a scene and a run call for: everything that is static in a kernel is a field here.

A kernel is generated for one Features value. What is off is absent from the kernel's source.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpmis.scene import CylinderLight, DiskLight, DistantLight, DomeLight, Material, RectLight, Scene, SphereLight
from warpmis.scene.light_control import LightControl
from warpmis.scene.material import MATTE_ALPHA, SMOOTH_ALPHA, is_rough, is_smooth
from warpmis.scene.texture import PrimvarLookup, TextureLookup, bounds_of

# Up to so many lights are weighed one by one; measured by scripts/bench/many_lights.py.
FEW_LIGHTS = 8


@dataclass(frozen=True)
class Features:
    """Effects, hashable. The strategies are part of it: a run without a mixture has none.

    Attributes:
        rect_light .. mesh_light: lights by kind; delta_light: point lights and distant lights of angle 0.
        dome_constant, dome_picture: an environment of one colour, or a lat-long picture.
        light_tree: so many lights at a distance, or so many points, that they are chosen by trees; rays meet the former
            through theirs.
        shaping: lights that shine not alike in all directions; ies: those by a profile.
        light_pictures: rect lights with a picture; light_tints: geometry that lights in another color than it glows.
        light_response: lights that diffuse and specular lobes see differently.
        glossy_choice: several lights, and surfaces with a glossy lobe, by which one of them is chosen.
        light_links, shadow_links: lights that do not reach all prims, or that not all prims stand in the way of.
        specular: a GGX lobe; clearcoat: a second one; smooth: a lobe so smooth that it is a mirror.
        opacity: surfaces that let rays straight through.
        transmission: dielectric interfaces that refract; rough_transmission: some are so rough that light samples are
            taken; absorption: within some of them light is lost.
        instances: prototypes that are traced through the transforms of their places; emissive_instances: of some of
            them triangles emit.
        shading_normals: normals that differ from the triangle's.
        textures, vertex_colors: material inputs that are pictures, or primvars; normal_maps: normals from pictures.
        orthographic, depth_of_field, clipping: cameras other than a pinhole; clipping planes.
        indirect: light by way of more than one surface: some surface reflects, and paths are long enough.
        strategies: names of the mixture's strategies at the first vertex; () is plain next-event estimation.
        statistics: what learning adds up beside the moments (methods.py).
        cache: a spatial cache guides paths at every vertex.
        allocation: what a pixel's numbers are: "shares" of the strategies in one direction; or of next-event
            estimation's two samples "counts", "weights", or coefficients of their "control".
        contributions: "summed", or "apart": light is kept apart by the path that it took, for AOVs.
        sampler: what the numbers of a path are: a lattice up to the first vertex, or independent.
        tree: what rays are traced through: "wide" nodes for a CPU, or "warp", Warp's own mesh, for a GPU.
    """

    rect_light: bool = False
    disk_light: bool = False
    sphere_light: bool = False
    cylinder_light: bool = False
    distant_light: bool = False
    dome_constant: bool = False
    dome_picture: bool = False
    mesh_light: bool = False
    delta_light: bool = False
    light_tree: bool = False
    shaping: bool = False
    ies: bool = False
    light_pictures: bool = False
    light_tints: bool = False
    light_response: bool = False
    glossy_choice: bool = False
    light_links: bool = False
    shadow_links: bool = False
    specular: bool = False
    clearcoat: bool = False
    smooth: bool = False
    opacity: bool = False
    transmission: bool = False
    rough_transmission: bool = False
    absorption: bool = False
    instances: bool = False
    emissive_instances: bool = False
    shading_normals: bool = False
    textures: bool = False
    vertex_colors: bool = False
    normal_maps: bool = False
    orthographic: bool = False
    depth_of_field: bool = False
    clipping: bool = False
    indirect: bool = False
    strategies: tuple[str, ...] = ()
    statistics: tuple[str, ...] = ()
    cache: bool = False
    allocation: str = "shares"
    contributions: str = "summed"
    sampler: str = "lattice"
    tree: str = "wide"

    @property
    def controlled(self) -> bool:
        """Whether any light's radiance is not the same in all directions and for all receivers."""
        asked = (self.shaping, self.light_pictures, self.light_tints, self.light_response)
        return any((*asked, self.light_links, self.shadow_links))

    @property
    def keeps_light_apart(self) -> bool:
        return self.contributions == "apart"

    @property
    def splits_lobes(self) -> bool:
        """Whether the diffuse lobe's share of what a surface scatters is asked for."""
        return self.light_response or self.keeps_light_apart

    @classmethod
    def all(cls, strategies: tuple[str, ...] = ()) -> Features:
        """Every effect on: the universal kernel."""
        effects = {f.name: True for f in fields(cls) if f.type == "bool" and f.name != "cache"}
        return cls(strategies=strategies, **effects)  # type: ignore[arg-type]  # mypy takes any field for any key

    def with_strategies(self, strategies: tuple[str, ...], statistics: tuple[str, ...] = ()) -> Features:
        return replace(self, strategies=strategies, statistics=statistics)

    def with_sampler(self, sampler: str = "lattice") -> Features:
        return replace(self, sampler=sampler)

    def with_cache(self) -> Features:
        return replace(self, cache=True)

    def with_allocation(self, allocation: str) -> Features:
        return replace(self, allocation=allocation)

    def with_contributions(self, contributions: str = "summed") -> Features:
        return replace(self, contributions=contributions)

    def with_tree(self, tree: str) -> Features:
        return replace(self, tree=tree)

    def with_depth(self, max_depth: int) -> Features:
        """What paths of so many bounces need of these effects."""
        return replace(self, indirect=self.indirect and max_depth > 1)


def is_emissive(material: Material) -> bool:
    return max(material.mean_emission) > 0.0


def reflects(material: Material) -> bool:
    """Whether the material scatters any light; one with a specular lobe always does."""
    constant: Any = material.mean
    return not material.lambertian or max(constant.diffuse_color) > 0.0


def is_glossy(material: Material) -> bool:
    """Whether the specular lobe or the coat is neither a mirror nor as good as matte, somewhere."""
    coated = bounds_of(material.clearcoat)[1] > 0.0
    roughnesses = [material.roughness, *([material.clearcoat_roughness] if coated else [])]
    bounds = [bounds_of(one) for one in roughnesses]
    return any(low**2 < MATTE_ALPHA and high**2 >= SMOOTH_ALPHA for low, high in bounds)


def is_delta(light: object) -> bool:
    """Whether a light has no extent in direction: a point, or a distant light of angle 0."""
    if isinstance(light, SphereLight):
        return light.radius == 0.0
    return isinstance(light, DistantLight) and light.half_angle == 0.0


def has_point_tree(scene: Scene) -> bool:
    """Whether the point lights are too many to weigh one by one."""
    return sum(is_delta(light) and not isinstance(light, DistantLight) for light in scene.lights) > FEW_LIGHTS


def emissive_materials(scene: Scene) -> NDArray[np.bool_]:
    """Whether each material emits, shape (materials,); one that does not where there is none."""
    return np.array([is_emissive(material) for material in scene.materials] or [False])


def has_emissive_instances(scene: Scene) -> bool:
    """Whether triangles of prototypes emit."""
    emits = emissive_materials(scene)
    return any(bool(emits[prototype.geometry.materials].any()) for prototype in scene.prototypes)


def has_light_tree(scene: Scene) -> bool:
    """Whether the lights of an extent at a distance, triangles that emit among them, are too many for that. Those of
    prototypes are never weighed one by one."""
    if has_emissive_instances(scene):
        return True
    emits = emissive_materials(scene)
    triangles = int(emits[scene.geometry.materials].sum()) if len(scene.geometry.materials) else 0
    at_infinity = DistantLight | DomeLight
    analytic = sum(not is_delta(light) and not isinstance(light, at_infinity) for light in scene.lights)
    return analytic + triangles > FEW_LIGHTS


def has_several_lights(scene: Scene) -> bool:
    """Whether one of them has to be chosen."""
    if has_light_tree(scene):
        return True
    emits = emissive_materials(scene)
    materials = scene.geometry.materials
    glowing = len(np.unique(scene.geometry.prims[emits[materials]])) if len(materials) else 0
    return len(scene.lights) + glowing > 1


def has_gloss(scene: Scene) -> bool:
    """Whether a material in use has a lobe by which one of several lights is chosen."""
    used = (scene.materials[index] for index in scene.used_materials)
    return any(is_glossy(material) for material in used if not material.lambertian)


def light_controls(scene: Scene) -> list[LightControl]:
    """What is asked for of all lights, those made of geometry included."""
    return [light.control for light in scene.lights] + [prim.control for prim in scene.prims]


def detect(scene: Scene) -> Features:
    """The effects that the scene's triangles and lights call for; materials that no triangle uses do not count."""
    used = [scene.materials[i] for i in scene.used_materials]
    specular = [m for m in used if not m.lambertian]
    coated = [m for m in specular if bounds_of(m.clearcoat)[1] > 0.0]
    glass = [m for m in used if m.transmission > 0.0]
    lookups = [lookup for m in used for lookup in m.lookups.values()]
    return replace(
        _light_effects(scene),
        mesh_light=any(is_emissive(m) for m in used),
        glossy_choice=has_gloss(scene) and has_several_lights(scene),
        specular=bool(specular),
        clearcoat=bool(coated),
        smooth=any(is_smooth(m.roughness) for m in specular) or any(is_smooth(m.clearcoat_roughness) for m in coated),
        opacity=any(m.mean.opacity < 1.0 or m.is_clear_pane for m in used),
        transmission=bool(glass),
        rough_transmission=any(is_rough(m.roughness) for m in glass),
        absorption=any(m.transmission_depth > 0.0 and not m.thin_walled for m in glass),
        instances=bool(scene.prototypes),
        emissive_instances=has_emissive_instances(scene),
        shading_normals=any(bool((part.normal_indices >= 0).any()) for part in scene.parts),
        textures=any(isinstance(lookup, TextureLookup) for lookup in lookups),
        vertex_colors=any(isinstance(lookup, PrimvarLookup) for lookup in lookups),
        normal_maps=any(m.normal is not None for m in used),
        orthographic=scene.camera.orthographic,
        depth_of_field=scene.camera.lens_radius > 0.0,
        clipping=len(scene.camera.clipping_planes) > 0,
        indirect=any(reflects(m) for m in used),
    )


def _light_effects(scene: Scene) -> Features:
    """Those of all lights that are not made of geometry, and of the controls of all."""
    extended = [light for light in scene.lights if not is_delta(light)]
    domes = [light for light in extended if isinstance(light, DomeLight)]
    controls = light_controls(scene)

    def has(kind: type) -> bool:
        return any(isinstance(light, kind) for light in extended)

    return Features(
        rect_light=has(RectLight),
        disk_light=has(DiskLight),
        sphere_light=has(SphereLight),
        cylinder_light=has(CylinderLight),
        distant_light=has(DistantLight),
        # Several domes are added up: one picture among them makes the sum a picture.
        dome_constant=bool(domes) and all(d.picture is None for d in domes),
        dome_picture=any(d.picture is not None for d in domes),
        delta_light=len(extended) < len(scene.lights),
        light_tree=has_light_tree(scene) or has_point_tree(scene),
        shaping=any(control.shaping is not None for control in controls),
        ies=any(control.shaping is not None and control.shaping.ies is not None for control in controls),
        light_pictures=any(control.picture is not None for control in controls),
        light_tints=any(control.tint is not None for control in controls),
        light_response=any(control.changes_response for control in controls),
        light_links=any(control.illuminates is not None for control in controls),
        shadow_links=any(control.shadow_casters is not None for control in controls),
    )
