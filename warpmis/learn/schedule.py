"""Which samples are spent on which allocation."""

from __future__ import annotations

from dataclasses import dataclass

from warpmis.config import RenderConfig


@dataclass(frozen=True)
class Round:
    """Samples per pixel traced with one frozen allocation; `learn`: its moments then give the next one."""

    first_sample: int
    samples: int
    learn: bool


def schedule(config: RenderConfig) -> tuple[Round, ...]:
    """The learn rounds, then everything that the budget leaves in one round; every sample enters the image."""
    rounds = []
    spent = 0
    if config.how.learns:
        count, spp = config.learn_rounds(), config.learn_spp()
        if config.how.next_event:
            # Its statistics are of pairs alone: pixels that have gone over to a mixture would add none.
            count, spp = 1, count * spp
        for _ in range(count):
            rounds.append(Round(spent, spp, learn=True))
            spent += spp
    if spent < config.spp:
        rounds.append(Round(spent, config.spp - spent, learn=False))
    return tuple(rounds)
