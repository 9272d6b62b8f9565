"""The table of docs/weights.md from what counts.py measured:

    python scripts/bench/counts_table.py COUNTS.json [COUNTS.json ...]

A row a scene, a column a method: variance, time, and the efficiency over `nee` with its standard error.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any


def cell(row: dict[str, Any]) -> str:
    (efficiency, error), _ = row["over"]
    return f"{row['variance']:.2f}, {row['time']:.2f}, **{efficiency:.2f}** ± {error:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", nargs="+", type=Path)
    arguments = parser.parse_args()
    for report in arguments.reports:
        scenes = json.loads(report.read_text(encoding="utf-8"))
        methods = [method for method in next(iter(scenes.values())) if method != "nee"]
        print(f"\n| scene | {' | '.join(methods)} |\n|---|{'---|' * len(methods)}")
        for scene, rows in scenes.items():
            print(f"| {scene} |", " | ".join(cell(rows[method]) for method in methods), "|")


if __name__ == "__main__":
    main()
