"""Which integrator a method has."""

from warpmis.config import RenderConfig
from warpmis.rendering.counted import CountsIntegrator
from warpmis.rendering.guided import GuidedIntegrator
from warpmis.rendering.integrator import Integrator
from warpmis.rendering.paired import PairIntegrator


def integrator_of(config: RenderConfig) -> type[Integrator]:
    if config.how.is_of_pair:
        return CountsIntegrator if config.how.allocation == "counts" else PairIntegrator
    return GuidedIntegrator if config.how.cache else Integrator
