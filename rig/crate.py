"""RO-Crate export: a run with everything that belongs to it, as a folder that research data repositories can read.

RO-Crate 1.1 (w3id.org/ro/crate/1.1): the files as they are, and ``ro-crate-metadata.json`` beside them, JSON-LD in the
vocabulary of schema.org. The specification is two pages of JSON, so it is written here rather than by a package.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.manifest import sha256_of
from straw.rig.notes import read_notes
from straw.rig.run import Run

CONTEXT = ["https://w3id.org/ro/crate/1.1/context", {"sha256": "https://schema.org/sha256"}]
FORMATS = {
    ".mcap": "application/x-mcap",
    ".toml": "application/toml",
    ".json": "application/json",
    ".jsonl": "application/jsonl",
    ".mp4": "video/mp4",
    ".sha256": "text/plain",
    ".html": "text/html",
}


def export(run: Run, files: Sequence[Path], output: Path, licence: str = "") -> list[Path]:
    """Copy a run and its ``files`` into a new folder ``output`` (or a .zip) that is an RO-Crate; returns its file
    names.

    Attachments of the recording, such as its protocol, are written as files too. RigError when the place is taken
    or a file cannot be copied; nothing half-written stays.
    """
    if output.exists():
        raise RigError(f"{output} exists and is not overwritten; choose another name or move it away")
    folder = output.with_name(output.name + ".part")
    try:
        folder.mkdir(parents=True)
        paths = list(dict.fromkeys([run.path, *files]))
        if len({path.name for path in paths}) < len(paths):
            raise RigError(f"{output}: two files of the run have the same name; rename one of them")
        copied = [Path(shutil.copy2(path, folder / path.name)) for path in paths]
        for name, data in run.attachments.items():
            target = folder / Path(name).name
            target.write_bytes(data)
            copied.append(target)
        (folder / "ro-crate-metadata.json").write_text(
            json.dumps(_graph(run, copied, licence), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        if output.suffix == ".zip":
            made = Path(shutil.make_archive(str(folder), "zip", folder))
            shutil.rmtree(folder)
            made.rename(output)
        else:
            folder.rename(output)
    except (OSError, RigError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, RigError):
            raise
        raise RigError(f"{output} cannot be written: {error.strerror or error}; check space and rights") from None
    return [Path(path.name) for path in copied]


def _graph(run: Run, files: Sequence[Path], licence: str) -> dict[str, Any]:
    said = run.metadata
    start = datetime.fromtimestamp(run.zero_time_ns * 1e-9, UTC).isoformat(timespec="milliseconds")
    notes = read_notes(run.path)
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": f"{run.run_id}: {said.get('protocol', 'run')} on specimen {run.specimen or 'unnamed'}",
        "description": "; ".join(text for _, text in notes.notes) or f"A run recorded by straw, sha256 {run.sha256}",
        "datePublished": datetime.now(UTC).date().isoformat(),
        "keywords": ["inflatable multistable structure", *notes.tags],
        "license": licence or "not stated",
        "hasPart": [{"@id": path.name} for path in files],
        "mentions": {"@id": "#run"},
    }
    software = {
        "@id": "#straw",
        "@type": "SoftwareApplication",
        "name": "straw",
        "softwareVersion": " ".join(filter(None, [run.software.get("straw"), run.software.get("git_commit")])) or "?",
        "softwareRequirements": [f"{name} {version}" for name, version in sorted(run.software.items())],
    }
    instrument = {"@id": "#controller", "@type": "Thing", "name": said.get("controller", "pressure controller")}
    action = {
        "@id": "#run",
        "@type": "CreateAction",
        "name": f"recording of {run.run_id}",
        "startTime": start,
        "actionStatus": f"{said.get('exit_status', 'unknown')}: {said.get('exit_reason', '')}",
        "instrument": [{"@id": "#straw"}, {"@id": "#controller"}],
        "result": [{"@id": run.path.name}],
        "additionalProperty": [{"@id": f"#setting-{name}"} for name in sorted(said)],
    }
    descriptor = {
        "@id": "ro-crate-metadata.json",
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    parts = [
        {
            "@id": path.name,
            "@type": "File",
            "name": path.name,
            "contentSize": str(path.stat().st_size),
            "encodingFormat": FORMATS.get(path.suffix.lower(), "application/octet-stream"),
            "sha256": sha256_of(path),
        }
        for path in files
    ]
    settings = [
        {"@id": f"#setting-{name}", "@type": "PropertyValue", "name": name, "value": value}
        for name, value in sorted(said.items())
    ]
    return {"@context": CONTEXT, "@graph": [descriptor, root, action, software, instrument, *parts, *settings]}
