"""Which function makes which table, figure and quoted number of the papers."""

from reproduce.locate import search_path

__path__ += [str(folder / "papers") for folder in search_path()]
