"""One function says which of several findings is the worst."""

from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    doubtful_finding,
    join_reasons,
    worst_of,
)


def test_the_worst_finding_is_the_first_one_with_the_worst_verdict():
    fine, doubtful = Finding("a", "fine"), doubtful_finding("b", "cut by the border")
    failed = Finding("c", "no light", verdict=Verdict.FAIL)
    assert worst_of((fine, doubtful, failed, doubtful_finding("d", "dark"))) is failed
    assert worst_of((fine, doubtful, doubtful_finding("d", "dark"))) is doubtful
    assert worst_of(()) is None
    assert QualityTable((fine, doubtful)).verdict is Verdict.WARN
    assert join_reasons((doubtful, failed)) == "cut by the border; no light"


def test_a_sentence_begins_with_a_capital_and_a_file_name_stays():
    lines = {"a.png: it is dim": "a.png: it is dim.", "my a.png: dim": "my a.png: dim."}
    lines |= {"it is dim": "It is dim.", "edge: 2.5 mm": "Edge: 2.5 mm."}
    lines |= {"session.toml is empty": "session.toml is empty."}
    assert {text: Finding("k", text).line for text in lines} == lines


def test_the_same_note_without_a_number_is_one_note():
    first, second = Finding("k", "a note"), Finding("k", "a note")
    assert first == second
    assert len({first, second, Finding("k", "another note")}) == 2
    assert Finding("k", "a note", 1.0) != first
