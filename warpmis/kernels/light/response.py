"""What a glossy receiver makes of light by its direction: the choice among lights goes by it.

An importance is an estimate of irradiance. Times the response of this file it estimates the light that is reflected
towards the viewer. A glossy lobe reflects the lights about the mirror's direction alone; chosen by irradiance, a
thousand others would be asked for each of them. The lobe is widened by the extent of what stands in that direction.

The response is a function of the receiver and of the light alone, as sampler and density must agree, and it is never
0. It leaves out Fresnel's term and masking, whose part of the choice is small.

References: Walter et al. (2007), equation 33, the distribution of normals; Tokuyoshi, Ikeda, Kulkarni, Harada (2024),
"Hierarchical Light Sampling with Accurate Spherical Gaussian Lighting", for lobes widened by clusters.
"""

import warp as wp

from warpmis.device.views import vec8f
from warpmis.kernels.lanes import max8, min8, splat8
from warpmis.kernels.light.records import Response

wp.set_module_options({"enable_backward": False})

# The response is 1 plus this times the reflectance, so no light's importance falls below a fiftieth of what a matte
# receiver gives it: what the estimate leaves out can still be found.
STRENGTH = wp.constant(50.0)
# Part of the squared extent of a light, over its squared distance, by which the squared roughness grows: the half
# vector turns by half of the light's angle.
WIDENING = wp.constant(1.0)
# Squared length of wo + wi below which it says nothing.
SHORTEST = wp.constant(0.04)


@wp.func
def is_glossy(r: Response) -> bool:
    return r.gloss + r.coat > 0.0


@wp.func
def over_all_directions(r: Response) -> float:
    """For light from everywhere."""
    return wp.where(is_glossy(r), 1.0 + STRENGTH * (r.matte + r.gloss + r.coat), 1.0)


@wp.func
def lobe_towards(weight: float, alpha2: float, cos2_h: float, h2: float) -> float:
    """Pi times a lobe, for the squared cosine of the half vector to the normal and its squared length before it was
    normalised: pi D / (4 cos^2(wo, h)), since that cosine is half of the length."""
    a2 = wp.min(alpha2, 1.0)
    s = (1.0 - cos2_h) + a2 * cos2_h
    return weight * a2 / (s * s * h2)


@wp.func
def towards(r: Response, n: wp.vec3, wi: wp.vec3, extent2: float) -> float:
    """For a light in the direction wi; extent2: its squared radius over its squared distance."""
    if not is_glossy(r):
        return 1.0
    h = r.wo + wi
    h2 = wp.max(wp.dot(h, h), SHORTEST)
    cosine = wp.max(wp.dot(h, n), 0.0)
    cos2_h = wp.min(cosine * cosine / h2, 1.0)
    widened = WIDENING * wp.min(extent2, 1.0)
    reflected = r.matte + lobe_towards(r.gloss, r.alpha2 + widened, cos2_h, h2)
    reflected += lobe_towards(r.coat, r.coat_alpha2 + widened, cos2_h, h2)
    return 1.0 + STRENGTH * reflected


@wp.func
def lobes_towards(weight: float, alpha2: float, widened: vec8f, cos2_h: vec8f, h2: vec8f) -> vec8f:
    """As lobe_towards, of eight."""
    one = splat8(1.0)
    a2 = min8(one * alpha2 + widened, one)
    s = (one - cos2_h) + wp.cw_mul(a2, cos2_h)
    return wp.cw_div(a2 * weight, wp.cw_mul(wp.cw_mul(s, s), h2))


@wp.func
def towards_eight(r: Response, n: wp.vec3, x: vec8f, y: vec8f, z: vec8f, extent2: vec8f) -> vec8f:
    """For eight groups of lights in the directions (x, y, z), which are shorter than 1 for groups all around."""
    one = splat8(1.0)
    hx = x + one * r.wo[0]
    hy = y + one * r.wo[1]
    hz = z + one * r.wo[2]
    h2 = max8(wp.cw_mul(hx, hx) + wp.cw_mul(hy, hy) + wp.cw_mul(hz, hz), splat8(SHORTEST))
    cosine = max8(hx * n[0] + hy * n[1] + hz * n[2], splat8(0.0))
    cos2_h = min8(wp.cw_div(wp.cw_mul(cosine, cosine), h2), one)
    widened = extent2 * WIDENING
    reflected = one * r.matte + lobes_towards(r.gloss, r.alpha2, widened, cos2_h, h2)
    if r.coat > 0.0:
        reflected = reflected + lobes_towards(r.coat, r.coat_alpha2, widened, cos2_h, h2)
    return one + reflected * STRENGTH
