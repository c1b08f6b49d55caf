"""Notebook kernels that start in a tenth of a second: forks of one process that has imported all.

A kernel of its own for every page is what makes a page true: nothing of another page is in it. Most
of its start is importing NumPy, pandas and Matplotlib, which is done once here, in a server that
runs no cell; every kernel is a fresh fork of it. `run` does the same for any other function.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint
from multiprocessing import get_all_start_methods, get_context
from multiprocessing.process import BaseProcess
from typing import Any

from jupyter_client.provisioning.factory import KernelProvisionerFactory
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

NAME = "warm"
# What nearly every page imports sooner or later, and what the build itself does.
IMPORTED = (
    *(
        "ipykernel.kernelapp",
        "ipykernel.ipkernel",
        "ipykernel.zmqshell",
        "IPython.core.completer",
    ),
    *(
        "matplotlib.backends.backend_svg",
        "matplotlib.pyplot",
        "pandas",
        "pandas.io.formats.style",
    ),
    *(
        "scipy.optimize",
        "scipy.stats",
        "scipy.spatial",
        "scipy.linalg",
        "scipy.special",
    ),
    *(
        "emcee",
        "erfa",
        "pydantic",
        "rich.table",
        "jupyter_cache.cache.main",
        "nbclient",
    ),
    *("reproduce.views.posteriors", "reproduce.views.contradictions"),
    *("reproduce.views.front", "reproduce.views.measurements"),
)
# Where processes cannot be forked each starts cold: slower, and the same otherwise.
FORKED = "forkserver" in get_all_start_methods()
context = get_context("forkserver") if FORKED else get_context("spawn")


class Forked:
    """A forked process with the part of `subprocess.Popen` that a provisioner uses."""

    stdin = stdout = stderr = None

    def __init__(self, process: BaseProcess) -> None:
        self.process = process
        self.pid = process.pid

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        return self.process.exitcode

    def wait(self) -> int | None:
        """Wait for its end."""
        self.process.join()
        return self.process.exitcode

    def send_signal(self, number: int) -> None:
        """Send it a signal."""
        if self.pid is not None and self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.process.kill()

    def terminate(self) -> None:
        """Ask it to end."""
        self.process.terminate()


class WarmProvisioner(LocalProvisioner):
    """Starts a kernel as a fork of the server."""

    async def launch_kernel(self, cmd: list[str], **settings: Any) -> Any:
        """Fork a kernel that listens on the connection that the command names."""
        arguments = cmd[cmd.index("-f") :]
        process = context.Process(
            target=serve,
            args=(arguments, settings.get("cwd"), settings.get("env")),
            daemon=True,
        )
        process.start()
        # Declared as a Popen, of which a kernel's provisioner asks only what Forked has.
        self.process = Forked(process)  # type: ignore[assignment]
        self.pid = process.pid
        return self.connection_info


def serve(
    arguments: list[str], folder: str | None, environment: Mapping[str, str] | None
) -> None:
    """Be a kernel: what ``python -m ipykernel_launcher`` does, in the folder of the page."""
    import matplotlib
    from ipykernel.kernelapp import IPKernelApp

    if folder:
        os.chdir(folder)
    os.environ.update(environment or {})
    sys.argv = ["ipykernel_launcher", *arguments]
    sys.path[0:0] = [""]  # as for a kernel: modules beside the page
    # Matplotlib was imported before the kernel could name the backend that shows its figures.
    matplotlib.rcParams["backend"] = "module://matplotlib_inline.backend_inline"
    # With a parent it ends when that ends, and does not tell a terminal how to leave it.
    IPKernelApp.launch_instance(
        [*arguments, f"--IPKernelApp.parent_handle={os.getppid()}"]
    )


def start() -> None:
    """Make every notebook client of this process use these kernels."""
    if FORKED:
        context.set_forkserver_preload(list(IMPORTED))
    factory = KernelProvisionerFactory.instance()
    factory.provisioners[NAME] = EntryPoint(
        NAME, f"{__name__}:WarmProvisioner", factory.GROUP_NAME
    )
    factory.default_provisioner_name = NAME


def run(function: Callable[..., Any], *arguments: Any) -> None:
    """Run a function in a fork of its own; what it returns is dropped.

    Raises
    ------
    RuntimeError
        If it fails; its own traceback is on standard error.
    """
    process = context.Process(target=function, args=arguments)
    process.start()
    process.join()
    if process.exitcode:
        raise RuntimeError(
            f"{function.__name__}{arguments}: exit code {process.exitcode}"
        )
