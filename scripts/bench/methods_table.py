"""The table of docs/tables.md from what methods.py measured:

    python scripts/bench/methods_table.py METHODS.json [METHODS.json ...]

A row a method, a column a scene: variance, time, efficiency and its standard error.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any


def cell(row: dict[str, Any]) -> str:
    return f"{row['variance']:.2f}, {row['time']:.2f}, **{row['efficiency']:.2f}** ± {row['error']:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", nargs="+", type=Path)
    arguments = parser.parse_args()
    scenes: dict[str, dict[str, dict[str, Any]]] = {}
    for report in arguments.reports:
        for scene, rows in json.loads(report.read_text(encoding="utf-8")).items():
            scenes[scene] = {row["method"]: row for row in rows}
    print("| method |", " | ".join(scenes), "|")
    print("|---|" + "---|" * len(scenes))
    for method in next(iter(scenes.values())):
        print(f"| {method} |", " | ".join(cell(rows[method]) for rows in scenes.values()), "|")


if __name__ == "__main__":
    main()
