"""What a user can do: the sentences of the marker `function`, each beside the test that holds it.

`python tests/test_functions.py` lists them by folder.
"""

import ast
from collections import Counter
from itertools import groupby
from pathlib import Path

TESTS = Path(__file__).parent


def functions() -> list[tuple[str, str]]:
    """Return the folder of each sentence, and the sentence."""
    return [
        (str(path.parent.relative_to(TESTS)), ast.literal_eval(sentence))
        for path in sorted(TESTS.rglob("*.py"))
        for test in ast.parse(path.read_text("utf-8")).body
        if isinstance(test, ast.FunctionDef) and test.name.startswith("test_")
        for marker in test.decorator_list
        if isinstance(marker, ast.Call) and ast.unparse(marker.func) == "pytest.mark.function"
        for sentence in marker.args
    ]


def test_each_function_is_listed_once():
    count = Counter(sentence for _, sentence in functions())
    assert count and set(count.values()) == {1}, count.most_common(3)


if __name__ == "__main__":
    for folder, listed in groupby(functions(), key=lambda function: function[0]):
        print(f"\n## {folder}\n", *(f"- {sentence}" for _, sentence in listed), sep="\n")
