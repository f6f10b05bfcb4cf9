"""The command line: reads arguments, calls the library, reports. Results go to stdout, the rest to stderr.

Exit status: 0 success, 1 a failed check, 2 bad input (nothing written), 3 the solver gave up (partial store kept),
130 interrupted (store ready to resume). Libraries that load slowly are imported by the commands that need them.
"""

import os
import sys
from collections.abc import Sequence

from cyclopts import CycloptsError

from shapespace.base.errors import InputError

# Commands register themselves, and are listed in help in this order.
from shapespace.cli import runs as runs  # isort: skip
from shapespace.cli import states as states  # isort: skip
from shapespace.cli import branches as branches  # isort: skip
from shapespace.cli import curves as curves  # isort: skip
from shapespace.cli import searches as searches  # isort: skip
from shapespace.cli import diagrams as diagrams  # isort: skip
from shapespace.cli import pictures as pictures  # isort: skip
from shapespace.cli import explorer as explorer  # isort: skip
from shapespace.cli import checking as checking  # isort: skip
from shapespace.cli import verifying as verifying  # isort: skip
from shapespace.cli import reproducing as reproducing  # isort: skip
from shapespace.cli.guide import page_for
from shapespace.cli.shared import BAD_INPUT, INTERRUPTED, app, tell


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        tokens = _spread(_imported(given))
        status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except InputError as error:
        tell(f"{error} (More: {page_for(given, error)})")
        return BAD_INPUT
    except CycloptsError as error:
        tell(f"{' '.join(str(error).split())} See `shapespace --help`, and {page_for(given)}.")
        return BAD_INPUT
    except KeyboardInterrupt:
        tell("interrupted.")
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of stdout has left (`| head`): not an error, but Python must not try to flush again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return status if isinstance(status, int) else 0


def _imported(tokens: Sequence[str]) -> list[str]:
    """The tokens without `--import FILE`, whose files were run: every command knows their models."""
    left = list(tokens)
    while any(token == "--import" or token.startswith("--import=") for token in left):
        from shapespace.study.plugins import import_file

        place = next(i for i, token in enumerate(left) if token == "--import" or token.startswith("--import="))
        _, equals, file = left.pop(place).partition("=")
        if not equals and place < len(left):
            file = left.pop(place)
        if not file:
            raise InputError("--import: needs a Python file that defines models.")
        import_file(file)
    return left


def _spread(tokens: Sequence[str]) -> list[str]:
    """`-s a=1 b=2` as `-s a=1 -s b=2`."""
    result: list[str] = []
    in_settings = False
    for token in tokens:
        if in_settings and "=" in token and not token.startswith("-") and result[-1] not in ("-s", "--set"):
            result.append("-s")
        in_settings = token in ("-s", "--set") or (in_settings and "=" in token and not token.startswith("-"))
        result.append(token)
    return result
