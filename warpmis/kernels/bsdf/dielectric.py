"""A dielectric interface: light is reflected at its microfacets or refracted through them, as Fresnel says.

The facets are those of microfacet.py. What is drawn has the weight G1(wi), times the change of radiance when refracted.
Where the interface is so rough that light samples pay, it is a vertex like others (rough_interface.py).

References: Walter et al. (2007), "Microfacet Models for Refraction through Rough Surfaces", equations 16, 21, 40;
Veach (1997), section 5.2, radiance across an interface.
"""

import warp as wp

from warpmis.device.views import MaterialView
from warpmis.kernels.bsdf.microfacet import SMOOTH_ALPHA, sample_visible_normal, smith_g1
from warpmis.scene import material as scene_material

wp.set_module_options({"enable_backward": False})

# Light samples are taken where facets are as rough and rays are bent as much: else what is refracted goes straight on
# or nearly so, which no light sample would find, and which float32 cannot tell the facet of.
ROUGH_ALPHA = wp.constant(scene_material.ROUGH_ALPHA)
LEAST_BEND = wp.constant(0.05)


@wp.struct
class DielectricSample:
    """A local direction, or the zero vector where there is none; its weight; whether it lies behind the surface."""

    wi: wp.vec3
    weight: wp.vec3
    is_refracted: bool


@wp.func
def fresnel_dielectric(cos_theta: float, eta: float) -> float:
    """Share of unpolarised light that is reflected, at a cosine of 0 to 1; eta: the index of refraction beyond the
    interface over that of the incident side. 1 beyond the critical angle. Reference: Born, Wolf (1999), section 1.5."""
    sin2_beyond = (1.0 - cos_theta * cos_theta) / (eta * eta)
    if sin2_beyond >= 1.0:
        return 1.0
    cos_beyond = wp.sqrt(1.0 - sin2_beyond)
    parallel = (eta * cos_theta - cos_beyond) / wp.max(eta * cos_theta + cos_beyond, 1.0e-20)
    perpendicular = (cos_theta - eta * cos_beyond) / wp.max(cos_theta + eta * cos_beyond, 1.0e-20)
    return 0.5 * (parallel * parallel + perpendicular * perpendicular)


@wp.func
def fresnel_pane(cos_theta: float, eta: float) -> float:
    """Share that a pane reflects: at its front, and again and again within. Reference: Stokes (1862)."""
    once = fresnel_dielectric(cos_theta, eta)
    return 2.0 * once / (1.0 + once)


@wp.func
def refracted(wo: wp.vec3, h: wp.vec3, eta: float) -> wp.vec3:
    """wo through a facet with the normal h on its side, below the critical angle. Reference: Snell's law."""
    cosine = wp.dot(wo, h)
    cos_beyond = wp.sqrt(wp.max(1.0 - (1.0 - cosine * cosine) / (eta * eta), 0.0))
    return h * (cosine / eta - cos_beyond) - wo / eta


@wp.func
def is_clear_pane(material: MaterialView) -> bool:
    """Whether the interface lets light straight through."""
    return material.transmission > 0.0 and material.thin_walled and material.alpha < SMOOTH_ALPHA


@wp.func
def pane_transmittance(material: MaterialView, cos_theta: float) -> wp.vec3:
    """Share of light that goes straight through a clear pane."""
    return material.tint * (material.transmission * (1.0 - fresnel_pane(cos_theta, material.ior)))


@wp.func
def sample_interface(
    material: MaterialView, wo: wp.vec3, is_front: bool, u_choice: float, u: wp.vec4
) -> DielectricSample:
    """A direction for wo, local and above the surface. u_choice chooses between reflection and refraction, u[0] and
    u[1] the facet. Of a clear pane only what it reflects: what goes straight through has been chosen before."""
    s = DielectricSample()
    h = wp.vec3(0.0, 0.0, 1.0)
    is_smooth = material.alpha < SMOOTH_ALPHA
    if not is_smooth:
        h = sample_visible_normal(wo, material.alpha, u[0], u[1])
    eta = wp.where(is_front, material.ior, 1.0 / material.ior)
    cosine = wp.dot(wo, h)
    reflectance = fresnel_dielectric(cosine, eta)
    if material.thin_walled:
        reflectance = wp.where(is_smooth, 1.0, fresnel_pane(cosine, material.ior))
    reflected = h * (2.0 * cosine) - wo
    s.weight = wp.vec3(1.0, 1.0, 1.0)
    if u_choice < reflectance:
        if reflected[2] <= 0.0:
            return s
        s.wi = reflected
    else:
        s.is_refracted = True
        wi = refracted(wo, h, eta)
        s.weight = material.tint / (eta * eta)
        if material.thin_walled:
            # Refracted twice, light leaves as far from straight on as it would be reflected.
            wi = wp.vec3(reflected[0], reflected[1], -reflected[2])
            s.weight = material.tint
        if wi[2] >= 0.0:
            return s
        s.wi = wi
    if not is_smooth:
        s.weight = s.weight * smith_g1(s.wi, material.alpha)
    return s


@wp.func
def is_rough_interface(material: MaterialView) -> bool:
    """Whether light samples are taken."""
    return material.alpha >= ROUGH_ALPHA and (material.thin_walled or wp.abs(material.ior - 1.0) >= LEAST_BEND)
