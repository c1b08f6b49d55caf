"""Objects in a notebook: HTML, once, without the text of a terminal."""

from page_cells import NOTEBOOK, code, execute

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
    cells = "".join(f"```{{code-cell}} ipython3\n{one}\n```\n\n" for one in sources)
    (tmp_path / "page.md").write_text(f"{NOTEBOOK}---\n\n# A page\n\n{cells}")
    for cell in code(execute(tmp_path / "page.md")[0])[1:]:
        (output,) = cell.outputs
        assert output.output_type == "execute_result"
        assert output.data["text/html"].lstrip().startswith("<")
