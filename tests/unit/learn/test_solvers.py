"""All solvers are used alike: a table names them, and the same three methods run any of them on cells of any kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp
from toys import random_moments, sums

from warpmis.kernels.moments import Layout
from warpmis.learn.solver import Problem, Solver
from warpmis.learn.solvers import SOLVERS
from warpmis.methods import METHODS

LEARNING = [name for name, method in METHODS.items() if method.learns]
CELLS = 7  # no picture's: a prime


def problem_of(name: str) -> Problem:
    method = METHODS[name]
    count = 0 if method.is_of_pair else 2 if method.two_strategies else 3
    return Problem(method, Layout(count, method.statistics), CELLS, "cpu", stratified=True)


def start_of(problem: Problem) -> np.ndarray:
    """One cell's numbers: equal shares or weights, or the coefficients of three colours."""
    if problem.method.allocation == "control":
        return np.zeros(3, np.float32)
    count = problem.layout.strategies or 2
    return np.full(count, 1.0 / count, np.float32)


def step_of(solver: Solver, problem: Problem) -> tuple[np.ndarray, set[wp.Kernel]]:
    """The shares after a step on random moments, the last cell's all 0, and the kernels that were launched."""
    layout = problem.layout
    dtype = layout.vec if problem.method.pool_radius is None else layout.relative_vec
    count = layout.strategies
    known = np.random.default_rng(7).uniform(0.5, 1.5, (CELLS, layout.size))
    if count:
        F2, q, _ = random_moments(count, CELLS, seed=7)
        known[:, : count + count * (count + 1) // 2] = sums(F2, q)
    known[-1] = 0.0
    start = start_of(problem)
    vec_s = wp.types.vector(length=len(start), dtype=wp.float32)
    shares = wp.array(np.tile(start, (CELLS, 1)), dtype=vec_s, device="cpu")
    launched = set()

    def launch(kernel: wp.Kernel, inputs: list[Any]) -> None:
        launched.add(kernel)
        for first in (0, 4):  # in two parts, as from two threads
            wp.launch(kernel, dim=min(4, CELLS - first), inputs=[first, *inputs], device="cpu")

    solver.step(wp.array(known, dtype=dtype, device="cpu"), shares, launch)
    return shares.numpy(), launched


@pytest.mark.parametrize("name", LEARNING)
def test_a_step_launches_what_the_solver_names_and_changes_cells_that_found_light(name: str) -> None:
    problem = problem_of(name)
    solver = SOLVERS[problem.method.solver](problem)
    allocation, launched = step_of(solver, problem)
    assert launched == set(solver.kernels())
    assert np.array_equal(allocation[-1], start_of(problem))
    assert (allocation[:-1] != allocation[-1]).any(axis=1).mean() > 0.5
    if problem.method.allocation != "control":
        assert allocation.sum(axis=1) == pytest.approx(np.ones(CELLS), abs=1e-6)


@pytest.mark.parametrize("name", LEARNING)
def test_buffers_hold_a_row_a_cell(name: str) -> None:
    problem = problem_of(name)
    assert all(len(buffer) == CELLS for buffer in SOLVERS[problem.method.solver](problem).buffers())


def test_every_solver_serves_a_method() -> None:
    assert set(SOLVERS) == {METHODS[name].solver for name in LEARNING}
