"""Alone: one lab per folder; a second one finds the first."""

from __future__ import annotations

import http.client
import json
from pathlib import Path
from urllib.parse import urlsplit

STATE = ".straw-lab"
LAB_FILE = "lab.json"
ANSWER_S = 2.0


def check_alone(folder: Path) -> str | None:
    """The address of the lab that serves this folder already; None when there is none."""
    try:
        said = json.loads((folder / STATE / LAB_FILE).read_text(encoding="utf-8"))
        url = str(said["url"])
        where = urlsplit(url)
        asking = http.client.HTTPConnection(where.hostname or "", where.port, timeout=ANSWER_S)
        try:
            asking.request("GET", f"/?{where.query}")
            return url if asking.getresponse().status == 303 else None  # its token grants access
        finally:
            asking.close()
    except (OSError, ValueError, KeyError, TypeError, http.client.HTTPException):
        return None
