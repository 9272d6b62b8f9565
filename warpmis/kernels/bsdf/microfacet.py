"""GGX microfacets with separable Smith masking and Schlick's Fresnel term, in the local frame (n = +Z).

References: Walter et al. (2007), "Microfacet Models for Refraction through Rough Surfaces", equations 33 and 34;
Heitz (2018), "Sampling the GGX Distribution of Visible Normals"; Dupuy and Benyoub (2023), "Sampling Visible GGX
Normals with Spherical Caps".
"""

import warp as wp

from warpmis.kernels.warps import INV_PI, PI
from warpmis.scene import material

wp.set_module_options({"enable_backward": False})

# Below it a lobe is a mirror (scene/material.py).
SMOOTH_ALPHA = wp.constant(material.SMOOTH_ALPHA)


@wp.func
def grazing_reflectance(f0: float) -> float:
    """F90, which no lobe of reflectance 0 has. No real interface reflects less than 2 %, so a lower F0 means that
    there is to be none. Reference: Lagarde and de Rousiers (2014), "Moving Frostbite to PBR", section 3.1."""
    return wp.min(50.0 * f0, 1.0)


@wp.func
def schlick(f0: wp.vec3, cos_theta: float) -> wp.vec3:
    """Fresnel reflectance, of one F90 for all colours. Reference: Schlick (1994)."""
    m = wp.clamp(1.0 - cos_theta, 0.0, 1.0)
    m2 = m * m
    f90 = grazing_reflectance(wp.max(f0))
    return f0 + (wp.vec3(f90, f90, f90) - f0) * (m2 * m2 * m)


@wp.func
def mean_schlick(f0: wp.vec3) -> wp.vec3:
    """Its mean over the hemisphere, weighted by the cosine."""
    f90 = grazing_reflectance(wp.max(f0))
    return f0 + (wp.vec3(f90, f90, f90) - f0) / 21.0


@wp.func
def schlick_scalar(f0: float, cos_theta: float) -> float:
    m = wp.clamp(1.0 - cos_theta, 0.0, 1.0)
    m2 = m * m
    return f0 + (grazing_reflectance(f0) - f0) * (m2 * m2 * m)


@wp.func
def ggx_d(h: wp.vec3, alpha: float) -> float:
    """Distribution of normals. Written with the slopes, so that a small alpha does not cancel near h = n."""
    slope2 = (h[0] * h[0] + h[1] * h[1]) / (alpha * alpha)
    s = slope2 + h[2] * h[2]
    return INV_PI / (alpha * alpha * s * s)


@wp.func
def smith_g1(w: wp.vec3, alpha: float) -> float:
    """Share of the microfacets facing w that w sees."""
    cos2 = w[2] * w[2]
    tan2 = (w[0] * w[0] + w[1] * w[1]) / wp.max(cos2, 1.0e-20)
    return 2.0 / (1.0 + wp.sqrt(1.0 + alpha * alpha * tan2))


@wp.func
def sample_visible_normal(wo: wp.vec3, alpha: float, u: float, v: float) -> wp.vec3:
    """A microfacet normal, by the area that it shows to wo (wo[2] > 0)."""
    stretched = wp.normalize(wp.vec3(alpha * wo[0], alpha * wo[1], wo[2]))
    phi = 2.0 * PI * u
    z = (1.0 - v) * (1.0 + stretched[2]) - stretched[2]
    sin_theta = wp.sqrt(wp.clamp(1.0 - z * z, 0.0, 1.0))
    cap = wp.vec3(sin_theta * wp.cos(phi), sin_theta * wp.sin(phi), z)
    h = cap + stretched
    return wp.normalize(wp.vec3(alpha * h[0], alpha * h[1], wp.max(h[2], 1.0e-7)))


@wp.func
def pdf_reflected(wo: wp.vec3, h: wp.vec3, alpha: float) -> float:
    """Solid angle density of wo mirrored about sample_visible_normal: D G1(wo) / (4 cos(wo))."""
    return ggx_d(h, alpha) * smith_g1(wo, alpha) / (4.0 * wo[2])
