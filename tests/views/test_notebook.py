"""What a notebook's kernel shows of an object: its HTML, once, and no terminal beside it."""

import nbformat
import pytest
from nbclient import NotebookClient

OBJECTS = (
    'rp.table("niu2024/table-2")',
    'rp.table("niu2024/table-2")["scale.red"]',
    'rp.table("niu2024/table-2").rerun({"niu2024/table-1#focal-length.red": "25.1 mm"})',
    'rp.table("chen2023/dichroic")',
    'rp.figure("niu2024/fig-1")',
    "rp.register([[0, 0], [100, 0], [0, 100]], [[1, 0], [101, 0], [1, 100]])",
)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    cells = [
        nbformat.v4.new_code_cell(source)
        for source in ("import reproduce as rp", *OBJECTS)
    ]
    notebook = nbformat.v4.new_notebook(cells=cells)
    folder = tmp_path_factory.mktemp("notebook")
    NotebookClient(notebook, resources={"metadata": {"path": folder}}).execute()
    return dict(
        zip(OBJECTS, (cell.outputs for cell in notebook.cells[1:]), strict=True)
    )


@pytest.mark.parametrize("source", OBJECTS)
def test_an_object_shows_itself_once(outputs, source):
    (output,) = outputs[source]
    assert output.output_type == "execute_result"
    assert output.data["text/html"].lstrip().startswith("<")
