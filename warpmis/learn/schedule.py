"""Which samples are spent on which allocation."""

from __future__ import annotations

from dataclasses import dataclass

from warpmis.config import RenderConfig


@dataclass(frozen=True)
class Round:
    """Samples per pixel traced with one frozen allocation; `learn`: its moments then give the next one.

    following: samples per pixel of the round after it, 0 for none; label: for those who watch.
    stride: of each cell of so many by so many pixels the first one is traced. is_kept: the picture holds the samples.
    may_be_left_out: where time is short, the render goes on without the round.
    """

    first_sample: int
    samples: int
    learn: bool
    following: int = 0
    label: str = ""
    stride: int = 1
    is_kept: bool = True
    may_be_left_out: bool = False


def schedule(config: RenderConfig) -> tuple[Round, ...]:
    """The learn rounds, then everything that the budget leaves in one round; every sample enters the image."""
    rounds: list[Round] = []
    spent = 0
    if config.how.learns:
        count, spp = config.learn_rounds(), config.learn_spp()
        for _ in range(count):
            spent += spp
            following = min(spp, config.spp - spent) if len(rounds) + 1 < count else config.spp - spent
            label = f"round {len(rounds) + 1}/{count}"
            rounds.append(Round(spent - spp, spp, learn=True, following=following, label=label))
    if spent < config.spp:
        rounds.append(Round(spent, config.spp - spent, learn=False))
    return tuple(rounds)
