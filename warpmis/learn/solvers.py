"""The table of solvers. Each row of methods.py that learns names one."""

from __future__ import annotations

from collections.abc import Callable

from warpmis.learn.control_variate import make_control_variate
from warpmis.learn.expectation import make_expectation
from warpmis.learn.newton_seed import make_newton_seed
from warpmis.learn.newton_share import make_newton_share
from warpmis.learn.newton_simplex import make_newton_simplex
from warpmis.learn.solver import KernelSolver, Problem, Solver
from warpmis.learn.variance_aware import make_variance_aware


def newton_share(problem: Problem) -> Solver:
    return KernelSolver(make_newton_share(problem.layout), (problem.method.min_share, problem.method.max_share))


def newton_seed(problem: Problem) -> Solver:
    return KernelSolver(make_newton_seed(problem.layout), (problem.method.min_share, problem.method.max_share))


def newton_simplex(problem: Problem) -> Solver:
    return KernelSolver(make_newton_simplex(problem.layout), (problem.min_share,))


def expectation(problem: Problem) -> Solver:
    return KernelSolver(make_expectation(problem.layout), (problem.min_share,))


def variance_aware(problem: Problem) -> Solver:
    return KernelSolver(make_variance_aware(problem.layout), (problem.method.min_share, problem.method.max_share))


def control_variate(problem: Problem) -> Solver:
    return KernelSolver(make_control_variate(problem.layout), ())


SOLVERS: dict[str, Callable[[Problem], Solver]] = {
    "newton_share": newton_share,
    "newton_seed": newton_seed,
    "newton_simplex": newton_simplex,
    "expectation": expectation,
    "variance_aware": variance_aware,
    "control_variate": control_variate,
}
