"""Write the pages with code as notebooks; a role becomes the key of its number."""

import re
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

HEAD = "---\nfile_format: mystnb\n"
CODE = re.compile(r"^```\{code-cell\}.*\n((?::.*\n)*)((?:.*\n)*?)```$", re.MULTILINE)
ROLE = re.compile(r"\{[a-z:]+\}(?=`)|^\([\w-]+\)=\n", re.MULTILINE)


def notebook(text):
    """Return a page as a notebook.

    >>> page = HEAD + "---\\n# A\\n\\nIs {fact}`x`.\\n\\n```{code-cell} x\\n:tags: [y]\\n1\\n```\\n"
    >>> [cell.source for cell in notebook(page).cells]
    ['# A\\n\\nIs `x`.', '1']
    """
    body = text.split("---\n", 2)[2]
    texts, codes = CODE.split(body)[::3], [found[2] for found in CODE.finditer(body)]
    cells = []
    for prose, code in zip(texts, (*codes, ""), strict=True):
        cells += [
            new_markdown_cell(ROLE.sub("", prose).strip()),
            new_code_cell(code.strip()),
        ]
    return new_notebook(cells=[cell for cell in cells if cell.source])


if __name__ == "__main__":
    for page in Path("book").rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        if text.startswith(HEAD):
            target = Path("notebooks", page.relative_to("book")).with_suffix(".ipynb")
            target.parent.mkdir(parents=True, exist_ok=True)
            nbformat.write(notebook(text), target)
