"""A rough dielectric interface, as two vertices: each looks to one of its sides.

The BSDF's own direction chooses the side, as Fresnel says of the facet that it has drawn. What else draws directions
has a side chosen for it beforehand. On its side the path scatters into one hemisphere as at all other vertices: the
frame is turned there, and the densities are those of the whole sphere. Light samples are taken on both sides.

References: Walter et al. (2007), "Microfacet Models for Refraction through Rough Surfaces", equations 13 to 17;
Heitz (2018), equation 3, the density of visible normals.
"""

import warp as wp

from warpmis.device.views import MaterialView
from warpmis.kernels.bsdf.dielectric import fresnel_dielectric, fresnel_pane
from warpmis.kernels.bsdf.microfacet import ggx_d, smith_g1
from warpmis.kernels.shading_frame import Frame

wp.set_module_options({"enable_backward": False})

# What is reflected counts as this at least, and so does what is let through: the estimate may miss either.
LEAST_PART = wp.constant(0.02)


@wp.struct
class InterfaceSide:
    """One side of an interface for a fixed wo, local to the frame that looks to wo's side.

    is_present: false at vertices that are no interface; is_beyond: whether the side is behind the surface.
    drawn: the BSDF's own direction, local to the frame that looks to the side, or the zero vector where it has drawn
    none; chance: the probability that the side is chosen for others.
    eta: the index of refraction beyond the interface over that on wo's side; ior: of the material.
    """

    is_present: bool
    is_beyond: bool
    drawn: wp.vec3
    chance: float
    thin_walled: bool
    eta: float
    ior: float
    tint: wp.vec3


@wp.struct
class SideScattering:
    """f_cos: BSDF times cosine, per colour; pdf: density of dielectric.sample_interface [1/sr]."""

    f_cos: wp.vec3
    pdf: float


@wp.func
def reflectance_of(side: InterfaceSide, cosine: float) -> float:
    """Of a facet."""
    if side.thin_walled:
        return fresnel_pane(cosine, side.ior)
    return fresnel_dielectric(cosine, side.eta)


@wp.func
def chance_beyond(side: InterfaceSide, wo: wp.vec3, alpha: float) -> float:
    """The probability that the side beyond is chosen.

    It is an estimate, from three facets, of the share of light that is let through.
    """
    tilted = wp.vec2(wo[2], alpha * wp.sqrt(wp.max(1.0 - wo[2] * wo[2], 0.0))) / wp.sqrt(1.0 + alpha * alpha)
    reflected = reflectance_of(side, wo[2])
    towards = reflectance_of(side, wp.min(tilted[0] + tilted[1], 1.0))
    away = reflectance_of(side, wp.max(tilted[0] - tilted[1], 0.0))
    return 1.0 - wp.clamp(0.5 * reflected + 0.25 * (towards + away), LEAST_PART, 1.0 - LEAST_PART)


@wp.func
def side_of(material: MaterialView, is_front: bool, is_beyond: bool) -> InterfaceSide:
    side = InterfaceSide()
    side.is_present = True
    side.is_beyond = is_beyond
    side.thin_walled = material.thin_walled
    side.eta = wp.where(is_front, material.ior, 1.0 / material.ior)
    side.ior = material.ior
    side.tint = material.tint
    return side


@wp.func
def chance_of(side: InterfaceSide) -> float:
    """The probability with which the vertex' side was chosen: 1 where there is only one."""
    return wp.where(side.is_present, side.chance, 1.0)


@wp.func
def turned(frame: Frame) -> Frame:
    """The frame that looks to the other side."""
    beyond = Frame()
    beyond.s = frame.s
    beyond.t = -frame.t
    beyond.n = -frame.n
    return beyond


@wp.func
def to_other_side(w: wp.vec3) -> wp.vec3:
    """A local direction of a frame, local to the turned one."""
    return wp.vec3(w[0], -w[1], -w[2])


@wp.func
def facet_between(side: InterfaceSide, wo: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """The upward facet that sends wo to wi: Walter et al. (2007), equations 13 and 16."""
    if not side.is_beyond:
        return wp.normalize(wo + wi)
    if side.thin_walled:
        # Refracted twice, light leaves as far from straight on as it would be reflected.
        return wp.normalize(wo + wp.vec3(wi[0], wi[1], -wi[2]))
    h = wp.normalize(wo + side.eta * wi)
    return wp.where(h[2] < 0.0, -h, h)


@wp.func
def evaluate_side(side: InterfaceSide, wo: wp.vec3, alpha: float, w: wp.vec3) -> SideScattering:
    """For a direction on the side (w[2] > 0), local to the frame that looks there."""
    s = SideScattering()
    wi = w
    if side.is_beyond:
        wi = to_other_side(w)
    h = facet_between(side, wo, wi)
    cosine = wp.dot(wo, h)
    if cosine <= 0.0:
        return s
    visible = ggx_d(h, alpha) * smith_g1(wo, alpha) * cosine / wo[2]
    reflectance = reflectance_of(side, cosine)
    tint = wp.vec3(1.0, 1.0, 1.0)
    if not side.is_beyond:
        s.pdf = reflectance * visible / (4.0 * cosine)
    elif side.thin_walled:
        s.pdf = (1.0 - reflectance) * visible / (4.0 * cosine)
        tint = side.tint
    else:
        cos_beyond = wp.dot(wi, h)
        if cos_beyond >= 0.0:
            return s
        bent = cosine + side.eta * cos_beyond
        s.pdf = (1.0 - reflectance) * visible * side.eta * side.eta * -cos_beyond / wp.max(bent * bent, 1.0e-20)
        tint = side.tint / (side.eta * side.eta)
    s.f_cos = tint * (s.pdf * smith_g1(wi, alpha))
    return s
