"""The card of a newcomer: each of its buttons begins something, and it can be closed for good."""

from PySide6.QtWidgets import QPushButton, QToolButton

from app.program.first_steps import STEPS, FirstSteps


def test_each_button_begins_something_and_a_closed_card_stays_closed(context, qtbot):
    card = FirstSteps(context=context)
    qtbot.addWidget(card)
    assert card.offer(True)
    begun: list[str] = []
    context.requests.begin.connect(begun.append)
    for button in card.findChildren(QPushButton):
        button.click()
    assert begun == list(STEPS)
    close = card.findChild(QToolButton, "first_steps.close")
    assert close is not None
    close.click()
    assert card.isHidden()
    other = FirstSteps(context=context)
    qtbot.addWidget(other)
    assert not other.offer(True)
