"""How the package makes its kernels: each in a module of its own, named by what the kernel is specialised to.

Warp names a module by its source and by the static values in it. It leaves out those of device functions that depend on
a loop's variable, such as the strategies' names: two kernels that differ in nothing else share one name, and the second
silently runs the first one's code. So the name also says what the factory was called with.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from hashlib import sha256
from inspect import signature
from typing import Any, ParamSpec

import warp as wp

Arguments = ParamSpec("Arguments")

# A kernel's body: a function in Warp's dialect, not yet a kernel.
KernelFunction = Callable[..., None]

# Warp's own default. We set it for our kernels, so that a caller's `warp.config.cpu_compiler_flags` neither slows them
# down nor compiles them anew.
CPU_COMPILER_FLAGS = (
    "-march=native -mllvm=-inline-threshold=9000 -mllvm=-inline-cold-callsite-threshold=3000"
    " -mllvm=-slp-recursion-max-depth=4"
)


def device_kernel(function: KernelFunction, name: str | None = None) -> wp.Kernel:
    """The function as a kernel in a module of its own, without the derivatives that nobody asks for."""
    options = {"cpu_compiler_flags": CPU_COMPILER_FLAGS}
    return wp.kernel(function, name=name, module="unique", enable_backward=False, module_options=options)


def kernel_factory(make: Callable[Arguments, KernelFunction]) -> Callable[Arguments, wp.Kernel]:
    """Decorates a function that returns the kernel's function for its arguments: it returns the kernel.

    Equal arguments, whose `repr` must say all about them, give the same kernel; others give one of another name.
    """
    parameters = signature(make)

    @cache
    def build(*values: Any) -> wp.Kernel:
        function = make(*values)  # type: ignore[call-arg]  # bound below
        return device_kernel(function, f"{function.__name__}_{sha256(repr(values).encode()).hexdigest()[:16]}")

    @wraps(make)
    def made(*arguments: Arguments.args, **named: Arguments.kwargs) -> wp.Kernel:
        bound = parameters.bind(*arguments, **named)
        bound.apply_defaults()
        return build(*bound.arguments.values())

    return made
