"""The film: merging is exact in any order, means and variances are those of all samples."""

from __future__ import annotations

import numpy as np
import pytest

from warpmis.film.film import Film


def film_of(samples: np.ndarray) -> Film:
    """A 1 x 1 film of grey samples that all hit at depth 2."""
    n = len(samples)
    grey = np.full((1, 1, 3), samples.sum())
    one = np.ones((1, 1))
    mean = samples.mean() if n else 0.0
    return Film(
        count=np.array([[n]]),
        rejected=np.array([[0]]),
        hits=np.array([[n]]),
        color=grey,
        luminance_mean=one * mean,
        luminance_m2=one * ((samples - mean) ** 2).sum(),
        albedo=grey * 0.5,
        normal=np.full((1, 1, 3), float(n)),
        depth=one * 2.0 * n,
        alpha=one * n,
    )


def test_merge_in_any_order_is_the_film_of_all_samples() -> None:
    rng = np.random.default_rng(0)
    parts = [1000.0 + rng.normal(size=n) for n in (1, 7, 256, 4096)]
    whole = film_of(np.concatenate(parts))
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        merged = film_of(parts[order[0]])
        for index in order[1:]:
            merged = merged.merge(film_of(parts[index]))
        assert merged.count == whole.count
        assert merged.luminance_mean == pytest.approx(whole.luminance_mean, rel=1e-12)
        assert merged.luminance_m2 == pytest.approx(whole.luminance_m2, rel=1e-9)
        assert merged.image() == pytest.approx(whole.image(), rel=1e-6)
        assert merged.variance() == pytest.approx(whole.variance(), rel=1e-6)
    assert whole.mean_depth() == pytest.approx(2.0)
    assert whole.coverage() == pytest.approx(1.0)


def test_an_empty_film_changes_nothing_and_has_finite_means() -> None:
    empty = film_of(np.zeros(0))
    for picture in (empty.image(), empty.variance(), empty.mean_depth(), empty.mean_normal(), empty.coverage()):
        assert (picture == 0.0).all()
    samples = np.array([1.0, 2.0, 4.0])
    merged = empty.merge(film_of(samples))
    assert merged.luminance_mean.item() == pytest.approx(samples.mean())
    assert merged.variance().item() == pytest.approx(samples.var(ddof=1))
