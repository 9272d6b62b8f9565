"""The command line: one module a command, and what they share in how they speak (`console.py`).

The only layer that prints or exits. Standard output carries results alone; everything else goes to standard error.
What takes long to import is imported once it is needed, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import atexit
import gc
import os
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

import warpmis
from warpmis.cli import compare, compile, inspect, render
from warpmis.cli.console import fail, load_pxr
from warpmis.cli.signals import as_interrupts, name_of, status_of
from warpmis.cli.streams import Forgiving, open_closed_streams, output_is_closed
from warpmis.errors import ConfigError, WarpmisError

EXIT_DONE = 0
EXIT_ERROR = 1
EXIT_USAGE = 2


def program() -> NoReturn:
    """`warpmis` in a shell: run its command and end the process with its status."""
    open_closed_streams()
    # Modules and kernels' syntax trees stay to the end: to walk through them in search of garbage, as often as Python
    # does by default, took a seventh of a start.
    gc.set_threshold(50_000, 20, 50)
    status = main()
    compilation = sys.modules.get("warpmis.device.compilation")
    if compilation is not None and compilation.is_compiling():
        # Python would wait for the compiling threads, some seconds long, for kernels that nobody will launch.
        compilation.kernel_cache.discard_unfinished()
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            Forgiving(stream).flush()
        os._exit(status)
    sys.exit(status)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status; never raises but argparse's SystemExit."""
    arguments = _parsed(argv)
    caught: list[int] = []
    try:
        if getattr(arguments, "json", False) and output_is_closed():
            raise ConfigError("--json prints on standard output, which is closed; open it or drop --json")
        load_pxr()
        with as_interrupts() as caught:
            arguments.run(arguments)
    except ConfigError as error:
        return fail(str(error), EXIT_USAGE)
    except WarpmisError as error:
        return fail(str(error), EXIT_ERROR)
    except KeyboardInterrupt:
        return fail(f"interrupted{name_of(caught)}", status_of(caught))
    except Exception as error:
        if os.environ.get("WARPMIS_TRACEBACK") == "1":
            traceback.print_exc()
        hint = "run with WARPMIS_TRACEBACK=1 for the traceback"
        return fail(f"internal error: {type(error).__name__}: {error} ({hint})", EXIT_ERROR)
    return EXIT_DONE


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with the arguments, and where all of them are listed."""

    def error(self, message: str) -> NoReturn:
        raise SystemExit(fail(f"{message}; see {self.prog} --help", EXIT_USAGE))


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = _parser()
    for text in sys.argv[1:] if argv is None else argv:
        if not is_utf8(text):
            parser.error(f"{text!r} is not UTF-8, which USD and image libraries ask for")
    arguments, rest = parser.parse_known_args(argv)
    # argparse of Python 3.11 finds an optional OUT right behind STAGE alone.
    if len(rest) == 1 and not rest[0].startswith("-") and getattr(arguments, "out", "") is None:
        arguments.out = rest.pop()
    if rest:
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    return arguments


def is_utf8(text: str) -> bool:
    """Python puts surrogates for what it cannot decode of its arguments."""
    return not any("\udc80" <= character <= "\udcff" for character in text)


def _parser() -> argparse.ArgumentParser:
    # No abbreviations: a script must not break when an option is added.
    description = "Render OpenUSD stages until the picture's error is below the one you ask for."
    parser = Parser(prog="warpmis", description=description, allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"warpmis {warpmis.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    render.add_parser(commands)
    compare.add_parser(commands)
    inspect.add_parser(commands)
    compile.add_parser(commands)
    return parser
