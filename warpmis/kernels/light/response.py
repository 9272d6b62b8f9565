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
from warpmis.kernels.lanes import splat8
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
# No lobe counts as narrower, in squared roughness: one of 0, as of an absent coat, would be 0 / 0 in its own direction.
NARROWEST = wp.constant(1.0e-6)


@wp.func
def is_glossy(r: Response) -> bool:
    return r.gloss + r.coat > 0.0


@wp.func
def over_all_directions(r: Response) -> float:
    """For light from everywhere."""
    return wp.where(is_glossy(r), 1.0 + STRENGTH * (r.matte + r.gloss + r.coat), 1.0)


@wp.func
def lobe_towards(weight: float, alpha2: float, cos2: float, h2: float) -> float:
    """Pi times a lobe, pi D / (4 cos^2(wo, h)): the latter cosine is half of the half vector's length.

    h2: squared length of the half vector; cos2: the same times the squared cosine to the normal.
    """
    a2 = wp.clamp(alpha2, NARROWEST, 1.0)
    s = h2 - (1.0 - a2) * cos2
    return weight * a2 * h2 / (s * s)


@wp.func
def towards(r: Response, n: wp.vec3, wi: wp.vec3, extent2: float) -> float:
    """For a light in the direction wi; extent2: its squared radius over its squared distance."""
    if not is_glossy(r):
        return 1.0
    h = r.wo + wi
    h2 = wp.max(wp.dot(h, h), SHORTEST)
    cosine = wp.max(wp.dot(h, n), 0.0)
    cos2 = wp.min(cosine * cosine, h2)
    widened = WIDENING * wp.min(extent2, 1.0)
    reflected = r.matte + lobe_towards(r.gloss, r.alpha2 + widened, cos2, h2)
    reflected += lobe_towards(r.coat, r.coat_alpha2 + widened, cos2, h2)
    return 1.0 + STRENGTH * reflected


@wp.func_native("""
    auto reflected = x;
    for (int i = 0; i < 8; ++i) {
        float hx = wo[0] + x[i];
        float hy = wo[1] + y[i];
        float hz = wo[2] + z[i];
        float h2 = hx * hx + hy * hy + hz * hz;
        h2 = h2 > shortest ? h2 : shortest;
        float cosine = hx * n[0] + hy * n[1] + hz * n[2];
        cosine = cosine > 0.0f ? cosine : 0.0f;
        float cos2 = cosine * cosine;
        cos2 = cos2 < h2 ? cos2 : h2;
        float a2 = lobes[1] + widened[i];
        a2 = a2 > narrowest ? a2 : narrowest;
        a2 = a2 < 1.0f ? a2 : 1.0f;
        float s = h2 - (1.0f - a2) * cos2;
        float coat_a2 = lobes[3] + widened[i];
        coat_a2 = coat_a2 > narrowest ? coat_a2 : narrowest;
        coat_a2 = coat_a2 < 1.0f ? coat_a2 : 1.0f;
        float coat_s = h2 - (1.0f - coat_a2) * cos2;
        reflected[i] = h2 * (lobes[0] * a2 / (s * s) + lobes[2] * coat_a2 / (coat_s * coat_s));
    }
    return reflected;
""")
def both_lobes_towards(
    wo: wp.vec3,
    n: wp.vec3,
    x: vec8f,
    y: vec8f,
    z: vec8f,
    lobes: wp.vec4,
    widened: vec8f,
    shortest: float,
    narrowest: float,
) -> vec8f:
    """The sum of two of lobe_towards, in a loop that the compiler turns into one for a CPU's SIMD registers; lobes:
    weight and squared roughness of each."""
    ...


@wp.func
def towards_eight(r: Response, n: wp.vec3, x: vec8f, y: vec8f, z: vec8f, extent2: vec8f) -> vec8f:
    """For eight groups of lights in the directions (x, y, z), which are shorter than 1 for groups all around."""
    lobes = wp.vec4(r.gloss, r.alpha2, r.coat, r.coat_alpha2)
    reflected = both_lobes_towards(r.wo, n, x, y, z, lobes, extent2 * WIDENING, SHORTEST, NARROWEST)
    return splat8(1.0 + STRENGTH * r.matte) + reflected * STRENGTH
