"""Which of several lights to sample: in proportion to an estimate of the irradiance that each brings, unoccluded.

The estimate, a light's importance, is a function of the shading point alone, so that the sampler and the density agree.
It may be crude, but it must not be 0 where a light contributes: it bounds the receiver's cosine from above.

A few lights are weighed one by one. Of many, those at a distance, triangles of mesh lights among them, are chosen by a
tree (tree.py), whose root stands for all of them beside the lights at infinity.
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import DISK, DISTANT, DOME, RECT, SPHERE, LightView, SceneView, vec8f
from warpmis.kernels.hit import NO_INSTANCE
from warpmis.kernels.lanes import splat8
from warpmis.kernels.light.place import first_place_leaf, make_place, receiver_in_place
from warpmis.kernels.light.records import NO_LIGHT, LightChoice, Receiver, Response
from warpmis.kernels.light.response import over_all_directions, towards
from warpmis.kernels.light.tree import LeafChoice, make_light_tree
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.warps import PI
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})


@wp.func
def light_importance(light: LightView, x: wp.vec3, n: wp.vec3) -> float:
    """Estimated irradiance [luminance nit sr] at x with unit normal n facing the viewer."""
    if light.kind == DOME:
        return light.luminance * PI
    if light.kind == DISTANT:
        # Up to the half angle below the horizon a part of the cone is above it.
        cos_bound = wp.dot(n, light.n) + wp.sqrt(2.0 * light.one_minus_cos)
        return wp.where(cos_bound > 0.0, light.luminance * PI * 2.0 * light.one_minus_cos, 0.0)
    to_center = light.center - x
    d2 = wp.dot(to_center, to_center)
    r2 = light.bound * light.bound
    if d2 <= r2:
        # Within the bounding sphere the light may be anywhere around: as if it filled the hemisphere.
        if (light.kind == RECT or light.kind == DISK) and wp.dot(to_center, light.n) >= 0.0:
            return 0.0
        return light.luminance * PI
    d = wp.sqrt(d2)
    # Upper bound of the receiver's cosine over the bounding sphere.
    cos_bound = wp.min(1.0, (wp.dot(n, to_center) + light.bound) / d)
    if cos_bound <= 0.0:
        return 0.0
    projected = light.area / d2
    if light.kind == RECT or light.kind == DISK:
        cos_light = -wp.dot(light.n, to_center) / d
        if cos_light <= 0.0:
            return 0.0
        projected = projected * cos_light
    elif light.kind == SPHERE:
        projected = PI * r2 / d2
    else:
        # A convex body shows on average a quarter of its surface (Cauchy).
        projected = projected * 0.25
    return light.luminance * wp.min(projected, 2.0 * PI) * cos_bound


@wp.func
def light_response(light: LightView, r: wp.ref[Receiver]) -> float:
    """What the receiver makes of the light's irradiance, at least 1."""
    if light.kind == DOME:
        return over_all_directions(r.response)
    if light.kind == DISTANT:
        return towards(r.response, r.n, light.n, 2.0 * light.one_minus_cos)
    to_center = light.center - r.x
    d2 = wp.dot(to_center, to_center)
    r2 = light.bound * light.bound
    if d2 <= r2:
        return over_all_directions(r.response)
    return towards(r.response, r.n, to_center / wp.sqrt(d2), r2 / d2)


@wp.func
def density(of_light: float, total: float) -> float:
    """Density among lights whose importances sum to `total`, from density times importance."""
    if total <= 0.0:
        return 0.0
    return of_light / total


def make_choice(features: Features) -> SimpleNamespace:
    """Functions: has_tree, first_weighed, importance, importance_of, leaf_importance, emitter_importance, choose,
    choose_from_tree, receiver; and those of `tree`."""
    tree = make_light_tree(features)
    places = make_place(features)

    @wp.func
    def has_tree(scene: SceneView) -> bool:
        if wp.static(features.light_tree):
            return scene.light_tree.child_nodes.shape[0] > 0
        return False

    @wp.func
    def first_weighed(scene: SceneView) -> int:
        """The first of the lights that are weighed one by one; those before it are in the tree."""
        return wp.where(has_tree(scene), scene.finite_light_count, 0)

    @wp.func
    def importance(scene: SceneView, light: LightView, r: wp.ref[Receiver]) -> float:
        """Of a light that is weighed by itself."""
        if scene.light_count == 1 and not has_tree(scene):
            return 1.0
        estimate = light_importance(light, r.x, r.n)
        if wp.static(features.glossy_choice):
            estimate = estimate * light_response(light, r)
        return estimate

    @wp.func
    def leaf_importance(scene: SceneView, r: wp.ref[Receiver], leaf: int) -> float:
        """Of a light in the tree: its part of the root's."""
        if r.finite <= 0.0:
            return 0.0
        return r.finite * tree.leaf_pmf(scene.light_tree, r, leaf)

    @wp.func
    def emitter_importance(scene: SceneView, r: wp.ref[Receiver], emitter: int, instance: int) -> float:
        """Of a mesh light's triangle in the tree, where it stands."""
        if wp.static(features.emissive_instances):
            if instance != NO_INSTANCE:
                place = scene.place_of_instance[instance]
                of_place = leaf_importance(scene, r, first_place_leaf(scene) + place)
                if of_place <= 0.0:
                    return 0.0
                local = receiver_in_place(scene, r, instance)
                root = scene.emitter_places[place].root
                leaf = scene.analytic_light_count + emitter
                return of_place * tree.leaf_pmf_below(scene.light_tree, local, root, leaf)
        return leaf_importance(scene, r, scene.analytic_light_count + emitter)

    @wp.func
    def importance_of(scene: SceneView, r: wp.ref[Receiver], index: int) -> float:
        """Of any light but a mesh light in the tree, by its index."""
        if wp.static(features.light_tree):
            if index < first_weighed(scene):
                return leaf_importance(scene, r, index)
        return importance(scene, scene.lights[index], r)

    @wp.func
    def is_turned_away(scene: SceneView, r: wp.ref[Receiver]) -> bool:
        """Whether there is a single light, which needs no choice, and it cannot reach r."""
        if scene.light_count != 1 or has_tree(scene):
            return False
        return light_importance(scene.lights[0], r.x, r.n) <= 0.0

    @wp.func
    def choose(
        scene: SceneView, r: wp.ref[Receiver], first: int, end: int, before: float, target: float
    ) -> LightChoice:
        """The one of the lights first to end - 1 at which the sum of importances, `before` that of the first, passes
        the target."""
        c = LightChoice()
        c.light = NO_LIGHT
        c.emitter = -1
        c.instance = NO_INSTANCE
        reached = float(before)
        for i in range(first, end):
            of_light = importance(scene, scene.lights[i], r)
            # The last light with any importance stays chosen if rounding lets the sum fall short of the target.
            if of_light > 0.0:
                c.light = i
                c.importance = of_light
                c.u_remapped = wp.clamp((target - reached) / of_light, 0.0, ONE_MINUS_EPSILON)
                reached += of_light
                if reached > target:
                    break
        return c

    @wp.func
    def choose_in_place(scene: SceneView, r: wp.ref[Receiver], place: int, chosen: LeafChoice) -> LeafChoice:
        """One of the emitters of the place that was chosen."""
        local = receiver_in_place(scene, r, scene.emitter_places[place].instance)
        root = scene.emitter_places[place].root
        of_root = tree.importances(scene.light_tree, root, local)
        leaf = tree.descend(scene.light_tree, local, root, of_root, chosen.left)
        leaf.pmf *= chosen.pmf
        return leaf

    @wp.func
    def choose_from_tree(scene: SceneView, r: wp.ref[Receiver], of_root: vec8f, u: float) -> LightChoice:
        """One of the lights in the tree; of_root: importances of the root's children."""
        leaf = tree.choose_leaf(scene.light_tree, r, of_root, u)
        c = LightChoice()
        c.instance = NO_INSTANCE
        if wp.static(features.emissive_instances):
            place = leaf.leaf - first_place_leaf(scene)
            if place >= 0:
                c.instance = scene.emitter_places[place].instance
                leaf = choose_in_place(scene, r, place, leaf)
        c.light = leaf.leaf
        c.emitter = -1
        c.importance = r.finite * leaf.pmf
        c.u_remapped = leaf.u_remapped
        if wp.static(features.mesh_light):
            if leaf.leaf >= scene.analytic_light_count:
                c.emitter = leaf.leaf - scene.analytic_light_count
                c.light = places.light_of(scene, c.emitter, c.instance)
        return c

    @wp.func
    def receiver(
        scene: SceneView, x: wp.vec3, n: wp.vec3, prim: int, u: float, u_fine: float, response: Response
    ) -> Receiver:
        """Choose a light with u. Each light's part of the numbers is one interval, so that the remapped u is as evenly
        spread over the light's samples as u is over all. u_fine: see Receiver."""
        r = Receiver()
        r.x = x
        r.n = n
        r.is_surface = True
        r.prim = prim
        r.u_fine = u_fine
        r.response = response
        r.choice.light = NO_LIGHT
        if wp.static(features.light_tree):
            r.links = -1
            if wp.static(features.light_links):
                if scene.prim_links.shape[0] > 0:
                    r.links = scene.prim_links[prim]
        if is_turned_away(scene, r):
            return r
        of_root = vec8f()
        if wp.static(features.light_tree):
            if has_tree(scene):
                of_root = tree.importances(scene.light_tree, 0, r)
                r.finite = wp.dot(of_root, splat8(1.0))
        in_tree = r.finite
        first = first_weighed(scene)
        for i in range(first, scene.light_count):
            of_light = importance(scene, scene.lights[i], r)
            if i < scene.finite_light_count:
                r.finite += of_light
            else:
                r.infinite += of_light
        r.total = r.finite + r.infinite
        target = u * r.total
        if wp.static(features.light_tree):
            if target < in_tree:
                r.choice = choose_from_tree(scene, r, of_root, target / in_tree)
                return r
        r.choice = choose(scene, r, first, scene.light_count, in_tree, target)
        return r

    return SimpleNamespace(
        has_tree=has_tree,
        first_weighed=first_weighed,
        importance=importance,
        importance_of=importance_of,
        leaf_importance=leaf_importance,
        emitter_importance=emitter_importance,
        choose=choose,
        choose_from_tree=choose_from_tree,
        tree=tree,
        receiver=receiver,
    )
