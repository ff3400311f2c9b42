"""The true values follow the list of known indenters."""

from __future__ import annotations

from dataclasses import replace

from pytestqt.qtbot import QtBot

from app.measure.judging import Stated
from app.measure.truth_form import TruthForm
from app.workspace.indenters import Indenter

BALL = Indenter("Ball 8 mm", "ball", 8.0)
ROD = Indenter("Rod", "cylinder", 5.0, height_mm=1.0)


def _choose(form: TruthForm, name: str) -> None:
    form.known.setCurrentIndex(form.known.findData(name))
    form.known.activated.emit(form.known.currentIndex())


def test_an_indenter_that_is_corrected_in_the_list_is_corrected_where_it_is_chosen(
    qtbot: QtBot,
) -> None:
    form = TruthForm()
    qtbot.addWidget(form)
    form.show_indenters((BALL, ROD))
    form.show_kind("cylinder", "diameter", "mm")
    _choose(form, "Rod")
    form.show_kind("ball", "diameter", "mm")
    _choose(form, "Ball 8 mm")
    with qtbot.waitSignal(form.changed):
        form.show_indenters((replace(BALL, size_mm=7.95), replace(ROD, height_mm=0.75)))
    assert form.stated == Stated(7.95, None, "Ball 8 mm")
    form.show_kind("cylinder", "diameter", "mm")
    assert form.stated == Stated(5.0, 0.75, "Rod")


def test_true_values_are_used_for_the_next_press_only_if_the_user_says_so(qtbot: QtBot) -> None:
    form = TruthForm()
    qtbot.addWidget(form)
    form.show_kind("cylinder", "diameter", "mm")
    form.state(Stated(5.0, 0.56))
    assert not form.again.isVisibleTo(form)
    with qtbot.waitSignal(form.changed):
        form.new_press()
    assert form.stated == Stated()
    form.show_kind("ball", "diameter", "mm")
    assert not form.again.isVisibleTo(form)  # the press before was a cylinder
    form.show_kind("cylinder", "diameter", "mm")
    form.again.click()
    assert form.stated == Stated(5.0, 0.56)
    assert not form.again.isVisibleTo(form)
