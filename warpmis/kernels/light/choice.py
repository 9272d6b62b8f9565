"""Which of several lights to sample: in proportion to an estimate of the irradiance that each brings, unoccluded.

The estimate, a light's importance, is a function of the shading point alone, so that the sampler and the density agree.
It may be crude, but it must not be 0 where a light contributes: it bounds the receiver's cosine from above.
"""

import warp as wp

from warpmis.device.views import DISK, DISTANT, DOME, RECT, SPHERE, LightView, SceneView
from warpmis.kernels.light.records import NO_LIGHT, LightChoice, Receiver
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.warps import PI

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
def importance(scene: SceneView, light: LightView, r: Receiver) -> float:
    if scene.light_count == 1:
        return 1.0
    return light_importance(light, r.x, r.n)


@wp.func
def density(of_light: float, total: float) -> float:
    """Density among lights whose importances sum to `total`, from density times importance."""
    if total <= 0.0:
        return 0.0
    return of_light / total


@wp.func
def is_turned_away(scene: SceneView, r: Receiver) -> bool:
    """Whether there is a single light, which needs no choice, and it cannot reach r."""
    if scene.light_count != 1:
        return False
    return light_importance(scene.lights[0], r.x, r.n) <= 0.0


@wp.func
def choose(scene: SceneView, r: Receiver, first: int, end: int, total: float, u: float) -> LightChoice:
    """One of the lights first to end - 1, whose importances sum to `total`, in proportion to them."""
    c = LightChoice()
    c.light = NO_LIGHT
    target = u * total
    reached = float(0.0)
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
def receiver(scene: SceneView, x: wp.vec3, n: wp.vec3, u: float) -> Receiver:
    """Choose a light with u. Each light's part of the numbers is one interval, so that the remapped u is as evenly
    spread over the light's samples as u is over all."""
    r = Receiver()
    r.x = x
    r.n = n
    r.chosen = NO_LIGHT
    if is_turned_away(scene, r):
        return r
    for i in range(scene.light_count):
        of_light = importance(scene, scene.lights[i], r)
        if i < scene.finite_light_count:
            r.finite += of_light
        else:
            r.infinite += of_light
    r.total = r.finite + r.infinite
    choice = choose(scene, r, 0, scene.light_count, r.total, u)
    r.chosen = choice.light
    r.chosen_importance = choice.importance
    r.u_remapped = choice.u_remapped
    return r
