"""The true values follow the list of known objects."""

from dataclasses import replace

import pytest
from pytestqt.qtbot import QtBot

from app.measure.inspector import ReferenceForm
from app.measure.press_state import PressState
from app.widgets.forms import Form
from gelpolight_core.session.reference_object import ReferenceObject

BALL = ReferenceObject("ball", 8.0, name="Ball 8 mm")
ROD = ReferenceObject("cylinder", 5.0, height_mm=1.0, name="Rod")
LIVE = PressState(
    frozen=True,
    earlier=False,
    measurable=True,
    freezable=True,
    reconstructing=False,
    detecting=False,
)


def _form(qtbot: QtBot) -> tuple[ReferenceForm, list[ReferenceObject]]:
    changes: list[ReferenceObject] = []
    form = ReferenceForm(lambda: changes.append(form.stated), lambda: None)
    qtbot.addWidget(form)
    return form, changes


def _choose(form: ReferenceForm, text: str) -> None:
    form.known.setCurrentIndex(form.known.findText(text))
    form.known.activated.emit(form.known.currentIndex())


def _show(form: ReferenceForm, kind: str) -> None:
    form.show_state(replace(LIVE, kind=kind))


def test_an_object_that_is_corrected_in_the_list_is_corrected_where_it_is_chosen(qtbot):
    form, changes = _form(qtbot)
    form.show_objects((BALL, ROD))
    _show(form, "cylinder")
    _choose(form, "Rod")
    _show(form, "ball")
    _choose(form, "Ball 8 mm")
    form.show_objects((replace(BALL, size_mm=7.95), replace(ROD, height_mm=0.75)))
    assert changes[-1] == form.stated == ReferenceObject("ball", 7.95, name="Ball 8 mm")
    _show(form, "cylinder")
    assert form.stated == ReferenceObject(size_mm=5.0, height_mm=0.75, name="Rod")
    form.form.change(size_mm=5.1)
    assert form.stated == ReferenceObject(size_mm=5.1, height_mm=0.75)


@pytest.mark.function("Use the same true size for the next press")
def test_true_values_are_used_for_the_next_press_only_if_the_user_says_so(qtbot):
    form, changes = _form(qtbot)
    again = "Same as the press before"
    _show(form, "cylinder")
    form.state(ReferenceObject(size_mm=5.0, height_mm=0.56))
    assert form.known.findText(again) < 0
    form.new_press()
    assert changes[-1] == form.stated == ReferenceObject("cylinder")
    _show(form, "ball")
    assert form.known.findText(again) < 0  # the press before was a cylinder
    _show(form, "cylinder")
    _choose(form, again)
    assert form.stated == ReferenceObject(size_mm=5.0, height_mm=0.56)


@pytest.mark.parametrize("narrow", [False, True])
def test_a_hidden_length_hides_its_uncertainty(qtbot, narrow):
    form = Form(ReferenceObject("ball"), "reference", narrow=narrow)
    qtbot.addWidget(form)
    form.show()
    shown = {name for name, field in form.inputs.items() if field.isVisible()}
    assert {"height_mm", "height_expanded_mm", "size_expanded_mm"} <= shown
    assert not shown & {"second_mm", "edge_radius_mm", "edge_radius_expanded_mm"}


def test_the_true_values_of_a_known_press_are_filled_in(qtbot):
    form, changes = _form(qtbot)
    _show(form, "cylinder")
    form.new_press(ReferenceObject("cylinder", 4.0, height_mm=0.8))
    assert changes[-1] == form.stated == ReferenceObject("cylinder", 4.0, height_mm=0.8)
    _show(form, "ball")
    assert form.stated == ReferenceObject("ball")


def test_the_origin_of_a_reference_is_shown(qtbot):
    form, _ = _form(qtbot)
    _show(form, "cylinder")
    assert form.known.currentText() == "No known object"
    form.new_press(replace(ROD, shape="cylinder", name="Virtual bench"))
    assert form.known.currentText() == "Virtual bench" and form.stated.size_mm == 5.0
    form.form.change(size_mm=5.1)
    assert form.known.currentText() == "Own values" and form.stated.name == ""
    _choose(form, "Virtual bench")
    assert form.stated.size_mm == 5.0
    form.new_press()
    assert form.known.currentText() == "No known object"
