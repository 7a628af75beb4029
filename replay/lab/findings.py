"""Findings: the results of the lab's jobs, from their files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FINDINGS = "findings.json"


def findings(work: Path | None) -> list[dict[str, Any]]:
    """Every job of the lab that found something: its inputs by SHA-256, its verdict, its constants; oldest first."""
    found = []
    for path in sorted(work.glob(f"*/{FINDINGS}")) if work and work.is_dir() else []:
        try:
            said = json.loads(path.read_text(encoding="utf-8"))
            about = json.loads((path.parent / "inputs.json").read_text(encoding="utf-8"))
            found.append(
                {
                    "id": path.parent.name,
                    "title": str(about["title"]),
                    "inputs": dict(about["inputs"] or {}),
                    "verdict": str(said.get("verdict", "")),
                    "causes": [str(cause) for cause in said.get("causes", [])],
                    "said": said,
                }
            )
        except (OSError, ValueError, KeyError, TypeError):
            continue  # cut off while it was written
    return found
