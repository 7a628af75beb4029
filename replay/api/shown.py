"""Results that a notebook displays as heading, table and picture, with the columns as a pandas DataFrame."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.errors import ReplayError

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

Rows = Mapping[str, NDArray[Any]]


class Shown:
    """Base of results that a notebook displays. A subclass defines its columns and, optionally, a sentence and a
    figure."""

    def _columns(self) -> Rows:
        """Columns (n,) by their names, each with its unit (``x_m``)."""
        raise NotImplementedError

    def _says(self) -> str:
        """One sentence above the picture."""
        return ""

    def _figure(self) -> Figure | None:
        """A picture, if there is one."""
        return None

    def _tables(self) -> Sequence[tuple[str, Rows]]:
        """Tables below the picture, each with its heading; the first is what `to_dataframe` gives."""
        return [("", self._columns())]

    def to_dataframe(self) -> pandas.DataFrame:
        """The columns as a pandas DataFrame; ReplayError where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise ReplayError("to_dataframe needs pandas, which is not installed: pip install pandas") from None
        return pandas.DataFrame(dict(self._columns()))

    def plot(self) -> Figure:
        """The picture as a matplotlib Figure; ``figure.savefig("it.png")`` keeps it."""
        found = self._figure()
        if found is None:
            raise ReplayError(f"{type(self).__name__} has nothing to draw")
        return found

    def __repr__(self) -> str:
        says = self._says()
        return f"<{type(self).__name__}{': ' if says else ''}{says}>"

    def _repr_html_(self) -> str:
        """HTML for Jupyter and similar notebooks."""
        parts = [f"<p><b>{type(self).__name__}</b> {escape(self._says())}</p>"]
        if (figure := self._figure()) is not None:
            kept = io.StringIO()
            figure.savefig(kept, format="svg")
            parts.append(kept.getvalue()[kept.getvalue().index("<svg") :])
        for heading, columns in self._tables():
            parts.append((f"<p>{escape(heading)}</p>" if heading else "") + table(columns))
        return f"<div>{''.join(parts)}</div>"


def table(columns: Rows, most: int = 6) -> str:
    """Columns as an HTML table of at most so many rows: the first and the last."""
    n = len(next(iter(columns.values()), ()))
    rows = list(range(n)) if n <= most else [*range(most // 2), -1, *range(n - most // 2, n)]
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(
        f"<tr>{'<td>…</td>' * len(columns)}</tr>"
        if i < 0
        else f"<tr>{''.join(f'<td>{escape(cell(column[i]))}</td>' for column in columns.values())}</tr>"
        for i in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def cell(value: Any) -> str:
    """A number or a word as text of a table."""
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def motion_figure(rows: Rows) -> Figure:
    """Tip and pressure over time, whichever of the columns are there: mm, degrees, kPa."""
    from matplotlib.figure import Figure  # slow to import

    panels = [
        (title, [(name, factor) for name, factor in names if name in rows])
        for title, names in (
            ("tip / mm", (("x_m", 1e3), ("z_m", 1e3))),
            ("phi / deg", (("phi_rad", 180 / np.pi),)),
            ("gauge pressure / kPa", (("command_pa", 1e-3), ("pressure_pa", 1e-3), ("external_pa", 1e-3))),
        )
    ]
    panels = [(title, names) for title, names in panels if names]
    figure = Figure(figsize=(7.0, 1.6 * len(panels) + 0.6), layout="constrained")
    every = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, names) in zip(every, panels, strict=True):
        for name, factor in names:
            axes.plot(rows["time_s"], rows[name] * factor, lw=1.2, label=name.rsplit("_", 1)[0])
        axes.set_ylabel(title)
        axes.grid(alpha=0.25)
        if len(names) > 1:
            axes.legend(loc="best", frameon=False)
    every[-1].set_xlabel("time / s")
    return figure


def remade(kind: Any, base: object, **more: Any) -> Any:
    """An object of a class that adds to another dataclass, with the fields of one of those."""
    known = {name: getattr(base, name) for name in type(base).__dataclass_fields__}  # type: ignore[attr-defined]
    return kind(**(known | more))
