"""Running a posterior and writing it down: for the terminal, for programs, for the book."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich.table import Table

from reproduce.inference.model import Model
from reproduce.inference.posterior import Posterior, Row, digits
from reproduce.inference.sampling import Plan, sample
from reproduce.inference.sensitivity import leanings
from reproduce.papers.declare import ROOT_SEED
from reproduce.papers.posteriors import posteriors


def plan_for(
    name: str,
    steps: int | None = None,
    ensembles: int = 4,
    walkers: int | None = None,
    seed: int | None = None,
) -> Plan:
    """Return how a model of the book is sampled."""
    declared = posteriors()[name]
    steps = steps or declared.steps
    return Plan(
        ROOT_SEED if seed is None else seed,
        ensembles=ensembles,
        walkers=walkers or declared.walkers,
        steps=steps,
        warmup=max(150, steps // 4),
    )


def run(
    model: Model,
    plan: Plan,
    *,
    workers: int = 1,
    folder: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Posterior:
    """Sample a model here or on several processors."""
    if workers == 1:
        return sample(model, plan, folder=folder, progress=progress)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return sample(model, plan, executor=pool, folder=folder, progress=progress)


@cache
def book_posterior(name: str) -> Posterior:
    """Return the posterior of a model of the book, sampled once in a process."""
    return run(posteriors()[name].model(), plan_for(name))


def all_rows(posterior: Posterior) -> list[Row]:
    """Return the summaries of parameters, then of consequences."""
    return [*posterior.rows(), *(row for row, _ in posterior.consequences())]


def summary_table(posterior: Posterior) -> Table:
    """Return the summary for a terminal, every number with the digits its error allows."""
    # Without a box, and with the unit beside the name, it fits 80 columns.
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("parameter", overflow="fold", min_width=12)
    for head in ("mean", "sd", "2.5 %", "97.5 %", "MCSE", "R-hat", "bulk", "tail"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in all_rows(posterior):
        label = row.name if row.unit == "1" else f"{row.name} ({row.unit})"
        table.add_row(label, *numbers(row))
    return table


def numbers(row: Row) -> list[str]:
    """Write the numbers of a summary: mean, sd, ends, MCSE, R-hat, bulk and tail ESS."""
    return [
        digits(row.mean, row.mcse),
        f"{row.deviation:.2g}",
        digits(row.low, row.mcse_end),
        digits(row.high, row.mcse_end),
        f"{row.mcse:.1g}",
        f"{row.rhat:.3f}",
        f"{row.bulk:.0f}",
        f"{row.tail:.0f}",
    ]


def provenance(name: str) -> tuple[dict[str, Any], str]:
    """Return what the data of a model of the book are, for programs and in one line."""
    declared = posteriors()[name]
    if not declared.simulated:
        return {"kind": "printed", "paper": declared.paper}, f"as printed in {declared.paper}"
    parameters = {one.name: one for one in declared.model().parameters}
    truth = {key: value * parameters[key].shown for key, value in declared.true_values().items()}
    shown = ", ".join(
        f"{key} {value:.6g}" + ("" if parameters[key].unit == "1" else f" {parameters[key].unit}")
        for key, value in truth.items()
    )
    words = f"simulated by us with printed settings of {declared.paper}; truth: {shown}"
    return {"kind": "simulated", "paper": declared.paper, "truth": truth}, words


def record(posterior: Posterior) -> dict[str, Any]:
    """Return everything of a summary for other programs."""
    return {
        "model": posterior.model.name,
        "seed": posterior.seed,
        "ensembles": posterior.chain.shape[0],
        "steps": posterior.chain.shape[1],
        "walkers": posterior.chain.shape[2],
        "acceptance": list(posterior.acceptance),
        "at_prior_end": [asdict(one) for one in leanings(posterior)],
        "parameters": [asdict(row) for row in posterior.rows()],
        "consequences": [asdict(row) for row, _ in posterior.consequences()],
    }
