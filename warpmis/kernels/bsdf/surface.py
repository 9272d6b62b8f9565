"""The scattering at one point: weights of the lobes for one outgoing direction, evaluation, sampling, density.

Model: diffuse (Lambert), a GGX lobe with Fresnel F, and a GGX coat with Fresnel C on top:

    f = (1 - E_c(wo)) [ o k_d / pi (1 - E(wo)) (1 - F(wi)) / (1 - F_mean) + k(wo) specular ] + coat

E, E_c: what the lobe and the coat reflect in all; k: what multiple scattering adds (albedo.py). Each layer gets just
what the one above leaves over, and the diffuse lobe has the shape that a smooth interface gives it. Where a lobe is so
smooth that it is a mirror it takes no part here: events.py follows it. One side of a rough dielectric interface is a
surface of its own (rough_interface.py).
"""

from types import SimpleNamespace

import warp as wp

from warpmis.device.views import MaterialView, SceneView
from warpmis.kernels.bsdf.albedo import coat_albedo, compensation, lobe_albedo, white_albedo
from warpmis.kernels.bsdf.microfacet import (
    SMOOTH_ALPHA,
    mean_schlick,
    pdf_reflected,
    sample_visible_normal,
    schlick,
    schlick_scalar,
    smith_g1,
)
from warpmis.kernels.bsdf.rough_interface import InterfaceSide, evaluate_side
from warpmis.kernels.rng import ONE_MINUS_EPSILON
from warpmis.kernels.shading_frame import luminance
from warpmis.kernels.warps import INV_PI, square_to_cosine_hemisphere
from warpmis.scene.features import Features

wp.set_module_options({"enable_backward": False})

ONE = wp.constant(wp.vec3(1.0, 1.0, 1.0))


@wp.struct
class Surface:
    """Scattering for a fixed wo (local, wo[2] > 0): what is left of the lobes and how often each is sampled.

    side: of a rough interface, or none; then of all else alpha alone counts.
    compensation: factor on the specular lobe; below_coat: on all lobes but the coat.
    """

    wo: wp.vec3
    side: InterfaceSide
    diffuse: wp.vec3
    specular_f0: wp.vec3
    compensation: wp.vec3
    below_coat: float
    alpha: float
    coat: float
    coat_f0: float
    coat_alpha: float
    p_diffuse: float
    p_specular: float
    p_coat: float


@wp.struct
class Scattering:
    """f_cos: BSDF times cosine, per colour; pdf_solid_angle: density of `sample` for that direction, of which
    pdf_specular is the part of the specular and coat lobes; diffuse: the diffuse lobe's share of f_cos, per colour,
    where lights or AOVs ask for it."""

    f_cos: wp.vec3
    pdf_solid_angle: float
    pdf_specular: float
    diffuse: wp.vec3


def make_surface(features: Features) -> SimpleNamespace:
    """Surface functions for the lobes in `features`: prepare, on_side, evaluate, remapped, sample."""
    has_lobes = features.specular or features.rough_transmission

    @wp.func
    def on_side(side: InterfaceSide, material: MaterialView, wo: wp.vec3) -> Surface:
        """One side of a rough interface: a single lobe, which counts as specular."""
        s = Surface()
        s.wo = wo
        s.side = side
        s.alpha = material.alpha
        s.p_specular = 1.0
        return s

    @wp.func
    def prepare(scene: SceneView, material: MaterialView, wo: wp.vec3) -> Surface:
        """Lobes and their sampling probabilities, in proportion to an estimate of each one's albedo."""
        s = Surface()
        s.wo = wo
        s.diffuse = material.diffuse
        albedo = luminance(material.diffuse)
        s.p_diffuse = albedo
        if wp.static(features.specular):
            if material.has_specular:
                s.specular_f0 = material.specular_f0
                s.alpha = material.alpha
                white = white_albedo(scene.albedos, wo[2], material.alpha)
                s.compensation = compensation(material.specular_f0, white)
                reflected = lobe_albedo(material.specular_f0, white)
                s.diffuse = wp.cw_mul(material.diffuse, ONE - reflected)
                s.p_diffuse = luminance(s.diffuse)
                s.diffuse = wp.cw_div(s.diffuse, wp.max(ONE - mean_schlick(s.specular_f0), ONE * 1.0e-6))
                s.p_specular = wp.where(material.alpha < SMOOTH_ALPHA, 0.0, luminance(reflected))
                if wp.static(features.opacity):
                    # What is let through is no longer reflected diffusely; the specular lobe stays (the
                    # specification's mode "transparent").
                    if not material.opacity_is_presence:
                        s.diffuse = s.diffuse * material.opacity
                        s.p_diffuse = s.p_diffuse * material.opacity
        if wp.static(features.clearcoat):
            s.coat = material.coat
            s.coat_f0 = material.coat_f0
            s.coat_alpha = material.coat_alpha
            s.below_coat = 1.0 - coat_albedo(scene.albedos, s.coat, s.coat_f0, s.coat_alpha, wo[2])
            s.p_diffuse = s.p_diffuse * s.below_coat
            s.p_specular = s.p_specular * s.below_coat
            s.p_coat = wp.where(material.coat_alpha < SMOOTH_ALPHA, 0.0, 1.0 - s.below_coat)
        total = s.p_diffuse + s.p_specular + s.p_coat
        if total > 0.0:
            s.p_diffuse = s.p_diffuse / total
            s.p_specular = s.p_specular / total
            s.p_coat = s.p_coat / total
        return s

    @wp.func
    def evaluate(s: Surface, wi: wp.vec3) -> Scattering:
        """BSDF times cosine and density for a local direction; both 0 below the surface."""
        scattering = Scattering()
        if wi[2] <= 0.0:
            return scattering
        if wp.static(features.rough_transmission):
            if s.side.is_present:
                of_side = evaluate_side(s.side, s.wo, s.alpha, wi)
                scattering.f_cos = of_side.f_cos
                scattering.pdf_solid_angle = of_side.pdf
                scattering.pdf_specular = of_side.pdf
                return scattering
        scattering.f_cos = s.diffuse * (INV_PI * wi[2])
        scattering.pdf_solid_angle = s.p_diffuse * INV_PI * wi[2]
        if wp.static(features.splits_lobes):
            scattering.diffuse = scattering.f_cos
        if wp.static(features.specular):
            if s.alpha > 0.0:
                scattering.f_cos = wp.cw_mul(scattering.f_cos, ONE - schlick(s.specular_f0, wi[2]))
                if wp.static(features.splits_lobes):
                    scattering.diffuse = scattering.f_cos
                if s.p_specular > 0.0:
                    h = wp.normalize(s.wo + wi)
                    pdf = pdf_reflected(s.wo, h, s.alpha)
                    fresnel = wp.cw_mul(schlick(s.specular_f0, wp.dot(s.wo, h)), s.compensation)
                    scattering.f_cos += fresnel * (pdf * smith_g1(wi, s.alpha))
                    scattering.pdf_specular += s.p_specular * pdf
            if wp.static(features.clearcoat):
                if s.coat > 0.0:
                    scattering.f_cos = scattering.f_cos * s.below_coat
                    if wp.static(features.splits_lobes):
                        scattering.diffuse = scattering.diffuse * s.below_coat
                    if s.p_coat > 0.0:
                        h = wp.normalize(s.wo + wi)
                        pdf = pdf_reflected(s.wo, h, s.coat_alpha)
                        coat_fresnel = s.coat * schlick_scalar(s.coat_f0, wp.dot(s.wo, h))
                        scattering.f_cos += ONE * (coat_fresnel * pdf * smith_g1(wi, s.coat_alpha))
                        scattering.pdf_specular += s.p_coat * pdf
            scattering.pdf_solid_angle += scattering.pdf_specular
        if wp.static(features.splits_lobes):
            scattering.diffuse = wp.cw_div(scattering.diffuse, wp.max(scattering.f_cos, ONE * 1.0e-20))
        return scattering

    @wp.func
    def remapped(s: Surface, u: float) -> float:
        """The number that chooses a lobe in `sample`, remapped from that lobe's part to [0, 1)."""
        within = u / wp.max(s.p_diffuse, 1.0e-20)
        if wp.static(has_lobes):
            if u >= s.p_diffuse and s.p_specular + s.p_coat > 0.0:
                above = u - s.p_diffuse
                within = above / wp.max(s.p_specular, 1.0e-20)
                if above >= s.p_specular and s.p_coat > 0.0:
                    within = (above - s.p_specular) / s.p_coat
        return wp.clamp(within, 0.0, ONE_MINUS_EPSILON)

    @wp.func
    def sample(s: Surface, u: wp.vec4) -> wp.vec3:
        """A local direction; below the surface (wi[2] <= 0) there is no sample. u[0] chooses the lobe."""
        if wp.static(features.rough_transmission):
            if s.side.is_present:
                return s.side.drawn
        wi = wp.vec3(0.0, 0.0, 0.0)
        if u[0] < s.p_diffuse:
            wi = square_to_cosine_hemisphere(u[1], u[2])
        if wp.static(features.specular):
            if u[0] >= s.p_diffuse and s.p_specular + s.p_coat > 0.0:
                alpha = s.alpha
                if u[0] >= s.p_diffuse + s.p_specular and s.p_coat > 0.0:
                    alpha = s.coat_alpha
                h = sample_visible_normal(s.wo, alpha, u[1], u[2])
                wi = h * (2.0 * wp.dot(s.wo, h)) - s.wo
        return wi

    return SimpleNamespace(prepare=prepare, on_side=on_side, remapped=remapped, evaluate=evaluate, sample=sample)
