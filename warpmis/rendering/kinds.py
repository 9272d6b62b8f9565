"""Which integrator a method has."""

from warpmis.config import RenderConfig
from warpmis.rendering.counted import CountsIntegrator
from warpmis.rendering.guided import GuidedIntegrator
from warpmis.rendering.integrator import Integrator


def integrator_of(config: RenderConfig) -> type[Integrator]:
    if config.how.counts:
        return CountsIntegrator
    return GuidedIntegrator if config.how.cache else Integrator
