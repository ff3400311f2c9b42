"""The statistics next to the table of records."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.measure.record_book import RecordBook
from app.measure.results_view import ResultsView
from gelpolight_core.records.entry import MeasurementRecord, Quantity


def test_a_true_angle_is_shown_in_degrees(context: AppContext, qtbot: QtBot) -> None:
    book = RecordBook(context=context, parent=context.toasts)
    view = ResultsView(book, context=context)
    qtbot.addWidget(view)
    quantities = (Quantity("angle_deg", 31.0, truth=30.0),)
    book.add(MeasurementRecord("A", "A-1", "angle", quantities), lambda _number: None)
    qtbot.waitUntil(lambda: len(book.records) == 1 and not book.busy, timeout=60_000)
    assert "true 30°" in view.statistics.text()
    book.close()
