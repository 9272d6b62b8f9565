"""IES profiles: luminous intensity over directions, from files of the LM-63 format, photometric type C.

Reference: ANSI/IES LM-63-19, "IES Standard File Format for the Electronic Transfer of Photometric Data".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpmis.scene.light_control import IesProfile

# Lamps, lumens, multiplier, counts of vertical and of horizontal angles, photometric type, unit, width, length, height,
# ballast factor, ballast-lamp factor, watts: what stands before the angles.
HEADER_NUMBERS = 13
TYPE_C = 1
MAX_ANGLES = 4096
# Of what is larger float32 cannot hold the products.
MAX_NUMBER = 1e18


class IesError(ValueError):
    """A file that is no LM-63 profile of type C; the message says why."""


def read_ies(text: str) -> IesProfile:
    """The profile of a file's text, its horizontal angles completed to a full turn by the file's symmetry.

    Raises:
        IesError: the text is damaged, or of another photometric type.
    """
    numbers = _numbers_after_tilt(text)
    if len(numbers) < HEADER_NUMBERS:
        raise IesError("it ends within its header")
    vertical_count, horizontal_count, photometric_type = (int(numbers[i]) for i in (3, 4, 5))
    if photometric_type != TYPE_C:
        raise IesError(f"photometric type {'?CBA'[photometric_type] if 1 <= photometric_type <= 3 else '?'} is not C")
    if not (2 <= vertical_count <= MAX_ANGLES and 1 <= horizontal_count <= MAX_ANGLES):
        raise IesError(f"{vertical_count} vertical and {horizontal_count} horizontal angles make no profile")
    body = numbers[HEADER_NUMBERS:]
    if len(body) < vertical_count + horizontal_count + vertical_count * horizontal_count:
        raise IesError("it ends within its intensities")
    vertical, horizontal, candela = np.split(body, [vertical_count, vertical_count + horizontal_count])
    candela = candela[: vertical_count * horizontal_count].reshape(horizontal_count, vertical_count)
    candela = candela * numbers[2] * numbers[10] * numbers[11]
    if not (np.diff(vertical) > 0.0).all() or not (np.diff(horizontal) > 0.0).all():
        raise IesError("its angles do not grow")
    if vertical[0] < 0.0 or vertical[-1] > 180.0:
        raise IesError("its vertical angles leave 0 to 180 degrees")
    if not (candela >= 0.0).all():
        raise IesError("its intensities are negative")
    if candela.max() > MAX_NUMBER:
        raise IesError(f"its intensities times its factors are above {MAX_NUMBER:g}")
    turned, around = _full_turn(horizontal, candela)
    return IesProfile(np.radians(vertical), np.radians(turned), around)


def _numbers_after_tilt(text: str) -> NDArray[np.float64]:
    """All numbers after the TILT line; those of TILT=INCLUDE are left out, as lamps are rendered upright."""
    lines = text.splitlines()
    tilt = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if tilt is None:
        raise IesError("it has no line TILT=")
    try:
        numbers = np.array(" ".join(lines[tilt + 1 :]).replace(",", " ").split(), np.float64)
    except ValueError:
        raise IesError("not all that follows TILT= is a number") from None
    if not np.isfinite(numbers).all() or (np.abs(numbers) > MAX_NUMBER).any():
        raise IesError("it holds a number that is not finite")
    if lines[tilt].strip().upper() == "TILT=INCLUDE" and len(numbers) >= 2:
        numbers = numbers[2 + 2 * max(int(numbers[1]), 0) :]
    return numbers


def _full_turn(
    horizontal: NDArray[np.float64], candela: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Horizontal angles that hold a full turn, and the rows for them: mirrored where the file has a part alone."""
    span = (horizontal[0], horizontal[-1])
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), np.repeat(candela, 2, axis=0)
    if span not in ((0.0, 90.0), (0.0, 180.0), (90.0, 270.0), (0.0, 360.0)):
        raise IesError(f"its horizontal angles run from {span[0]:g} to {span[1]:g} degrees")
    if span in ((0.0, 90.0), (90.0, 270.0)):
        horizontal, candela = np.concatenate([horizontal, 180.0 - horizontal]), np.concatenate([candela, candela])
    if span in ((0.0, 90.0), (0.0, 180.0)):
        horizontal, candela = np.concatenate([horizontal, -horizontal]), np.concatenate([candela, candela])
    turn, first = np.unique(horizontal % 360.0, return_index=True)
    around = candela[first]
    # One angle more on either side: what lies between the last and the first is interpolated, too.
    return np.concatenate([[turn[-1] - 360.0], turn, [turn[0] + 360.0]]), around[[-1, *range(len(turn)), 0]]
