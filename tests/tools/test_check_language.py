"""The check of words: places, kinds of text, and the subjects of commits."""

from pathlib import Path

import check_language

MODULE = '''"""Explain what it reads."""
# beside
def shown(x):
    """Return a value.

    Parameters
    ----------
    x : float
    """
    def _inner():
        """They are told."""
    raise ValueError("x: expected the print of a table")
'''
SUBJECTS = {
    "Reject pivots far from the stars": 0,
    "Pass the seed to the process": 0,
    "Rejects pivots": 1,
    "Rejected pivots": 1,
    "The pivot is rejected": 1,
    "reject pivots": 1,
    "Reject pivots.": 1,
    "Reject " + 66 * "x": 1,
}


def test_texts_of_the_package_must_have_no_finding(tmp_path, capsys):
    package, other = tmp_path / "src/module.py", tmp_path / "tests/module.py"
    for path in (package, other):
        path.parent.mkdir()
        path.write_text(MODULE)
    found = [
        f for t in check_language.texts([package]) for f in check_language.findings(t)
    ]
    lines = {(f.kind, int(f.place.rpartition(":")[2])) for f in found}
    assert lines == {("comment", 2), *(("string", line) for line in (1, 8, 11, 12))}
    page = tmp_path / "page.md"
    page.write_text("---\nx: beside\n---\nA page.\n```python\nbeside\n```\n`beside`\n")
    assert check_language.main([page]) == 0
    page.write_text("A page.\nbeside\n")
    for path in (page, package):
        assert check_language.main([path]) == 1
    assert f"{page}:2: beside ->" in capsys.readouterr().out


def test_subjects_of_commits(tmp_path):
    message = tmp_path / "message"
    for subject, code in SUBJECTS.items():
        message.write_text(f"{subject}\n\nbeside\n")
        assert check_language.check_commit(Path(message)) == code, subject
