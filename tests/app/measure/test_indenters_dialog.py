"""The list of known objects."""

from dataclasses import replace

from PySide6.QtWidgets import QDialog

from app.measure.page import IndentersDialog
from gelpolight_core.session.reference_object import ReferenceObject

BALL = ReferenceObject("ball", 8.0, name="Ball 8 mm")
ROD = ReferenceObject("cylinder", 5.0, height_mm=1.0, name="Rod")


def test_objects_are_added_corrected_and_removed_and_an_invalid_list_is_not_accepted(qtbot):
    dialog = IndentersDialog((BALL, ROD))
    qtbot.addWidget(dialog)
    dialog.remove()
    dialog.form.change(size_mm=5.02, size_expanded_mm=0.002, certificate="K-1", due="next May")
    dialog.accept()
    assert "next May" in dialog.problem.text() and dialog.result() != QDialog.DialogCode.Accepted
    dialog.form.change(due="2027-03-31")
    dialog.add()
    dialog.form.change(name="", shape="cuboid", second_mm=4.0)
    dialog.accept()
    assert dialog.problem.text() and dialog.result() != QDialog.DialogCode.Accepted
    dialog.form.change(name="Block")
    dialog.accept()
    assert dialog.result() == QDialog.DialogCode.Accepted
    assert dialog.indenters == (
        replace(ROD, size_mm=5.02, size_expanded_mm=0.002, certificate="K-1", due="2027-03-31"),
        ReferenceObject("cuboid", 5.0, second_mm=4.0, name="Block"),
    )
