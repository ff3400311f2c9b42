"""The line above the views keeps its size, and hides no part of an advice."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from app.live.advice import Advice
from app.live.banner import Banner
from app.services.jobs import Jobs


def test_the_banner_has_the_same_size_with_and_without_text(qapp: object) -> None:
    jobs = Jobs("test")
    banner = Banner(jobs, idle="Quiet.")
    height = banner.height()
    banner.advise(Advice("Do this.\nAnd that.", "act", "Do it", role="warn"))
    assert banner.height() == height
    jobs.progressed.emit("Working", 0.5)
    assert banner.height() == height
    banner.deleteLater()


def test_a_long_advice_can_be_read_from_its_beginning_to_its_end(qapp: object) -> None:
    jobs = Jobs("test")
    banner = Banner(jobs, idle="Quiet.")
    banner.resize(400, banner.height())
    banner.show()
    text = " ".join(f"sentence {n}." for n in range(60))
    banner.advise(Advice(text))
    label = banner.findChild(QLabel, "inspect.advice")
    assert label is not None and "sentence 59." in label.toolTip()
    assert label.alignment() & Qt.AlignmentFlag.AlignTop, "its beginning can be read"
    banner.deleteLater()
