"""The times of pages: every notebook, each run whole."""

from page_times import BOOK, NAME, study
from reproduce.store import studies
from run_notebooks import pages_of, read

PAGE = """---
file_format: mystnb
kernelspec:
  name: python3
---

```{code-cell} ipython3
import time
time.sleep(0.5)
```
"""


def test_a_page_is_run_whole_and_text_is_none(tmp_path):
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "one.md").write_text(PAGE)
    (tmp_path / "text.md").write_text("# Words alone")
    ((page, seconds),) = study(tmp_path).to_numpy().tolist()
    assert page == "part/one"
    assert seconds >= 0.5


def test_every_page_of_the_book_has_its_time():
    stored = studies.table(NAME)
    pages = [page for page in pages_of(BOOK) if read(page)]
    assert list(stored["page"]) == [
        p.relative_to(BOOK).with_suffix("").as_posix() for p in pages
    ]
    assert (stored["seconds"] > 0).all()
