"""The lights that a ray meets: their radiance, and the densities with which light samples would have found them."""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import DOME, MESH, LightTreeView, SceneView
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.instances import nonzero
from warpmis.kernels.intersect import make_intersect
from warpmis.kernels.lanes import first_set_bit, mask_less_equal, max8, min8, splat8
from warpmis.kernels.light.choice import density
from warpmis.kernels.light.distant import INFINITE_DISTANCE
from warpmis.kernels.light.dome import dome_pdf, dome_radiance, dome_uv, pdf_dome_constant
from warpmis.kernels.light.mesh_light import hit_emitter_triangle, pdf_mesh
from warpmis.kernels.light.met import keep_emission
from warpmis.kernels.light.place import area_of, direction_in_place, make_place, origin_in_place
from warpmis.kernels.light.records import NO_LIGHT, LightHit, RayStretch, Receiver
from warpmis.kernels.light.tree import CENTER, HALF, ROWS
from warpmis.kernels.medium import transmittance
from warpmis.kernels.mis import balance_weight
from warpmis.kernels.shadow import has_shadow_link
from warpmis.kernels.wide_tree import SlabRay, slab_ray
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

# A shadow ray stops this share of the way short of its light, so that a surface behind the light is no occluder.
SHADOW_END = wp.constant(0.9999)
# Rays are followed so much farther than to the surface that ends them: a light flush with it shines.
FLUSH = wp.constant(1.001)

# Levels of the lights' tree: 24 turns by cost, then halves (device/light_tree.py: HALVING_LEVEL), three turns a level.
LEVELS = 20
stack_of_levels = wp.types.vector(length=LEVELS, dtype=wp.int32)


@wp.struct
class LightsOnRay:
    """The lights that a ray meets, but for mesh lights, which are surfaces.

    radiance: sum over the analytic lights and the dome seen along the ray; weighted: the same with each light's MIS
    weight against the density given; hits: number of analytic lights seen. finite, infinite: sums of density times
    importance for the ray's direction, over the lights at a distance and at infinity: where the whole line is asked
    for, counting also those hidden behind the surface that the ray hits.
    """

    radiance: wp.vec3
    weighted: wp.vec3
    finite: float
    infinite: float
    hits: int


@wp.func
def boxes_on_ray(tree: LightTreeView, node: int, ray: SlabRay, reach: float) -> int:
    """A mask of the node's children with an analytic light whose boxes the ray meets nearer than `reach`."""
    row = node * ROWS
    lower = splat8(0.0)
    upper = splat8(reach)
    for axis in range(3):
        middle = (tree.rows[row + CENTER + axis] - splat8(ray.origin[axis])) * ray.inverse[axis]
        half = tree.rows[row + HALF + axis] * wp.abs(ray.inverse[axis])
        lower = max8(lower, middle - half)
        upper = min8(upper, middle + half)
    return mask_less_equal(lower, upper) & tree.analytic[node]


def make_on_ray(
    features: Features, choice: SimpleNamespace, kinds: SimpleNamespace, control: SimpleNamespace
) -> SimpleNamespace:
    """Functions: gather, emitter_density, pdf_emitter_triangles, light_of_emitter."""
    intersect = make_intersect(features)
    places = make_place(features)

    @wp.func
    def emitter_density(
        scene: SceneView,
        r: wp.ref[Receiver],
        emitter: int,
        instance: int,
        normal: wp.vec3,
        wi: wp.vec3,
        distance: float,
    ) -> float:
        """Density times importance of a mesh light's triangle for wi, which meets it at this distance."""
        light = scene.lights[places.light_of(scene, emitter, instance)]
        if wp.static(features.light_tree):
            if choice.has_tree(scene):
                area = area_of(places.emitter_at(scene, emitter, instance))
                of_triangle = choice.emitter_importance(scene, r, emitter, instance)
                return pdf_mesh(light, area, normal, wi, distance) * of_triangle
        return pdf_mesh(light, light.area, normal, wi, distance) * choice.importance(scene, light, r)

    @wp.func
    def density_if_met(scene: SceneView, r: wp.ref[Receiver], emitter: int, instance: int, wi: wp.vec3) -> float:
        """The same of a triangle wherever the line meets it; 0 where it does not."""
        found = places.emitter_at(scene, emitter, instance)
        distance = hit_emitter_triangle(found, r.x, wi)
        if distance <= 0.0:
            return 0.0
        return emitter_density(scene, r, emitter, instance, found.n, wi, distance)

    @wp.func
    def pdf_emitters_of_places(scene: SceneView, r: wp.ref[Receiver], wi: wp.vec3) -> float:
        """pdf_emitter_triangles of prototypes' triangles in their places."""
        pdf = float(0.0)
        if scene.emitter_place_bvh == wp.uint64(0):
            return pdf
        query = wp.bvh_query_ray(scene.emitter_place_bvh, r.x, nonzero(wi))
        row = int(0)
        while wp.bvh_query_next(query, row):
            place = scene.emitter_places[row]
            start = origin_in_place(scene, place.instance, r.x)
            inside = wp.bvh_query_ray(place.bvh, start, direction_in_place(scene, place.instance, wi))
            emitter = int(0)
            while wp.bvh_query_next(inside, emitter):
                pdf += density_if_met(scene, r, place.first_emitter + emitter, place.instance, wi)
        return pdf

    @wp.func
    def pdf_emitter_triangles(scene: SceneView, r: wp.ref[Receiver], wi: wp.vec3) -> float:
        """Density times importance of the mesh lights for wi: every triangle on the line counts, hidden or not."""
        pdf = float(0.0)
        if wp.static(features.emissive_instances):
            pdf += pdf_emitters_of_places(scene, r, wi)
        if scene.emitter_bvh == wp.uint64(0):
            return pdf
        query = wp.bvh_query_ray(scene.emitter_bvh, r.x, wi)
        emitter = int(0)
        while wp.bvh_query_next(query, emitter):
            pdf += density_if_met(scene, r, emitter, NO_INSTANCE, wi)
        return pdf

    @wp.func
    def dome_hit(scene: SceneView, r: wp.ref[Receiver], wi: wp.vec3, h: LightHit) -> LightHit:
        if wp.static(features.dome_picture):
            if scene.dome.rows > 0:
                h.distance = INFINITE_DISTANCE
                h.pdf_solid_angle = dome_pdf(scene.dome, dome_uv(scene.dome.to_dome * wi))
        if wp.static(features.dome_constant):
            if scene.dome.rows == 0:
                h.distance = INFINITE_DISTANCE
                h.pdf_solid_angle = pdf_dome_constant(r.n, wi)
        return h

    @wp.func
    def with_light(
        scene: SceneView, r: wp.ref[Receiver], stretch: RayStretch, index: int, h: LightHit, ray: LightsOnRay
    ) -> LightsOnRay:
        """The ray's light with that of one more light, which its line meets there."""
        wi = stretch.wi
        light = scene.lights[index]
        of_light = float(-1.0)
        if stretch.whole_line:
            of_light = h.pdf_solid_angle * choice.importance_of(scene, r, index)
            if index < scene.finite_light_count:
                ray.finite += of_light
            else:
                ray.infinite += of_light
        through = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(features.shadow_links):
            if r.is_surface and has_shadow_link(scene, index):  # the camera does not see through
                # What ends the ray tells nothing of this light's shadows: found on the first stretch, or never.
                through = intersect.transmittance(scene, index, r.x, wi, h.distance * SHADOW_END)
                h.distance = wp.where(stretch.near == 0.0, 0.5 * stretch.far, 0.0)
        # A light flush with a surface shines: hence the tolerance, the same as the shadow ray's.
        if h.distance * SHADOW_END > stretch.far or h.distance * SHADOW_END <= stretch.near:
            return ray
        radiance = light.radiance
        if wp.static(features.dome_picture):
            if light.kind == DOME and scene.dome.rows > 0:
                radiance = dome_radiance(scene.dome, dome_uv(scene.dome.to_dome * wi))
        radiance = wp.cw_mul(radiance, through)
        if wp.static(features.absorption):
            radiance = wp.cw_mul(radiance, transmittance(r.absorption, h.distance - stretch.near))
        if wp.static(features.controlled):
            radiance = wp.cw_mul(radiance, control.factor(scene, index, r, wi))
            if wp.static(features.light_response):
                if r.is_surface:
                    radiance = wp.cw_mul(radiance, control.response(scene, index, r.diffuse))
        ray.radiance += radiance
        if of_light < 0.0:
            of_light = h.pdf_solid_angle * choice.importance_of(scene, r, index)
        weighted = radiance * balance_weight(stretch.pdf, density(of_light, r.total))
        ray.weighted += weighted
        if wp.static(features.keeps_light_apart):
            share = control.diffuse_share(scene, index, r.diffuse)
            keep_emission(scene, r, index, wp.where(r.weighs_emission, weighted, radiance), share)
        if h.distance < INFINITE_DISTANCE:
            ray.hits += 1
        return ray

    @wp.func
    def drawn_or(r: wp.ref[Receiver], index: int, h: LightHit) -> LightHit:
        """What was drawn counts as hit where it was drawn, whatever a test of the rounded direction finds."""
        if r.drawn_pdf > 0.0 and r.drawn == index:
            h.distance = r.drawn_distance
            h.pdf_solid_angle = r.drawn_pdf
        return h

    @wp.func
    def with_leaf(
        scene: SceneView, r: wp.ref[Receiver], stretch: RayStretch, index: int, drawn: int, ray: LightsOnRay
    ) -> LightsOnRay:
        """The ray's light with that of an analytic light whose box it meets; `drawn` is in it already."""
        if index == drawn:
            return ray
        h = kinds.hit(scene.lights[index], r.x, stretch.wi)
        if h.distance > 0.0:
            ray = with_light(scene, r, stretch, index, h, ray)
        return ray

    @wp.func
    def gather_from_nodes(
        scene: SceneView, r: wp.ref[Receiver], stretch: RayStretch, reach: float, drawn: int, ray: LightsOnRay
    ) -> LightsOnRay:
        """with_leaf of all leaves nearer than `reach`, through the nodes by which lights are chosen."""
        slab = slab_ray(r.x, stretch.wi)
        nodes = stack_of_levels()
        masks = stack_of_levels()
        level = int(0)
        node = int(0)
        mask = boxes_on_ray(scene.light_tree, node, slab, reach)
        while mask != 0 or level > 0:
            if mask == 0:
                level -= 1
                node = nodes[level]
                mask = masks[level]
            else:
                child = scene.light_tree.child_nodes[8 * node + first_set_bit(mask)]
                mask = mask & (mask - 1)
                if child >= 0:
                    nodes[level] = node
                    masks[level] = mask
                    level += 1
                    node = child
                    mask = boxes_on_ray(scene.light_tree, node, slab, reach)
                else:
                    ray = with_leaf(scene, r, stretch, -1 - child, drawn, ray)
        return ray

    @wp.func
    def gather_from_bvh(
        scene: SceneView, r: wp.ref[Receiver], stretch: RayStretch, reach: float, drawn: int, ray: LightsOnRay
    ) -> LightsOnRay:
        """The same through Warp's own tree, for a GPU."""
        query = wp.bvh_query_ray(scene.light_bvh, r.x, stretch.wi)
        index = int(0)
        while wp.bvh_query_next(query, index, reach):
            ray = with_leaf(scene, r, stretch, index, drawn, ray)
        return ray

    @wp.func
    def gather_from_tree(scene: SceneView, r: wp.ref[Receiver], stretch: RayStretch, ray: LightsOnRay) -> LightsOnRay:
        """The ray's light with that of the analytic lights in the tree."""
        drawn = int(NO_LIGHT)
        if r.drawn_pdf > 0.0 and r.drawn < scene.analytic_light_count:
            drawn = r.drawn
            ray = with_light(scene, r, stretch, drawn, drawn_or(r, drawn, LightHit()), ray)
        reach = stretch.far * FLUSH
        if stretch.whole_line:
            reach = INFINITE_DISTANCE
        if wp.static(features.shadow_links):
            reach = INFINITE_DISTANCE
        if wp.static(features.tree == "wide"):
            ray = gather_from_nodes(scene, r, stretch, reach, drawn, ray)
        else:
            ray = gather_from_bvh(scene, r, stretch, reach, drawn, ray)
        return ray

    @wp.func
    def gather(
        scene: SceneView, r: wp.ref[Receiver], wi: wp.vec3, near: float, far: float, pdf: float, whole_line: bool
    ) -> LightsOnRay:
        """Analytic lights on the stretch (near, far] of the ray from r.x along wi (see RayStretch)."""
        stretch = RayStretch()
        stretch.wi = wi
        stretch.near = near
        stretch.far = far
        stretch.pdf = pdf
        stretch.whole_line = whole_line
        ray = LightsOnRay()
        if wp.static(features.light_tree):
            if choice.has_tree(scene) and scene.analytic_light_count > 0:
                ray = gather_from_tree(scene, r, stretch, ray)
        for i in range(choice.first_weighed(scene), scene.light_count):
            light = scene.lights[i]
            h = kinds.hit(light, r.x, stretch.wi)
            if light.kind != MESH:
                h = drawn_or(r, i, h)
            if light.kind == DOME:
                h = dome_hit(scene, r, stretch.wi, h)
            if h.distance > 0.0:
                ray = with_light(scene, r, stretch, i, h, ray)
        return ray

    return SimpleNamespace(
        gather=gather,
        emitter_density=emitter_density,
        light_of_emitter=places.light_of,
        pdf_emitter_triangles=pdf_emitter_triangles,
    )
