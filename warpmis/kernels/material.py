"""The material at a point: its record as it is, or resolved from inputs that vary over the surface."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from warpmis.device.views import (
    COAT,
    COAT_ROUGHNESS,
    CONSTANT,
    DIFFUSE,
    EMISSIVE,
    METALLIC,
    NO_TILE,
    NORMAL,
    ROUGHNESS,
    SPECULAR,
    InputsView,
    MaterialView,
    SceneView,
    VaryingView,
)
from warpmis.kernels.hit import NO_INSTANCE, Hit
from warpmis.kernels.texture import Footprint, coordinates, corner_coordinates, footprint, picture_value, primvar_value
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# Alpha 0 would divide by 0 (device/materials.py has the same bound for constant inputs).
MIN_ALPHA = wp.constant(1.0e-6)
MAX_EMISSION = wp.constant(3.0e38)


@wp.func
def clamped(color: wp.vec3, high: float) -> wp.vec3:
    return wp.vec3(wp.clamp(color[0], 0.0, high), wp.clamp(color[1], 0.0, high), wp.clamp(color[2], 0.0, high))


@cache
def make_material(features: Features) -> SimpleNamespace:
    """Material functions for what varies in `features`: at, mapped_normal."""

    @wp.func
    def primvar_row(varying: wp.array(dtype=VaryingView), column: int, triangle: int, instance: int) -> int:
        """The row of the primvars that a lookup reads: the triangle's, or that of the instance where it has none."""
        row = triangle
        if wp.static(features.instances):
            if instance != NO_INSTANCE and wp.isnan(varying[0].primvars[triangle, 0, column]):
                row = varying[0].first_place + instance
        return row

    @wp.func
    def evaluate_inputs(
        varying: wp.array(dtype=VaryingView), constant: InputsView, triangle: int, instance: int, u: float, v: float
    ) -> InputsView:
        """The inputs as they are at a point, each within its range.

        A loop with one lookup in it: a call for each input would be compiled in place nine times.
        """
        i = constant
        f = Footprint()
        for row in range(i.first_lookup, i.first_lookup + i.lookup_count):
            lookup = varying[0].lookups[row]
            at = primvar_row(varying, lookup.column, triangle, instance)
            value = wp.vec3()
            if wp.static(features.vertex_colors):
                if lookup.tile == NO_TILE:
                    value = primvar_value(varying[0].primvars, lookup, at, u, v)
            if wp.static(features.textures):
                if lookup.tile != NO_TILE:
                    if not lookup.reuses_footprint:
                        f = footprint(varying, lookup, coordinates(varying[0].primvars, lookup, at, u, v))
                    value = picture_value(varying, lookup, f)
            number = wp.clamp(value[0], 0.0, 1.0)
            which = lookup.input
            if which == NORMAL:
                i.normal = value
            elif which == DIFFUSE:
                i.diffuse = clamped(value, 1.0)
            elif which == EMISSIVE:
                i.emissive = clamped(value, MAX_EMISSION)
            elif which == SPECULAR:
                i.specular = clamped(value, 1.0)
            elif which == METALLIC:
                i.metallic = number
            elif which == ROUGHNESS:
                i.roughness = number
            elif which == COAT:
                i.coat = number
            elif which == COAT_ROUGHNESS:
                i.coat_roughness = number
            elif i.opacity_threshold > 0.0:
                i.opacity = wp.where(number >= i.opacity_threshold, 1.0, 0.0)
            else:
                i.opacity = number
        return i

    @wp.func
    def resolve(
        varying: wp.array(dtype=VaryingView), base: MaterialView, triangle: int, instance: int, u: float, v: float
    ) -> MaterialView:
        """`base` with the inputs as they are at a point, resolved as device/materials.py does constant ones."""
        i = evaluate_inputs(varying, varying[0].inputs[base.inputs], triangle, instance, u, v)
        m = base
        m.diffuse = i.diffuse
        if base.has_specular:
            m.specular_f0 = i.specular
            if not i.use_specular_workflow:
                # coat_f0 is the reflectance of the index of refraction, whether there is a coat or not.
                dielectric = base.coat_f0 * (1.0 - i.metallic)
                m.specular_f0 = wp.vec3(dielectric, dielectric, dielectric) + i.diffuse * i.metallic
                m.diffuse = i.diffuse * (1.0 - i.metallic)
        m.alpha = wp.max(i.roughness * i.roughness, MIN_ALPHA)
        m.coat = i.coat
        m.coat_alpha = wp.max(i.coat_roughness * i.coat_roughness, MIN_ALPHA)
        m.opacity = i.opacity
        m.normal = i.normal
        m.emission = i.emissive
        if base.opacity_is_presence:
            m.emission = i.emissive * i.opacity
        return m

    @wp.func
    def at(scene: SceneView, triangle: int, instance: int, u: float, v: float) -> MaterialView:
        """The material at a point of a triangle, of an instance or of none; u weighs the first corner, v the second."""
        material = scene.materials[scene.triangles[triangle].material]
        if wp.static(features.textures or features.vertex_colors):
            if material.inputs != CONSTANT:
                return resolve(scene.varying, material, triangle, instance, u, v)
        return material

    @wp.func
    def mapped_normal(scene: SceneView, hit: Hit, material: MaterialView, n: wp.vec3) -> wp.vec3:
        """The unit normal `n` (of the front, in the world) turned by the normal map that the material has.

        The map's x and y go along the surface in the directions in which the texture coordinates grow:
        dp/ds and dp/dt from the triangle's edges, made orthogonal to n.
        Reference: Lengyel (2019), "Foundations of Game Engine Development 2", section 7.5.
        """
        triangle = hit.triangle
        varying = scene.varying
        lookup = varying[0].lookups[varying[0].inputs[material.inputs].normal_lookup]
        corners = scene.indices[triangle]
        p2 = scene.points[corners[2]]
        e0 = scene.points[corners[0]] - p2
        e1 = scene.points[corners[1]] - p2
        if wp.static(features.instances):
            if hit.instance != NO_INSTANCE:
                e0 = scene.instances[hit.instance].linear * e0
                e1 = scene.instances[hit.instance].linear * e1
        row = primvar_row(varying, lookup.column, triangle, hit.instance)
        st2 = corner_coordinates(varying[0].primvars, lookup, row, 2)
        d0 = corner_coordinates(varying[0].primvars, lookup, row, 0) - st2
        d1 = corner_coordinates(varying[0].primvars, lookup, row, 1) - st2
        determinant = d0[0] * d1[1] - d1[0] * d0[1]
        if determinant == 0.0:
            return n
        along_s = (e0 * d1[1] - e1 * d0[1]) * wp.sign(determinant)
        along_t = (e1 * d0[0] - e0 * d1[0]) * wp.sign(determinant)
        tangent = along_s - n * wp.dot(n, along_s)
        length = wp.length(tangent)
        if length == 0.0:
            return n
        tangent = tangent / length
        bitangent = wp.cross(n, tangent)
        if wp.dot(bitangent, along_t) < 0.0:
            bitangent = -bitangent
        turned = tangent * material.normal[0] + bitangent * material.normal[1] + n * material.normal[2]
        length = wp.length(turned)
        return wp.where(length > 0.0, turned / wp.max(length, 1.0e-20), n)

    return SimpleNamespace(at=at, mapped_normal=mapped_normal)
