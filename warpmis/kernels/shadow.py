"""What a shadow ray meets: how much of a light's radiance arrives.

A shadow ray need not know what it meets first. One search through the triangles, in any order, ends at the first that
lets no light through. Only a ray that meets none of those, but others, goes from surface to surface.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.instances import nonzero
from warpmis.kernels.shading_frame import luminance, to_local
from warpmis.kernels.wide_tree import BLOCKED, OPEN, VEILED, make_occlusion_in_tree
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# A ray goes straight through at most so many transparent surfaces.
MAX_TRANSPARENT = wp.constant(64)


@wp.func
def has_shadow_link(scene: SceneView, light: int) -> bool:
    """Whether some prim casts no shadow from the light, a row of SceneView.controls."""
    if light >= scene.controls.shape[0]:
        return False
    return scene.controls[light].shadow_casters.shape[0] > 0


def make_transmittance(features: Features, surfaces: SimpleNamespace) -> wp.Function:
    """The function for the transmittance of a shadow ray. surfaces: the other functions of kernels/intersect.py."""
    all_block = not features.opacity and not features.shadow_links

    @wp.func
    def is_caster(scene: SceneView, light: int, instance: int, triangle: int) -> bool:
        if wp.static(features.shadow_links):
            if has_shadow_link(scene, light):
                return scene.controls[light].shadow_casters[surfaces.prim_at(scene, instance, triangle)] != 0
        return True

    @wp.func
    def is_opaque(material: MaterialView) -> bool:
        """Whether no light goes straight through, wherever on the surface. The material's inputs are their means."""
        if wp.static(features.transmission):
            if material.transmission > 0.0 and material.thin_walled:
                return False
        return material.opacity >= 1.0

    @wp.func
    def every_surface_blocks(scene: SceneView, light: int) -> bool:
        if wp.static(features.opacity):
            return False
        else:
            if wp.static(features.shadow_links):
                return not has_shadow_link(scene, light)
            else:
                return True

    @wp.func
    def any_blocks(scene: SceneView, light: int, instance: int, face: int) -> bool:
        return True

    @wp.func
    def opaque_caster_blocks(scene: SceneView, light: int, instance: int, face: int) -> bool:
        triangle = face + 0
        if wp.static(features.instances):
            if instance != NO_INSTANCE:
                triangle += scene.instances[instance].first_triangle
        if not is_caster(scene, light, instance, triangle):
            return False
        return is_opaque(scene.materials[scene.triangles[triangle].material])

    occlusion_in_tree = make_occlusion_in_tree(any_blocks if all_block else opaque_caster_blocks)

    @wp.func
    def occlusion_in_mesh(
        scene: SceneView,
        light: int,
        instance: int,
        mesh: wp.uint64,
        root: int,
        origin: wp.vec3,
        wi: wp.vec3,
        reach: float,
    ) -> int:
        """OPEN, VEILED or BLOCKED; by Warp's own query, which cannot pass some by, where every surface blocks."""
        if wp.static(features.tree == "wide"):
            return occlusion_in_tree(scene, light, instance, root, origin, wi, reach)
        else:
            return wp.where(wp.mesh_query_ray_anyhit(mesh, origin, wi, reach), BLOCKED, OPEN)

    @wp.func
    def occlusion(scene: SceneView, light: int, origin: wp.vec3, wi: wp.vec3, distance: float) -> int:
        """The same, of the whole world; by Warp's own query VEILED, unseen, where some surface may not block."""
        if wp.static(features.tree != "wide"):
            if not every_surface_blocks(scene, light):
                return VEILED
        met = occlusion_in_mesh(scene, light, NO_INSTANCE, scene.mesh, scene.root, origin, wi, distance)
        if wp.static(features.instances):
            if scene.instance_count > 0:
                query = wp.bvh_query_ray(scene.instance_bvh, origin, nonzero(wi))
                index = int(0)
                while met != BLOCKED and wp.bvh_query_next(query, index, distance):
                    place = scene.instances[index]
                    start = place.inverse * (origin - place.translation)
                    along = place.inverse * wi
                    here = occlusion_in_mesh(scene, light, index, place.mesh, place.root, start, along, distance)
                    met = wp.max(met, here)
        return met

    @wp.func
    def visibility(scene: SceneView, light: int, origin: wp.vec3, wi: wp.vec3, distance: float) -> wp.vec3:
        """Share of the light that arrives where every surface blocks: 1 or 0."""
        if occlusion(scene, light, origin, wi, distance) == OPEN:
            return wp.vec3(1.0, 1.0, 1.0)
        return wp.vec3(0.0, 0.0, 0.0)

    @wp.func
    def transmittance(scene: SceneView, light: int, origin: wp.vec3, wi: wp.vec3, distance: float) -> wp.vec3:
        """The same, per colour, where surfaces let light through, or cast no shadow from this light."""
        share = wp.vec3(1.0, 1.0, 1.0)
        met = occlusion(scene, light, origin, wi, distance)
        if met == OPEN:
            return share
        if met == BLOCKED:
            return wp.vec3(0.0, 0.0, 0.0)
        start = origin
        remaining = distance
        for _surface in range(MAX_TRANSPARENT):
            hit = surfaces.closest_hit(scene, start, wi)
            if hit.distance >= remaining:
                return share
            if is_caster(scene, light, hit.instance, hit.triangle):
                if is_opaque(scene.materials[scene.triangles[hit.triangle].material]):
                    return wp.vec3(0.0, 0.0, 0.0)
                material = surfaces.material_at(scene, hit.triangle, hit.instance, hit.u, hit.v)
                cos_theta = to_local(surfaces.shading_frame(scene, hit, material, wi), -wi)[2]
                share = wp.cw_mul(share, surfaces.transparency(scene, material, cos_theta))
                if luminance(share) <= 0.0:
                    return share
            remaining -= hit.distance
            start = hit.p - hit.ng * hit.offset
        return wp.vec3(0.0, 0.0, 0.0)

    return visibility if all_block else transmittance
