"""Results as columns of numpy arrays."""
from __future__ import annotations

import html
from typing import Any

from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Names, module_of

_MOST_ROWS = 10


@checked
class Table(Names):
    """Columns by name, each a numpy array of one entry a row."""

    def __init__(self, columns: Any = (), /, **more: Any) -> None:
        try:
            super().__init__(columns, **more)
        except (TypeError, ValueError):
            raise ArgumentError(f"Table: columns: found {found_in_words(columns)}, expected a dict of names and arrays", "columns") from None

    def __len__(self) -> int:
        """Number of columns, as of any dict; `rows` is that of rows."""
        return super().__len__()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.values()), ()))

    def to_pandas(self) -> Any:
        """The same as a pandas.DataFrame; needs pandas."""
        pandas = module_of("pandas", "Table.to_pandas")
        return pandas.DataFrame(dict(self))

    def to_arrow(self) -> Any:
        """The same as a pyarrow.Table; needs pyarrow."""
        pyarrow = module_of("pyarrow", "Table.to_arrow")
        return pyarrow.table({name: column.tolist() if column.dtype == object else column for name, column in self.items()})

    def __repr__(self) -> str:
        return f"<table of {self.rows} rows: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        def cells(tag, texts):
            return "<tr>" + "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in texts) + "</tr>"

        shown = min(self.rows, _MOST_ROWS)
        body = [cells("td", [_text(column[i]) for column in self.values()]) for i in range(shown)]
        more = f"<p>{self.rows} rows</p>" if shown < self.rows else ""
        return f"<table>{cells('th', self)}{''.join(body)}</table>{more}"


def _text(value):
    return f"{value:.6g}" if isinstance(value, float) else str(value)
