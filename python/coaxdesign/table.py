"""Columns with units, and figures."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._support import need, write_whole

Values = NDArray[Any]


class Svg:
    """A figure as SVG, shown by notebooks as it is. The text is ``svg``."""

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"<Svg, {len(self.svg)} characters>"

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Writes the figure to a file, and gives its path."""
        path = Path(path)
        write_whole(path, self.svg.encode(), force)
        return path


class Table:
    """Columns of equal length, each with a unit: SI and radians.

    ``table["airspeed"]`` is a NumPy array of one dimension, ``table.units``
    tells its unit (``"1"`` for none, ``""`` for words and flags),
    ``table.metadata`` where the table comes from. ``len(table)`` is the number
    of rows, iteration goes over the names.
    """

    def __init__(
        self,
        columns: Mapping[str, tuple[str, Values | Sequence[str]]],
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._values = {name: np.asarray(values) for name, (_, values) in columns.items()}
        self.units: dict[str, str] = {name: unit for name, (unit, _) in columns.items()}
        self.metadata: dict[str, str] = dict(metadata or {})

    @property
    def columns(self) -> list[str]:
        """Names of the columns, in order."""
        return list(self._values)

    def keys(self) -> list[str]:
        """Names of the columns, so that ``dict(table)`` works."""
        return self.columns

    def __getitem__(self, name: str) -> Values:
        try:
            return self._values[name]
        except KeyError:
            raise KeyError(f"{name!r}; there are {', '.join(self._values)}") from None

    def get(self, name: str) -> Values:
        """The column itself, for languages without ``table[name]``."""
        return self[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(next(iter(self._values.values()), ()))

    def __repr__(self) -> str:
        names = ", ".join(self.columns[:6]) + (", ..." if len(self.columns) > 6 else "")
        return f"<{type(self).__name__}: {len(self)} rows of {len(self.columns)} columns: {names}>"

    def _repr_html_(self) -> str:
        shown = self.columns[:14]
        head = "".join(
            f"<th>{html.escape(name)}<br><small>{html.escape(self.units[name])}</small></th>"
            for name in shown
        )
        rows = []
        for k in range(min(len(self), 40)):
            cells = (_cell(self._values[name][k]) for name in shown)
            rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
        left = len(self) - len(rows), len(self.columns) - len(shown)
        note = f"<p>and {left[0]} more rows, {left[1]} more columns</p>" if any(left) else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>{note}"

    def to_arrow(self) -> Any:
        """A ``pyarrow.Table``; a field's metadata has its ``unit``, the schema's the provenance."""
        arrow = need("pyarrow", "frames", "an Arrow table")
        fields, arrays = [], []
        for name, values in self._values.items():
            array = arrow.array(values.tolist() if values.dtype.kind == "U" else values)
            fields.append(arrow.field(name, array.type, metadata={"unit": self.units[name]}))
            arrays.append(array)
        return arrow.Table.from_arrays(
            arrays, schema=arrow.schema(fields, metadata=self.metadata or None)
        )

    def to_polars(self, *, units_in_names: bool = False) -> Any:
        """A ``polars.DataFrame``. Polars keeps no units; ``units_in_names`` puts them there."""
        polars = need("polars", "frames", "a Polars frame")
        return polars.DataFrame(
            {
                self._name(name, units_in_names): values.tolist()
                if values.dtype.kind == "U"
                else values
                for name, values in self._values.items()
            }
        )

    def to_pandas(self, *, units_in_names: bool = False) -> Any:
        """A ``pandas.DataFrame`` with the units in ``attrs["units"]``."""
        pandas = need("pandas", "frames", "a pandas frame")
        frame = pandas.DataFrame(
            {self._name(name, units_in_names): values for name, values in self._values.items()}
        )
        frame.attrs["units"] = dict(self.units)
        frame.attrs["metadata"] = dict(self.metadata)
        return frame

    def to_xarray(self, dimension: str) -> Any:
        """An ``xarray.Dataset`` over one column, with the units in ``attrs["units"]``."""
        xarray = need("xarray", "frames", "a dataset")
        variables = {
            name: (dimension, values, {"units": self.units[name]})
            for name, values in self._values.items()
            if name != dimension
        }
        coordinates = {
            dimension: (dimension, self[dimension], {"units": self.units[dimension]})
        }
        return xarray.Dataset(variables, coordinates, attrs=dict(self.metadata))

    def write_parquet(self, path: str | Path, *, force: bool = False) -> Path:
        """Writes the table as Parquet (zstd), units and provenance with it."""
        arrow = need("pyarrow", "frames", "Parquet")
        parquet = need("pyarrow.parquet", "frames", "Parquet")
        sink = arrow.BufferOutputStream()
        parquet.write_table(self.to_arrow(), sink, compression="zstd")
        path = Path(path)
        write_whole(path, sink.getvalue().to_pybytes(), force)
        return path

    def _name(self, name: str, with_unit: bool) -> str:
        unit = self.units[name]
        return f"{name} [{unit}]" if with_unit and unit not in ("", "1") else name


def _cell(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return f"{value:.5g}"
    return html.escape(str(value))


def plain(value: object) -> str:
    """A value as compact JSON, for metadata."""
    return json.dumps(value, separators=(",", ":"), sort_keys=True)
