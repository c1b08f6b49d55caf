"""Objects in a notebook: HTML, once, without the text of a terminal."""

import nbformat
from nbclient import NotebookClient

OBJECTS = (
    'rp.table("niu2024/table-2")',
    'rp.table("niu2024/table-2")["scale.red"]',
    'rp.table("niu2024/table-2").rerun({"niu2024/table-1#focal-length.red": "25.1 mm"})',
    'rp.table("chen2023/dichroic")',
    'rp.figure("niu2024/fig-1")',
    "rp.register([[0, 0], [100, 0], [0, 100]], [[1, 0], [101, 0], [1, 100]])",
)


def test_an_object_displays_itself_once(tmp_path):
    sources = ("import reproduce as rp", *OBJECTS)
    cells = [nbformat.v4.new_code_cell(source) for source in sources]
    notebook = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(notebook, resources={"metadata": {"path": tmp_path}}).execute()
    for cell in notebook.cells[1:]:
        (output,) = cell.outputs
        assert output.output_type == "execute_result"
        assert output.data["text/html"].lstrip().startswith("<")
