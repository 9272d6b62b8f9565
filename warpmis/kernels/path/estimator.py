"""Which estimator the paths of a kernel take, and the state that they carry for it."""

from types import SimpleNamespace

from warpmis.kernels.path.contributions import make_contributions, scattering_type
from warpmis.kernels.path.counts import CountsEstimate, make_counts
from warpmis.kernels.path.guided import make_guided, make_guided_estimate
from warpmis.kernels.path.mixture import make_densities, make_estimate, make_mixture
from warpmis.kernels.path.next_event import NoEstimate, make_next_event
from warpmis.kernels.path.parts import make_parts, parts_type
from warpmis.kernels.path.record import NoRecord, Record, make_record, no_record
from warpmis.kernels.path.state import make_state
from warpmis.kernels.path.throughput import make_roulette
from warpmis.kernels.path.vertex_records import make_vertex_records
from warpmis.kernels.strategies import make_strategies
from warpmis.scene.features import Features


def make_estimator(
    features: Features,
    surface: SimpleNamespace,
    lights: SimpleNamespace,
    direct_light: SimpleNamespace,
    sampler: SimpleNamespace,
) -> SimpleNamespace:
    """The estimator's functions (next_event.py), its `record` and `contributions`, the type PathState, `strategies`.

    By the spatial cache where there is one, or by counts of samples where pixels have those. Else next-event estimation
    without strategies, and with them their mixture.
    """
    strategies = make_strategies(features, surface, lights)
    Scattering = scattering_type(features)
    if features.cache:
        PathState = make_state(make_guided_estimate(), NoRecord, Scattering)
        contributions = make_contributions(features, PathState)
        record = make_vertex_records(PathState)
        estimator = make_guided(PathState, strategies.vec_s, surface, direct_light, record, contributions)
        estimator.record = record
    elif features.allocation == "counts":
        learns = "parts" in features.statistics
        PathState = make_state(CountsEstimate, parts_type(learns), Scattering)
        contributions = make_contributions(features, PathState)
        record = make_parts(PathState, learns)
        survives = make_roulette(features, PathState, record, sampler).survives
        next_event = make_next_event(PathState, strategies.vec_s, surface, direct_light, contributions)
        estimator = make_counts(
            PathState, strategies, surface, lights, direct_light, next_event, contributions, record, survives
        )
        estimator.record = record
    elif not features.strategies:
        PathState = make_state(NoEstimate, NoRecord, Scattering)
        contributions = make_contributions(features, PathState)
        estimator = make_next_event(PathState, strategies.vec_s, surface, direct_light, contributions)
        estimator.record = no_record(PathState)
    else:
        PathState = make_state(make_estimate(strategies.vec_s), Record, Scattering)
        contributions = make_contributions(features, PathState)
        record = make_record(PathState)
        densities = make_densities(features, PathState, strategies, lights)
        next_event = make_next_event(PathState, strategies.vec_s, surface, direct_light, contributions)
        # Of paths that end behind the mixture's vertex none comes to a vertex without one.
        estimator = make_mixture(PathState, strategies, densities, next_event, record, features.indirect)
        estimator.record = record
    if not hasattr(estimator, "survives"):
        estimator.survives = make_roulette(features, PathState, estimator.record, sampler).survives
    estimator.PathState = PathState
    estimator.contributions = contributions
    estimator.strategies = strategies
    return estimator
