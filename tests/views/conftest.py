"""The papers, one by one."""

import pytest

from reproduce.printed.cells import PAPERS


@pytest.fixture(params=PAPERS)
def paper(request):
    return request.param
