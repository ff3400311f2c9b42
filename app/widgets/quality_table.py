"""A table of quality figures: verdict, name, value, limit, and advice on the poor ones."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QSizePolicy

from gelpolight_core.base.finding import Finding, QualityTable, Verdict

from .label import MarkupLabel, escaped
from .widget_names import set_names


class QualityTableWidget(MarkupLabel):
    """Shows a QualityTable. Its text can be selected and copied.

    Parameters
    ----------
    name : str
        Object name, a dotted path.
    accessible : str
        Text for screen readers, such as "Quality of the lens".
    narrow : bool, optional
        For a side panel: verdicts as signs without words.

    Attributes
    ----------
    table : QualityTable
        The shown table.
    """

    def __init__(self, name: str, accessible: str, *, narrow: bool = False) -> None:
        super().__init__(wrap=True)
        set_names(self, name, accessible)
        self._narrow = narrow
        self.table = QualityTable()
        selectable = Qt.TextInteractionFlag
        self.setTextInteractionFlags(
            selectable.TextSelectableByMouse | selectable.TextSelectableByKeyboard
        )
        self.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)

    def set_table(self, table: QualityTable) -> None:
        """Show a table."""
        if table != self.table:
            self.table = table
            self.setText(self.markup(table, narrow=self._narrow))

    @staticmethod
    def markup(table: QualityTable, *, narrow: bool = False) -> str:
        """Return a table as markup for a :class:`MarkupLabel`."""
        rows = "".join(_row(figure, narrow=narrow) for figure in table.figures)
        return f"<table width='100%' cellspacing='4'>{rows}</table>" if rows else ""

    def minimumSizeHint(self) -> QSize:
        """Return a width at which the labels are readable."""
        width = 260 if self._narrow else 360
        return QSize(width, self.heightForWidth(width))


def _row(figure: Finding, *, narrow: bool) -> str:
    verdict, cell = figure.verdict, "<td width='1%' align='right' style='white-space: nowrap"
    colour = f"white-space: nowrap; color: @{verdict.value}"
    sign = verdict.sign if narrow else f"{verdict.sign} {verdict.word}"
    if verdict is Verdict.PASS and not figure.limit_text:
        sign = ""  # not judged
    limit = escaped(f"limit {figure.limit_text}" if figure.limit_text else "")
    limit = f"<span style='color: @muted'>{limit}</span>"
    between = "<br>" if narrow else f"</td>{cell}'>"  # a side panel has no room for another column
    row = (
        f"<tr><td width='1%' style='{colour}'><b>{sign}</b></td>"
        f"<td width='97%'>{escaped(figure.text)}</td>"
        f"{cell}'>{escaped(figure.value_text)}{between}{limit}</td></tr>"
    )
    advice = _advice(figure)
    return row + (f"<tr><td></td><td colspan='3'>{escaped(advice)}</td></tr>" if advice else "")


def _advice(figure: Finding) -> str:
    poor = figure.verdict is not Verdict.PASS and bool(figure.remedy)
    return f"{figure.remedy}." if poor else ""
