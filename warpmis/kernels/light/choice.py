"""Which of several lights to sample: in proportion to an estimate of the irradiance that each brings, unoccluded.

The estimate is a function of the shading point alone, so that the sampler and the density agree. It may be crude, but
it must not be 0 where a light contributes: it bounds the receiver's cosine from above.
"""

import warp as wp

from warpmis.device.views import DISK, DISTANT, DOME, RECT, SPHERE, LightView
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
